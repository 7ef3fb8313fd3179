"""The flat view as a task of BenchMARL: its MAPPO, IPPO, QMIX and others play it, by default MAPPO.

BenchMARL needs an older TorchRL, so give it an environment of its own:
python -m venv benchmarl && benchmarl/bin/pip install "benchmarl==1.5.2" -e .
benchmarl/bin/python examples/benchmarl_task.py --algorithm qmix --frames 3000
"""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import chmarl_pb

try:
    from benchmarl import algorithms
    from benchmarl.environments.common import TaskClass
    from benchmarl.experiment import Experiment, ExperimentConfig
    from benchmarl.models.mlp import MlpConfig
    from torchrl.data import Composite
    from torchrl.envs import MarlGroupMapType
    from torchrl.envs.libs.pettingzoo import PettingZooWrapper
except ImportError as error:
    raise SystemExit(f"error: this example needs BenchMARL ({error}); install it as its first lines say") from None


def make_env(seed: int | None, device: str, options: dict[str, Any]) -> PettingZooWrapper:
    """Return the flat view in TorchRL, both robots in one group, with the global state."""
    group = MarlGroupMapType.ALL_IN_ONE_GROUP
    return PettingZooWrapper(
        chmarl_pb.flat_env(**options), group_map=group, return_state=True, seed=seed or 0, device=device
    )


class HouseholdTask(TaskClass):  # type: ignore[misc]
    """A task whose ``config`` are options of :func:`chmarl_pb.flat_env`."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: str
    ) -> Callable[[], PettingZooWrapper]:
        """Return what makes an environment."""
        return partial(make_env, seed, device, self.config)

    def supports_continuous_actions(self) -> bool:
        """Actions are numbers."""
        return False

    def supports_discrete_actions(self) -> bool:
        """Actions are numbers."""
        return True

    def has_render(self, env: Any) -> bool:
        """Evaluations make no films."""
        return False

    def max_steps(self, env: Any) -> int:
        """Return the steps of the longest episode."""
        return int(self.config.get("max_steps", 28))

    def group_map(self, env: Any) -> dict[str, list[str]]:
        """Return the group and its robots."""
        return env.group_map  # type: ignore[no-any-return]

    def observation_spec(self, env: Any) -> Any:
        """Return the vectors' spec."""
        return self._only(env, "observation")

    def info_spec(self, env: Any) -> Any:
        """Return the infos' spec."""
        return self._only(env, "info")

    def action_mask_spec(self, env: Any) -> Any:
        """Return the masks' spec."""
        return self._only(env, "action_mask")

    def state_spec(self, env: Any) -> Any:
        """Return the global state's spec."""
        return Composite({"state": env.observation_spec["state"].clone()})

    def action_spec(self, env: Any) -> Any:
        """Return the actions' spec."""
        return env.full_action_spec

    @staticmethod
    def env_name() -> str:
        """Return the name of the environment."""
        return "chmarl"

    def _only(self, env: Any, key: str) -> Any:
        specs = {group: env.observation_spec[group] for group in env.group_map}
        return Composite(
            {group: Composite({key: spec[key].clone()}, shape=spec.shape) for group, spec in specs.items()}
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print the mean return of the last batch."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--algorithm", default="mappo", choices=("mappo", "ippo", "qmix", "vdn", "iql"))
    parser.add_argument("--frames", type=int, default=3_000)
    parser.add_argument("--split", default="train")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarl"), help="folder of BenchMARL's files")
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    config = ExperimentConfig.get_from_yaml()
    config.loggers, config.create_json, config.render, config.prefer_continuous_actions = [], False, False, False
    config.save_folder = str(options.out)
    batch = min(options.frames, 1_000)
    config.max_n_frames, config.evaluation_interval, config.evaluation_episodes = options.frames, batch, 2
    config.on_policy_collected_frames_per_batch = config.off_policy_collected_frames_per_batch = batch
    config.on_policy_n_envs_per_worker = config.off_policy_n_envs_per_worker = 2
    config.on_policy_n_minibatch_iters, config.on_policy_minibatch_size = 2, min(batch, 400)
    config.off_policy_n_optimizer_steps, config.off_policy_train_batch_size = 2, min(batch, 128)
    algorithm = getattr(algorithms, f"{options.algorithm.capitalize()}Config").get_from_yaml()
    network = MlpConfig.get_from_yaml()
    task = HouseholdTask("HOUSEHOLD", {"split": options.split, "goal": True})
    experiment = Experiment(task, algorithm, network, seed=0, config=config, critic_model_config=network)
    experiment.run()
    print(f"{options.algorithm}: {experiment.total_frames} frames, mean return {experiment.mean_return:.2f}")


if __name__ == "__main__":
    main()
