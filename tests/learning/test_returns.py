"""What value learners aim at: lambda-returns, normal values, soft targets; PQN; a mixer of all monotonic functions."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.gradient import DivergedError, descend
from chmarl_pb.learning.algorithms.losses import Returns, lambda_returns
from chmarl_pb.learning.algorithms.mappo import Mappo
from chmarl_pb.learning.algorithms.mixers import MIXERS, Mixer
from chmarl_pb.learning.algorithms.normalizer import Normalizer, update_and_preserve
from chmarl_pb.learning.algorithms.pqn import Pqn
from chmarl_pb.learning.algorithms.registry import make_learner
from chmarl_pb.learning.algorithms.value import ValueLearner
from chmarl_pb.learning.rollouts.collect import Collector, epsilon_greedy
from chmarl_pb.learning.runs.validation import play_greedily
from chmarl_pb.learning.spaces import learner_interface_of
from tests.helpers.small_runs import MAPPO, PQN, SMALL
from training.games import MATRIX_GAMES, MatrixGame, TwoStepGame

torch.set_num_threads(1)  # these networks are too small for more
NO_FILES: dict[str, Any] = {"validation_interval": 10**6, "log_interval": 10**6, "checkpoint_interval": 10**6}


@pytest.mark.parametrize("cut", [True, False])
@pytest.mark.parametrize("td_lambda", [0.0, 0.6, 1.0])
def test_a_lambda_return_is_the_weighted_sum_of_n_step_returns(td_lambda: float, cut: bool) -> None:
    rng, gamma, steps = np.random.default_rng(0), 0.9, 4
    reward, following = rng.normal(size=(2, steps))
    following[-1] *= cut  # an episode that has ended is worth nothing further

    def n_step(start: int, count: int) -> float:
        rewards = sum(gamma**k * reward[start + k] for k in range(count))
        return float(rewards + gamma**count * following[start + count - 1])

    wanted = []
    for start in range(steps):
        most = steps - start
        weights = [(1 - td_lambda) * td_lambda ** (n - 1) for n in range(1, most)] + [td_lambda ** (most - 1)]
        wanted.append(sum(weight * n_step(start, n) for n, weight in enumerate(weights, 1)))

    def padded(row: list[float]) -> torch.Tensor:
        return torch.tensor([[*row, 7.0, 7.0]]).unsqueeze(-1)

    mask = torch.arange(steps + 2).view(1, -1, 1) < steps
    not_done = mask.clone()
    not_done[0, steps - 1] = cut
    found = lambda_returns(padded(reward.tolist()), not_done, padded(following.tolist()), mask, gamma, td_lambda)
    assert found[0, :steps, 0].tolist() == pytest.approx(wanted, abs=1e-5)


def test_a_normalizer_knows_mean_and_deviation_of_what_counts() -> None:
    rng, normalizer = np.random.default_rng(0), Normalizer(2)
    values = torch.from_numpy(rng.normal([5.0, -200.0], [2.0, 30.0], (400, 10, 2)).astype(np.float32))
    mask = torch.ones(10, 2, dtype=torch.bool)
    mask[5:, 1] = False
    for part in values:
        normalizer.update(part.where(mask, torch.tensor(1e6)), mask)
    assert normalizer.mean.tolist() == pytest.approx([5.0, -200.0], rel=0.05)
    assert normalizer.deviation.tolist() == pytest.approx([2.0, 30.0], rel=0.1)
    before = normalizer.mean.clone()
    normalizer.update(values[0], torch.zeros(10, 1, dtype=torch.bool))
    assert torch.equal(normalizer.mean, before), "nothing counted"
    torch.testing.assert_close(normalizer.denormalize(normalizer.normalize(values)), values)


def test_popart_changes_the_scale_and_not_the_values() -> None:
    torch.manual_seed(0)
    head, normalizer, inputs = nn.Linear(3, 1), Normalizer(1), torch.randn(20, 3)
    for shift in (-200.0, 3.0, 50.0):
        before = normalizer.denormalize(head(inputs))
        update_and_preserve(normalizer, head, torch.randn(30, 1) + shift, torch.ones(30, 1))
        torch.testing.assert_close(normalizer.denormalize(head(inputs)), before, rtol=1e-4, atol=1e-3)


def test_the_critic_of_mappo_says_the_same_after_new_returns_were_taken_in() -> None:
    learner = Mappo("mappo", learner_interface_of(TwoStepGame()), MAPPO)
    assert learner._values is not None
    states = torch.eye(3)
    before = learner.value(states)
    update_and_preserve(learner._values, learner._head, torch.full((8, 1), -90.0), torch.ones(8, 1))
    torch.testing.assert_close(learner.value(states), before, rtol=1e-4, atol=1e-3)


def test_soft_targets_go_a_share_of_the_way() -> None:
    learner = make_learner("qmix", learner_interface_of(TwoStepGame()), replace(SMALL, tau=0.25))
    assert isinstance(learner, ValueLearner)
    before = [weight.clone() for weight in learner._targets.parameters()]
    with torch.no_grad():
        for weight in learner.networks.parameters():
            weight.add_(1.0)
    learner._update_targets()
    for old, new in zip(before, learner._targets.parameters(), strict=True):
        torch.testing.assert_close(new, old + 0.25)


def fitted(mixer: Mixer, table: np.ndarray) -> np.ndarray:
    """Return the table that a mixer holds after it was fitted to one, the agents' values with it."""
    torch.manual_seed(0)
    own = nn.Parameter(torch.tensor([[0.0, 1.0], [0.0, 1.0]]))
    wanted, state = torch.tensor(table, dtype=torch.float32).flatten(), torch.ones(4, 1)
    optimizer = torch.optim.Adam([own, *mixer.parameters()], lr=0.02)
    pairs = torch.cartesian_prod(torch.arange(2), torch.arange(2))
    for _ in range(500):
        held = mixer(torch.stack([own[0, pairs[:, 0]], own[1, pairs[:, 1]]], dim=-1), state).flatten()
        optimizer.zero_grad()
        (held - wanted).square().mean().backward()
        optimizer.step()
    table_held: np.ndarray = held.detach().view(2, 2).numpy()
    return table_held


def test_the_deep_mixer_holds_an_or_which_is_beyond_qmix() -> None:
    for name, error in (("qmix", 2.0), ("qmix-deep", 0.0)):
        torch.manual_seed(1)
        held = fitted(MIXERS[name](2, 1, 16), MATRIX_GAMES["or"])
        assert np.abs(held - MATRIX_GAMES["or"]).max() == pytest.approx(error, abs=0.3), name


@pytest.mark.parametrize("name", ["qmix", "qmix-deep"])
def test_monotonic_mixers_rise_with_every_agents_value(name: str) -> None:
    torch.manual_seed(0)
    mixer = MIXERS[name](3, 5, 8)
    values = (20 * torch.randn(50, 3)).requires_grad_()
    mixer(values, torch.randn(50, 5)).sum().backward()
    assert values.grad is not None and (values.grad >= 0).all()


def test_qmix_learns_of_values_far_below_zero_once_they_are_normal() -> None:
    """Sums of values far below 0 are where ELU is flat, so that agents hear nothing of the loss."""
    game = partial(MatrixGame, MATRIX_GAMES["additive"] - 200)
    config = replace(
        SMALL, episodes=400, envs=8, buffer_size=400, batch_size=32, gradient_steps=4, learning_rate=5e-3,
        exploration_final_eps=1.0, normalize_values=True, standardize_state=True, **NO_FILES,
    )  # fmt: skip
    agents = train(game, "qmix", config).agents
    assert play_greedily(Collector(game, 1), agents, [0])[0].episode_return == -194


def test_agents_that_are_cut_off_go_on_at_their_own_rate() -> None:
    reward = torch.tensor([1.0, -3.0]).expand(4, 5, 2)
    mask = torch.ones_like(reward, dtype=torch.bool)
    returns = Returns(0.9, 0.0, Normalizer(2))
    returns.update_scale(reward, mask, mask)
    assert returns.scale is not None
    torch.testing.assert_close(returns.scale.mean, torch.tensor([10.0, -30.0]))


def test_the_scale_of_values_does_not_follow_itself() -> None:
    """It once followed targets, which hold what it makes of the networks' values, and grew without end."""
    config = replace(SMALL, normalize_values=True, gamma=0.99, td_lambda=0.6)
    learner = make_learner("vdn", learner_interface_of(TwoStepGame()), config)
    assert isinstance(learner, ValueLearner) and learner.returns.scale is not None
    with torch.no_grad():
        for part in learner._targets.parameters():
            part.add_(3.0)  # targets that think too much of themselves
    rewards, ones = torch.full((16, 25, 1), -10.0), torch.ones(16, 25, 1, dtype=torch.bool)
    for _ in range(300):
        learner.returns.update_scale(rewards + torch.randn(16, 25, 1), ones, ones)
    assert learner.returns.scale.mean.item() == pytest.approx(-1000, rel=0.01), "-10 a step, for ever"
    assert 1 < learner.returns.scale.deviation.item() < 10


@pytest.mark.parametrize("algorithm", ["iql", "vdn", "qmix", "qtran"])
def test_the_scale_of_values_stays_that_of_the_returns_in_a_run(algorithm: str) -> None:
    game = partial(MatrixGame, MATRIX_GAMES["additive"] - 200)
    learner = train(game, algorithm, replace(SMALL, episodes=200, gradient_steps=8, normalize_values=True)).learner
    assert isinstance(learner, ValueLearner) and learner.returns.scale is not None
    assert ((learner.returns.scale.mean > -215) & (learner.returns.scale.mean < -190)).all()
    assert (learner.returns.scale.deviation < 15).all()


def test_standardized_rewards_hide_scale_and_level() -> None:
    """Two games that differ in both alone give the same weights, but for rounding."""
    config = replace(SMALL, episodes=64, standardize_rewards=True, exploration_final_eps=1.0)
    one, other = (
        train(partial(MatrixGame, table), "vdn", config).agents.state_dict()
        for table in (MATRIX_GAMES["additive"], 8 * MATRIX_GAMES["additive"] - 128)
    )
    for name, weights in one.items():
        torch.testing.assert_close(weights, other[name], rtol=1e-2, atol=1e-3)


def test_a_gradient_that_is_no_number_ends_the_run_and_spares_the_weights() -> None:
    weight = nn.Parameter(torch.ones(2))
    optimizer = torch.optim.Adam([weight])
    with pytest.raises(DivergedError, match="the loss is nan"):
        descend({"loss": (weight * torch.nan).sum()}, optimizer, 1.0, [weight])
    assert torch.equal(weight.detach(), torch.ones(2))


def test_random_actions_are_those_that_one_draw_after_the_other_gives() -> None:
    rng, alike = np.random.default_rng(5), np.random.default_rng(5)
    masks = np.random.default_rng(0).random((60, 4, 2, 9)) < 0.5
    masks[..., 3] |= ~masks.any(axis=-1)
    for mask in masks:
        wanted = [rng.choice(np.flatnonzero(row)) for row in mask.reshape(-1, 9)]
        found = epsilon_greedy(1.0)(torch.zeros(mask.shape), torch.from_numpy(mask), np.zeros(0), alike)
        assert found.ravel().tolist() == wanted
        rng.random(found.shape)


def test_pqn_learns_a_game_of_one_step_from_new_episodes_alone() -> None:
    game = partial(MatrixGame, MATRIX_GAMES["additive"])
    config = replace(
        PQN, episodes=400, envs=8, buffer_size=16, batch_size=16, learning_rate=0.01, exploration_final_eps=1.0,
        **NO_FILES,
    )  # fmt: skip
    learner = train(game, "pqn", config).learner
    assert isinstance(learner, Pqn) and learner.agents["first"].norms
    assert play_greedily(Collector(game, 1), learner.agents, [0])[0].episode_return == 6
    assert learner.updates == 25 * config.n_epochs


def test_scales_are_kept_in_checkpoints() -> None:
    config = replace(
        SMALL, normalize_values=True, standardize_state=True, standardize_rewards=True, tau=0.1, td_lambda=0.7,
        episodes=32,
    )  # fmt: skip
    for algorithm in ("iql", "qtran"):
        learner = train(TwoStepGame, algorithm, config).learner
        again = make_learner(algorithm, learner_interface_of(TwoStepGame()), config)
        again.restore(learner.state(), Path("last.pt"))
        for name, part in learner.state()["scales"].items():
            assert torch.equal(part, again.state()["scales"][name]) and torch.isfinite(part).all()
