"""Where X and Y can be taken, and in which direction they lie, goes past the encoder, to the actions that point."""

from contextlib import closing

import numpy as np
import pytest
import torch
from gymnasium import spaces
from torch import Tensor

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.learning.networks import bearings, build_encoder, cells
from chmarl_pb.learning.networks.detections import LABELS, SHAPE, GroundedDetectionEncoder
from chmarl_pb.learning.networks.grounded_graphs import GroundedGraphEncoder
from chmarl_pb.learning.networks.match import ROOMS, Wanted, named_by
from chmarl_pb.learning.networks.numbers import Numbers
from chmarl_pb.learning.networks.parts import Asked
from chmarl_pb.learning.networks.tables import EMBEDDING
from chmarl_pb.policies.aiming import aims_at, nodes_of
from chmarl_pb.policies.belief.guide import Guide
from chmarl_pb.robots.pointing import CELLS
from chmarl_pb.tasks.language import read_pairs

MUG, SOFA, CLASSES = BENCHMARK.class_ids["mug"], BENCHMARK.class_ids["sofa"], len(BENCHMARK.rows) + 1
KINDS = (BENCHMARK.graspables, BENCHMARK.receptacles)  # what a Pick takes, and what a Place goes onto
ROOM_KINDS = len(ROOMS)


def asked(item: int = MUG, target: int = SOFA, colour: int | None = None, room: int | None = None) -> Asked:
    """Return what an instruction asks for: by default a mug, of a colour, and a sofa, in a room or anywhere (0)."""
    classes = torch.zeros(1, 2, CLASSES)
    classes[0, 0, item] = classes[0, 1, target] = 1.0
    colours = None if colour is None else torch.zeros(1, 2, 12).index_fill_(2, torch.tensor([colour]), 1.0)
    rooms = None if room is None else torch.zeros(1, 1 + ROOM_KINDS).index_fill_(1, torch.tensor([room]), 1.0)
    return Asked(torch.zeros(1, EMBEDDING), Wanted(classes, colours, rooms))


def encoder(nodes: int) -> GroundedGraphEncoder:
    ids, states = spaces.Box(0, CLASSES - 1, (nodes,), np.int16), spaces.Box(0, 9, (nodes,), np.int16)
    return GroundedGraphEncoder(ids, states, None, spaces.Box(0, 11, (nodes,), np.int16), True)


def places_of(seen: dict[str, np.ndarray]) -> tuple[Tensor, Tensor]:
    """Return cells (2, CELLS) and bearings (2, 3) of an observation whose instruction is understood."""
    classes, colours, rooms = named_by(seen["instruction"])
    told = asked(int(classes[0]), int(classes[1]), int(colours[0]), int(rooms[0]))
    keys = ("node_class", "node_state", "edges", "node_color", "node_view")
    ids, states, edges, colours, views = (torch.from_numpy(seen[key])[None] for key in keys)
    found = encoder(ids.shape[1]).places(ids, states, edges, colours, views, told)
    return found[0, : cells.SIZE].view(2, -1), found[0, cells.SIZE :].view(2, 3)


def test_they_say_what_a_policy_works_out_that_points_and_guides() -> None:
    with closing(chmarl_pb.parallel_env(track="grounded", split="val-unseen")) as env:
        policy, guided, sure = chmarl_pb.make_policy("belief", env), 0, np.zeros(2, dtype=int)
        for seed in range(4):
            observations, infos = env.reset(seed=seed)
            policy.reset(seed)
            guide = Guide(("kitchen", "bedroom", "bathroom", "livingroom"), ("humanoid",), BENCHMARK)
            while env.agents:
                for name in env.agents:
                    sure += agrees_about_cells(observations[name])
                guided += agrees_about_directions(observations["drone"], guide)
                observations, _, _, _, infos = env.step(policy.act(observations, infos))
    assert guided > 10 and (sure > 10).all()


def agrees_about_cells(seen: dict[str, np.ndarray]) -> list[int]:
    """Return in how many cells X, and Y, surely is."""
    in_cells, _ = places_of(seen)
    for row, (name, kinds) in enumerate(zip(*read_pairs(seen["instruction"], BENCHMARK), KINDS, strict=True)):
        parts = {aim.cell: aim.part for aim in aims_at(nodes_of(seen, kinds, BENCHMARK), (name,))}
        for cell, found in zip(CELLS, in_cells[row].tolist(), strict=True):
            if found > 0.6:
                assert parts[cell] > 0.5
            assert parts.get(cell, 0.0) >= found - 1e-3  # less where only few pixels are in the cell
    return (in_cells > 0.6).sum(dim=1).tolist()


def agrees_about_directions(seen: dict[str, np.ndarray], guide: Guide) -> int:
    _, directions = places_of(seen)
    told = 0
    for row, name in enumerate(read_pairs(seen["instruction"], BENCHMARK)[0]):
        angle, (there, cosine, sine) = guide.bearing(seen, name), directions[row].tolist()
        assert (angle is not None) == (there > 0.5)
        if angle is not None:
            aside = abs(np.exp(1j * angle) - complex(cosine, sine))  # it sends aside what is too near
            told += aside < 0.05
    return told


@pytest.mark.parametrize(("colour", "cell"), [(3, (0, 0)), (5, (0, 2))])
def test_x_is_what_has_the_colour_that_is_asked_for(colour: int, cell: tuple[int, int]) -> None:
    ids, colours = torch.tensor([[MUG, MUG, SOFA, 0]]), torch.tensor([[3, 5, 0, 0]])
    view = torch.tensor([[[0.1, 0.1, 0.01], [0.9, 0.1, 0.01], [0.5, 0.9, 0.02], [0.0, 0.0, 0.0]]])
    found = encoder(4).places(ids, torch.zeros_like(ids), torch.zeros(1, 1, 3), colours, view, asked(colour=colour))
    in_cells = found[0, : cells.SIZE].view(2, -1) > 0.9
    assert [CELLS[number] for number in in_cells[0].nonzero().flatten().tolist()] == [cell]
    assert (2, 1) in [CELLS[number] for number in in_cells[1].nonzero().flatten().tolist()]


@pytest.mark.parametrize(("room", "found"), [(0, [1, 1]), (1, [1, 0]), (2, [0, 1]), (3, [0, 0])])
def test_y_is_in_the_room_that_is_asked_for(room: int, found: list[int]) -> None:
    ids = torch.tensor([[SOFA, SOFA, ROOMS[0], ROOMS[1]]])
    edges = torch.tensor([[[0, 2, 5], [1, 3, 5]]])
    view = torch.tensor([[[0.2, 0.2, 0.01], [0.8, 0.8, 0.01], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]])
    numbers = encoder(4).places(ids, torch.zeros_like(ids), edges, torch.zeros_like(ids), view, asked(room=room))
    in_cells = numbers[0, len(CELLS) : cells.SIZE] > 0.9
    assert [bool(in_cells[CELLS.index((0, 0))]), bool(in_cells[CELLS.index((2, 2))])] == [bool(one) for one in found]


def test_detections_count_as_far_as_they_are_sure() -> None:
    detected = torch.zeros(1, *SHAPE)
    detected[0, LABELS.index("mug"), :4] = torch.tensor([0.5, 0.5 * -0.9, 0.5 * 0.9, 0.5 * 0.5])  # left and below
    found = GroundedDetectionEncoder().places(detected, asked())[0]
    assert found.sum() == found[CELLS.index((2, 0))] > 0.9
    detected[0, LABELS.index("apple"), :4] = detected[0, LABELS.index("mug"), :4]  # as sure, as large, in the same cell
    assert GroundedDetectionEncoder().places(detected, asked())[0].max() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(("sure", "there"), [(0.9, 0.8), (0.1, 0.0)])
def test_a_robot_that_is_surely_in_the_picture_is_what_directions_go_from(sure: float, there: float) -> None:
    detected = torch.zeros(1, *SHAPE)
    detected[0, LABELS.index("humanoid"), :4] = sure * torch.tensor([1.0, -0.5, 0.5, 0.3])
    detected[0, LABELS.index("mug"), :4] = 0.8 * torch.tensor([1.0, 0.1, -0.3, 0.2])  # 0.6 to the right, 0.8 up
    directions = GroundedDetectionEncoder().places(detected, asked())[0, cells.SIZE :].view(2, 3)
    torch.testing.assert_close(directions[0], there * torch.tensor([1.0, 0.6, 0.8]), atol=1e-3, rtol=0)
    assert not directions[1].any()  # no Y


def test_they_follow_the_features_where_a_run_asks_for_them() -> None:
    with closing(chmarl_pb.parallel_env(track="grounded", split="val-unseen")) as env:
        space = env.observation_space("humanoid")
        observations, _ = env.reset(seed=0)
    seen = {key: torch.from_numpy(part)[None] for key, part in observations["humanoid"].items()}
    torch.manual_seed(0)
    encode, past = build_encoder(space, 16, graph_pool="grounded", cells_past=True), cells.SIZE + bearings.SIZE
    assert encode(seen).shape == (1, 16 + past + ROOM_KINDS) and encode.past == past + ROOM_KINDS
    with pytest.raises(ValueError, match="graph_pool='grounded'"):
        build_encoder(space, 16, graph_pool="mean", cells_past=True)


def test_the_room_that_an_instruction_names_follows_them() -> None:
    with closing(chmarl_pb.parallel_env(track="grounded", split="val-unseen")) as env:
        encode = build_encoder(env.observation_space("humanoid"), 16, graph_pool="parsed", cells_past=True)
        rooms = set[int]()
        for seed in range(8):
            seen = env.reset(seed=seed)[0]["humanoid"]
            named = int(named_by(seen["instruction"])[2, 0])
            told = encode({key: torch.from_numpy(part)[None] for key, part in seen.items()})[0, -ROOM_KINDS:]
            assert told.tolist() == [float(number == named) for number in range(1, 1 + ROOM_KINDS)]
            rooms.add(named)
    assert len(rooms) > 2


def test_messages_are_also_told_by_the_robots_own_heading() -> None:
    space = spaces.Dict({"messages": spaces.Box(0, 1, (1, 2)), "self": spaces.Box(-1, 1, (5,))})
    own = [0.1, 0.2, 0.6, 0.8, 1.0]  # cosine and sine before whether it holds something
    numbers = Numbers(space, turned=True)
    row = numbers({"messages": torch.tensor([[[2.0, 3.0]]]), "self": torch.tensor([own])})[0]
    by_key = dict(zip(("messages", "self"), ([2.0, 3.0], own), strict=True))
    as_they_are = [value for key in space.spaces for value in by_key[key]]
    expected = [*as_they_are, 0.6 * 2, 0.6 * 3, 0.8 * 2, 0.8 * 3]
    assert numbers.size == len(row) and sorted(row.tolist()) == pytest.approx(sorted(expected))


def test_what_has_no_heading_turns_nothing() -> None:
    space = spaces.Dict({"messages": spaces.Box(0, 1, (3,)), "self": spaces.Box(-1, 1, (2,))})
    assert Numbers(space, turned=True).size == 5
    space = spaces.Dict({"messages": spaces.Discrete(3), "self": spaces.Discrete(4)})  # choices are encoded
    assert build_encoder(space, 8, numbers_past=True)({"messages": torch.ones(2), "self": torch.ones(2)}).shape == (
        2,
        8,
    )
