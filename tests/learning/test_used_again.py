"""What environments and experts do with what they are given, and use again of what they return, changes nothing; what
is no step of a ParallelEnv is refused in a sentence."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import parent_process
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from chmarl_pb.errors import WorkerError
from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.registry import ALGORITHMS, Algorithm
from chmarl_pb.learning.algorithms.value import Config, ValueLearner
from chmarl_pb.learning.networks.encoders import build_encoder
from chmarl_pb.learning.rollouts.batched import play_together
from chmarl_pb.learning.rollouts.collect import Collector, epsilon_greedy
from chmarl_pb.learning.rollouts.replay_buffer import Episode
from chmarl_pb.learning.runs.run import LAST, _success
from chmarl_pb.learning.spaces import learner_interface_of
from chmarl_pb.learning.storage.checkpoint import CheckpointError
from tests.helpers.small_runs import CONFIGS, IMITATION, SMALL, Constant
from tests.helpers.uneven_env import UnevenEnv
from tests.learning.test_workers import Elsewhere, die

torch.set_num_threads(1)  # these networks are too small for more


class Pairs(UnevenEnv):
    """The uneven environment with actions of two components."""

    def action_space(self, agent: str) -> Any:
        return spaces.MultiDiscrete([3 if agent == "long" else 2, 4])

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        return super().step({name: int(pair[0]) for name, pair in actions.items()})


class Taking(Pairs):
    """It empties the dict and changes the arrays that it is given."""

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        result = super().step(actions)
        for pair in actions.values():
            pair[:] = 0
        actions.clear()
        return result


class Reusing(Constant):
    """An expert that counts its questions in one array, and proposes for those who are gone as well."""

    row: Any = np.zeros(2, np.int64)

    def act(self, observations: Any, infos: Any) -> dict[str, Any]:
        self.row[:] = 1, (self.row[1] + 1) % 4
        return {"long": self.row, "short": self.row if "short" in observations else None}


class Changed(UnevenEnv):
    """The uneven environment whose steps return something else."""

    def __init__(self, change: Callable[[Any, tuple[Any, ...]], Any]):
        super().__init__()
        self._change = change

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        changed: tuple[Any, ...] = self._change(self, super().step(actions))
        return changed


class Backwards(UnevenEnv):
    """The same agents in another order."""

    def __init__(self) -> None:
        super().__init__()
        self.possible_agents.reverse()


class BackwardsElsewhere(UnevenEnv):
    """The same agents in another order in processes that are not that of the run."""

    def __init__(self) -> None:
        super().__init__()
        if parent_process() is not None:
            self.possible_agents.reverse()


def play(make: Callable[[], Any], expert: Any = None) -> Episode:
    """Return an episode of random actions."""
    collector = Collector(make, 1, expert)
    agents = ValueLearner("vdn", collector.interface, SMALL).agents.eval()
    return collector.play(agents, epsilon_greedy(1.0), np.random.default_rng(0), [0], ask_experts=True)[0]


def test_actions_stay_what_was_chosen_whatever_becomes_of_them_in_the_step() -> None:
    kept, taken = play(Pairs), play(Taking)
    assert str(taken.actions) == str(kept.actions)
    assert np.array_equal(taken.acted, kept.acted) and taken.episode_return == kept.episode_return


class ReusingTensor(Reusing):
    """The same with one tensor."""

    row = torch.zeros(2, dtype=torch.int64)

    def act(self, observations: Any, infos: Any) -> dict[str, Any]:
        self.row[0], self.row[1] = 1, (self.row[1] + 1) % 4
        return {"long": self.row}


def test_labels_in_a_tensor_stay_too() -> None:
    labels = play(Pairs, partial(ReusingTensor, actions={})).labels
    assert [tuple(label["long"].tolist()) for label in labels] == [(1, 1), (1, 2), (1, 3), (1, 0)]


def test_each_environment_has_actions_of_its_own() -> None:
    class Sharing:
        """One row for all robots of all episodes."""

        row = np.array([1, 2])

        def reset(self, seeds: Any) -> None: ...

        def act(self, episodes: Any, observations: Any, infos: Any) -> list[dict[str, Any]]:
            self.row[:] = 1, 2
            return [dict.fromkeys(seen, self.row) for seen in observations]

    seen = [[list(map(int, row)) for row in one.values()] for one in played_by(Sharing())]
    assert seen == [[[1, 2]] * len(one) for one in seen] and len(seen) == 8


def played_by(policy: Any) -> list[dict[str, Any]]:
    """Return the actions that two environments, which change what they are given, are stepped with."""
    given: list[dict[str, Any]] = []

    class Noting(Taking):
        """Notes what it is given."""

        def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
            given.append({name: np.array(pair) for name, pair in actions.items()})
            return super().step(actions)

    for _ in play_together([Noting(), Noting()], policy, [0, 1], [None, None]):
        pass
    return given


def test_labels_stay_what_was_proposed_and_are_of_those_who_are_there() -> None:
    labels = play(Pairs, partial(Reusing, actions={})).labels
    assert [tuple(label["long"]) for label in labels] == [(1, 1), (1, 2), (1, 3), (1, 0)]
    assert [sorted(label) for label in labels] == [["long", "short"]] * 2 + [["long"]] * 2
    config = replace(IMITATION, episodes=8)
    assert train(Pairs, "imitation", config, expert=partial(Reusing, actions={})).learner.updates > 0


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda env, step: step[:4], r"step\(\) returns dict, dict, dict, dict; return five dicts"),
        (lambda env, step: step[0], r"step\(\) returns dict; return five dicts"),
        (lambda env, step: (*step[:4], None), "dict, NoneType; return five dicts"),
        (lambda env, step: ({}, *step[1:]), "no observation of 'long', which env.agents still names"),
        (lambda env, step: env.agents.append("ghost") or step, "no observation of 'ghost', which env.agents still"),
    ],
)
def test_steps_are_those_of_a_parallel_env(change: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        play(partial(Changed, change))


def test_steps_may_be_lists() -> None:
    assert play(partial(Changed, lambda env, step: [*step])).episode_return > 0


def test_agents_that_have_ended_leave() -> None:
    def keep(env: Any, step: tuple[Any, ...]) -> tuple[Any, ...]:
        env.agents = ["long"]
        seen = {"long": np.zeros((2, 2), np.float32)} | step[0]
        return (seen, *step[1:4], {"long": {"action_mask": [0, 1, 1]}})

    def last(env: Any, step: tuple[Any, ...]) -> tuple[Any, ...]:
        return (*keep(env, step)[:2], {"long": True}, *keep(env, step)[3:])

    def make(change: Any) -> Collector:
        return Collector(partial(Changed, change), 1, horizon=4)

    for change, reason in ((last, "all agents have ended, but env.agents still names them"), (keep, "all agents have")):
        collector = make(change)
        agents = ValueLearner("vdn", collector.interface, SMALL).agents.eval()
        with pytest.raises(ValueError, match=reason):
            collector.play(agents, epsilon_greedy(1.0), np.random.default_rng(0), [0])


def test_success_is_that_of_agents_alone() -> None:
    episode = Episode()
    infos: dict[str, Any] = {"time": 3, "one": {"success": np.array([True, True])}, "two": {}}
    episode.info = infos
    assert _success(episode) == [1.0]
    infos["two"]["success"] = np.array([True, False])
    assert _success(episode) == [0.0]


def test_a_run_goes_on_with_agents_in_one_order(tmp_path: Path) -> None:
    train(UnevenEnv, "iql", SMALL, tmp_path)
    with pytest.raises(CheckpointError, match=r"agents=\['long', 'short'\], not \['short', 'long'\]"):
        train(Backwards, "iql", SMALL, tmp_path)
    assert (tmp_path / LAST).exists()


def test_processes_have_agents_in_one_order() -> None:
    with pytest.raises(ValueError, match="possible_agents are long, short in one process and short, long in another"):
        train(BackwardsElsewhere, "iql", replace(SMALL, workers=2))


def test_a_process_that_dies_at_once_may_be_one_that_began_the_script_again() -> None:
    with pytest.raises(WorkerError, match=r"after 0 episodes \(out of memory, or a script .* __name__ == '__main__'"):
        train(partial(Elsewhere, die), "iql", replace(SMALL, workers=2))


def test_environments_without_agents_are_named_first() -> None:
    with pytest.raises(ValueError, match="None has no possible_agents"):
        train(lambda: None, "vdn", SMALL)


@pytest.mark.parametrize(
    ("space", "where"),
    [
        (spaces.Box(0, 1, (0,)), "the observation of 'long' has no numbers"),
        (spaces.Dict({"a": spaces.Discrete(2), "b": spaces.Box(0, 1, (0, 3))}), "'long', key 'b', has no numbers"),
        (spaces.Dict({}), "the observation of 'long' has no numbers"),
    ],
)
def test_spaces_without_numbers_are_refused(space: Any, where: str) -> None:
    env = UnevenEnv()
    env._spaces["long"] = space
    with pytest.raises(ValueError, match=where):
        learner_interface_of(env)


class Empty(UnevenEnv):
    """One of its keys is no name."""

    def __init__(self) -> None:
        super().__init__()
        self._spaces["long"] = spaces.Dict({"": spaces.Box(-10, 10, (2, 2))})

    def _observe(self) -> dict[str, Any]:
        seen = super()._observe()
        return seen | ({"long": {"": seen["long"]}} if "long" in seen else {})


class Below(UnevenEnv):
    """Choices below 0, and an agent that does not say what it sees last."""

    def __init__(self) -> None:
        super().__init__()
        self._spaces["short"] = spaces.Discrete(3, start=-5)

    def _observe(self) -> dict[str, Any]:
        return super()._observe() | ({"short": -4} if "short" in self.agents else {})

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        observations, *others = super().step(actions)
        return ({name: observations[name] for name in self.agents or ["long"]}, *others)


@pytest.mark.parametrize("make", [Empty, Below])
@pytest.mark.parametrize("algorithm", ["iql", "qmix", "qtran", "mappo", "pqn"])
def test_keys_without_a_name_and_choices_below_zero_are_learned_from(make: Any, algorithm: str) -> None:
    assert np.isfinite(train(make, algorithm, CONFIGS[algorithm]).best_score)


def test_own_float16_under_the_name_of_pictures_is_told_from_them() -> None:
    space = spaces.Dict({"image": spaces.Box(-1, 1, (4,), np.float16)})
    with pytest.raises(
        ValueError, match=r"'image' holds float16, .* image_encoder='cnn' is none of these; name one of"
    ):
        build_encoder(space, 8, "cnn")


@dataclass(frozen=True)
class Placed(Config):
    """Settings of one's own that no checkpoint can hold."""

    where: Path = Path()


def test_settings_that_no_checkpoint_holds_are_refused_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ALGORITHMS, "placed", Algorithm(ValueLearner, Placed))
    config = Placed(**{**vars(SMALL), "mixer": "vdn"})
    with pytest.raises(CheckpointError, match=r"config\['where'\]: a checkpoint keeps no PosixPath"):
        train(UnevenEnv, "placed", config, tmp_path / "run")
    assert not (tmp_path / "run").exists()
