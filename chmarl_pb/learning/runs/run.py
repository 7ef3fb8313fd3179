"""A training run, from rollout to rollout: play some episodes, learn from the replay buffer, validate, log, save."""

import copy
import json
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from chmarl_pb.files import file_hash
from chmarl_pb.learning.algorithms.gradient import check_finite
from chmarl_pb.learning.algorithms.registry import make_learner
from chmarl_pb.learning.benchmark_env import untold
from chmarl_pb.learning.config import RunConfig
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import Collector
from chmarl_pb.learning.rollouts.replay_buffer import Episode, ReplayBuffer
from chmarl_pb.learning.rollouts.workers import PlayRollout
from chmarl_pb.learning.runs import interrupts
from chmarl_pb.learning.runs.interrupts import StopRequested
from chmarl_pb.learning.runs.logger import Logger
from chmarl_pb.learning.runs.validation import Validate, scores_of
from chmarl_pb.learning.spaces import LearnerInterface
from chmarl_pb.learning.storage.checkpoint import CheckpointError, check_same, is_whole, load, save
from chmarl_pb.processes import ProcessDiedError

LAST, BEST = "last.pt", "best.pt"


class Run:
    """A training run; all of it can be saved between two rollouts, and in one before its validation.

    With ``overlap`` the gradient steps that follow a rollout are taken while the next one is played, by the weights
    from before them; those that follow the last one are taken after it. A rollout that is broken off is played again by
    the same weights.

    Attributes:
        learner: networks and optimizer; the agents' networks are in training mode in gradient steps alone.
        episodes: number of played episodes.
        rows: number of written rows of metrics.
        best_score: of the best validation so far.
    """

    def __init__(
        self,
        collector: Collector,
        play: PlayRollout,
        algorithm: str,
        config: RunConfig,
        folder: Path | None,
        validate: Validate,
        setting: dict[str, Any],
        device: torch.device,
        resumed: bool = False,
    ):
        """Begin a run; a resumed one is to be restored, and reads no weights to begin with.

        Args:
            collector: what validations play in.
            play: plays rollouts of such environments.
            algorithm: name of the learner.
            config: everything else that fixes the run.
            folder: for checkpoints and metrics; None: nothing is written.
            validate: chooses the best weights.
            setting: what policies made from the checkpoints have to know.
            device: of torch, that the networks learn on.
            resumed: whether it goes on.
        """
        self.config, self.folder, self.setting = config, folder, setting
        self._collector, self._play_rollout, self._validate = collector, play, validate
        self._validated_by = scores_of(validate)
        self.learner = make_learner(algorithm, collector.interface, config, resumed)
        self._begun_with = origin(Path(config.first_weights)) if config.first_weights and not resumed else {}
        self._device = device
        self.learner.to(self._device)
        self.learner.agents.eval()
        self.replay = _make_buffer(collector.interface, algorithm, config, device)
        streams = np.random.SeedSequence(config.seed).spawn(3)
        self._streams = dict(zip(("tasks", "actions", "batches"), map(np.random.default_rng, streams), strict=True))
        self.episodes, self.rows, self.best_score = 0, 0, -np.inf
        self._unreported: int | None = None  # episodes before a rollout that is learned from, until its row is written
        self._acting: dict[str, Any] | None = None  # weights of a rollout, once gradient steps were taken beside it
        self._saved = time.monotonic()
        self._window: dict[str, list[float]] = defaultdict(list)
        self._clock = {"rollout": 0.0, "updates": 0.0, "steps": 0, "transitions": 0, "gradients": 0}

    @property
    def is_over(self) -> bool:
        """Whether all episodes are played, learned from and reported."""
        return self.episodes >= self.config.episodes and self._unreported is None

    def advance(self, logger: Logger) -> None:
        """Play a rollout, learn from it, and do what is due after it; what was left of the last rollout comes first.

        Raises:
            StopRequested: the run is to end; its state is that of before the rollout, but for the gradient steps that
                were taken beside it, or of before its validation.
            ValueError: the score of a validation is no number.
        """
        if self._unreported is None:
            before = self.episodes
            self._play()
            if self._learns and (not self.config.overlap or self.episodes >= self.config.episodes):
                self._learn()
            self._unreported = before
        self._report(self._unreported, logger)

    @property
    def _learns(self) -> bool:
        """Whether enough episodes are played to learn from."""
        return self.episodes >= max(min(self.config.learning_starts, self.config.episodes), 1)

    def _report(self, before: int, logger: Logger) -> None:
        """Validate, log and save, as it is due after a rollout that began after some episodes."""
        row: dict[str, Any] = {}
        if self._due(before, self.config.validation_interval):
            self.save()  # validation takes its time
            row["validation"] = self._score()
        if self._due(before, self.config.log_interval):
            row = self._figures() | row
        if row:
            logger.write({"episodes": self.episodes, **row})
            self.rows = logger.rows
        logger.advance(self.episodes)
        self._unreported = None
        if self._due(before, self.config.checkpoint_interval) or time.monotonic() > self._saved + interrupts.EVERY:
            self.save()

    def save(self) -> None:
        """Write the checkpoint that a run goes on from, if there is a folder."""
        if self.folder is not None:
            save(self.folder / LAST, "run", self.state())
            self._saved = time.monotonic()

    def state(self) -> dict[str, Any]:
        """Return all that the run needs to go on; a finished one needs no replay buffer."""
        replay = self.replay.state() if self.episodes < self.config.episodes else None
        streams = {name: json.dumps(stream.bit_generator.state) for name, stream in self._streams.items()}
        return {
            **self._settings(), "learner": self.learner.state(), "replay": replay, "streams": streams,
            "episodes": self.episodes, "rows": self.rows, "best_score": self.best_score, "window": dict(self._window),
            "unreported": self._unreported, "acting": self._acting, "begun_with": self._begun_with,
            "validated_by": self._validated_by,
        }  # fmt: skip

    def restore(self, state: dict[str, Any], path: Path) -> None:
        """Go on from a state; an older one, which does not tell the split that it was trained in, with whatever split.

        Args:
            state: made by ``state``.
            path: of the file that it comes from, for errors.

        Raises:
            CheckpointError: it is of other settings.
        """
        theirs, own = dict(state), self._settings()
        self._begun_with = state.get("begun_with", {})  # nothing in older ones
        theirs["setting"] = {**untold(state["setting"], self.setting), **state["setting"]}
        if state["algorithm"] == self.learner.algorithm:  # settings that are newer than the file have their defaults
            first = self.config.first_weights
            if first and Path(first).is_file() and file_hash(Path(first)) == self._begun_with.get("sha256"):
                theirs["config"] = {**theirs["config"], "start": first}  # the same weights may lie elsewhere now
            if str(own_expert := getattr(self.config, "expert", "")).startswith(f"{theirs['config'].get('expert')} "):
                theirs["config"] = {**theirs["config"], "expert": own_expert}  # older ones tell the name alone
            theirs |= asdict(type(self.config)(**theirs["config"]))
            own |= asdict(self.config)
        known = {"agents": own["agents"], **theirs}  # older runs do not tell the order of agents
        check_same({**known, "config": None}, {**own, "config": None}, path)
        before, now = state.get("validated_by", self._validated_by), self._validated_by
        if isinstance(before, str):  # older ones tell the name alone, which says too little
            before = now
        if before != now and state["best_score"] > -np.inf:
            other = f"by {before['name']}, not by {now['name']}," if before["name"] != now["name"] else "by another one"
            raise CheckpointError(
                f"{path}: its weights were chosen {other} whose scores may be others; give the same `validate`, with "
                f"the same arguments, or use another folder"
            )
        self.learner.restore(state["learner"], path)
        if state["replay"] is not None:
            self.replay.restore(state["replay"])
        for name, stream in self._streams.items():
            stream.bit_generator.state = json.loads(state["streams"][name])
        self.episodes, self.rows, self.best_score = state["episodes"], state["rows"], state["best_score"]
        if self.folder is not None and not is_whole(self.folder / BEST):
            self.best_score = -np.inf  # the best weights are lost, so the next ones are the best that there are
        self._window = defaultdict(list, state["window"])
        self._unreported = state.get("unreported")  # older checkpoints were written after the row alone
        self._acting = state.get("acting")  # older ones knew no steps beside a rollout

    def _play(self) -> None:
        config, start = self.config, time.perf_counter()
        before = {name: self._streams[name].bit_generator.state for name in ("tasks", "actions")}
        seeds = self._seeds()
        choose = self.learner.choose(self.episodes)
        agents = self.learner.agents
        if self._acting is not None:  # this rollout was broken off after the gradient steps
            agents = copy.deepcopy(agents)
            agents.load_state_dict(self._acting)
        try:
            played = self._play_rollout(agents, choose, self._streams["actions"], seeds, self._meanwhile)
        except (StopRequested, ProcessDiedError):
            for name, state in before.items():  # the rollout is played again
                self._streams[name].bit_generator.state = state
            raise
        self._acting = None
        for episode in played:
            self._window["return"].append(episode.episode_return)
            self.replay.add(_scaled(episode, config.reward_scale))
            self._window["length"].append(len(episode))
            self._window["success"] += _success(episode)
        self.episodes += len(played)
        self._clock["rollout"] += time.perf_counter() - start
        self._clock["steps"] += sum(map(len, played))

    def _meanwhile(self) -> None:
        """Take the gradient steps that follow the last rollout, if they are to overlap with the one being played."""
        if self.config.overlap and self._learns and self._acting is None:
            acting, start = copy.deepcopy(self.learner.agents.state_dict()), time.perf_counter()
            self._learn()
            self._acting = acting
            self._clock["rollout"] -= time.perf_counter() - start  # it is counted as that of updates

    def _seeds(self) -> list[int]:
        """Return the seeds of a rollout: random ones, but in a row where an environment is to stay in its home."""
        envs, apart = self.config.envs, self._collector.episodes_in_a_home
        seeds = self._streams["tasks"].integers(2**31, size=envs)
        if apart > 1:
            rollouts, stay = self.episodes // envs, min(apart, self.config.home_rollouts)
            homes = np.random.default_rng([self.config.seed, rollouts // stay]).integers(2**31 // apart, size=envs)
            seeds = homes * apart + rollouts % stay
        return [int(seed) for seed in seeds]

    def _learn(self) -> None:
        start = time.perf_counter()
        for batch, figures in self._gradient_steps():
            for name, value in figures.items():
                self._window[name].append(value)
            self._clock["transitions"] += int(batch.acted.any(dim=-1).sum())
            self._clock["gradients"] += 1
        check_finite(self.learner.agents)
        self._clock["updates"] += time.perf_counter() - start

    def _gradient_steps(self) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take gradient steps in training mode; what networks draw, as dropout does, follows from seed and step."""
        steps = self.learner.learn(self.replay, self._streams["batches"])
        self.learner.agents.train()
        with torch.random.fork_rng([self._device] if self._device.type == "cuda" else []):
            while True:
                place = np.random.SeedSequence([self.config.seed, self.learner.updates])
                torch.manual_seed(int(place.generate_state(1)[0]))
                if (step := next(steps, None)) is None:
                    break
                yield step
        self.learner.agents.eval()

    def _score(self) -> dict[str, float]:
        """Validate, keep the weights if none so far were better, so of equals the last ones, and return the figures.

        Raises:
            ValueError: there is no score, or a figure is no number.
        """
        figures = _figures_of(self._validate(self._collector, self.learner.agents))
        for name, value in figures.items():
            if not np.isfinite(value):
                raise ValueError(
                    f"the validation after {self.episodes} episodes has the {name} {value}, which is no number"
                    f"{', so no weights can be chosen by it' * (name == 'score')}; see to what `validate` returns, or "
                    "to the rewards of the environment"
                )
        if figures["score"] >= self.best_score:
            self.best_score = figures["score"]
            if self.folder is not None:
                content = self._settings() | {"agents": self.learner.agents.state_dict(), "episodes": self.episodes}
                content |= {"begun_with": self._begun_with} if self._begun_with else {}
                save(self.folder / BEST, "value", content | {"validation": figures})
        return figures

    def _figures(self) -> dict[str, Any]:
        """Return the means since the last row, and how fast all went."""
        means = {name: float(np.mean(values)) for name, values in self._window.items() if values}
        clock = self._clock
        played = clock["rollout"] + (clock["updates"] if self.config.overlap else 0)
        speed = {
            "rollout_steps_per_s": clock["steps"] / max(played, 1e-9),
            "updates_per_s": clock["gradients"] / max(clock["updates"], 1e-9),
            "learned_steps_per_s": clock["transitions"] / max(clock["updates"], 1e-9),
            "rollout_share": clock["rollout"] / max(clock["rollout"] + clock["updates"], 1e-9),
        }
        self._window.clear()
        self._clock = dict.fromkeys(clock, 0)
        return {"updates": self.learner.updates, "train": means, "speed": speed}

    def _settings(self) -> dict[str, Any]:
        """Return what fixes the run's numbers, in plain types."""
        interface = self._collector.interface
        spaces = {name: str(space) for name, space in interface.observations.items()}
        return {
            "algorithm": self.learner.algorithm, "config": asdict(self.config), "setting": self.setting,
            "observations": spaces, "actions": interface.actions, "agents": list(interface.agents),
        }  # fmt: skip

    def _due(self, before: int, interval: int) -> bool:
        return self.episodes // interval > before // interval or self.episodes >= self.config.episodes


def _figures_of(found: Any) -> dict[str, float]:
    """Return what a validation returns, in plain numbers.

    Raises:
        ValueError: it is no dict of numbers, or has no score.
    """
    numbers = found if isinstance(found, Mapping) else {}
    figures = {name: _number(value) for name, value in numbers.items()}
    wrong = [name for name, value in figures.items() if not isinstance(value, int | float)]
    if wrong or "score" not in figures:
        what = f"{wrong[0]!r}: {numbers[wrong[0]]!r} among its figures" if wrong else repr(found)
        raise ValueError(f"validate returns {what}; let it return a dict of numbers with one of the name 'score'")
    return figures


def _number(value: Any) -> Any:
    """Return a number of NumPy or torch as Python's; anything else as it is."""
    try:
        return value.item() if hasattr(value, "item") else value
    except (ValueError, RuntimeError):  # several numbers
        return value


def origin(weights: Path) -> dict[str, Any]:
    """Return what is kept of the learner whose weights a run begins with.

    Raises:
        CheckpointError: the file is damaged or holds no such learner.
    """
    content = load(weights, "value")
    kept = {key: content.get(key) for key in ("algorithm", "config", "episodes", "validation")}
    return {"sha256": file_hash(weights), **kept}


def _make_buffer(interface: LearnerInterface, algorithm: str, config: RunConfig, device: torch.device) -> ReplayBuffer:
    """Return a run's replay buffer.

    Raises:
        ValueError: memory does not hold what has to be learned from at once.
    """
    replay = ReplayBuffer(interface, config.horizon, config.kept, config.memory_gib, device)
    if config.on_policy and replay.capacity < config.kept:
        raise ValueError(
            f"memory_gib={config.memory_gib}: holds {replay.capacity} of the {config.kept} episodes that "
            f"{algorithm} learns from at once; give more memory, or a smaller buffer_size, learning_starts or envs"
        )
    return replay


def _scaled(episode: Episode, scale: float) -> Episode:
    episode.rewards = [reward * np.float32(scale) for reward in episode.rewards]
    return episode


def _success(episode: Episode) -> list[float]:
    """Return whether the episode succeeded, if the environment says so."""
    found = [info["success"] for info in episode.info.values() if isinstance(info, Mapping) and "success" in info]
    return [float(all(np.all(success) for success in found))] if found else []
