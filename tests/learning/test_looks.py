"""Where a robot has looked goes past the GRU, as it is from where the robot stands."""

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor, nn

import chmarl_pb
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.networks.agents import NO_ACTION, Agent, RecurrentActors
from chmarl_pb.learning.networks.looks import HEADINGS, Looks

ROOMS = 3
SPACE = spaces.Dict({"self": spaces.Box(-1, 1, (ROOMS + 3,))})
Views = list[tuple[int, int]]  # room and heading in each step
VIEWS = st.lists(st.tuples(st.integers(0, ROOMS - 1), st.integers(0, HEADINGS - 1)), min_size=1, max_size=12)


def observed(views: Views) -> dict[str, Tensor]:
    """Return the observations of one episode."""
    own = np.zeros((1, len(views), ROOMS + 3), np.float32)
    for step, (room, heading) in enumerate(views):
        angle = 2 * np.pi * heading / HEADINGS
        own[0, step] = [*np.eye(ROOMS)[room], np.cos(angle), np.sin(angle), 0]
    return {"self": torch.from_numpy(own)}


@given(VIEWS)
def test_it_is_told_the_headings_that_each_room_was_seen_in(views: Views) -> None:
    told, _ = Looks(SPACE)(observed(views), None)
    seen: dict[int, list[int]] = {room: [] for room in range(ROOMS)}
    for step, (room, heading) in enumerate(views):
        seen[room].append(heading)
        here, first, shares = told[0, step].split([HEADINGS, HEADINGS, ROOMS])
        assert here.nonzero().flatten().tolist() == sorted({(other - heading) % HEADINGS for other in seen[room]})
        assert first.nonzero().flatten().tolist() == [(seen[room][0] - heading) % HEADINGS]
        np.testing.assert_allclose(shares, [len(set(headings)) / HEADINGS for headings in seen.values()], rtol=1e-6)


@given(VIEWS, st.data())
def test_step_by_step_is_as_all_at_once(views: Views, data: st.DataObject) -> None:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        agent = Agent(SPACE, (4,), DAggerConfig(features=4, hidden=4, numbers_past=True, looks_past=True))
    observations = observed(views)
    actions = torch.tensor([NO_ACTION, *data.draw(st.lists(st.integers(0, 3), min_size=11, max_size=11))][: len(views)])
    together = agent(observations, actions.view(1, -1, 1))[0]
    player, it = RecurrentActors(nn.ModuleDict({"it": agent}), 1), torch.arange(1)
    for step in range(len(views)):
        if step:
            player.remember("it", it, actions[step].view(1, 1))
        values = player.values("it", it, {"self": observations["self"][:, step]})
        torch.testing.assert_close(values, together[:, step])


def test_the_humanoid_turns_by_a_step_of_headings() -> None:
    env = chmarl_pb.parallel_env(split="val-unseen")
    space = env.observation_space("humanoid")
    observations, _ = env.reset(seed=0)
    looks, before, ahead = Looks(space), None, list[int]()
    turn = env.unwrapped.action_names["humanoid"].index("turn_left")
    for _ in range(HEADINGS):
        own = torch.from_numpy(observations["humanoid"]["self"]).view(1, 1, -1)
        told, kept = looks({"self": own}, before)
        before, ahead = kept[:, -1], [*ahead, int(told[0, 0, :HEADINGS].sum())]
        observations = env.step({"humanoid": turn, "drone": 0})[0]
    assert ahead == list(range(1, HEADINGS + 1))
    env.close()


def test_without_a_heading_there_is_nothing_to_remember() -> None:
    space = spaces.Dict({"messages": spaces.Box(0, 1, (2,), np.int8)})
    with pytest.raises(ValueError, match="looks_past: no observation has a self"):
        Agent(space, (4,), DAggerConfig(numbers_past=True, looks_past=True))
