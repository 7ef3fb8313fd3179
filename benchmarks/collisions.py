"""How deep robots' arms reach into things while they are driven: ``python -m benchmarks.collisions --episodes 200``.

The planner plays drawn tasks of the benchmark's homes, of generated ones and of those in ``scenes/examples`` with
``execution="simulated"``. Every motion is looked at twice: as ``env.collisions`` counts it, and at every snapshot
(30 Hz) in a second client. The arm, the hand and what it carries count in all but what is picked or placed and the
surface that it is on. One line of the JSON file is an episode; a run that was interrupted goes on, and says how many
episodes other code has played.
"""

import argparse
import json
import re
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.kept import SOURCE, warn_of_other_code
from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.evaluation.provenance import source_hash
from chmarl_pb.files import append_line, write_atomically
from chmarl_pb.homes.assemble import build_home
from chmarl_pb.homes.generate.names import home_name
from chmarl_pb.homes.home import home_names
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.robots.execution import DEEP, TICKS_PER_FRAME, Snapshot
from chmarl_pb.world import TIME_STEP, Support, World
from chmarl_pb.world.bullet import pybullet

PHASES = ("drive", "reach", "lift", "place", "withdraw")
EXAMPLES = ("loft", "studio", "townhouse")
_ROBOT = "humanoid"
_ARM = ("shoulder", "upper_arm", "forearm", "wrist", "hand", "left_finger", "right_finger")
_BLOCK = 5  # episodes that are played in a home before the next one has its turn
_STILL = 1e-4  # metres a frame below which a base or an object has not moved
_BELOW, _ABOVE = 0.03, 0.01  # metres round the height of a surface at which it may be touched


@dataclass
class Depths:
    """The deepest penetration of each phase of one motion, metres, and between which bodies it was."""

    deepest: dict[str, float] = field(default_factory=dict)
    where: dict[str, str] = field(default_factory=dict)

    def note(self, phase: str, depth: float, where: str) -> None:
        """Note a depth if it is the phase's greatest."""
        if depth > self.deepest.setdefault(phase, 0.0):
            self.deepest[phase], self.where[phase] = depth, where


class Probe:
    """A second client with the bodies of a home, in which snapshots are looked at."""

    def __init__(self, env: HouseholdEnv):
        """Load the home and the robot of an environment that has been reset."""
        self._world = World(env.world.home)
        self._client, physics = self._world.client, self._world.physics
        self._body = env.simulation.models[_ROBOT].load(self._client)
        robot = env.world.physics.robots[_ROBOT]
        physics.robots[_ROBOT] = type(robot)(self._body, robot.joints, robot.grasp_link)
        count = pybullet.getNumJoints(self._body, physicsClientId=self._client)
        infos = [pybullet.getJointInfo(self._body, number, physicsClientId=self._client) for number in range(count)]
        self._arm = {info[12].decode(): info[0] for info in infos if info[12].decode() in _ARM}
        self._names = {number: name for name, number in physics.links.items()}
        self._things = {thing.body: name for name, thing in physics.objects.items()}

    def close(self) -> None:
        """Disconnect."""
        self._world.physics.close()

    def depths(
        self, snapshots: Sequence[Snapshot], others: Mapping[str, Any], carrying: bool, support: Support | None
    ) -> Depths:
        """Return how deep a motion went.

        Args:
            snapshots: of the motion.
            others: object -> its pose before it.
            carrying: whether the gripper held something at first.
            support: what the object was taken from or put on.
        """
        physics, found = self._world.physics, Depths()
        item = next(iter(snapshots[0].items), None) if snapshots else None
        for name in physics.objects:
            physics.move_object(name, others.get(name))
        for phase, snapshot in phases(snapshots, item, carrying):
            physics.move_robot(_ROBOT, snapshot.bases[_ROBOT])
            physics.set_joints(_ROBOT, snapshot.joints[_ROBOT])
            for name, pose in snapshot.items.items():
                physics.move_object(name, pose)
            found.note(phase, 0.0, "")
            for name, link in self._arm.items():
                for depth, where in self._touched(self._body, link, item, support if "finger" in name else None):
                    found.note(phase, depth, f"{name} in {where}")
            if item and (phase in ("lift", "place") or (carrying and phase == "drive")):
                body = physics.objects[item].body
                for depth, where in self._touched(body, -1, item, support, level=True):
                    found.note(phase, depth, f"{item} in {where}")
        return found

    def _touched(
        self, body: int, link: int, item: str | None, support: Support | None, level: bool = False
    ) -> Iterator[tuple[float, str]]:
        """Yield how deep a link stands in what, but for points of its support (if only these may touch: level ones)."""
        low, high = pybullet.getAABB(body, link, physicsClientId=self._client)
        for other, part in pybullet.getOverlappingObjects(low, high, physicsClientId=self._client) or ():
            name = self._names.get(part, "?") if other == self._world.physics.home else self._things.get(other)
            if name is None or name == item:
                continue
            for point in pybullet.getClosestPoints(body, other, 0.0, link, part, physicsClientId=self._client):
                if support is not None and name == support.receptacle and (not level or point[7][2] >= 0.7):
                    if -_BELOW < point[6][2] - support.height < _ABOVE:
                        continue
                yield -point[8], name


def phases(snapshots: Sequence[Snapshot], item: str | None, carrying: bool) -> Iterator[tuple[str, Snapshot]]:
    """Yield snapshots with what the robot does in them, told by what moves."""
    last = len(snapshots) - 1
    base = [snapshot.bases[_ROBOT] for snapshot in snapshots]
    driven = max((i for i in range(last + 1) if _differ(base[i], base[-1])), default=-1)
    moved = [i for i in range(last) if item and _differ(snapshots[i].items[item], snapshots[i + 1].items[item])]
    first, final = (moved[0], moved[-1]) if moved else (last + 1, last + 1)
    for i, snapshot in enumerate(snapshots):
        if i <= driven:
            yield "drive", snapshot
        elif carrying:
            yield ("place" if i <= final else "withdraw") if item and moved and final > driven else "drive", snapshot
        else:
            yield ("reach" if i <= first else "lift") if item else "drive", snapshot


def _differ(one: Any, other: Any) -> bool:
    return any(abs(a - b) > _STILL for a, b in zip((*one[0], *one[1]), (*other[0], *other[1]), strict=True))


def play(env: HouseholdEnv, probe: Probe, seed: int) -> dict[str, Any]:
    """Play an episode of the planner and return what is kept of it."""
    policy, motions, seconds, moved = make_policy("planner", env), [], 0.0, 0.0
    observations, infos = env.reset(seed=seed)
    policy.reset(0)
    while env.agents:
        actions = policy.act(observations, infos)
        before, counted, start = env.world.state, env.collisions, time.process_time()
        observations, _, _, _, infos = env.step(actions)
        seconds += time.process_time() - start
        moved += len(env.snapshots) * TICKS_PER_FRAME * TIME_STEP
        item = next(iter(env.snapshots[0].items), None) if env.snapshots else None
        supports = before.objects.supports if item in before.objects.supports else env.world.supports
        found = probe.depths(env.snapshots, before.objects.poses, bool(before.grips), supports.get(item or ""))
        motions.append(
            {
                "action": env.action_names[_ROBOT][actions[_ROBOT]],
                "depths": {phase: round(depth, 5) for phase, depth in found.deepest.items()},
                "where": {phase: found.where[phase] for phase, depth in found.deepest.items() if depth > DEEP},
                "counted": env.collisions - counted,
            }
        )
    return {"success": env.outcome.success, "seconds": seconds, "moved": moved, "motions": motions}


def episodes(count: int, homes: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Yield homes and seeds, a block of each home in turn."""
    total = -(-count // len(homes))
    for first in range(0, total, _BLOCK):
        yield from ((home, seed) for home in homes for seed in range(first, min(first + _BLOCK, total)))


def all_homes(generated: int) -> list[str]:
    """Return the homes of the benchmark, some generated ones and the examples."""
    return [*home_names(), *(home_name(seed) for seed in range(generated)), *EXAMPLES]


def urdf_of(home: str, folder: str) -> str:
    """Return what an environment takes as a home; a layout of an example is built in a folder."""
    if home in EXAMPLES:
        return str(build_home(SCENES_DIR / "examples" / f"{home}.toml", Path(folder) / f"{home}.urdf"))
    return home


def table(kept: Sequence[dict[str, Any]]) -> Table:
    """Return the number of motions that go deeper than the limit, by kind of home and phase."""
    kinds = {row["home"]: "example" if row["home"] in EXAMPLES else re.split("[-_]", row["home"])[0] for row in kept}
    columns = ("episodes", "solved", *PHASES, "motions", "counted", "missed", "deepest mm", "times real time")
    shown = Table("homes", *columns)
    for kind in [*dict.fromkeys(kinds.values()), "all"]:
        rows = [row for row in kept if kind in (kinds[row["home"]], "all")]
        motions = [motion for row in rows for motion in row["motions"]]
        counted = sum(motion["counted"] for motion in motions)
        by_phase = [[motion["depths"][phase] for motion in motions if phase in motion["depths"]] for phase in PHASES]
        worst = [depth for row in rows for depth in deepest(row)]
        missed = sum(depth > DEEP and not motion["counted"] for depth, motion in zip(worst, motions, strict=True))
        speed = sum(row["moved"] for row in rows) / max(1e-9, sum(row["seconds"] for row in rows))
        shown.add_row(
            kind, str(len(rows)), str(sum(row["success"] for row in rows)),
            *(f"{sum(depth > DEEP for depth in depths)} of {len(depths)}" for depths in by_phase),
            f"{sum(depth > DEEP for depth in worst)} of {len(worst)}", str(counted), str(missed),
            f"{1000 * max(worst, default=0.0):.0f}", f"{speed:.1f}",
        )  # fmt: skip
    return shown


def deepest(row: dict[str, Any]) -> list[float]:
    """Return how deep each motion of an episode went, metres."""
    return [max(motion["depths"].values(), default=0.0) for motion in row["motions"]]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=70)
    parser.add_argument("--generated", type=int, default=20, help="how many generated homes are among the homes")
    parser.add_argument("--home", action="append", help="home_1, generated-7, loft; may be given several times")
    parser.add_argument("--json", type=Path, default=Path("results/collisions.jsonl"))
    parser.add_argument("--again", action="store_true", help="play what went deeper than 5 mm in the file again")
    options = parser.parse_args()
    kept = [json.loads(line) for line in options.json.read_text().splitlines()] if options.json.exists() else []
    if options.again:
        kept = [row for row in kept if all(depth <= DEEP for depth in deepest(row))]
        write_atomically(options.json, "".join(f"{json.dumps(row)}\n" for row in kept))
    warn_of_other_code(options.json, kept)
    done, homes = {(row["home"], row["seed"]) for row in kept}, options.home or all_homes(options.generated)
    env, probe, entered = None, None, ""
    with tempfile.TemporaryDirectory() as folder:
        for home, seed in episodes(options.episodes, homes):
            if (home, seed) in done:
                continue
            if env is None or probe is None or entered != home:
                if env is not None and probe is not None:
                    env.close()
                    probe.close()
                env, entered = HouseholdEnv(home=urdf_of(home, folder), execution="simulated"), home
                env.reset(seed=seed)
                probe = Probe(env)
            kept.append({"home": home, "seed": seed, SOURCE: source_hash(), **play(env, probe, seed)})
            append_line(options.json, json.dumps(kept[-1]))
    Console(width=160).print(table([row for row in kept if row["home"] in homes]))


if __name__ == "__main__":
    main()
