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

ROOMS, STEPS = 3, 6
FACING = 2 * HEADINGS
TURN = ROOMS  # the first action that is no Goto
SPACE = spaces.Dict({"self": spaces.Box(-1, 1, (ROOMS + 4,), np.float32)})
CONFIG = DAggerConfig(features=4, hidden=4, views_past=True)


def state(room: int, heading: int, holds: bool = False) -> Tensor:
    """Return a robot's own state."""
    angle = heading * 2 * math.pi / HEADINGS
    row = torch.zeros(ROOMS + 4)
    row[room] = 1
    row[-3:] = torch.tensor([math.cos(angle), math.sin(angle), holds])
    return row


def seen(states: list[Tensor], actions: list[int]) -> tuple[Tensor, Tensor, Tensor]:
    """Return the present view, those of the present room and those of all rooms (rooms, FACING), at each step."""
    told = Views(SPACE)({"self": torch.stack(states)[None]}, torch.tensor(actions)[None, :, None], None).numbers[0]
    return told[:, :FACING], told[:, FACING : 2 * FACING], told[:, 2 * FACING :].unflatten(1, (-1, FACING))


def bits(*turns: int, holds: bool = False) -> list[int]:
    return sorted(2 * turn + holds for turn in turns)


def places(row: Tensor) -> list[int]:
    return row.nonzero().flatten().tolist()


def test_views_are_told_by_turns_since_the_goto() -> None:
    states = [state(2, 7), state(1, 4), state(1, 5), state(1, 6, holds=True), state(0, 11), state(1, 4)]
    now, here, everywhere = seen(states, [NO_ACTION, 1, TURN, TURN, 0, 1])
    assert [places(row) for row in now] == [[], bits(0), bits(1), bits(2, holds=True), bits(0), bits(0)]
    assert places(here[3]) == sorted(bits(0, 1) + bits(2, holds=True)) == places(here[5])
    assert places(here[4]) == bits(0)
    assert [places(room) for room in everywhere[5]] == [bits(0), places(here[3]), [], []]


def test_a_goto_that_led_elsewhere_is_none() -> None:
    now, _, _ = seen([state(0, 3), state(0, 4), state(0, 5)], [0, 1, TURN])
    assert [places(row) for row in now] == [bits(0), bits(1), bits(2)]


def test_a_full_turn_in_the_benchmark_shows_each_view_once() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen")) as env:
        views, names = Views(env.observation_space("humanoid")), env.action_names["humanoid"]
        env.reset(seed=0)
        actions = [names.index("goto_kitchen"), *[names.index("turn_left")] * (HEADINGS - 1)]
        observations = [env.step({"humanoid": action, "drone": 8})[0]["humanoid"]["self"] for action in actions]
    own = {"self": torch.from_numpy(np.stack(observations))[None]}
    told = views(own, torch.tensor(actions)[None, :, None], None).numbers[0]
    assert [places(row) for row in told[:, :FACING]] == [bits(turn) for turn in range(HEADINGS)]
    assert places(told[-1, FACING : 2 * FACING]) == bits(*range(HEADINGS))


@pytest.fixture
def agent() -> Agent:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        return Agent(SPACE, (ROOMS + 3,), CONFIG)


def test_what_has_been_looked_at_is_not_forgotten(agent: Agent) -> None:
    for weights in agent.memory.parameters():
        nn.init.zeros_(weights)
    actions = torch.tensor([0, *[TURN] * (STEPS - 1)])[None, :, None]
    around, still = (
        agent({"self": torch.stack([state(0, 0), state(0, turn), *[state(0, 0)] * (STEPS - 2)])[None]}, actions)[0][0]
        for turn in (1, 0)
    )
    assert (around != still).flatten(1).any(dim=1).tolist() == [False, *[True] * (STEPS - 1)]


@pytest.mark.parametrize("history", [False, True])
def test_step_by_step_is_as_all_at_once(history: bool) -> None:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        agent = Agent(SPACE, (ROOMS + 3,), DAggerConfig(features=4, hidden=4, views_past=True, history_past=history))
    rng = np.random.default_rng(0)
    rooms, headings = (rng.integers(count, size=(2, STEPS)).tolist() for count in (ROOMS, HEADINGS))
    own = torch.stack([torch.stack(list(map(state, *row))) for row in zip(rooms, headings, strict=True)])
    actions = torch.from_numpy(rng.integers(ROOMS + 3, size=(2, STEPS, 1)))
    actions[:, 1] = torch.tensor(rooms)[:, 1, None]  # one Goto at least
    actions[:, 0] = NO_ACTION
    together, player = agent({"self": own}, actions)[0], Player(nn.ModuleDict({"it": agent}), 2)
    for step in range(STEPS):
        values = player.values("it", torch.arange(2), {"self": own[:, step]})
        torch.testing.assert_close(values, together[:, step])
        if step + 1 < STEPS:
            player.remember("it", torch.arange(2), actions[:, step + 1])


def test_padding_shows_nothing() -> None:
    now, here, _ = seen([state(0, 3), torch.zeros(ROOMS + 4)], [0, TURN])
    assert not here[1].any()
    assert now[0].any()


@pytest.mark.parametrize(
    "space", [spaces.Box(0, 1, (2,), np.float32), spaces.Dict({"messages": spaces.Box(0, 1, (2,), np.int8)})]
)
def test_a_robot_that_does_not_know_where_it_is_has_no_views(space: spaces.Space[object]) -> None:
    with pytest.raises(ValueError, match="views_past needs the robot's own state"):
        Agent(space, (4,), CONFIG)
