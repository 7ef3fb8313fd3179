"""Train a baseline of Stable-Baselines3; killed at any moment, the same call goes on."""

import json
import time
from contextlib import ExitStack
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecTransposeImage

import chmarl_pb
from chmarl_pb.envs.options import Options
from chmarl_pb.errors import WorkerError
from chmarl_pb.files import write_atomically
from chmarl_pb.learning.algorithms.gradient import check_finite
from chmarl_pb.learning.benchmark_env import other_rooms, trained_in
from chmarl_pb.learning.config import TRAINED_IN
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS, frozen_encoder
from chmarl_pb.learning.runs.device import find_device
from chmarl_pb.learning.runs.interrupts import Signals, StopRequested
from chmarl_pb.learning.runs.lock import run_lock
from chmarl_pb.learning.sb3.bar import Bar
from chmarl_pb.learning.sb3.checkpoint import save_model
from chmarl_pb.learning.sb3.config import ALGORITHMS, PRESETS, Config
from chmarl_pb.learning.sb3.journal import Journal
from chmarl_pb.learning.sb3.run import Milestones, Validation, make_logger
from chmarl_pb.learning.sb3.validation import SPLITS, make_validation, validation_tasks
from chmarl_pb.learning.sb3.wrappers import ScaledRewards, encode_pictures, select_keys
from chmarl_pb.learning.storage.checkpoint import check_kept, is_whole
from chmarl_pb.learning.threads import threads
from chmarl_pb.robots.registry import listed

BEST, LAST, RESULT = "best.zip", "last.pt", "result.json"
_VALIDATION_ENVS = 2


def run(
    config: Config,
    folder: Path,
    workers: int | None = None,
    quiet: bool = True,
    device: str = "cpu",
) -> BaseAlgorithm:
    """Train a model, or go on with an interrupted run from its last checkpoint; it ends with the same numbers.

    The first signal that asks the run to end has it saved as it was when the present rollout began; a killed run loses
    a minute at most.

    Args:
        config: everything that fixes the run.
        folder: for the best weights, checkpoints, log and result.
        workers: processes of the environments; see :func:`chmarl_pb.sb3_vec_env`.
        quiet: whether no progress is shown.
        device: of torch, that the networks learn on.

    Returns:
        The model with the last weights.

    Raises:
        Interrupted: a signal asked the run to end.
        CheckpointError: the folder's checkpoint is damaged or of other settings, another process trains there, or the
            run is over and its best weights are gone.
    """
    where, config = find_device(device), _completed(config)
    tasks = validation_tasks(config.tasks, config.home, listed(config.robots), config.catalog, config.track)
    make = partial(make_validation, config.env_id, tasks, _VALIDATION_ENVS, config.env_options)
    signals = Signals()
    with ExitStack() as stack:
        stack.enter_context(threads(1))  # networks as small as these are fastest with one
        stack.enter_context(run_lock(folder, LAST, BEST))
        title = f"{config.algo} on {config.env_id}, preset {config.preset}, seed {config.seed}: {folder}"
        bar = stack.enter_context(Bar(title, config.steps, quiet))
        journal = Journal(chmarl_pb.sb3_vec_env(config.envs, config.env_id, workers, **config.env_options))
        env = _wrapped(journal, config, PRESETS[config.preset].reward_scale)
        stack.callback(env.close)
        validation_env = _wrapped(chmarl_pb.sb3_vec_env(_VALIDATION_ENVS, make, workers), config)
        stack.callback(validation_env.close)
        best = _Best(config, folder)
        validation = Validation(validation_env, len(tasks), config.sampled, folder, best, bar.say, signals.check)
        return _learn(config, folder, env, journal, validation, signals, bar, where)


def _completed(config: Config) -> Config:
    """Return settings with what is really had: feedback, and what the files hold that settings name."""
    frozen = config.observation == "visual" and config.image_encoder in FROZEN_ENCODERS and not config.keys
    own = Options(home=config.home, catalog=config.catalog)
    return replace(
        config, frozen=frozen_encoder(config.image_encoder).fingerprint if frozen else "",
        catalog_sha256=own.things.content, rooms=other_rooms(own), feedback=config.env_options["feedback"],
    )  # fmt: skip


def _settings(config: Config) -> dict[str, Any]:
    """Return what a run has to go on with."""
    given = {name: value for name, value in config.env_options.items() if name in ("home", "robots", "catalog")}
    return asdict(config) | {TRAINED_IN: trained_in(Options(track=config.track, **given))}


def _wrapped(env: VecEnv, config: Config, reward_scale: float = 1.0) -> VecEnv:
    if config.frozen:
        env = encode_pictures(env, frozen_encoder(config.image_encoder))
    if config.keys:
        env = select_keys(env, config.keys)
    env = VecMonitor(env)
    space = env.observation_space
    pictures = isinstance(space, spaces.Dict) and any(map(is_image_space, space.spaces.values()))
    return ScaledRewards(VecTransposeImage(env) if pictures else env, reward_scale)


def _learn(
    config: Config,
    folder: Path,
    env: VecEnv,
    journal: Journal,
    validation: Validation,
    signals: Signals,
    bar: Bar,
    device: torch.device,
) -> BaseAlgorithm:
    algorithm, start = ALGORITHMS[config.algo], time.perf_counter()
    settings = config.settings(env.observation_space)
    model = algorithm.model(
        algorithm.policy, env, seed=config.seed, policy_kwargs=config.policy_kwargs, device=device, **settings
    )
    own_log = 0 if config.replays else _log_interval(config)
    milestones = Milestones(
        validation, folder / LAST, _settings(config), config.seed, config.interval, journal, own_log, signals.check
    )
    milestones.resume(model)
    if not is_whole(folder / BEST):
        validation.best_mean_reward = -np.inf  # if there were any, they are lost: the next are the best that there are
    first = model.num_timesteps
    rows = validation.rows()
    model.set_logger(make_logger(folder, first, int(rows[-1]["steps"]) if rows else 0))
    is_over = milestones.finished and (folder / RESULT).is_file()
    if not milestones.finished:
        every: Any = None if own_log else _log_interval(config)
        bar.prepare()
        with signals:
            try:
                model.learn(config.steps - first, [milestones, bar], log_interval=every, reset_num_timesteps=False)
            except (StopRequested, WorkerError) as error:
                if isinstance(error, WorkerError) and signals.number is None:  # else the signal has ended the workers
                    raise
                milestones.save()
                raise signals.interrupted(f"{milestones.saved_steps} steps", folder / LAST) from None
            except ValueError:
                check_finite(model.policy)  # by which torch refuses to draw actions
                raise
    check_kept(folder / BEST)
    if is_over:
        return model
    splits = (config.home,) if config.home else SPLITS[config.track]
    result = {
        "config": asdict(config), "splits": splits, "best": validation.best(), "validations": validation.rows(),
        "steps": model.num_timesteps, "seconds": round(time.perf_counter() - start, 1), "resumed_at": first,
    }  # fmt: skip
    write_atomically(folder / RESULT, json.dumps(result, indent=1) + "\n")
    return model


def _log_interval(config: Config) -> int:
    """Return how often a row is logged: on-policy in steps, others in episodes."""
    if config.replays:
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
