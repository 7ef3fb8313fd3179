"""Settings of runs that take a second, and an expert to imitate, for tests on ``UnevenEnv``."""

from functools import partial
from typing import Any

from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.algorithms.mappo import MappoConfig
from chmarl_pb.learning.algorithms.pqn import PqnConfig
from chmarl_pb.learning.algorithms.value import Config
from chmarl_pb.learning.config import RunConfig

VALUE = ("iql", "vdn", "qmix", "qtran")  # algorithms that learn values
SIZES: dict[str, Any] = {
    "envs": 4, "horizon": 5, "batch_size": 8, "learning_starts": 8, "features": 8, "hidden": 8,
    "validation_interval": 16, "checkpoint_interval": 16, "log_interval": 8,
}  # fmt: skip
IMITATION = DAggerConfig(episodes=48, buffer_size=20, gradient_steps=2, **SIZES)
MAPPO = MappoConfig(episodes=48, buffer_size=8, critic_starts=8, **SIZES)
PQN = PqnConfig(episodes=48, buffer_size=8, **SIZES)
SMALL = Config(episodes=48, buffer_size=20, gradient_steps=2, target_update_interval=3, **SIZES)
CONFIGS: dict[str, RunConfig] = {
    **dict.fromkeys(VALUE, SMALL), "pqn": PQN, "imitation": IMITATION, "mappo": MAPPO,
}  # fmt: skip


class Constant:
    """An expert that always does the same."""

    def __init__(self, env: Any, actions: dict[str, int]):
        self.actions = actions

    def reset(self, seed: int | None) -> None:
        pass

    def act(self, observations: Any, infos: Any) -> dict[str, int]:
        return self.actions


EXPERT = partial(Constant, actions={"long": 2, "short": 1})
