"""The cells of a picture in which X and Y lie go past the encoder, to the actions that point at them."""

import pytest
import torch
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.learning.networks import build_encoder
from chmarl_pb.learning.networks.cells import SIZE, cells_of
from chmarl_pb.learning.networks.detections import LABELS, SHAPE, GroundedDetectionEncoder
from chmarl_pb.learning.networks.graphs import GroundedGraphEncoder
from chmarl_pb.learning.networks.match import Wanted
from chmarl_pb.learning.networks.parts import Asked
from chmarl_pb.learning.networks.tables import EMBEDDING
from chmarl_pb.robots.pointing import CELLS, cell_at

MUG, SOFA, CLASSES = BENCHMARK.class_ids["mug"], BENCHMARK.class_ids["sofa"], len(BENCHMARK.rows) + 1
FRACTION = st.floats(0, 1, width=32)


def asked(colour: int | None = None) -> Asked:
    """Return what an instruction asks for: a mug, of a colour, and a sofa."""
    classes = torch.zeros(1, 2, CLASSES)
    classes[0, 0, MUG] = classes[0, 1, SOFA] = 1.0
    colours = None if colour is None else torch.zeros(1, 2, 12).index_fill_(2, torch.tensor([colour]), 1.0)
    return Asked(torch.zeros(1, EMBEDDING), Wanted(classes, colours))


@given(FRACTION, FRACTION)
def test_a_thing_counts_in_the_cell_that_actions_point_at(u: float, v: float) -> None:
    likely = torch.tensor([[[0.25], [0.0]]])
    found = cells_of(likely, torch.tensor([[u]]), torch.tensor([[v]])).view(2, len(CELLS))
    assert found[0].tolist() == [0.25 if cell == cell_at(u, v) else 0.0 for cell in CELLS] and not found[1].any()


def test_nodes_of_the_colour_that_is_asked_for_count_where_they_are() -> None:
    part = GroundedGraphEncoder(spaces.Box(0, CLASSES - 1, (4,)), spaces.Box(0, 9, (4,)), None, None, True)
    classes, colours = torch.tensor([[MUG, MUG, SOFA, 0]]), torch.tensor([[3, 5, 0, 0]])
    view = torch.tensor([[[0.1, 0.1, 0.01], [0.9, 0.1, 0.01], [0.5, 0.9, 0.2], [0.0, 0.0, 0.0]]])
    found = part.cells(classes, classes, torch.zeros(1, 1, 3), colours, view, asked(5)).view(2, len(CELLS))
    assert [CELLS[number] for number in found[0].nonzero().flatten().tolist()] == [(0, 2)]
    assert [CELLS[number] for number in found[1].nonzero().flatten().tolist()] == [(2, 1)]


def test_detections_count_as_far_as_they_are_sure() -> None:
    detected = torch.zeros(1, *SHAPE)
    detected[0, LABELS.index("mug"), :3] = torch.tensor([0.5, 0.5 * -0.9, 0.5 * 0.9])  # left and below
    found = GroundedDetectionEncoder().cells(detected, asked()).view(2, len(CELLS))
    assert found.sum() == 0.5 and found[0, CELLS.index((2, 0))] == 0.5


def test_they_follow_the_features_where_a_run_asks_for_them() -> None:
    env = chmarl_pb.parallel_env(track="grounded", split="val-unseen")
    space = env.observation_space("humanoid")
    observations, _ = env.reset(seed=0)
    seen = {key: torch.from_numpy(part)[None] for key, part in observations["humanoid"].items()}
    torch.manual_seed(0)
    encode = build_encoder(space, 16, graph_pool="grounded", cells_past=True)
    assert encode(seen).shape == (1, 16 + SIZE) and encode.past == SIZE
    with pytest.raises(ValueError, match="graph_pool='grounded'"):
        build_encoder(space, 16, graph_pool="mean", cells_past=True)
    env.close()
