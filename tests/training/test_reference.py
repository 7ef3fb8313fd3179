"""Games from elsewhere: all learners have settings for them, and they pay as published results are given."""

import importlib.util

import numpy as np
import pytest

from training.reference import GAMES, SETTINGS, config_of, measure

HERE = all(importlib.util.find_spec(name) for name in ("mpe2", "lbforaging"))
needs_games = pytest.mark.skipif(not HERE, reason="pip install mpe2 lbforaging")


@pytest.mark.parametrize("game", GAMES)
@pytest.mark.parametrize("algorithm", SETTINGS)
def test_every_learner_has_settings_for_every_game(game: str, algorithm: str) -> None:
    config = config_of(algorithm, game, 50_000, 3)
    assert config.seed == 3 and config.episodes * GAMES[game].horizon <= 50_000


@needs_games
@pytest.mark.parametrize("game", GAMES)
def test_random_actions_earn_what_the_table_says(game: str) -> None:
    env, rng, returns = GAMES[game].make(), np.random.default_rng(0), []
    for seed in range(20):
        env.reset(seed=seed)
        returns.append(0.0)
        for _ in range(GAMES[game].horizon):
            _, rewards, *_ = env.step({name: int(rng.integers(env.action_space(name).n)) for name in env.agents})
            assert len(set(rewards.values())) == 1, "the team is paid as one"
            returns[-1] += next(iter(rewards.values()))
            if not env.agents:
                break
        assert not env.agents
    env.close()
    assert np.mean(returns) == pytest.approx(GAMES[game].random, abs=25 if game == "simple_spread" else 0.1)


@needs_games
def test_a_short_run_gives_a_figure() -> None:
    assert -600 < measure("simple_spread", "pqn", 16 * 25, 0) < 0
