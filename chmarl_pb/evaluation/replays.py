"""The report's replays: chosen episodes played again and drawn as a plan of the home with the robots' ways."""

import hashlib
import json
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import AssetError, HomeError
from chmarl_pb.evaluation.episode_file import EpisodeFile, record_episode, save_episode
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.evaluation.result import Report
from chmarl_pb.evaluation.tables import title_of
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.solids import Points
from chmarl_pb.policies.replay import ReplayPolicy
from chmarl_pb.tasks.task import Task

_SCALE = 45.0  # pixels in a metre
_MARGIN = 0.3  # metres around the floors

Place = tuple[float, float]


@dataclass
class _Ways:
    """Where the robots and X have been, one place for the start and for each step."""

    robots: dict[str, list[Place]] = field(default_factory=lambda: defaultdict(list))
    items: list[Place] = field(default_factory=list)

    def note(self, env: HouseholdEnv) -> None:
        for name, robot in env.simulation.robots.items():
            x, y, _ = robot.lattice.pose(robot.pose)
            self.robots[name].append((float(x), float(y)))
        place = env.world.grip(env.setting.goal.item)
        self.items.append((float(place[0]), float(place[1])))


def choose(report: Report) -> list[Played]:
    """Return episodes worth a look: the solved one of middling score and the failed one that got furthest."""
    solved = sorted((episode for episode in report.episodes if episode.success), key=lambda episode: episode.score)
    failed = [episode for episode in report.episodes if not episode.success]
    chosen = solved[len(solved) // 2 : len(solved) // 2 + 1]
    return chosen + sorted(failed, key=lambda episode: -episode.potential)[:1]


def replays(reports: Iterable[Report], folder: Path) -> str:
    """Return the chosen episodes of results as HTML, and save their episode files.

    Args:
        reports: the results.
        folder: for the episode files, beside the page.
    """
    cards = [_card(report, episode, folder) for report in reports for episode in choose(report)]
    return "".join(cards) or "<p>No episodes.</p>"


def _card(report: Report, episode: Played, folder: Path) -> str:
    ending = f"solved in {episode.steps} steps" if episode.success else f"failed after {episode.steps} steps"
    name = f"{title_of(report)}, {report.settings['observation'].replace('_', ' ')}"
    title = f"{name}: {episode.task.id}, seed {episode.seed}, {ending} (L* {episode.optimal_steps})"
    head = f"<summary>{escape(title)}</summary>"
    home = episode.task.home
    if report.foreign or not isinstance(episode.task, Task):
        return f"<details>{head}<p>Played in a changed environment: {escape(report.foreign)}.</p></details>"
    try:
        if report.settings["homes_sha256"].get(home) != home_hash(home):
            return f"<details>{head}<p>{escape(home)} has changed since.</p></details>"
        env = HouseholdEnv(report.settings["observation"], home=home, **report.settings["options"])
    except (AssetError, HomeError) as error:  # robots, things or the home are not here
        return f"<details>{head}<p>{escape(str(error))}</p></details>"
    try:
        ways, policy = _Ways(), ReplayPolicy(episode.actions, env)
        seed = episode_seed(episode.task, episode.seed)
        file = record_episode(env, policy, report.settings["policy"], seed, episode.task, ways.note)
        if (len(file.actions), file.success) != (episode.steps, episode.success):
            return f"<details>{head}<p>This version of the package plays it otherwise.</p></details>"
        drawing, steps = _drawing(env, ways), _steps(env, file)
        instruction = escape(env.instruction)
    finally:
        env.close()
    path = folder / _file_name(report, episode)
    save_episode(file, path)
    link = f'<a href="{escape(folder.name)}/{escape(path.name)}">episode file</a>'
    return f"<details>{head}<p><em>{instruction}</em> {link}</p><div class='replay'>{drawing}{steps}</div></details>"


def _file_name(report: Report, episode: Played) -> str:
    """Return a short name that no other episode has: one task may be played in many results of one policy."""
    settings = json.dumps(report.settings, sort_keys=True)
    mark = hashlib.sha256(f"{settings} {episode.actions}".encode()).hexdigest()[:8]
    name = re.sub(r"[^\w.-]", "_", episode.task.id)  # of somebody's file: it names no folder
    return f"{name}-seed{episode.seed}-{mark}.json"


def _steps(env: HouseholdEnv, file: EpisodeFile) -> str:
    """Return a table of the actions and rewards."""
    names = list(env.action_names.values())
    rows = []
    for step, (numbers, reward) in enumerate(zip(file.actions, file.rewards, strict=True), start=1):
        actions = "".join(
            f"<td>{kinds[number].replace('_', ' ')}</td>" for kinds, number in zip(names, numbers, strict=True)
        )
        rows.append(f"<tr><td>{step}</td>{actions}<td>{f'{reward:+.0f}' if reward else 0}</td></tr>")
    robots = "".join(f'<th class="r{place}">{escape(name)}</th>' for place, name in enumerate(env.action_names))
    head = f"<tr><th>step</th>{robots}<th>reward</th></tr>"
    return f'<div class="scroll"><table class="steps"><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table></div>'


def _drawing(env: HouseholdEnv, ways: _Ways) -> str:
    """Return a plan of the home as SVG: furniture, targets, the robots' ways, X at its start and end."""
    plan = _Plan(env.simulation.home)
    goals = set(env.setting.goal.receptacles)
    parts = plan.home_shapes(goals)
    for place, (name, model) in reversed(list(enumerate(env.simulation.models.items()))):
        parts.append(plan.way(ways.robots[name], name, f"r{place}{' flies' if model.flies else ''}"))
    (x, y), (u, v) = plan.pixel(ways.items[0]), plan.pixel(ways.items[-1])
    parts.append(f'<circle class="item" cx="{x:.0f}" cy="{y:.0f}" r="7"><title>X at the start</title></circle>')
    parts.append(f'<circle class="item end" cx="{u:.0f}" cy="{v:.0f}" r="7"><title>X at the end</title></circle>')
    return f'<svg class="plan" viewBox="0 0 {plan.width:.0f} {plan.height:.0f}">{"".join(parts)}</svg>'


class _Plan:
    """Draws a home from above."""

    def __init__(self, home: Home):
        self.home = home
        low, high = home.bounds
        self._left, self._top = float(low[0]) - _MARGIN, float(high[1]) + _MARGIN
        self.width, self.height = (float(side) + 2 * _MARGIN for side in high - low)
        self.width, self.height = self.width * _SCALE, self.height * _SCALE

    def pixel(self, place: Place) -> Place:
        """Return where a point in metres is drawn."""
        return (place[0] - self._left) * _SCALE, (self._top - place[1]) * _SCALE

    def home_shapes(self, goals: set[str]) -> list[str]:
        """Return floors, furniture and walls; things in ``goals`` stand out."""
        parts = [self._polygon(floor, "floor", room.name) for room in self.home.rooms.values() for floor in room.floors]
        for thing in (*self.home.things, *(thing for thing in self.home.structure if thing.class_name == "wall")):
            kind = "goal" if thing.name in goals else "wall" if thing.class_name == "wall" else "thing"
            parts += [self._polygon(solid.polygon, kind, thing.name) for solid in thing.solids]
        for room in self.home.rooms.values():
            x, y = self.pixel((float(room.centre[0]), float(room.centre[1])))
            parts.append(f'<text x="{x:.0f}" y="{y:.0f}">{escape(room.name)}</text>')
        return parts

    def _polygon(self, outline: Points, kind: str, name: str) -> str:
        corners = (self.pixel((float(x), float(y))) for x, y in outline)
        points = " ".join(f"{x:.0f},{y:.0f}" for x, y in corners)
        return f'<polygon class="{kind}" points="{points}"><title>{escape(name)}</title></polygon>'

    def way(self, places: Sequence[Place], robot: str, kind: str) -> str:
        """Return a robot's way: a line, a dot for each step, a ring at its start."""
        dots = [self.pixel(place) for place in places]
        line = " ".join(f"{x:.0f},{y:.0f}" for x, y in dots)
        marks = "".join(f'<circle cx="{x:.0f}" cy="{y:.0f}" r="2.5"/>' for x, y in dots)
        start = f'<circle class="start" cx="{dots[0][0]:.0f}" cy="{dots[0][1]:.0f}" r="8"/>'
        title = f"<title>{escape(robot)}</title>"
        return f'<g class="{kind}">{title}<polyline points="{line}"/>{marks}{start}</g>'
