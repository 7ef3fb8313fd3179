"""Which robots there are in an environment, by names, robot files or models."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from chmarl_pb.errors import AssetError, OptionError
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.robots.mobile import MobileRobot
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.robot import Robot
from chmarl_pb.world import World

#: The benchmark's robots.
TEAM = ("humanoid", "drone")
MOST = 8  # robots of one environment

_PARTS = ("lattice", "actions", "plan", "finish", "spawn")  # of a Robot, that a class of one's own may lack

#: Makes the robot of a model in a world, with what its home offers and under a name.
Make = Callable[[RobotModel, World, Space, str], Robot]


def team_of(robots: Sequence[str | Path | RobotModel]) -> dict[str, RobotModel]:
    """Return agent -> model; agents are named by their kind, with a number from 0 where a kind repeats.

    Args:
        robots: names of robots of the package, paths of robot files, or models.

    Raises:
        OptionError: there are too few or too many robots, none that grasps, or two kinds of one name.
        AssetError: there is no such robot, or its file cannot be used.
    """
    if isinstance(robots, str) or not isinstance(robots, Sequence) or not 1 <= len(robots) <= MOST:
        raise OptionError(f"robots={robots!r}: give 1 to {MOST} robots, e.g. {TEAM}")
    for robot in robots:
        if not isinstance(robot, str | os.PathLike | RobotModel):
            raise OptionError(
                f"robots={robots!r}: {robot!r} is no robot; name one, or the path of a robot file (.toml)"
            )
    models = [robot if isinstance(robot, RobotModel) else find_model(robot) for robot in robots]
    if len({model.name for model in models}) < len(set(models)):
        raise OptionError(f"robots={robots!r}: two kinds of robots have one name; rename a robot file")
    if not any(model.reach for model in models):
        raise OptionError(f"robots={robots!r}: none can grasp; add one with an arm, as 'humanoid'")
    kinds = [model.name for model in models]
    numbers = [kinds[:place].count(kind) for place, kind in enumerate(kinds)]
    return {
        f"{model.name}_{number}" if kinds.count(model.name) > 1 else model.name: model
        for model, number in zip(models, numbers, strict=True)
    }


def listed(text: str) -> tuple[str, ...]:
    """Return the names and robot files that a command line names with commas between them."""
    return tuple(part.strip() for part in text.split(","))


def make_robot(model: RobotModel, world: World, space: Space, name: str) -> Robot:
    """Return the robot of a model, loaded into a world.

    Raises:
        AssetError: its URDF cannot be loaded, its arm is not one that this package knows, its class is no robot, or
            cannot grasp, or it would fly into walls.
        HomeError: it cannot reach a room.
    """
    walls = max((solid.top for thing in world.home.structure for solid in thing.solids), default=0.0)
    if model.flies and model.altitude <= walls:
        raise AssetError(
            f"robot {name!r}: altitude = {model.altitude:g} m is not above the walls of {world.home.path}, which end "
            f"at {walls:g} m; let it fly higher"
        )
    make: Make = model.make or (MobileManipulator if model.reach else MobileRobot)
    robot = make(model, world, space, name)
    if lacking := [part for part in _PARTS if not hasattr(robot, part)]:
        raise AssetError(
            f"robot {name!r}: make gives a {type(robot).__name__} without {', '.join(lacking)}; "
            "derive it from MobileRobot"
        )
    actions = robot.actions
    named = isinstance(actions, tuple) and all(isinstance(action, str) and action for action in actions)
    if not named or len(set(actions)) < len(actions) or "stay" not in actions:
        raise AssetError(f"robot {name!r}: actions={actions!r}; use a tuple of different names, 'stay' among them")
    if name not in world.state.robots:
        raise AssetError(f"robot {name!r}: {type(robot).__name__} has not joined the world; derive it from MobileRobot")
    if model.reach and not isinstance(robot, MobileManipulator):
        raise AssetError(f"robot {name!r}: {type(robot).__name__} is to grasp; derive it from MobileManipulator")
    return robot
