"""A run of Stable-Baselines3 that can be killed at any moment: validation, checkpoints and log between rollouts."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, EvalCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from stable_baselines3.common.vec_env import VecEnv

from chmarl_pb.envs.registration import options_of
from chmarl_pb.envs.tracks import TRACKS
from chmarl_pb.errors import WriteError
from chmarl_pb.files import append_line, sealed, write_atomically, writing
from chmarl_pb.learning.algorithms.gradient import check_finite
from chmarl_pb.learning.config import ROOMS, TRAINED_IN
from chmarl_pb.learning.runs import interrupts
from chmarl_pb.learning.runs.logger import BOARD, METRICS, read_rows
from chmarl_pb.learning.sb3.config import BEFORE_PRESETS
from chmarl_pb.learning.sb3.journal import Journal, buffer_content, counters, fill_buffer, go_back, moment
from chmarl_pb.learning.storage.checkpoint import check_same, load, reading, save

KIND = "sb3"
_VALIDATED = "eval/mean_reward"  # what SB3 calls a figure that a validation alone has
_HISTORY = ("evaluations_timesteps", "evaluations_results", "evaluations_length", "evaluations_successes")


class Validation(EvalCallback):
    """Plays the same validation tasks each time; the mean reward, by which the best weights are chosen, is PLW."""

    def __init__(
        self,
        env: VecEnv,
        tasks: int,
        sampled: bool,
        folder: Path,
        on_best: BaseCallback,
        say: Callable[[str], None],
        check: Callable[[], None],
    ):
        """Validate in environments of :func:`chmarl_pb.learning.sb3.validation.make_validation`.

        Args:
            env: the environments.
            tasks: number of tasks.
            sampled: whether actions are drawn.
            folder: of the run.
            on_best: called when the weights are the best so far.
            say: tells what came of a validation.
            check: called before each step; an error ends the validation.
        """
        super().__init__(
            env, on_best, n_eval_episodes=tasks, eval_freq=1, log_path=str(folder), deterministic=not sampled,
            verbose=0, warn=False,
        )  # fmt: skip
        self._say, self._check = say, check

    def _log_success_callback(self, locals_: dict[str, Any], globals_: dict[str, Any]) -> None:
        self._check()
        if episode := locals_["info"].get("episode"):  # in floats of 32 bits, whose mean no checkpoint would give again
            episode["r"] = float(episode["r"])
        super()._log_success_callback(locals_, globals_)

    def _on_step(self) -> bool:
        self.eval_env.seed(0)
        # EvalCallback keeps what is better; of equals the last weights are to be kept, which have learned for longer.
        kept = self.best_mean_reward
        self.best_mean_reward = below = float(np.nextafter(kept, -np.inf))
        torch.manual_seed(0)  # training begins its own stream anew after this
        file = Path(f"{self.log_path}.npz")
        try:
            with writing(file):
                going_on = super()._on_step()
        except BaseException as error:
            self.best_mean_reward = kept  # it will be validated again
            if isinstance(error, WriteError):
                file.unlink(missing_ok=True)  # half of it would be worse than none; the checkpoint has its contents
            raise
        if self.best_mean_reward == below:
            self.best_mean_reward = kept
        row = self.rows()[-1]
        self._say(f"steps {row['steps']:,}  validation: SR {100 * row['sr']:.1f}  PLW {100 * row['plw']:.1f}")
        return going_on

    def history(self) -> dict[str, Any]:
        """Return all validations so far, in plain types."""
        return {name: [np.asarray(row).tolist() for row in getattr(self, name)] for name in _HISTORY}

    def best(self) -> dict[str, float]:
        """Return the row of the validation whose weights are kept."""
        # Runs of earlier versions kept the best mean in 32 bits.
        return min(reversed(self.rows()), key=lambda row: abs(row["plw"] - self.best_mean_reward))

    def rows(self) -> list[dict[str, float]]:
        """Return steps, success rate and PLW of all validations so far."""
        columns = self.evaluations_timesteps, self.evaluations_successes, self.evaluations_results
        rows = zip(*columns, strict=True)
        return [{"steps": int(at), "sr": float(np.mean(won)), "plw": float(np.mean(plw))} for at, won, plw in rows]


class Milestones(BaseCallback):
    """Validates, saves, and begins all random streams and episodes anew, every so many steps and at the end.

    What follows depends on the checkpoint, the seed and the number of steps only, so that an interrupted run ends with
    the same numbers. Between two milestones a checkpoint also holds where the random streams are, and the actions since
    the last milestone: played again, they bring the environments back to where they were, bit by bit.
    """

    def __init__(
        self,
        validation: Validation,
        path: Path,
        settings: dict[str, Any],
        seed: int,
        interval: int,
        journal: Journal,
        log_interval: int,
        check: Callable[[], None],
    ):
        """Remember what to do.

        Args:
            validation: at each milestone.
            path: of the checkpoint.
            settings: of the run.
            seed: of all random streams.
            interval: steps between two milestones.
            journal: the innermost environments, with their actions since the last milestone.
            log_interval: steps between two rows of the log; 0: the algorithm writes them itself.
            check: called where the run can end; see :class:`chmarl_pb.learning.runs.interrupts.Signals`.
        """
        super().__init__()
        self.validation, self.path, self.settings = validation, path, settings
        self.seed, self.interval = seed, interval
        self.finished = False
        self._journal, self._log_interval, self._check = journal, log_interval, check
        self._begun: int | None = None
        self._logged, self._saved = 0, time.monotonic()
        self._moment: dict[str, Any] = {}
        self._played = 0  # actions of the journal that led to the moment
        self._kept_log: list[Any] = []

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
        before = {TRAINED_IN: self.settings[TRAINED_IN], **BEFORE_PRESETS, ROOMS: self.settings[ROOMS]}
        theirs = {**before, **content["settings"]}
        has_feedback = TRACKS[str(options_of(theirs["env_id"])["track"])]["feedback"]
        theirs["feedback"] = bool(theirs["feedback"] and has_feedback)  # older ones say what was asked for
        check_same(theirs, self.settings, self.path)
        model.set_parameters(content["parameters"])
        kept = content.get("moment")
        for name, value in (kept or content)["counters"].items():
            setattr(model, name, value)
        fill_buffer(getattr(model, "replay_buffer", None), content["replay"])
        self.validation.best_mean_reward = content["best"]
        for name, value in content["history"].items():
            setattr(self.validation, name, value)
        self._logged = model.num_timesteps
        self.finished = kept is None and model.num_timesteps >= self.settings["steps"]
        if kept is not None:
            self._begin(model, content["begun"])
            self._journal.play_again(model, content["played"].numpy())
            go_back(model, kept)
            self._kept_log = kept["log"]

    def _init_callback(self) -> None:
        self.validation.init_callback(self.model)

    def _on_training_start(self) -> None:
        logger = self.model.logger
        for name, value, count in self._kept_log:
            logger.name_to_value[name], logger.name_to_count[name], logger.name_to_excluded[name] = value, count, ()

    def _on_rollout_start(self) -> None:
        steps = self.model.num_timesteps
        if self._begun is None:
            self._begin(self.model, steps)
        self._note()
        if steps // self.interval > (self._begun or 0) // self.interval:
            self._pause()
            self._begin(self.model, steps)
            self._note()
        elif time.monotonic() > self._saved + interrupts.EVERY:
            self.save()

    def _on_step(self) -> bool:
        self._check()
        return True

    def _on_training_end(self) -> None:
        self._note()
        self._pause()

    def _note(self) -> None:
        """Log if it is due, as SB3 would count from the last interruption, and note where the run is."""
        steps = self.model.num_timesteps
        if self._log_interval and steps // self._log_interval > self._logged // self._log_interval:
            self._logged = steps
            self.model.dump_logs()
        self._moment, self._played = moment(self.model), len(self._journal.actions)

    def _begin(self, model: BaseAlgorithm, steps: int) -> None:
        """Begin all random streams and episodes anew."""
        self._begun = steps
        env = model.get_env()
        assert env is not None
        model.set_random_seed(int(np.random.SeedSequence([self.seed, steps]).generate_state(1)[0]) // 2)
        # SB3 has no public way to do this between two rollouts.
        model._last_obs = env.reset()  # type: ignore[assignment]
        model._last_episode_starts = np.ones(env.num_envs, dtype=bool)
        for buffer in (model.ep_info_buffer, model.ep_success_buffer):
            if buffer is not None:
                buffer.clear()

    def _pause(self) -> None:
        """Validate and save, unless there is nothing left to learn from.

        Raises:
            DivergedError: a weight is infinite or no number.
        """
        check_finite(self.model.policy)
        self.save()  # validation takes its time
        self.validation.on_step()
        self.finished = self.model.num_timesteps >= self.model._total_timesteps
        self._write({"counters": counters(self.model)})

    def save(self) -> None:
        """Write where the run was when the present rollout began."""
        if self._moment:
            played = torch.from_numpy(np.array(self._journal.actions[: self._played], dtype=np.int64))
            self._write({"moment": self._moment, "begun": self._begun, "played": played})

    @property
    def saved_steps(self) -> int:
        """Steps up to the moment that ``save`` writes."""
        return int(self._moment["counters"]["num_timesteps"]) if self._moment else 0

    def _write(self, where: dict[str, Any]) -> None:
        model = self.model
        content = {
            "settings": self.settings,
            "parameters": model.get_parameters(),
            "replay": {} if self.finished else buffer_content(getattr(model, "replay_buffer", None)),
            "best": float(self.validation.best_mean_reward),
            "history": self.validation.history(),
        }
        save(self.path, KIND, content | where)
        self._saved = time.monotonic()


class Log(KVWriter):
    """Appends rows to ``metrics.jsonl``; those of an interrupted run after its last checkpoint are dropped."""

    def __init__(self, folder: Path, steps: int, validated: int = 0):
        """Open the log of a run that goes on from a number of steps, the last of which were validated at some."""
        self._path = folder / METRICS
        rows = [row for row in read_rows(self._path) if row["steps"] <= (validated if _VALIDATED in row else steps)]
        write_atomically(self._path, "".join(f"{sealed(row)}\n" for row in rows))

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


def make_logger(folder: Path, steps: int, validated: int) -> Logger:
    """Return a logger to ``metrics.jsonl``, and to TensorBoard if it is installed; see :class:`Log`."""
    return Logger(str(folder), [Log(folder, steps, validated), Events(folder)])
