"""The global state: what a centralized critic or a mixer may know in training, never the policies."""

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.catalog import Catalog
from chmarl_pb.navigation.free_space import grip_point
from chmarl_pb.navigation.lattice import heading_angle
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
    low, high = simulation.home.bounds
    middle, scale = (low + high) / 2, float((high - low).max()) / 2

    def point(*position: float) -> list[float]:
        x, y, z = position
        return [(x - middle[0]) / scale, (y - middle[1]) / scale, z / scale]

    parts: list[float] = []
    for robot in outcome.state.robots.values():
        angle = heading_angle(robot.heading)
        parts += [*point(*robot.base[0])[:2], np.cos(angle), np.sin(angle)]
    x, y, _ = outcome.state.robots[grasper].base[0]
    x_of, y_of, z_of = outcome.state.objects.poses[goal.item][0]
    parts += point(*grip_point((x_of, y_of, z_of), simulation.world.size(goal.item)))
    centres = np.array([simulation.home.receptacles[name].centre for name in goal.receptacles])
    nearest = np.argsort(np.hypot(*(centres - (x, y)).T), kind="stable")[:_NEAREST_TARGETS]
    for number in nearest:
        name = goal.receptacles[number]
        top = max(solid.top for solid in simulation.home.receptacles[name].solids)
        parts += point(*centres[number], top)
    parts += [0.0] * (3 * (_NEAREST_TARGETS - len(nearest)))
    parts += messages.ravel().tolist()
    parts += [outcome.held is not None, outcome.success, outcome.potential / (10 * len(setting.goals)), elapsed]
    classes = [catalog.class_of(name) for name in (goal.item, goal.receptacles[0])]
    known = simulation.home.catalog
    for names, wanted in zip((known.graspables, known.receptacles), classes, strict=True):
        parts += [name == wanted for name in names]
    return np.array(parts, dtype=np.float32)
