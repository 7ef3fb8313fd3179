"""A run of Stable-Baselines3 that can be killed at any moment: validation, checkpoints and log between rollouts."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, EvalCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from stable_baselines3.common.vec_env import VecEnv

from chmarl_pb.errors import WriteError
from chmarl_pb.files import append_line, sealed, write_atomically, writing
from training.checkpoint import CheckpointError, load, reading, save
from training.logbook import BOARD, METRICS, read_rows
from training.sb3.config import BEFORE_PRESETS

KIND = "sb3"
_HISTORY = ("evaluations_timesteps", "evaluations_results", "evaluations_length", "evaluations_successes")
#: Of SB3's algorithms, where they have them: all that weights and the replay buffer do not hold.
_COUNTERS = ("num_timesteps", "exploration_rate", "_n_updates", "_n_calls", "_episode_num")


class Validation(EvalCallback):
    """Plays the same validation tasks each time; the mean reward, by which the best weights are chosen, is PLW."""

    def __init__(
        self,
        env: VecEnv,
        tasks: int,
        sampled: bool,
        folder: Path,
        on_best: BaseCallback,
        say: Callable[[str], None] = lambda text: None,
    ):
        """Validate in environments of :func:`training.sb3.validation.make_validation`; say what came of it."""
        super().__init__(
            env, on_best, n_eval_episodes=tasks, eval_freq=1, log_path=str(folder), deterministic=not sampled,
            verbose=0, warn=False,
        )  # fmt: skip
        self._say = say

    def _on_step(self) -> bool:
        self.eval_env.seed(0)
        torch.manual_seed(0)  # training begins its own stream anew after this
        file = Path(f"{self.log_path}.npz")
        try:
            with writing(file):
                going_on = super()._on_step()
        except WriteError:
            file.unlink(missing_ok=True)  # half of it would be worse than none; the checkpoint has its contents
            raise
        row = self.rows()[-1]
        self._say(f"steps {row['steps']:,}  validation: SR {100 * row['sr']:.1f}  PLW {100 * row['plw']:.1f}")
        return going_on

    def history(self) -> dict[str, Any]:
        """Return all validations so far, in plain types."""
        return {name: [np.asarray(row).tolist() for row in getattr(self, name)] for name in _HISTORY}

    def rows(self) -> list[dict[str, float]]:
        """Return steps, success rate and PLW of all validations so far."""
        columns = self.evaluations_timesteps, self.evaluations_successes, self.evaluations_results
        rows = zip(*columns, strict=True)
        return [{"steps": int(at), "sr": float(np.mean(won)), "plw": float(np.mean(plw))} for at, won, plw in rows]


class Milestones(BaseCallback):
    """Validates, saves, and begins all random streams and episodes anew, every so many steps and at the end.

    What follows depends on the checkpoint, the seed and the number of steps only, so that an interrupted run ends with
    the same numbers. SB3 saves neither its random streams nor the episodes that are being played.
    """

    def __init__(self, validation: Validation, path: Path, settings: dict[str, Any], seed: int, interval: int):
        """Remember what to do.

        Args:
            validation: at each milestone.
            path: of the checkpoint.
            settings: of the run.
            seed: of all random streams.
            interval: steps between two milestones.
        """
        super().__init__()
        self.validation, self.path, self.settings = validation, path, settings
        self.seed, self.interval = seed, interval
        self._begun: int | None = None

    def resume(self, model: BaseAlgorithm) -> None:
        """Go on from the checkpoint, if there is one; no code of the file is run.

        Raises:
            CheckpointError: it is damaged or of other settings.
        """
        if not self.path.exists():
            return
        with reading(self.path):
            self._restore(model, load(self.path, KIND))

    def _restore(self, model: BaseAlgorithm, content: dict[str, Any]) -> None:
        settings = {**BEFORE_PRESETS, **content["settings"]}
        if settings != self.settings:
            raise CheckpointError(
                f"{self.path}: its settings {settings} differ from {self.settings}; use another folder"
            )
        model.set_parameters(content["parameters"])
        for name, value in content["counters"].items():
            setattr(model, name, value)
        _fill(getattr(model, "replay_buffer", None), content["replay"])
        self.validation.best_mean_reward = content["best"]
        for name, value in content["history"].items():
            setattr(self.validation, name, value)

    def _init_callback(self) -> None:
        self.validation.init_callback(self.model)

    def _on_rollout_start(self) -> None:
        steps = self.model.num_timesteps
        if self._begun is None:
            self._begin(steps)
        elif steps // self.interval > self._begun // self.interval:
            self._pause()
            self._begin(steps)

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self._pause()

    def _begin(self, steps: int) -> None:
        """Begin all random streams and episodes anew."""
        model, self._begun = self.model, steps
        env = self.training_env
        model.set_random_seed(int(np.random.SeedSequence([self.seed, steps]).generate_state(1)[0]) // 2)
        model._last_obs = env.reset()  # type: ignore[assignment]  # SB3 has no public way to do this between two rollouts
        model._last_episode_starts = np.ones(env.num_envs, dtype=bool)
        for buffer in (model.ep_info_buffer, model.ep_success_buffer):
            if buffer is not None:
                buffer.clear()

    def _pause(self) -> None:
        """Validate and save."""
        self.validation.on_step()
        model, finished = self.model, self.model.num_timesteps >= self.model._total_timesteps
        content = {
            "settings": self.settings,
            "parameters": model.get_parameters(),
            "counters": {name: getattr(model, name) for name in _COUNTERS if hasattr(model, name)},
            "replay": {} if finished else _content(getattr(model, "replay_buffer", None)),
            "best": float(self.validation.best_mean_reward),
            "history": self.validation.history(),
        }
        save(self.path, KIND, content)


class Log(KVWriter):
    """Appends rows to ``metrics.jsonl``; those of an interrupted run after its last checkpoint are dropped."""

    def __init__(self, folder: Path, steps: int):
        """Open the log of a run that goes on from a number of steps."""
        self._path = folder / METRICS
        rows = read_rows(self._path) if self._path.exists() else []
        write_atomically(self._path, "".join(f"{sealed(row)}\n" for row in rows if row["steps"] <= steps))

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        """Append a row."""
        numbers = {
            name: float(value) for name, value in key_values.items() if isinstance(value, int | float | np.number)
        }
        append_line(self._path, sealed({"steps": step, **numbers}))

    def close(self) -> None:
        """Do nothing: the file is closed after each row."""


class Events(KVWriter):
    """Writes TensorBoard's events, from the first row on, as their writer has no words for a full disk."""

    def __init__(self, folder: Path):
        """Remember the run's folder."""
        self._folder = folder
        self._board: TensorBoardOutputFormat | None = None

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        """Add a row, if TensorBoard is installed."""
        with writing(self._folder / BOARD, self._folder):
            try:
                self._board = self._board or TensorBoardOutputFormat(str(self._folder / BOARD))
            except (ImportError, AssertionError):
                return
            self._board.write(key_values, key_excluded, step)

    def close(self) -> None:
        """End the events."""
        if self._board is not None:
            with writing(self._folder / BOARD, self._folder):
                self._board.close()


def make_logger(folder: Path, steps: int) -> Logger:
    """Return a logger to ``metrics.jsonl``, and to TensorBoard if it is installed."""
    return Logger(str(folder), [Log(folder, steps), Events(folder)])


def _content(buffer: Any) -> dict[str, Any]:
    """Return what is in a replay buffer, as tensors; {} if there is no buffer."""
    if buffer is None:
        return {}
    end = buffer.buffer_size if buffer.full else buffer.pos
    cut = {name: _cut(value, end) for name, value in vars(buffer).items() if _cut(value, end) is not None}
    return {"pos": buffer.pos, "full": buffer.full, "arrays": cut}


def _cut(value: Any, end: int) -> Any:
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value[:end])
    if isinstance(value, dict) and value and all(isinstance(part, np.ndarray) for part in value.values()):
        return {key: torch.from_numpy(part[:end]) for key, part in value.items()}
    return None


def _fill(buffer: Any, content: dict[str, Any]) -> None:
    if buffer is None or not content:
        return
    buffer.pos, buffer.full = content["pos"], content["full"]
    for name, kept in content["arrays"].items():
        own = getattr(buffer, name)
        for target, source in [(own[key], kept[key]) for key in kept] if isinstance(kept, dict) else [(own, kept)]:
            target[: len(source)] = source.numpy()
