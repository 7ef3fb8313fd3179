"""`python -m training.sb3`: train a baseline of Stable-Baselines3; killed at any moment, the same command goes on."""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecTransposeImage

import chmarl_pb
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.errors import WorkerError
from chmarl_pb.files import write_atomically
from training.encoders import GRAPH_POOLS
from training.encoders.frozen import ENCODERS, frozen_encoder
from training.held import held
from training.interrupts import Asked, Signals, run_command
from training.sb3.bar import Bar
from training.sb3.config import ALGORITHMS, PRESETS, Config
from training.sb3.features import FeatureVecEnv
from training.sb3.journal import Journal
from training.sb3.policy import save_model
from training.sb3.run import Milestones, Validation, make_logger
from training.sb3.validation import SPLITS, make_validation, validation_tasks
from training.sb3.wrappers import ScaledRewards, SelectedKeys
from training.threads import threads as torch_threads

BEST, LAST, RESULT = "best.zip", "last.pt", "result.json"
_VALIDATION_ENVS = 2


def run(
    config: Config, folder: Path, workers: int | None = None, quiet: bool = True, threads: int = 1
) -> BaseAlgorithm:
    """Train a model, or go on with an interrupted run from its last checkpoint; it ends with the same numbers.

    The first signal that asks the run to end has it saved as it was when the present rollout began; a killed run loses
    a minute at most.

    Args:
        config: everything that fixes the run.
        folder: for the best weights, checkpoints, log and result.
        workers: processes of the environments; see :func:`chmarl_pb.sb3_vec_env`.
        quiet: whether no progress is shown.
        threads: of torch, while this runs; networks as small as these are fastest with one.

    Returns:
        The model with the last weights.

    Raises:
        Interrupted: a signal asked the run to end.
        CheckpointError: the folder's checkpoint is damaged or of other settings, or another process trains there.
    """
    tasks = validation_tasks(config.tasks)
    make = partial(make_validation, config.env_id, tasks, _VALIDATION_ENVS, config.env_options)
    signals = Signals()
    with ExitStack() as stack:
        stack.enter_context(torch_threads(threads))
        stack.enter_context(held(folder))
        title = f"{config.algo} on {config.env_id}, preset {config.preset}, seed {config.seed}: {folder}"
        bar = stack.enter_context(Bar(title, config.steps, quiet))
        journal = Journal(chmarl_pb.sb3_vec_env(config.envs, config.env_id, workers, **config.env_options))
        env = _wrapped(journal, config, PRESETS[config.preset].reward_scale)
        stack.callback(env.close)
        validation_env = _wrapped(chmarl_pb.sb3_vec_env(_VALIDATION_ENVS, make, workers), config)
        stack.callback(validation_env.close)
        best = _Best(config, folder)
        validation = Validation(validation_env, len(tasks), config.sampled, folder, best, bar.say, signals.check)
        return _learn(config, folder, env, journal, validation, signals, bar)


def _wrapped(env: VecEnv, config: Config, reward_scale: float = 1.0) -> VecEnv:
    if config.frozen:
        env = FeatureVecEnv(env, frozen_encoder(config.image_encoder))
    if config.keys:
        env = SelectedKeys(env, config.keys)
    env = VecMonitor(env)
    space = env.observation_space
    pictures = isinstance(space, spaces.Dict) and any(map(is_image_space, space.spaces.values()))
    return ScaledRewards(VecTransposeImage(env) if pictures else env, reward_scale)


def _learn(
    config: Config, folder: Path, env: VecEnv, journal: Journal, validation: Validation, signals: Signals, bar: Bar
) -> BaseAlgorithm:
    algorithm, start = ALGORITHMS[config.algo], time.perf_counter()
    settings = config.settings(env.observation_space)
    model = algorithm.model(
        algorithm.policy, env, seed=config.seed, policy_kwargs=config.policy_kwargs, device="cpu", **settings
    )
    own_log = 0 if config.algo == "dqn" else _log_interval(config)
    milestones = Milestones(
        validation, folder / LAST, asdict(config), config.seed, config.interval, journal, own_log, signals.check
    )
    milestones.resume(model)
    first = model.num_timesteps
    model.set_logger(make_logger(folder, first))
    if not milestones.finished:
        every: Any = None if own_log else _log_interval(config)
        bar.prepare()
        with signals:
            try:
                model.learn(config.steps - first, [milestones, bar], log_interval=every, reset_num_timesteps=False)
            except (Asked, WorkerError) as error:
                if isinstance(error, WorkerError) and signals.number is None:  # else the signal has ended the workers
                    raise
                milestones.save()
                raise signals.interrupted(f"{milestones.saved_steps} steps", folder / LAST) from None
    rows = validation.rows()
    best = max(rows, key=lambda row: row["plw"])
    result = {
        "config": asdict(config), "splits": SPLITS, "best": best, "validations": rows, "steps": model.num_timesteps,
        "seconds": round(time.perf_counter() - start, 1), "resumed_at": first,
    }  # fmt: skip
    write_atomically(folder / RESULT, json.dumps(result, indent=1) + "\n")
    return model


def _log_interval(config: Config) -> int:
    """Return how often a row is logged: on-policy in steps, DQN in episodes."""
    if config.algo == "dqn":
        return 200
    rollout = config.envs * int(PRESETS[config.preset].settings[config.algo]["n_steps"])
    return max(2_048 // rollout, 1) * rollout


class _Best(BaseCallback):
    """Keeps the weights that are the best so far."""

    def __init__(self, config: Config, folder: Path):
        super().__init__()
        self._config, self._path = config, folder / BEST

    def _on_step(self) -> bool:
        save_model(self.model, self._config, self._path)
        return True


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    return run_command(partial(_main, sys.argv[1:] if arguments is None else arguments), ValueError)


def _main(arguments: Sequence[str]) -> int:
    config, folder, workers = parse(arguments)
    if config.observation == "visual" and config.image_encoder in ENCODERS and not config.keys:
        config = replace(config, frozen=frozen_encoder(config.image_encoder).fingerprint)
    run(config, folder, workers, quiet=False)
    best = json.loads((folder / RESULT).read_text())["best"]
    print(
        f"{folder / BEST}: SR {100 * best['sr']:.1f}, PLW {100 * best['plw']:.1f} on validation tasks. Evaluate it with"
    )
    goal = " --goal" if PRESETS[config.preset].goal else ""
    print(f"chmarl-pb evaluate --policy {folder / BEST} --split test-unseen --observation {config.observation}{goal}")
    return 0


def parse(arguments: Sequence[str]) -> tuple[Config, Path, int | None]:
    """Return the settings that a command names, the folder of the run, and the number of processes."""
    parser = _parser()
    options = vars(parser.parse_args(arguments))
    workers, out = options.pop("workers"), options.pop("out")
    observation, humanoid_only = options.pop("observation"), options.pop("humanoid_only")
    if options["env_id"] and (observation or humanoid_only):
        parser.error("--env names observation and robots already; leave out --observation and --humanoid-only")
    options["env_id"] = options["env_id"] or _env_id(observation or "scene_graph", humanoid_only)
    return Config(**options), out or Path("out/sb3") / _name(options), workers


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m training.sb3", description=__doc__.split("`: ")[1])
    default = {field.name: field.default for field in fields(Config)}
    switch = argparse.BooleanOptionalAction
    parser.add_argument("--algo", choices=tuple(ALGORITHMS), required=True)
    parser.add_argument("--env", choices=ENV_IDS, dest="env_id", help="or --observation, as the tables name it")
    parser.add_argument("--observation", choices=("scene_graph", "visual"), help="default: scene_graph")
    parser.add_argument("--humanoid-only", action="store_true", help="the drone follows the search policy")
    parser.add_argument(
        "--preset", choices=tuple(PRESETS), default=default["preset"],
        help="what the network reads, and how it learns: the goal's few numbers, an encoder's features, too, or these "
        "alone; default: %(default)s",
    )  # fmt: skip
    parser.add_argument("--messages", action=switch, default=True, help="whether the robots hear each other")
    parser.add_argument("--feedback", action=switch, default=True, help="whether they get language feedback")
    parser.add_argument("--image-encoder", choices=("cnn", *ENCODERS), default="cnn", help="all but cnn are frozen")
    texts = {
        "steps": "of all environments", "seed": "of every random stream", "envs": "side by side",
        "image_size": "pixels", "interval": "steps between two validations", "tasks": "of each validation split",
    }  # fmt: skip
    for name, text in texts.items():
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=int, default=default[name], help=f"{text}; default: %(default)s"
        )
    parser.add_argument("--graph-pool", choices=tuple(GRAPH_POOLS), default=default["graph_pool"])
    parser.add_argument("--learning-rate", type=float, help="default: that of the algorithm")
    parser.add_argument("--workers", type=int, help="processes; default: one for each core")
    parser.add_argument("--out", type=Path, help="folder of the run; default: out/sb3/NAME")
    return parser


def _env_id(observation: str, humanoid_only: bool) -> str:
    """Return the Gymnasium id of a row of the tables."""
    kind = {"scene_graph": "SceneGraph", "visual": "Visual"}[observation]
    return f"CHMARL/{kind}{'Humanoid' if humanoid_only else ''}-v0"


def _name(options: dict[str, object]) -> str:
    """Return the name of a run's folder."""
    parts = [options["algo"], str(options["env_id"]).removeprefix("CHMARL/").removesuffix("-v0").lower()]
    parts += [word for word in ("messages", "feedback") if options[word]]
    return "-".join([*map(str, parts), str(options["preset"]), f"seed{options['seed']}"])


if __name__ == "__main__":
    raise SystemExit(main())
