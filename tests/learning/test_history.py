"""What has been heard, said and seen so far goes past the GRU."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.networks.agents import NO_ACTION, Agent, RecurrentActors

WORDS, STEPS = 3, 6
SPACE = spaces.Dict({"messages": spaces.Box(0, 1, (1, WORDS), np.int8)})
CONFIG = DAggerConfig(features=4, hidden=4, numbers_past=True, history_past=True)


@pytest.fixture
def agent() -> Iterator[Agent]:
    """Return an agent of two heads that hears one of three words."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        yield Agent(SPACE, (5, 2), CONFIG)


def heard(*steps: int, episodes: int = 1) -> dict[str, Tensor]:
    """Return observations that name one word in some steps, and nothing in the others."""
    messages = torch.zeros(episodes, STEPS, 1, WORDS)
    messages[:, list(steps), 0, 1] = 1
    return {"messages": messages}


def no_actions(episodes: int = 1) -> Tensor:
    return torch.full((episodes, STEPS, 2), NO_ACTION)


def forget(agent: Agent) -> None:
    """Let the GRU remember nothing."""
    for weights in agent.memory.parameters():
        nn.init.zeros_(weights)


def test_a_word_is_not_forgotten(agent: Agent) -> None:
    forget(agent)
    silent, told = (agent(heard(*steps), no_actions())[0][0] for steps in ((), (2,)))
    differs = (silent != told).flatten(1).any(dim=1)
    assert differs.tolist() == [False, False, True, True, True, True]
    torch.testing.assert_close(told[3], told[5], rtol=0, atol=0)


def test_neither_is_an_own_action(agent: Agent) -> None:
    forget(agent)
    acted = no_actions()
    acted[0, 1] = torch.tensor([4, 1])
    silent, after = (agent(heard(), actions)[0][0] for actions in (no_actions(), acted))
    assert (silent != after).flatten(1).any(dim=1).tolist() == [False, True, True, True, True, True]


def test_step_by_step_is_as_all_at_once(agent: Agent) -> None:
    generator = torch.Generator().manual_seed(0)
    observations = {"messages": torch.randint(2, (3, STEPS, 1, WORDS), generator=generator)}
    actions = torch.randint(2, (3, STEPS, 2), generator=generator)
    actions[:, 0] = NO_ACTION
    together = agent(observations, actions)[0]
    player, everyone = RecurrentActors(nn.ModuleDict({"it": agent}), 3), torch.arange(3)
    for step in range(STEPS):
        one_step = {"messages": observations["messages"][:, step]}
        torch.testing.assert_close(player.values("it", everyone, one_step), together[:, step])
        if step + 1 < STEPS:
            player.remember("it", everyone, actions[:, step + 1])


def test_the_memory_lies_in_one_piece_as_cudnn_wants_it(agent: Agent) -> None:
    given: list[Tensor | None] = []
    agent.memory.register_forward_pre_hook(lambda _, inputs: given.append(inputs[1]))
    state = agent(heard(1, episodes=3), no_actions(3))[2]
    agent(heard(1, episodes=3), no_actions(3), state)
    assert given[0] is None and given[1] is not None and given[1].is_contiguous()


def test_padding_after_the_end_changes_nothing(agent: Agent) -> None:
    real = torch.arange(STEPS).expand(2, STEPS) < torch.tensor([[STEPS], [3]])
    cut = agent(heard(1, episodes=2), no_actions(2), real=real)[0]
    torch.testing.assert_close(cut[1, :3], cut[0, :3])
    unread = heard(1, episodes=2)
    unread["messages"][~real] = torch.nan
    assert torch.equal(agent(unread, no_actions(2), real=real)[0], cut)
    _, _, state = agent(heard(1, episodes=2), no_actions(2), real=real)
    assert state.shape == (1, 2, agent.state_size) and agent.state_size == 4 + WORDS + 7
