"""The global state: what a centralized critic or a mixer may know in training, never the policies."""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.catalog import Catalog
from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.free_space import grip_point
from chmarl_pb.navigation.lattice import DIRECTIONS
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.messages import Messages
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.setting import Setting
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.targets import target_of

_NEAREST_TARGETS = 3


def state_size(robots: int, said: int, known: Catalog) -> int:
    """Return the length of the state vector of so many robots when messages are so many numbers."""
    return robots * 4 + 3 + 3 * _NEAREST_TARGETS + said + 4 + len(known.graspables) + len(known.receptacles)


def global_state(
    simulation: Simulation, setting: Setting, outcome: Outcome, messages: Messages, elapsed: float
) -> np.ndarray:
    """Return the state vector, float32, all entries about in [-1, 1].

    In order: x, y, cosine and sine of the heading of each robot; x, y, z of X; x, y, z of the three
    targets nearest to the robot that grasps (zeros where there are fewer); messages; holding,
    success, potential / 10, share of the steps that are gone; one-hot classes of X and Y. With
    several objects, X is the one that Pick and Place are about, and potential is the mean. With
    several robots that can grasp, it is the one that holds something, else the first. Positions
    are relative to the home's middle, over half its larger side.
    """
    grasper = next(iter(outcome.state.grips), setting.graspers[0])
    goal = target_of(setting.goals, outcome.state, grasper, outcome.seen[grasper])
    fixed = _fixed_of(simulation.home, goal)

    numbers: list[float] = []
    for robot in outcome.state.robots.values():
        x, y, z = robot.base[0]
        numbers += [*fixed.scaled(x, y, z)[:2], *DIRECTIONS[robot.heading]]
    x, y, z = outcome.state.objects.poses[goal.item][0]
    numbers += fixed.scaled(*grip_point((x, y, z), simulation.world.size(goal.item)))
    x, y, _ = outcome.state.robots[grasper].base[0]
    columns, rows = fixed.centres
    nearest = np.hypot(columns - x, rows - y).argsort(kind="stable")[:_NEAREST_TARGETS].tolist()
    for number in nearest:
        numbers += fixed.tops[number]
    numbers += [0.0] * (3 * (_NEAREST_TARGETS - len(nearest)))
    numbers += messages.ravel().tolist()
    numbers += [outcome.held is not None, outcome.success, outcome.potential / (10 * len(setting.goals)), elapsed]
    return np.concatenate([np.array(numbers, np.float32), fixed.classes])


@dataclass(frozen=True, eq=False)
class _Fixed:
    """What of a state is the same in all steps that are about one goal in one home.

    Attributes:
        middle: (2,) of the home, in metres.
        scale: half of its larger side.
        centres: (2, n) x and y of the things that would do as Y.
        tops: their centres on top, scaled.
        classes: one-hot classes of X and of Y, float32.
    """

    middle: tuple[float, float]
    scale: float
    centres: NDArray[np.float64]
    tops: list[list[float]]
    classes: NDArray[np.float32]

    def scaled(self, x: float, y: float, z: float) -> list[float]:
        """Return a position relative to the home's middle, over half its larger side."""
        return [(x - self.middle[0]) / self.scale, (y - self.middle[1]) / self.scale, z / self.scale]


_known: WeakKeyDictionary[Home, dict[Goal, _Fixed]] = WeakKeyDictionary()


def _fixed_of(home: Home, goal: Goal) -> _Fixed:
    known = _known.setdefault(home, {})
    if goal not in known:
        known[goal] = _make_fixed(home, goal)
    return known[goal]


def _make_fixed(home: Home, goal: Goal) -> _Fixed:
    low, high = home.bounds
    (x, y), scale = ((low + high) / 2).tolist(), float((high - low).max()) / 2
    things = [home.receptacles[name] for name in goal.receptacles]
    centres = np.array([thing.centre for thing in things]).T.copy()
    tops = [max(solid.top for solid in thing.solids) for thing in things]
    item, receptacle = (catalog.class_of(name) for name in (goal.item, goal.receptacles[0]))
    classes = [name == item for name in home.catalog.graspables]
    classes += [name == receptacle for name in home.catalog.receptacles]
    fixed = _Fixed((x, y), scale, centres, [], np.array(classes, np.float32))
    fixed.tops.extend(fixed.scaled(*place) for place in zip(*centres.tolist(), tops, strict=True))
    return fixed
