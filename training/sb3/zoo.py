"""``python -m training.sb3.zoo``: write the preset ``goal`` as the YAML files that RL Baselines3 Zoo reads."""

import argparse
import json
from pathlib import Path
from typing import Any

from chmarl_pb.envs.observations import Observer
from chmarl_pb.envs.options import Options
from chmarl_pb.files import write_atomically
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.sb3.config import ALGORITHMS, PRESETS, AlgorithmName, Config, EnvId
from chmarl_pb.learning.sb3.wrappers import ScaledRewards

FOLDER = Path(__file__).parent / "hyperparams"
#: Our name of an algorithm -> the zoo's, which is also that of its file.
NAMES: dict[AlgorithmName, str] = {
    "ppo": "ppo", "a2c": "a2c", "dqn": "dqn", "qr-dqn": "qrdqn", "recurrent-ppo": "ppo_lstm",
}  # fmt: skip
ENV_IDS: tuple[EnvId, ...] = ("CHMARL/SceneGraphHumanoid-v1", "CHMARL/SceneGraphHumanoid-v0", "CHMARL/SceneGraph-v0")

_HEAD = "# Written by `python -m training.sb3.zoo` from chmarl_pb/learning/sb3/config.py; do not edit.\n"
_ROOMS = ("",) * 4  # how many the benchmark's homes have


def text_of(algo: AlgorithmName) -> str:
    """Return the file of an algorithm."""
    return _HEAD + "".join(_entry(Config(algo, env_id, "goal")) for env_id in ENV_IDS)


def _entry(config: Config) -> str:
    """Return the settings of a run under its environment's id; JSON is YAML."""
    lines = [f"  {key}: {json.dumps(value)}\n" for key, value in _settings(config).items()]
    return f"\n{config.env_id}:\n{''.join(lines)}"


def _settings(config: Config) -> dict[str, Any]:
    factor = PRESETS[config.preset].reward_scale
    env = {name: value for name, value in config.env_options.items() if name in ("goal", "flat_actions")}
    return {
        "n_timesteps": config.steps,
        "n_envs": config.envs,
        "policy": ALGORITHMS[config.algo].policy,
        "policy_kwargs": _code(config.policy_kwargs),
        "env_kwargs": env,
        "vec_env_wrapper": [{f"{ScaledRewards.__module__}.{ScaledRewards.__qualname__}": {"factor": factor}}],
        **config.settings(Observer(Options(goal=True), _ROOMS).space),
    }


def _code(arguments: dict[str, Any]) -> str:
    """Return keyword arguments as the zoo evaluates them, where ``importlib`` is known."""
    values = {
        name: f"importlib.import_module({value.__module__!r}).{value.__name__}" if isinstance(value, type) else value
        for name, value in arguments.items()
    }
    return f"dict({', '.join(f'{name}={value}' for name, value in values.items())})"


def main() -> int:
    """Write all files; return the exit code."""
    argparse.ArgumentParser(prog="python -m training.sb3.zoo", description=__doc__).parse_args()
    return run_command(_main)


def _main() -> int:
    for algo, name in NAMES.items():
        write_atomically(FOLDER / f"{name}.yml", text_of(algo))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
