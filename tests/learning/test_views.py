"""In which directions a robot has looked, in which rooms, goes past the GRU."""

import math
from contextlib import closing

import numpy as np
import pytest
import torch
from gymnasium import spaces
from torch import Tensor, nn

import chmarl_pb
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.networks.agents import NO_ACTION, Agent, Player
from chmarl_pb.learning.networks.views import Views
from chmarl_pb.navigation.lattice import HEADINGS

ROOMS, STEPS = 3, 5
SPACE = spaces.Dict({"self": spaces.Box(-1, 1, (ROOMS + 3,), np.float32)})
CONFIG = DAggerConfig(features=4, hidden=4, views_past=True)


def state(room: int, heading: int, holds: bool = False) -> Tensor:
    """Return a robot's own state."""
    angle = heading * 2 * math.pi / HEADINGS
    row = torch.zeros(ROOMS + 3)
    row[room] = 1
    row[-3:] = torch.tensor([math.cos(angle), math.sin(angle), holds])
    return row


def played(*steps: Tensor) -> dict[str, Tensor]:
    return {"self": torch.stack(steps)[None]}


def test_each_view_has_a_number_of_its_own() -> None:
    states = [
        state(room, heading, holds) for room in range(ROOMS) for heading in range(HEADINGS) for holds in (False, True)
    ]
    seen = Views(SPACE)(played(*states))[0]
    assert Views(SPACE).size == len(states)
    assert torch.equal(seen, torch.eye(len(states)))


def test_views_of_the_benchmark_change_with_room_and_heading() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen")) as env:
        views = Views(env.observation_space("humanoid"))
        observations = [env.reset(seed=0)[0]["humanoid"]]
        turn = env.action_names["humanoid"].index("turn_left")
        for _ in range(HEADINGS):
            observations.append(env.step({"humanoid": turn, "drone": 0})[0]["humanoid"])
    seen = views({"self": torch.from_numpy(np.stack([one["self"] for one in observations]))})
    assert seen.sum(dim=1).tolist() == [1] * (HEADINGS + 1)
    assert seen.amax(dim=0).sum() == HEADINGS
    assert torch.equal(seen[0], seen[-1])


def test_what_has_been_looked_at_is_not_forgotten() -> None:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        agent = Agent(SPACE, (4,), CONFIG)
    for weights in agent.memory.parameters():
        nn.init.zeros_(weights)
    first, last = [state(0, 0), state(0, 1)], [state(0, 0)] * 3
    no_actions = torch.full((1, STEPS, 1), NO_ACTION)
    around, still = (agent(played(*steps, *last), no_actions)[0][0] for steps in (first, [state(0, 0)] * 2))
    assert (around != still).flatten(1).any(dim=1).tolist() == [False, True, True, True, True]


def test_step_by_step_is_as_all_at_once_and_padding_is_no_view() -> None:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        agent = Agent(SPACE, (4,), CONFIG)
    rng = np.random.default_rng(0)
    states = [
        [state(int(rng.integers(ROOMS)), int(rng.integers(HEADINGS)), bool(rng.integers(2))) for _ in range(STEPS)]
        for _ in range(2)
    ]
    observations, actions = torch.stack([torch.stack(row) for row in states]), torch.full((2, STEPS, 1), NO_ACTION)
    together = agent({"self": observations}, actions)[0]
    player = Player(nn.ModuleDict({"it": agent}), 2)
    for step in range(STEPS):
        values = player.values("it", torch.arange(2), {"self": observations[:, step]})
        torch.testing.assert_close(values, together[:, step])
    padded = observations.clone()
    padded[1, 3:] = 0
    assert not Views(SPACE)({"self": padded})[1, 3:].any()


def test_robots_that_do_not_know_where_they_are_have_no_views() -> None:
    with pytest.raises(ValueError, match="views_past needs the robots' own states"):
        Agent(spaces.Dict({"messages": spaces.Box(0, 1, (2,), np.int8)}), (4,), CONFIG)
    with pytest.raises(ValueError, match="views_past needs the robots' own states"):
        Agent(spaces.Box(0, 1, (2,), np.float32), (4,), CONFIG)
