"""Playing an environment at random, and a hash of all that comes back."""

from typing import Any

import numpy as np
import pybullet

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.solids import inside
from chmarl_pb.robots.registry import TEAM

HUMANOID_ACTIONS = (
    "goto_kitchen", "goto_bedroom", "goto_bathroom", "goto_livingroom", "pick", "place", "move_forward", "turn_left",
    "turn_right", "stay",
)  # fmt: skip
DRONE_ACTIONS = (
    "goto_kitchen", "goto_bedroom", "goto_bathroom", "goto_livingroom", "move_forward", "move_backward", "move_left",
    "move_right", "stay",
)  # fmt: skip
STAY = {"humanoid": 9, "drone": 8}


def room_at(home: Home, x: float, y: float) -> str | None:
    """Return the room whose floor holds a point, or None outside."""
    rooms = home.rooms.values()
    return next((room.name for room in rooms if any(inside(floor, np.array([x, y])) for floor in room.floors)), None)


def random_actions(env: HouseholdEnv, rng: np.random.Generator) -> dict[str, int]:
    return {name: int(rng.integers(env.action_space(name).n)) for name in TEAM}


def play(env: HouseholdEnv, seed: int, steps: int = 25) -> str:
    """Play random actions from a seed and return the hash of all that came back."""
    rng = np.random.default_rng(seed)
    results: list[tuple[Any, ...]] = [env.reset(seed=seed)]
    for _ in range(steps):
        if not env.agents:
            results.append(env.reset())
        results.append(env.step(random_actions(env, rng)))
    return digest(*[part for result in results for part in result])


def everything(env: HouseholdEnv) -> str:
    """Return a hash of the world, with PyBullet's own poses."""
    client, world = env.world.client, env.world
    world.sync()
    poses = {n: pybullet.getBasePositionAndOrientation(b, physicsClientId=client) for n, b in world.bodies.items()}
    robots = {name: robot.pose for name, robot in world.robots.items()}
    arm = env.simulation.oracle.robot.arm.configuration()
    return digest(poses, robots, arm, world.held, sorted(world.supports.items(), key=str), env.outcome, env.messages)
