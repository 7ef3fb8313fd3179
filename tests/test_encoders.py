"""Encoders: graphs as Kipf and Welling have them, whatever their padding and order; words, pictures, features."""

import os
from pathlib import Path

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

torch = pytest.importorskip("torch")

from chmarl_pb.envs.parallel import HouseholdEnv  # noqa: E402
from training.checkpoint import CheckpointError  # noqa: E402
from training.encoders import build_encoder  # noqa: E402
from training.features import FeatureEnv, feature_space, with_features  # noqa: E402
from training.graphs import GraphEncoder  # noqa: E402
from training.pretrain import average_precision, pretrain  # noqa: E402
from training.resnet import FrozenResNet18, ResNet18, fingerprint, frozen_resnet18  # noqa: E402
from training.views import GRID, LABELS, Views, labels_of  # noqa: E402

NODES, EDGES, CLASSES, STATES = 12, 20, 9, 4
IDS = spaces.Box(0, CLASSES, (NODES,), np.int16), spaces.Box(0, STATES, (NODES,), np.int16)


@pytest.fixture(scope="module")
def space() -> spaces.Dict:
    """One robot's scene-graph observations."""
    env = HouseholdEnv()
    yield env.observation_space("humanoid")
    env.close()


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of random weights of ResNet-18 with statistics that are not those of the start."""
    with torch.random.fork_rng():
        torch.manual_seed(3)
        network = ResNet18()
        for module in network.modules():
            if isinstance(module, torch.nn.BatchNorm2d):
                module.running_mean.normal_(0, 0.1)
                module.running_var.uniform_(0.5, 2)
    path = tmp_path_factory.mktemp("weights") / "resnet18.pt"
    torch.save({**network.state_dict(), "fc.bias": torch.zeros(1000)}, path)
    return path


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


def by_definition(encoder: GraphEncoder, node_class: np.ndarray, node_state: np.ndarray, edges: np.ndarray):
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


@settings(max_examples=40, deadline=None)
@given(st.lists(graphs(), min_size=1, max_size=4))
def test_graphs_are_convolved_as_defined(encoder: GraphEncoder, several: list[tuple[np.ndarray, ...]]) -> None:
    features = encoder(*stacked(*several))
    wanted = torch.stack([by_definition(encoder, *graph) for graph in several])
    torch.testing.assert_close(features, wanted, atol=1e-5, rtol=1e-4)


@settings(max_examples=20, deadline=None)
@given(graphs().filter(lambda graph: graph[0].any()))
def test_gradients_are_those_of_the_definition(encoder: GraphEncoder, graph: tuple[np.ndarray, ...]) -> None:
    found = []
    for value in (encoder(*stacked(graph))[0], by_definition(encoder, *graph)):
        encoder.zero_grad()
        (value * torch.arange(encoder.size)).sum().backward()
        found.append([parameter.grad.clone() for parameter in encoder.parameters()])
    for ours, wanted in zip(*found, strict=True):
        torch.testing.assert_close(ours, wanted, atol=1e-3, rtol=1e-3)


@settings(max_examples=20, deadline=None)
@given(graphs(), st.randoms(use_true_random=False))
def test_order_of_the_nodes_does_not_count(encoder: GraphEncoder, graph: tuple[np.ndarray, ...], random) -> None:
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
    parts = {f"{name}_{key}": part for name in ("one", "other") for key, part in space.spaces.items()}
    joint = spaces.Dict({**parts, "clock": spaces.Discrete(5)})
    encode = build_encoder(joint, 8)
    sample = joint.sample()
    features = encode({key: torch.from_numpy(np.asarray(value)[None]) for key, value in sample.items()})
    assert features.shape == (1, 8)
    sample["clock"] = (sample["clock"] + 1) % 5
    assert not torch.equal(
        features, encode({key: torch.from_numpy(np.asarray(value)[None]) for key, value in sample.items()})
    )


def test_padding_of_a_sentence_does_not_count() -> None:
    space = spaces.Dict({"instruction": spaces.Box(0, 50, (6,), np.int16)})
    encode = build_encoder(space, 8)
    short = encode({"instruction": torch.tensor([[4, 7, 0, 0, 0, 0], [4, 7, 4, 7, 0, 0]])})
    torch.testing.assert_close(short[0], short[1])
    assert torch.isfinite(encode({"instruction": torch.zeros(1, 6, dtype=torch.int16)})).all()


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


def test_resnet_has_the_parts_of_torchvisions() -> None:
    network = ResNet18()
    assert (
        sum(parameter.numel() for parameter in network.parameters()) == 11_689_512 - 513_000
    )  # without the last layer
    names = set(network.state_dict())
    assert {"conv1.weight", "layer2.0.downsample.1.running_var", "layer4.1.bn2.weight"} <= names and len(names) == 120


def test_frozen_features_are_those_of_the_plain_network(weights: Path) -> None:
    network = ResNet18().eval()
    loaded = torch.load(weights, weights_only=True)
    network.load_state_dict({name: value for name, value in loaded.items() if not name.startswith("fc.")})
    images = torch.from_numpy(np.random.default_rng(0).integers(0, 256, (2, 128, 128, 3), dtype=np.uint8))
    frozen = frozen_resnet18(str(weights))
    with torch.no_grad():
        torch.testing.assert_close(frozen(images).float(), network(images), atol=2e-3, rtol=2e-3)
    assert frozen(images).dtype == torch.float16 and frozen.fingerprint == fingerprint(network.state_dict())


def test_missing_or_damaged_weights_are_named(weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CHMARL_RESNET18", str(tmp_path / "none.pt"))
    with pytest.raises(CheckpointError, match=r"none\.pt.*training\.pretrain.*CHMARL_RESNET18"):
        frozen_resnet18()
    (tmp_path / "cut.pt").write_bytes(weights.read_bytes()[:1000])
    with pytest.raises(CheckpointError, match=r"cut\.pt"):
        frozen_resnet18(str(tmp_path / "cut.pt"))
    torch.save({"conv1.weight": torch.zeros(3)}, tmp_path / "other.pt")
    with pytest.raises(CheckpointError, match=r"other\.pt"):
        frozen_resnet18(str(tmp_path / "other.pt"))


def test_a_network_fits_no_other_frozen_weights(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    space = spaces.Box(0, 255, (64, 64, 3), np.uint8)
    monkeypatch.setattr("training.pictures.frozen_resnet18", lambda: frozen_resnet18(str(weights)))
    encode = build_encoder(space, 8, "resnet18")
    state = encode.state_dict()
    assert sum(value.numel() for value in state.values() if isinstance(value, torch.Tensor)) < 1_000_000
    encode.load_state_dict(state)
    other = FrozenResNet18(ResNet18().state_dict())
    monkeypatch.setattr("training.pictures.frozen_resnet18", lambda: other)
    with pytest.raises(RuntimeError, match="other weights"):
        build_encoder(space, 8, "resnet18").load_state_dict(state)


def test_features_take_the_place_of_pictures(weights: Path) -> None:
    env = FeatureEnv(HouseholdEnv(observation="visual", split="val-unseen"), str(weights))
    observations, _ = env.reset(seed=1)
    plain, _ = env.env.reset(seed=1)
    again = with_features(plain, frozen_resnet18(str(weights)))
    for name in env.possible_agents:
        assert env.observation_space(name).contains(observations[name])
        np.testing.assert_array_equal(observations[name]["image"], again[name]["image"])
    assert build_encoder(env.observation_space("drone"), 8)(
        {key: torch.from_numpy(part)[None] for key, part in observations["drone"].items()}
    ).shape == (1, 8)
    assert feature_space(env.env.observation_space("drone"))["image"].dtype == np.float16
    assert env.step({"humanoid": 9, "drone": 8})[0].keys() == observations.keys()
    env.close()


def test_labels_say_what_is_where() -> None:
    segmentation = np.full((128, 128), len(LABELS))
    segmentation[:2, 126:] = 5  # four pixels, in the corner at the top right
    segmentation[64, 64:67] = 7  # three pixels: not visible
    cells, present, centres = labels_of(segmentation)
    assert np.flatnonzero(present).tolist() == [5]
    assert np.argwhere(cells).tolist() == [[5, 0, GRID - 1]]
    np.testing.assert_allclose(centres[5], (1, -1), atol=0.02)


def test_average_precision_is_that_of_the_order() -> None:
    present = np.array([True, False, True, False])
    assert average_precision(np.array([4.0, 3.0, 2.0, 1.0]), present) == pytest.approx((1 + 2 / 3) / 2)
    assert average_precision(np.array([4.0, 1.0, 3.0, 2.0]), present) == 1


@pytest.mark.slow  # writes checkpoints of 130 MB
def test_pretraining_goes_on_after_an_interruption(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng, count = np.random.default_rng(0), 8
    monkeypatch.setattr("training.pretrain.BATCH", count)
    views = Views(
        rng.integers(0, 256, (count, 32, 32, 3), dtype=np.uint8),
        rng.random((count, len(LABELS), 1, 1)) < 0.2,
        rng.random((count, len(LABELS))) < 0.8,
        rng.random((count, len(LABELS), 2)).astype(np.float16),
    )

    class Stopped(Exception):
        pass

    class Bar:
        """Stops at a batch."""

        def __init__(self, stop: int):
            self.left = stop

        def add_task(self, *_, **__) -> int:
            return 0

        def update(self, *_, **__) -> None:
            self.left -= 1
            if self.left == 0:
                raise Stopped

    whole = pretrain(tmp_path / "whole.pt", views, views, 2, 0, Bar(99))
    with pytest.raises(Stopped):
        pretrain(tmp_path / "cut.pt", views, views, 2, 0, Bar(2))
    assert not (tmp_path / "cut.pt").exists()
    assert pretrain(tmp_path / "cut.pt", views, views, 2, 0, Bar(99)) == whole
    assert sorted(os.listdir(tmp_path)) == ["cut.pt", "whole.pt"]
    assert frozen_resnet18(str(tmp_path / "cut.pt")).fingerprint == whole["fingerprint"]
