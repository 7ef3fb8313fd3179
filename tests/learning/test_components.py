"""Actions of several components: a head for each, whose values, log-probabilities and entropies add up."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.dagger import draw, expert_mixture, imitation_loss
from chmarl_pb.learning.algorithms.losses import chosen, unroll
from chmarl_pb.learning.algorithms.mappo import Mappo
from chmarl_pb.learning.algorithms.registry import make_learner
from chmarl_pb.learning.cloning.bc import LAST
from chmarl_pb.learning.components import NEVER, as_action, as_row, best_action, counts_in, mask_of
from chmarl_pb.learning.networks.agents import NO_ACTION, Agent
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import NO_LABEL, Collector, epsilon_greedy
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.runs.run import BEST
from chmarl_pb.learning.runs.validation import play_greedily
from chmarl_pb.learning.spaces import learner_interface_of
from tests.helpers.small_runs import CONFIGS, IMITATION, MAPPO, PQN, SMALL
from tests.helpers.stopping import in_pieces
from tests.helpers.telling_env import CHOICES, Teller, TellingEnv

torch.set_num_threads(1)  # these networks are too small for more
PAIR = (CHOICES, 2)


def played(algorithm: str, choose: Any) -> tuple[Any, Batch]:
    """Return a learner, and a batch of four episodes that it has played."""
    collector = Collector(TellingEnv, 4, Teller)
    learner = make_learner(algorithm, collector.interface, CONFIGS[algorithm])
    replay = ReplayBuffer(collector.interface, 5, 4, 1.0)
    for episode in collector.play(learner.agents, choose, np.random.default_rng(0), range(4), ask_experts=True):
        replay.add(episode)
    return learner, replay.sample(4, np.random.default_rng(0))


def test_shapes_and_masks_of_two_heads() -> None:
    assert learner_interface_of(TellingEnv()).actions == {"teller": PAIR, "doer": 2}
    learner, batch = played("vdn", epsilon_greedy(1.0))
    assert batch.actions["teller"].shape == batch.labels["teller"].shape == (4, 2, 2)
    assert batch.actions["doer"].shape == (4, 2, 1)
    assert batch.action_mask["teller"][0, 0].tolist() == [[False, True, True], [True, True, False]], "no third symbol"
    values = unroll(learner.agents, batch).values
    assert values["teller"].shape == (4, 3, 2, 3) and values["doer"].shape == (4, 3, 1, 2)
    assert (values["teller"][..., 1, 2] == NEVER).all()
    assert (batch.actions["teller"][..., 0] > 0).all(), "the mask is about the first head"
    assert set(batch.actions["teller"][..., 1].unique().tolist()) == {0, 1}
    assert mask_of("doer", {}, 3).tolist() == [[True] * 3]
    assert mask_of("doer", {"doer": {"action_mask": [0, 1, 1]}}, 3).tolist() == [[False, True, True]]
    assert mask_of("doer", {"doer": {"action_mask": [1, 1, 1]}}, 3).all()
    assert mask_of("doer", {"doer": {"action_mask": [0, 0]}}, 2).all()


@pytest.mark.parametrize(
    ("info", "words"),
    [
        (None, "info of 'doer' is None; return a dict"),
        ({"action_mask": np.ones(7)}, r"action_mask of 'doer' has the shape \(7,\); give it \(3,\)"),
        ({"action_mask": [1]}, r"action_mask of 'doer' has the shape \(1,\)"),
    ],
)
def test_masks_that_are_not_about_the_actions_are_refused(info: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        mask_of("doer", {"doer": info}, 3)


def test_a_heads_outputs_are_the_sum_and_not_the_product() -> None:
    agent = Agent(spaces.Box(0, 1, (4,)), (26, 16), SMALL)
    assert agent.head.out_features == 42 and agent.memory.input_size == SMALL.features + 42
    values, *_ = agent(torch.zeros(2, 3, 4), torch.full((2, 3, 2), NO_ACTION))
    assert values.shape == (2, 3, 2, 26)


def test_values_of_heads_add_up_and_their_best_is_that_of_each() -> None:
    values = torch.tensor([[[1.0, 5.0, 2.0], [4.0, 3.0, NEVER]]])
    mask = torch.tensor([[[True, False, True], [True, True, False]]])
    best = best_action(values, mask)
    assert best.tolist() == [[2, 0]]
    assert chosen({"a": values}, {"a": best}).tolist() == [[2.0 + 4.0]]


def test_both_heads_are_drawn_by_their_own_probabilities() -> None:
    values = torch.tensor([[0.0, 1.0, 9.0], [2.0, 0.0, NEVER]]).expand(20_000, 2, 3)
    mask = torch.tensor([[True, True, False], [True, True, False]]).expand(20_000, 2, 3)
    drawn = draw(values, mask, np.random.default_rng(0))
    wanted = [float(torch.softmax(torch.tensor(pair), 0)[1]) for pair in ([0.0, 1.0], [2.0, 0.0])]
    assert drawn.mean(axis=0).tolist() == pytest.approx(wanted, abs=0.01)
    assert np.cov(drawn.T)[0, 1] == pytest.approx(0, abs=0.01), "they do not depend on each other"


def test_log_probabilities_and_entropies_of_heads_add_up() -> None:
    learner, batch = played("mappo", expert_mixture(0.0))
    assert isinstance(learner, Mappo)
    logs, entropies = learner._log_probabilities(batch)
    values = unroll(learner.agents, batch).values["teller"][:, :-1].double()
    act = values[..., 0, 1:].log_softmax(-1)  # action 0 is forbidden
    say = values[..., 1, :2].log_softmax(-1)
    done = batch.actions["teller"]
    wanted = act.gather(-1, done[..., :1] - 1) + say.gather(-1, done[..., 1:])
    torch.testing.assert_close(logs[..., 0].double(), wanted.squeeze(-1), atol=1e-5, rtol=1e-5)
    entropy = -(act.exp() * act).sum(-1) - (say.exp() * say).sum(-1)
    torch.testing.assert_close(entropies[..., 0].double(), entropy, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("algorithm", CONFIGS)
def test_gradients_reach_both_heads(algorithm: str) -> None:
    learner, _ = played(algorithm, epsilon_greedy(1.0))
    head = learner.agents["teller"].head.weight
    before = head.detach().clone()
    collector = Collector(TellingEnv, 4, Teller)
    replay = ReplayBuffer(collector.interface, 5, 64, 1.0)
    choose = learner.choose(0)
    for first in range(0, 64, 4):
        seeds = range(first, first + 4)
        for episode in collector.play(learner.agents, choose, np.random.default_rng(first), seeds, ask_experts=True):
            replay.add(episode)
    for _ in learner.learn(replay, np.random.default_rng(0)):
        pass
    changed = (head.detach() - before).abs().amax(dim=1)
    assert (changed[[1, 2]] > 0).all() and (changed[CHOICES:] > 0).all()


def test_each_head_has_its_labels() -> None:
    logits = torch.randn(2, 3, 2, 4, generator=torch.Generator().manual_seed(0))
    labels = torch.tensor([[[0, 1], [2, NO_LABEL], [NO_LABEL, 3]]]).expand(2, 3, 2)
    cross = torch.nn.functional.cross_entropy
    acts = cross(logits[:, :2, 0].flatten(0, 1), labels[:, :2, 0].flatten())
    says = cross(logits[:, ::2, 1].flatten(0, 1), labels[:, ::2, 1].flatten())
    torch.testing.assert_close(imitation_loss(logits, labels), acts + says)
    _, batch = played("imitation", expert_mixture(1.0))
    assert torch.equal(batch.actions["teller"], batch.labels["teller"]), "what the expert does and says is followed"


def test_who_names_an_action_alone_says_nothing_of_the_second_head() -> None:
    assert as_row(2, PAIR, NO_LABEL).tolist() == [2, NO_LABEL] and as_row((2, 1), PAIR, NO_LABEL).tolist() == [2, 1]
    assert as_action(np.array([1]), 3) == 1 and as_action(np.array([1]), (3,)).tolist() == [1]


def test_learners_learn_to_tell_and_to_listen() -> None:
    """What the doer is paid for only the teller sees: without words it gets 1 + 0.5 in the mean, with them 2."""
    sizes: dict[str, Any] = {"validation_interval": 10_000, "envs": 8, "batch_size": 32, "hidden": 16, "features": 16}
    imitation = replace(IMITATION, episodes=200, learning_rate=0.02, buffer_size=200, **sizes)
    values = replace(
        SMALL, episodes=600, learning_rate=1e-2, buffer_size=600, exploration_fraction=0.6, gradient_steps=4,
        target_update_interval=20, **sizes,
    )  # fmt: skip
    for algorithm, config in (("imitation", imitation), ("vdn", values)):
        agents = train(TellingEnv, algorithm, config, expert=Teller).agents
        returns = [one.episode_return for one in play_greedily(Collector(TellingEnv, 8), agents, range(16))]
        assert min(returns) == 2.0, algorithm


@pytest.mark.parametrize("algorithm", ["qmix", "pqn", "imitation", "mappo"])
def test_equal_seeds_give_equal_numbers_also_after_interruptions(
    algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = {"qmix": SMALL, "pqn": PQN, "imitation": IMITATION, "mappo": MAPPO}[algorithm]

    def run(name: str) -> dict[str, torch.Tensor]:
        return train(TellingEnv, algorithm, config, tmp_path / name, expert=Teller).agents.state_dict()

    whole = run("whole")
    again = run("twice")
    pieces, stopped = in_pieces(lambda: run("pieces"), 40, monkeypatch)
    assert all(torch.equal(part, again[key]) for key, part in whole.items())
    assert stopped > 1 and all(torch.equal(part, pieces[key]) for key, part in whole.items())
    assert (tmp_path / "whole" / BEST).is_file() and (tmp_path / "whole" / LAST).is_file()


def test_other_spaces_are_refused() -> None:
    square = np.full((2, 2), 2)
    for space in (spaces.MultiDiscrete(square), spaces.MultiDiscrete([2, 2], start=[1, 0]), spaces.Box(0, 1)):
        with pytest.raises(ValueError, match=r"(?s)'it'.*learners need Discrete or MultiDiscrete from 0 on"):
            counts_in("it", space)
