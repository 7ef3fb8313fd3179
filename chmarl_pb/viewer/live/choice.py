"""What is chosen before an episode: task, home, rules, robots."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.tracks import OF_TRACK, PAPER
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.homes.home import home_names
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.splits import find_task, load_tasks
from chmarl_pb.tasks.task import Task
from chmarl_pb.viewer.live.game import Game
from chmarl_pb.viewer.record import choose_task

_LISTED = ("test-unseen", "val-unseen", "test-seen", "val-seen")  # splits whose tasks the page lists

#: What the page calls a channel -> the option ``messages``.
CHANNELS: dict[str, Any] = {"as the track": OF_TRACK, "board": True, "own words": "symbols", "none": False}


@dataclass(frozen=True)
class Choice:
    """What an episode is begun with.

    Attributes:
        task: its id; None: one is drawn for the home, or a good one is taken if there is no home either.
        home: name or path; a task that is named has its own.
        draw: which of the tasks that can be drawn for a home.
        track: the rules.
        messages: the channel, where it is not the track's.
        max_steps: joint steps, where they are not the track's.
        observation: what policies observe.
        robots: the team.
        catalog: catalogue file of own things.
        rules: more options of the environment.
    """

    task: str | None = None
    home: str | None = None
    draw: int = 0
    track: str = PAPER
    messages: Any = OF_TRACK
    max_steps: int = OF_TRACK
    observation: str = "scene_graph"
    robots: tuple[Any, ...] = TEAM
    catalog: str | None = None
    rules: Mapping[str, Any] = field(default_factory=dict)

    def begin(self) -> Game:
        """Return a new game.

        Raises:
            TaskError: the task is unknown, or cannot be solved with these robots.
            HomeError: the home cannot be used.
            OptionError: an option has a value that it does not know.
        """
        task = self._find()
        env = HouseholdEnv(
            self.observation, home=task.home, track=self.track, messages=self.messages, max_steps=self.max_steps,
            robots=self.robots, catalog=self.catalog, execution="simulated", **self.rules,
        )  # fmt: skip
        try:
            return Game(env, task)
        except BaseException:
            env.close()
            raise

    def _find(self) -> Task:
        if self.task is not None:
            return find_task(self.task)
        if self.home is None:
            return choose_task()
        lookalikes = self.rules.get("lookalikes", OF_TRACK)
        given: dict[str, Any] = {"catalog": self.catalog, "robots": self.robots, "track": self.track}
        (task,) = draw_tasks(self.home, 1, self.draw, lookalikes=lookalikes, **given)
        return task


def homes_on_offer(now: str) -> list[str]:
    """Return the names of homes that the page lists, with the one that is played in."""
    names = home_names()
    return names if now in names else [now, *names]


def tasks_on_offer(home: str) -> list[str]:
    """Return ids of fixed tasks in a home; all others may be named."""
    return [task.id for split in _LISTED for task in load_tasks(split) if task.home == home]
