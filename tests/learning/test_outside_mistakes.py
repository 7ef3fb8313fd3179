"""What environments, experts and validations of one's own return is copied, made plain, or refused in a sentence."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from chmarl_pb.learning import Config, train
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.networks.encoders import build_encoder
from chmarl_pb.learning.networks.images import ConvEncoder
from chmarl_pb.learning.networks.parts import FlatEncoder
from chmarl_pb.learning.rollouts.collect import Collector, epsilon_greedy
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.runs.validation import play_greedily
from chmarl_pb.learning.spaces import check_values, learner_interface_of
from chmarl_pb.learning.storage.checkpoint import load
from tests.helpers.small_runs import SMALL
from tests.helpers.uneven_env import UnevenEnv
from training.games import MATRIX_GAMES, MatrixGame

torch.set_num_threads(1)  # these networks are too small for more
GAME = partial(MatrixGame, MATRIX_GAMES["additive"])


class Changed(UnevenEnv):
    """An environment whose steps are changed before they are returned."""

    def __init__(self, change: Callable[..., Any]):
        super().__init__()
        self._change = change

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        """Change what it returns in place."""
        result = super().step(actions)
        self._change(self, *result)
        return result


class Counting(UnevenEnv):
    """An environment that has one array for its state and uses it again."""

    def __init__(self) -> None:
        super().__init__()
        self._state = np.zeros(1, np.float32)

    def state(self) -> np.ndarray:
        """Return the number of steps so far."""
        self._state[:] = getattr(self, "_time", 0)
        return self._state


class Payments(MatrixGame):
    """A game of one step in which only the first agent acts on what both are paid."""

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        """Pay each agent something else."""
        observations, _, ended, cut, infos = super().step(actions)
        first, second = [(4.0, -1.0), (0.0, 1.0), (-20.0, 0.0)][actions["first"]]
        return observations, {"first": first, "second": second}, ended, cut, infos


def play(make: Callable[[], Any]) -> Any:
    """Return an episode of random actions."""
    collector = Collector(make, 1)
    agents = train(UnevenEnv, "vdn", replace(SMALL, episodes=8)).agents
    return collector.play(agents, epsilon_greedy(1.0), np.random.default_rng(0), [0])[0]


def test_states_in_an_array_that_is_used_again_are_copied() -> None:
    collector = Collector(Counting, 1)
    agents = train(UnevenEnv, "vdn", replace(SMALL, episodes=8)).agents
    episode = collector.play(agents, epsilon_greedy(1.0), np.random.default_rng(0), [0])[0]
    assert np.concatenate(episode.states).tolist() == [0, 1, 2, 3, 4]


def test_the_observation_after_the_last_step_is_asked_for() -> None:
    with pytest.raises(ValueError, match=r"'long' acts in step 4 .* observes last"):
        play(partial(Changed, lambda env, seen, *_: env.agents or seen.clear()))


@pytest.mark.parametrize("reward", [np.ones(1), np.array([[2.0]]), np.float64(1), 1])
def test_rewards_of_one_number_are_numbers(reward: Any) -> None:
    episode = play(partial(Changed, lambda env, seen, rewards, *_: rewards.update(dict.fromkeys(rewards, reward))))
    assert np.array(episode.rewards).shape == (4, 2) and isinstance(episode.episode_return, float)


@pytest.mark.parametrize("reward", [np.ones(2), None, "1 each", {}])
def test_other_rewards_are_refused(reward: Any) -> None:
    with pytest.raises(ValueError, match=r"the reward of '(long|short)' is .*one number"):
        play(partial(Changed, lambda env, seen, rewards, *_: rewards.update(dict.fromkeys(rewards, reward))))


@pytest.mark.parametrize("state", [{"time": 1}, "three", [[1], [2, 3]]])
def test_states_that_are_no_numbers_are_refused(state: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Counting, "state", lambda self: state)
    with pytest.raises(ValueError, match=r"state\(\) returns .*not an array of numbers"):
        learner_interface_of(Counting())


def test_agents_without_names_or_observations_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    env = UnevenEnv()
    env.possible_agents = [0, 1]  # type: ignore[list-item]
    monkeypatch.setattr(env, "action_space", lambda agent: spaces.Discrete(2))
    with pytest.raises(ValueError, match="an agent named 0"):
        learner_interface_of(env)
    monkeypatch.setattr(UnevenEnv, "reset", lambda self, seed=None, options=None: ({}, {}))
    with pytest.raises(ValueError, match="no observation of any"):
        learner_interface_of(UnevenEnv())


@pytest.mark.parametrize(("value", "held"), [(1e4, True), (np.inf, True), (1e5, False)])
def test_numbers_too_great_for_the_space_are_refused(value: float, held: bool) -> None:
    seen = np.array([0.0, value], np.float32)
    with nullcontext() if held else pytest.raises(ValueError, match="which does not hold what the environment returns"):
        check_values("it", np.zeros(2, np.float16), seen)


def test_more_actions_than_a_replay_buffer_holds_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(UnevenEnv, "action_space", lambda self, agent: spaces.Discrete(40_000))
    with pytest.raises(ValueError, match="32,767"):
        learner_interface_of(UnevenEnv())


def test_gone_agents_are_nobody_in_the_state() -> None:
    """Nor do they look as one that observes 0."""
    interface = learner_interface_of(UnevenEnv())
    long = np.ones((2, 2), np.float32)
    state = interface.state(UnevenEnv(), {"long": long})
    assert state.tolist() == [1.0] * 4 + [0.0] * 13


@pytest.mark.parametrize("said", [7, -2, 0.6, "left", None, [0, 1]])
def test_experts_name_actions_that_there_are(said: Any) -> None:
    class Expert:
        def reset(self, seed: int | None = None) -> None: ...

        def act(self, observations: Any, infos: Any) -> dict[str, Any]:
            return {"first": said}

    config = DAggerConfig(episodes=8, horizon=1, envs=2, batch_size=2, learning_starts=2, features=8, hidden=8)
    with pytest.raises(ValueError, match=r"the expert would do .* in the place of 'first'"):
        train(GAME, "imitation", config, expert=lambda env: Expert())


def test_numbers_of_numpy_in_settings_and_scores_are_read_again(tmp_path: Path) -> None:
    odd: dict[str, Any] = {
        "seed": np.int64(3), "learning_rate": np.float64(1e-3), "normalize_values": np.bool_(True)
    }  # fmt: skip

    def validate(*_: Any) -> Any:
        return {"score": np.mean([1.0, 2.0]), "more": np.float32(0.5)}

    setting = {"number": np.int64(4), "list": [np.float32(0.5)]}
    train(GAME, "vdn", replace(SMALL, episodes=8, **odd), tmp_path, validate, setting)
    best = load(tmp_path / BEST)
    assert load(tmp_path / LAST)["config"] == best["config"]
    assert best["validation"] == {"score": 1.5, "more": 0.5}
    assert best["setting"]["number"] == 4 and best["config"]["seed"] == 3


def test_whole_numbers_may_come_as_floats() -> None:
    config = Config(envs=4.0, seed=1.0, hidden=8.0)  # type: ignore[arg-type]
    assert config == Config(envs=4, seed=1, hidden=8) and isinstance(config.envs, int)


@pytest.mark.parametrize("value", [float("inf"), float("nan"), 2.5, "4", 0])
def test_no_such_number_of_episodes(value: Any) -> None:
    with pytest.raises(ValueError, match="episodes="):
        Config(episodes=value)


def test_one_reward_of_the_team_is_standardized() -> None:
    """Each by its own scale, the second agent's small payments would count as much as the first one's."""
    config = replace(
        SMALL, episodes=600, envs=8, batch_size=32, standardize_rewards=True, exploration_final_eps=1.0,
        learning_rate=0.01,
    )  # fmt: skip
    agents = train(partial(Payments, np.zeros((3, 3))), "vdn", config).agents
    assert play_greedily(Collector(partial(Payments, np.zeros((3, 3))), 1), agents, [0])[0].episode_return == 1.5


def test_small_numbers_in_three_dimensions_are_no_picture() -> None:
    grid, picture = spaces.Box(0, 1, (7, 7, 4), np.uint8), spaces.Box(0, 255, (7, 7, 11), np.uint8)
    flat, conv = (next(build_encoder(space).children()) for space in (grid, picture))
    assert isinstance(flat, FlatEncoder) and isinstance(conv, ConvEncoder) and not conv.channels_first
    assert build_encoder(picture)(torch.zeros(2, 7, 7, 11, dtype=torch.uint8)).shape == (2, 128)


def test_names_are_looked_up_whatever_is_observed() -> None:
    with pytest.raises(ValueError, match="graph_pool='nonsense' is not known"):
        build_encoder(spaces.Box(0, 1, (3,)), graph_pool="nonsense")
    with pytest.raises(ValueError, match="image_encoder='nonsense' is not known"):
        build_encoder(spaces.Box(0, 1, (3,)), image_encoder="nonsense")
