"""Rollouts in several processes: the same episodes, the same numbers each time, and errors that come home."""

import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import pairwise
from multiprocessing import active_children, parent_process
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
import pytest
import torch
from torch.nn.utils import parameters_to_vector

from chmarl_pb.errors import WorkerError
from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.value import Config, ValueLearner
from chmarl_pb.learning.benchmark_env import benchmark
from chmarl_pb.learning.networks.encoders import build_encoder
from chmarl_pb.learning.rollouts.collect import Choose, Collector, epsilon_greedy, greedy
from chmarl_pb.learning.rollouts.replay_buffer import Episode
from chmarl_pb.learning.rollouts.workers import rollouts_of
from chmarl_pb.learning.runs.interrupts import StopRequested
from chmarl_pb.learning.runs.logger import METRICS, Logger, read_rows
from chmarl_pb.learning.runs.run import Run
from chmarl_pb.learning.runs.validation import by_return
from chmarl_pb.signals import Interrupted
from tests.helpers.small_runs import CONFIGS, EXPERT, SMALL
from tests.helpers.stopping import in_pieces
from tests.helpers.uneven_env import UnevenEnv
from tests.learning.test_interrupts import assert_same

torch.set_num_threads(1)  # these networks are too small for more


def rollouts(workers: int, choose: Choose, count: int = 2, envs: int = 5) -> list[Episode]:
    """Return the episodes of some rollouts."""
    make, rng = partial(Collector, UnevenEnv, expert=EXPERT), np.random.default_rng(0)
    with closing(make(envs)) as collector, rollouts_of(collector, make, workers) as play:
        agents = ValueLearner("vdn", collector.interface, SMALL).agents.eval()
        seeds = np.arange(count * envs).reshape(count, envs).tolist()
        return [episode for row in seeds for episode in play(agents, choose, rng, row)]


def contents(episodes: list[Episode]) -> list[Any]:
    """Return what can be compared of episodes."""
    return [
        [one.actions, one.labels, np.array(one.rewards).tolist(), np.array(one.states).tolist()] for one in episodes
    ]


def told(one: Any) -> Any:
    """Return all that is kept of an episode, each array by its type, shape and values."""
    if isinstance(one, dict):
        return {name: told(part) for name, part in one.items()}
    if isinstance(one, list):
        return [told(part) for part in one]
    return (type(one), one.dtype, one.shape, one.tolist()) if isinstance(one, np.ndarray) else one


@pytest.mark.parametrize("workers", [2, 5])
def test_episodes_come_whole_from_other_processes(workers: int) -> None:
    alone, together = rollouts(1, greedy), rollouts(workers, greedy)
    assert [told(vars(one)) for one in together] == [told(vars(one)) for one in alone]
    assert all(one.observations[-1]["short"]["noise"].shape == (3,) for one in together)


@pytest.mark.parametrize("workers", [2, 5])
def test_episodes_without_chance_are_those_of_one_process(workers: int) -> None:
    alone, together = rollouts(1, greedy), rollouts(workers, greedy)
    assert len(alone) == 10 and contents(together) == contents(alone)


def test_each_process_draws_by_itself_and_the_same_each_time() -> None:
    episodes = rollouts(2, epsilon_greedy(1.0), envs=8)
    assert contents(episodes) == contents(rollouts(2, epsilon_greedy(1.0), envs=8))
    drawn = [[[one.actions for one in episodes[first : first + 4]]] for first in range(0, 16, 4)]
    assert all(drawn[number] not in drawn[:number] for number in range(4)), "processes or rollouts share their draws"
    assert not active_children()


@pytest.mark.parametrize("algorithm", ["qmix", "imitation"])
@pytest.mark.parametrize(("overlap", "every"), [(False, 43), (True, 13)])
def test_a_run_may_be_interrupted_anywhere(
    algorithm: str, overlap: bool, every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = replace(CONFIGS[algorithm], workers=2, overlap=overlap)
    run = partial(train, UnevenEnv, algorithm, config, validate=by_return(8), expert=EXPERT)
    run(tmp_path / "whole")
    _, times = in_pieces(lambda: run(tmp_path / "pieces"), every, monkeypatch)
    assert times > 1
    assert_same(tmp_path / "whole", tmp_path / "pieces")
    assert all(0 <= row["speed"]["rollout_share"] <= 1 for row in read_rows(tmp_path / "whole" / METRICS))


class Noted:
    """Plays rollouts, and notes by which weights, and which there are after what is done meanwhile."""

    def __init__(self, collector: Collector, stopped: int | None = None):
        """Play in a collector; one rollout, by its number, is stopped when it is over."""
        self.collector, self._stopped = collector, stopped
        self.weights: list[tuple[torch.Tensor, torch.Tensor]] = []

    def __call__(
        self,
        agents: torch.nn.ModuleDict,
        choose: Choose,
        rng: np.random.Generator,
        seeds: Sequence[int],
        meanwhile: Callable[[], None] = lambda: None,
    ) -> list[Episode]:
        """Return the episodes; the arguments are those of ``PlayRollout``."""
        before = parameters_to_vector(agents.parameters()).clone()
        episodes = self.collector.play(agents, choose, rng, seeds)
        meanwhile()
        if self._stopped == len(self.weights):
            self._stopped = None
            raise StopRequested
        self.weights.append((before, parameters_to_vector(agents.parameters()).clone()))
        return episodes


class Telling(torch.nn.Module):
    """The usual encoder; its state is not made of tensors alone."""

    def __init__(self, space: Any, size: int, *others: Any, **options: Any):
        """Make the usual one."""
        super().__init__()
        self.inner = build_encoder(space, size, *others, **options)

    def forward(self, observation: Any) -> torch.Tensor:
        """Return its features."""
        features: torch.Tensor = self.inner(observation)
        return features

    def get_extra_state(self) -> str:
        """Return what it is called."""
        return "told"

    def set_extra_state(self, state: Any) -> None:
        """Hear it."""
        assert state == "told"


TELLING = replace(SMALL, encoder=f"{__name__}:{Telling.__name__}")


def run_noted(
    overlap: bool, stopped: int | None = None, config: Config = SMALL
) -> tuple[Run, list[tuple[torch.Tensor, torch.Tensor]]]:
    """Train, in two runs if a rollout is stopped; return the last run and the weights before and after each rollout."""
    config = replace(config, overlap=overlap)
    with closing(Collector(UnevenEnv, config.envs)) as collector, closing(Logger(None, config.episodes)) as logger:
        play = Noted(collector, stopped)
        make = partial(Run, collector, play, "qmix", config, None, by_return(2), {}, torch.device("cpu"))
        run = make()
        while not run.is_over:
            try:
                run.advance(logger)
            except StopRequested:
                state = run.state()
                run = make()
                run.restore(state, Path("last.pt"))
        return run, play.weights


def test_gradient_steps_may_overlap_with_the_next_rollout() -> None:
    (apart, before), (beside, overlapping) = run_noted(False), run_noted(True)
    starts, rollouts = SMALL.learning_starts // SMALL.envs, SMALL.episodes // SMALL.envs
    assert apart.learner.updates == beside.learner.updates == (rollouts - starts + 1) * SMALL.gradient_steps
    assert all(torch.equal(*pair) for pair in before), "nothing is learned beside a rollout unless it is asked for"
    changed = [not torch.equal(*pair) for pair in overlapping]
    assert changed == [False] * starts + [True] * (rollouts - starts)
    for (_, after), (following, _) in pairwise(overlapping):
        assert torch.equal(after, following), "a rollout follows the gradient steps before it"
    last = parameters_to_vector(beside.learner.agents.parameters())
    assert not torch.equal(last, overlapping[-1][1]), "the last rollout is learned from, too"


@pytest.mark.parametrize("starts", [0, 1, 10_000])
def test_as_much_is_learned_with_overlap_whenever_learning_starts(starts: int) -> None:
    config = replace(SMALL, learning_starts=starts)
    (apart, _), (beside, _) = run_noted(False, config=config), run_noted(True, config=config)
    assert apart.learner.updates == beside.learner.updates > 0


@pytest.mark.parametrize("config", [SMALL, TELLING])
def test_a_rollout_that_is_stopped_beside_gradient_steps_is_played_again_by_the_weights_before_them(
    config: Config,
) -> None:
    stopped = SMALL.learning_starts // SMALL.envs + 2
    (whole, played), (pieces, again) = run_noted(True, config=config), run_noted(True, stopped, config)
    assert all(torch.equal(one, other) for (one, _), (other, _) in zip(played, again, strict=True))
    assert pieces.learner.updates == whole.learner.updates
    weights = [parameters_to_vector(run.learner.agents.parameters()) for run in (whole, pieces)]
    assert torch.equal(*weights)


@pytest.mark.parametrize("workers", [1, 2])
def test_all_play_beside_the_run_that_learns(workers: int) -> None:
    make, rng, done = partial(Collector, UnevenEnv, expert=EXPERT), np.random.default_rng(0), []
    with closing(make(4)) as collector, rollouts_of(collector, make, workers, beside=True) as play:
        collector.envs.clear()  # nothing can be played here
        agents = ValueLearner("vdn", collector.interface, SMALL).agents.eval()
        episodes = play(agents, greedy, rng, range(4), lambda: done.append(True))
    assert done and contents(episodes) == contents(rollouts(1, greedy, 1, 4))


def test_who_learns_on_policy_cannot_overlap() -> None:
    with pytest.raises(ValueError, match="overlap=True: this algorithm learns from what its present weights"):
        replace(CONFIGS["mappo"], overlap=True)


class Elsewhere(UnevenEnv):
    """Does something in its steps, but not in the process of the run."""

    def __init__(self, act: Callable[[], None]):
        """Take what it does."""
        super().__init__()
        self._act = act

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        if parent_process() is not None:
            self._act()
        return super().step(actions)


def fail() -> None:
    raise ValueError("the lamp is out")


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def stop_all() -> None:
    """End as after a signal to all processes of a group, while the run waits for this one."""
    time.sleep(1.0)
    parent = parent_process()
    assert parent is not None and parent.pid is not None
    os.kill(parent.pid, signal.SIGTERM)
    die()


@pytest.mark.parametrize(
    ("act", "kind", "words"), [(fail, ValueError, "the lamp is out"), (die, WorkerError, "a process died")]
)
def test_errors_of_other_processes_end_the_run(act: Callable[[], None], kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=words):
        train(partial(Elsewhere, act), "vdn", replace(SMALL, workers=2))
    assert not active_children()


def test_a_signal_to_all_processes_saves_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chmarl_pb.learning.rollouts.workers._WAIT", 60.0)  # the others end before the run looks
    with pytest.raises(Interrupted, match=r"goes on from .*last\.pt"):
        train(partial(Elsewhere, stop_all), "vdn", replace(SMALL, workers=2), tmp_path)
    assert (tmp_path / "last.pt").is_file()


def test_pictures_are_encoded_in_each_process(tmp_path: Path) -> None:
    make, setting = benchmark("visual", image_encoder="resnet18", image_size=64)
    config = replace(SMALL, episodes=2, envs=2, workers=2, horizon=30, image_encoder="resnet18")
    train(make, "vdn", config, tmp_path, setting=setting)
    assert (tmp_path / "last.pt").is_file()


def test_what_cannot_be_sent_is_told() -> None:
    lock = Lock()
    with pytest.raises(ValueError, match=r"the environment cannot be sent .* or give workers=1"):
        train(lambda: (lock, UnevenEnv())[1], "vdn", replace(SMALL, workers=2))
    with pytest.raises(ValueError, match=r"the environment cannot be sent .* or give workers=1 without overlap"):
        train(lambda: (lock, UnevenEnv())[1], "vdn", replace(SMALL, overlap=True))


def test_each_process_has_an_environment() -> None:
    with pytest.raises(ValueError, match="workers=5: must be at most envs=4"):
        replace(SMALL, workers=5)
