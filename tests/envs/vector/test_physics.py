"""In a vector PyBullet's bodies move only when somebody looks, and who looks finds them where they are in the state."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.envs.vector.env import HouseholdVectorEnv
from chmarl_pb.world import World
from chmarl_pb.world.physics import Physics

STEPS = 12


class Looking(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Reads PyBullet's bodies in every step, as a user's wrapper may."""

    def step(self, action: Any) -> Any:
        """Step, and compare."""
        result = self.env.step(action)
        assert shows_its_state(self.get_wrapper_attr("world"))
        return result


def looking() -> gymnasium.Env[Any, Any]:
    return Looking(gymnasium.make("CHMARL/SceneGraph-v0", split="val-unseen"))


def shows_its_state(world: World) -> bool:
    """Whether every body is where it is in the state."""
    bases = all(np.allclose(world.physics.read_base(name)[0], robot.base[0]) for name, robot in world.robots.items())
    return bases and all(np.allclose(world.physics.read_object(name)[0], world.pose(name)[0]) for name in world.objects)


def played(envs: HouseholdVectorEnv) -> None:
    envs.action_space.seed(0)
    for _ in range(STEPS):
        envs.step(envs.action_space.sample())


@pytest.fixture
def moves(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The robots whose bodies were moved."""
    found: list[str] = []
    move: Callable[..., None] = Physics.move_robot

    def noting(self: Physics, name: str, base: Any) -> None:
        found.append(name)
        move(self, name, base)

    monkeypatch.setattr(Physics, "move_robot", noting)
    return found


def test_bodies_move_when_somebody_looks(moves: list[str]) -> None:
    envs = chmarl_pb.vector_env(2, workers=1, split="val-unseen")
    try:
        envs.reset(seed=0)
        moves.clear()
        played(envs)
        assert len(moves) < STEPS, "robots that only drive need no physics"
        assert all(map(shows_its_state, envs.get_attr("world")))
    finally:
        envs.close()


def test_bodies_move_in_every_step_under_a_wrapper_that_may_look(moves: list[str]) -> None:
    envs = chmarl_pb.vector_env(2, looking, workers=1)
    try:
        envs.reset(seed=0)
        moves.clear()
        played(envs)
        assert len(moves) >= STEPS
    finally:
        envs.close()
