"""The validation tasks as a Gymnasium environment whose return is PLW, for Stable-Baselines3's EvalCallback."""

from collections.abc import Sequence
from typing import Any

import gymnasium

import chmarl_pb  # noqa: F401  (registers the ids in worker processes)
from chmarl_pb.envs.tracks import GROUNDED, PAPER, TRACKS
from chmarl_pb.envs.vector.env import make_function
from chmarl_pb.evaluation.metrics import score_now
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.learning.runs.validation import home_tasks, spread_tasks
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.splits import STREAM, VALIDATION
from chmarl_pb.tasks.task import Task

#: Track -> splits that weights are chosen on.
SPLITS = {PAPER: VALIDATION["train"], GROUNDED: VALIDATION[STREAM]}


class PathWeighted(gymnasium.Wrapper):
    """Plays tasks in turn, each with the seed that an evaluation gives it; pays an episode's PLW at its end.

    Attributes:
        episodes_in_a_home: seeds of environments side by side are numbers of tasks here, also in generated homes.
    """

    episodes_in_a_home = 1

    def __init__(self, env: gymnasium.Env, tasks: Sequence[Task], stride: int):
        """Wrap an environment.

        Args:
            env: the inner environment.
            tasks: to be played.
            stride: number of environments that share the tasks.
        """
        super().__init__(env)
        self._tasks, self._stride, self._next, self._steps = tasks, stride, 0, 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start the next task; a seed says which is the first."""
        self._next = self._next if seed is None else seed
        self._task = self._tasks[min(self._next, len(self._tasks) - 1)]  # of an odd number the last one is left over
        self._next, self._steps = self._next + self._stride, 0
        return self.env.reset(seed=episode_seed(self._task, 0), options={"task": self._task})

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act once."""
        observation, _, terminated, truncated, info = self.env.step(action)
        self._steps += 1
        won = terminated and info["is_success"]
        score = score_now(self.unwrapped.parallel, won, self._steps)  # type: ignore[attr-defined]
        return observation, score, terminated, truncated, info


def validation_tasks(
    most: int,
    home: str | None = None,
    robots: tuple[str, ...] = TEAM,
    catalog: str | None = None,
    track: str = PAPER,
) -> list[Task]:
    """Return at most some tasks of each validation split, at equal distances; or as many drawn for a home.

    Args:
        most: of each split.
        home: name or path; None: the splits.
        robots: that are to solve the drawn tasks.
        catalog: catalogue file of own things.
        track: whose splits are meant, and by whose rules tasks are drawn.
    """
    if home is not None:
        return home_tasks(home, len(SPLITS[track]) * most, robots, catalog, TRACKS[track]["lookalikes"])
    return [task for split in SPLITS[track] for task in spread_tasks(split, most)]


def make_validation(env_id: str, tasks: Sequence[Task], stride: int, options: dict[str, Any]) -> gymnasium.Env:
    """Return an environment that plays validation tasks; see :class:`PathWeighted`."""
    return PathWeighted(make_function(env_id, options)(), tasks, stride)
