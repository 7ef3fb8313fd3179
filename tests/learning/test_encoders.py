"""Encoders: graphs as Kipf and Welling have them, whatever their padding and order; words, pictures, features."""

from collections.abc import Iterator
from random import Random

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning.networks import DictEncoder, build_encoder
from chmarl_pb.learning.networks.graphs import GraphEncoder
from chmarl_pb.learning.networks.parts import FlatEncoder, TokenEncoder
from chmarl_pb.learning.observation_keys import named

NODES, EDGES, CLASSES, STATES = 12, 20, 9, 4
IDS = spaces.Box(0, CLASSES, (NODES,), np.int16), spaces.Box(0, STATES, (NODES,), np.int16)


@pytest.fixture(scope="module")
def space() -> Iterator[spaces.Dict]:
    """One robot's scene-graph observations."""
    env = HouseholdEnv()
    yield env.observation_space("humanoid")
    env.close()


@st.composite
def graphs(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A graph as observations have it."""
    count = draw(st.integers(0, NODES))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    node_class, node_state = np.zeros(NODES, np.int16), np.zeros(NODES, np.int16)
    node_class[:count] = rng.integers(1, CLASSES + 1, count)
    node_state[:count] = rng.integers(1, STATES + 1, count)
    edges = np.zeros((EDGES, 3), np.int16)
    if count:
        rows = draw(st.integers(0, EDGES))
        edges[:rows] = np.column_stack([*rng.integers(0, count, (2, rows)), rng.integers(1, 6, rows)])
        edges[:rows][edges[:rows, 0] == edges[:rows, 1]] = 0  # nothing is related to itself
    return node_class, node_state, edges


def stacked(*several: tuple[np.ndarray, ...]) -> list["torch.Tensor"]:
    return [torch.from_numpy(np.stack(column)) for column in zip(*several, strict=True)]


@pytest.fixture(scope="module")
def encoder() -> GraphEncoder:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return GraphEncoder(*IDS)


def by_definition(
    encoder: GraphEncoder, node_class: np.ndarray, node_state: np.ndarray, edges: np.ndarray
) -> torch.Tensor:
    """Kipf and Welling's equation 2, twice, with a full matrix, and the mean over the nodes."""
    count = int((node_class > 0).sum())
    if not count:
        return torch.zeros(encoder.size)
    matrix = torch.eye(count)
    for source, target, relation in edges.tolist():
        if relation:
            matrix[source, target] += 1
            matrix[target, source] += 1
    root = matrix.sum(dim=1) ** -0.5
    matrix = root[:, None] * matrix * root
    ids = [torch.from_numpy(part[:count]).long() for part in (node_class, node_state)]
    nodes = torch.cat([encoder.classes(ids[0]), encoder.states(ids[1])], dim=1)
    nodes = torch.relu(matrix @ encoder.first(nodes))
    return torch.relu(matrix @ encoder.second(nodes)).mean(dim=0)


@settings(max_examples=40)
@given(st.lists(graphs(), min_size=1, max_size=4))
def test_graphs_are_convolved_as_defined(encoder: GraphEncoder, several: list[tuple[np.ndarray, ...]]) -> None:
    features = encoder(*stacked(*several))
    wanted = torch.stack([by_definition(encoder, *graph) for graph in several])
    torch.testing.assert_close(features, wanted, atol=1e-5, rtol=1e-4)


def gradient_of(parameter: torch.nn.Parameter) -> torch.Tensor:
    assert parameter.grad is not None
    return parameter.grad.clone()


@settings(max_examples=20)
@given(graphs().filter(lambda graph: graph[0].any()))
def test_gradients_are_those_of_the_definition(encoder: GraphEncoder, graph: tuple[np.ndarray, ...]) -> None:
    found = []
    for value in (encoder(*stacked(graph))[0], by_definition(encoder, *graph)):
        encoder.zero_grad()
        (value * torch.arange(encoder.size)).sum().backward()
        found.append([gradient_of(parameter) for parameter in encoder.parameters()])
    for ours, wanted in zip(*found, strict=True):
        torch.testing.assert_close(ours, wanted, atol=1e-3, rtol=1e-3)


@settings(max_examples=20)
@given(graphs(), st.randoms(use_true_random=False))
def test_order_of_the_nodes_does_not_count(
    encoder: GraphEncoder, graph: tuple[np.ndarray, ...], random: Random
) -> None:
    node_class, node_state, edges = graph
    count = int((node_class > 0).sum())
    order = list(range(count))
    random.shuffle(order)
    place = {node: new for new, node in enumerate(order)}
    moved = edges.copy()
    for number in np.flatnonzero(edges[:, 2]):
        moved[number, :2] = place[int(edges[number, 0])], place[int(edges[number, 1])]
    shuffled = [np.concatenate([part[order], part[count:]]) for part in (node_class, node_state)]
    one, other = encoder(*stacked(graph, (*shuffled, moved)))
    torch.testing.assert_close(one, other, atol=1e-5, rtol=1e-4)


def test_edges_to_padding_are_left_out(encoder: GraphEncoder) -> None:
    node_class, node_state = np.array([3, 5, *[0] * 10], np.int16), np.array([1, 2, *[0] * 10], np.int16)
    edges = np.zeros((EDGES, 3), np.int16)
    edges[0] = 0, 1, 2
    odd = edges.copy()
    odd[1], odd[2] = (0, 7, 1), (NODES, 0, 3)
    one, other = encoder(*stacked((node_class, node_state, edges), (node_class, node_state, odd)))
    assert torch.equal(one, other)


def test_any_observation_of_the_space_is_encoded(space: spaces.Dict) -> None:
    encode = build_encoder(space, 16)
    samples = [space.sample() for _ in range(3)]
    batch = {key: torch.from_numpy(np.stack([sample[key] for sample in samples])) for key in space.spaces}
    features = encode(batch)
    assert features.shape == (3, 16) and torch.isfinite(features).all()


def test_leading_dimensions_are_flattened_and_graphs_may_be_cut(space: spaces.Dict) -> None:
    env = HouseholdEnv()
    observations = [env.reset(seed=seed)[0]["humanoid"] for seed in range(6)]
    env.close()
    batch = {key: torch.from_numpy(np.stack([one[key] for one in observations])) for key in space.spaces}
    encode = build_encoder(space, 16)
    wanted = encode(batch)
    folded = {key: part.reshape(2, 3, *part.shape[1:]) for key, part in batch.items()}
    assert torch.equal(encode(folded), wanted)
    longest = int((batch["node_class"] > 0).sum(dim=1).max())
    cut = {key: part[:, :longest] if key.startswith("node_") else part for key, part in batch.items()}
    assert torch.equal(encode(cut), wanted)


def test_keys_of_several_robots_and_unknown_keys_are_encoded(space: spaces.Dict) -> None:
    parts = {f"{name}_{key}": part for name in ("humanoid", "drone") for key, part in space.spaces.items()}
    joint = spaces.Dict({**parts, "clock": spaces.Discrete(5)})
    encode = build_encoder(joint, 8)
    sample = joint.sample()
    features = encode({key: torch.from_numpy(np.asarray(value)[None]) for key, value in sample.items()})
    assert features.shape == (1, 8)
    sample["clock"] = (sample["clock"] + 1) % 5
    assert not torch.equal(
        features, encode({key: torch.from_numpy(np.asarray(value)[None]) for key, value in sample.items()})
    )


def test_only_the_benchmarks_own_keys_and_spaces_are_words_and_graphs(space: spaces.Dict) -> None:
    """Other environments may use the same words in the names of their keys, or our names for other things."""
    tokens, graph = space["feedback"], {key: space[key] for key in ("node_class", "node_state", "edges")}
    flat = {
        "force_feedback": spaces.Box(0, 1, (3,), np.float32), "my_instruction": tokens, "feedback": tokens,
        "my_node_class": graph["node_class"], "edges": graph["edges"], "bent_edges": spaces.Box(0, 1, (4, 3), np.int16),
    }  # fmt: skip
    kinds = {key: type(part) for key, part in parts_of(spaces.Dict(flat)).items()}
    assert kinds == dict.fromkeys(flat, FlatEncoder) | {"feedback": TokenEncoder}
    encode = build_encoder(spaces.Dict({"force_feedback": flat["force_feedback"]}), 8)
    one, other = (encode({"force_feedback": torch.tensor([values])}) for values in ((0.1, 0.2, 0.3), (0.9, 0.8, 0.7)))
    assert not torch.equal(one, other)
    assert [type(part) for part in parts_of(spaces.Dict(graph)).values()] == [GraphEncoder]
    for missing in graph:
        rest = spaces.Dict({key: part for key, part in graph.items() if key != missing})
        assert all(type(part) is FlatEncoder for part in parts_of(rest).values())


def test_keys_of_own_robots_are_known_by_their_self(space: spaces.Dict) -> None:
    joint = {f"{robot}_{key}": part for robot in ("humanoid", "scout_0", "scout_1") for key, part in space.items()}
    keys = [*joint, "force_feedback"]
    assert named(keys, "messages") == ["humanoid_messages", "scout_0_messages", "scout_1_messages"]
    assert "force_feedback" not in named(keys, "feedback") and "scout_1_feedback" in named(keys, "feedback")
    kinds = {key: type(part) for key, part in parts_of(spaces.Dict(joint)).items()}
    assert kinds["scout_1_node_class"] is GraphEncoder and kinds["scout_0_instruction"] is TokenEncoder
    assert parts_of(spaces.Dict(joint)).keys() == {
        f"{robot}_{key}" for robot in ("humanoid", "scout_0", "scout_1") for key in parts_of(space)
    }


@pytest.mark.parametrize(
    "box",
    [
        spaces.Box(-np.inf, np.inf, (4,), np.float32), spaces.Box(0, 9, (4,), np.float32),
        spaces.Box(0, np.iinfo(np.int64).max, (4,), np.int64), spaces.Box(-1, 9, (4,), np.int16),
        spaces.Box(0, 9, (2, 2), np.int16),
    ],
    ids=["infinite", "floats", "huge", "negative", "two dimensions"],
)  # fmt: skip
def test_a_box_that_holds_no_ids_is_flat_whatever_its_name(box: spaces.Box) -> None:
    space = spaces.Dict(dict.fromkeys(("feedback", "instruction", "node_class", "node_state", "edges", "image"), box))
    assert {type(part) for part in parts_of(space).values()} == {FlatEncoder}
    seen = {key: torch.ones((3, *box.shape), dtype=torch.float32) for key in space.spaces}
    assert torch.isfinite(build_encoder(space, 8)(seen)).all()


def parts_of(space: spaces.Dict) -> dict[str, torch.nn.Module]:
    encode = build_encoder(space, 8)
    assert isinstance(encode, DictEncoder)
    return dict(zip(encode.keys, encode.parts, strict=True))


def test_padding_of_a_sentence_does_not_count() -> None:
    space = spaces.Dict({"instruction": spaces.Box(0, 50, (6,), np.int16)})
    encode = build_encoder(space, 8)
    short = encode({"instruction": torch.tensor([[4, 7, 0, 0, 0, 0], [4, 7, 4, 7, 0, 0]])})
    torch.testing.assert_close(short[0], short[1])
    assert torch.isfinite(encode({"instruction": torch.zeros(1, 6, dtype=torch.int16)})).all()


@pytest.mark.parametrize("pool", ["grounded", "parsed"])
def test_pools_that_know_the_benchmarks_classes_need_them(pool: str) -> None:
    graph = spaces.Dict({
        "node_class": spaces.Box(0, 9, (12,), np.int16), "node_state": spaces.Box(0, 4, (12,), np.int16),
        "edges": spaces.Box(0, 12, (20, 3), np.int16),
    })  # fmt: skip
    with pytest.raises(ValueError, match="a space has 9: use 'mean' or 'gated'"):
        build_encoder(graph, 8, graph_pool=pool)
    assert build_encoder(graph, 8).size == 8


def test_boxes_and_discretes_alone_are_encoded() -> None:
    assert build_encoder(spaces.Box(-1, 1, (3, 2)), 8)(torch.zeros(4, 5, 3, 2)).shape == (20, 8)
    assert build_encoder(spaces.Box(-1, 1, ()), 8)(torch.zeros(4)).shape == (4, 8)
    assert build_encoder(spaces.Discrete(3), 8)(torch.tensor([[0, 1], [2, 2]])).shape == (4, 8)
    with pytest.raises(ValueError, match="cannot be encoded"):
        build_encoder(spaces.Text(3), 8)
    with pytest.raises(ValueError, match="cnn, resnet18"):
        build_encoder(spaces.Box(0, 255, (64, 64, 3), np.uint8), 8, "vgg")


@pytest.mark.parametrize("size", [32, 84, 128])
def test_pictures_may_have_their_channels_first(size: int) -> None:
    encode = build_encoder(spaces.Box(0, 255, (size, size, 3), np.uint8), 8)
    turned = build_encoder(spaces.Box(0, 255, (3, size, size), np.uint8), 8)
    turned.load_state_dict(encode.state_dict())
    images = torch.from_numpy(np.random.default_rng(0).integers(0, 256, (2, size, size, 3), dtype=np.uint8))
    torch.testing.assert_close(encode(images), turned(images.permute(0, 3, 1, 2)), atol=1e-5, rtol=1e-4)
