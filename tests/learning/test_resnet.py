"""The frozen ResNet-18: weights from files, and the same features in whole numbers, whatever is computed together."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

from chmarl_pb.learning.networks import build_encoder, int8
from chmarl_pb.learning.networks.frozen import BEFORE, FrozenEncoder, frozen_encoder, weights_hash, with_hash
from chmarl_pb.learning.networks.int8 import LARGEST, RANGES, compact
from chmarl_pb.learning.networks.residual import ResNet18, folded
from chmarl_pb.learning.storage.checkpoint import CheckpointError
from tests.helpers.frozen_weights import pictures, random_weights

WHOLE = random_weights()
EXACT = {name: value for name, value in WHOLE.items() if name != RANGES}


def plain() -> ResNet18:
    network = ResNet18().eval().requires_grad_(False)
    network.load_state_dict(EXACT)
    return network


COMPACT = with_hash({**compact(folded(plain())), RANGES: WHOLE[RANGES]}, WHOLE)


@pytest.fixture(scope="module")
def frozen() -> FrozenEncoder:
    """In whole numbers."""
    return FrozenEncoder("resnet18", WHOLE)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of weights as torchvision has them."""
    path = tmp_path_factory.mktemp("weights") / "resnet18.pt"
    torch.save({**EXACT, "fc.bias": torch.zeros(1000)}, path)
    return path


def test_resnet_has_the_parts_of_torchvisions() -> None:
    network = ResNet18()
    count = sum(parameter.numel() for parameter in network.parameters())
    assert count == 11_689_512 - 513_000  # without the last layer
    names = set(network.state_dict())
    assert {"conv1.weight", "layer2.0.downsample.1.running_var", "layer4.1.bn2.weight"} <= names and len(names) == 120


def test_features_without_ranges_are_those_of_the_plain_network(weights: Path) -> None:
    images = pictures(2, 64)
    found = frozen_encoder("resnet18", str(weights))
    torch.testing.assert_close(found(images).float(), plain()(images), atol=2e-3, rtol=2e-3)
    assert found(images).dtype == torch.float16 and found.fingerprint == weights_hash(EXACT)


@pytest.mark.parametrize("size", [64, 97, 128])
def test_whole_numbers_give_nearly_the_same_features(frozen: FrozenEncoder, size: int) -> None:
    images = pictures(4, size, seed=1)
    wanted, found = plain()(images), frozen(images).float()
    assert torch.cosine_similarity(found, wanted).min() > 0.999
    assert frozen.fingerprint != weights_hash(EXACT)


def test_compact_weights_give_the_same_features_under_the_same_fingerprint(frozen: FrozenEncoder) -> None:
    small = FrozenEncoder("resnet18", COMPACT)
    images = pictures(6, 96, seed=2)
    assert torch.equal(small(images), frozen(images)) and small.fingerprint == frozen.fingerprint
    assert sum(value.nbytes for value in COMPACT.values()) < 0.26 * sum(value.nbytes for value in EXACT.values())


SCALED = "layer1.0.conv1.weight"


CHANGES: tuple[dict[str, torch.Tensor | None], ...] = (
    {BEFORE: torch.zeros(5, dtype=torch.uint8)},
    {SCALED: -COMPACT[SCALED]},
    {SCALED + LARGEST: None},
    {SCALED + LARGEST: torch.tensor(1.0)},
    {SCALED + LARGEST: torch.full((64,), torch.nan)},
    {SCALED + LARGEST: torch.ones(64, dtype=torch.int64)},
    {"conv1.weight" + LARGEST: torch.ones(64)},
)


@pytest.mark.parametrize("changed", [*CHANGES, *({**change, BEFORE: None} for change in CHANGES[2:])])
def test_compact_weights_that_have_changed_are_refused(tmp_path: Path, changed: dict[str, torch.Tensor | None]) -> None:
    """With the hash all are told; without it, those whose parts do not go together."""
    path, weights = tmp_path / "odd.pt", {**COMPACT, **changed}
    weights = {name: value for name, value in weights.items() if value is not None}
    torch.save(weights, path)
    with pytest.raises(CheckpointError, match=r"odd\.pt: "):
        frozen_encoder("resnet18", str(path))


FORGETFUL = FrozenEncoder("resnet18", WHOLE, kept=0)


@settings(max_examples=10)
@given(st.lists(st.integers(1, 5), min_size=1, max_size=4), st.integers(0, 99))
def test_features_do_not_depend_on_company(sizes: list[int], seed: int) -> None:
    images = pictures(sum(sizes), 64, seed)
    parts = [FORGETFUL(part) for part in images.split(sizes)]
    assert torch.equal(torch.cat(parts), FORGETFUL(images))


def test_features_do_not_depend_on_threads() -> None:
    images, before, found = pictures(3, 64), torch.get_num_threads(), []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            found.append(FORGETFUL(images))
    finally:
        torch.set_num_threads(before)
    assert torch.equal(*found)


def test_features_are_remembered(frozen: FrozenEncoder) -> None:
    few = FrozenEncoder("resnet18", WHOLE, kept=3)
    images = pictures(5, 64)
    wanted = frozen(images)
    assert torch.equal(few(images[[0, 1, 0, 0]]), wanted[[0, 1, 0, 0]])
    assert (few.asked, few.computed) == (4, 2)
    assert torch.equal(few(images), wanted)
    assert torch.equal(few(images[[4, 2]]), wanted[[4, 2]])
    assert (few.asked, few.computed) == (11, 5)
    assert torch.equal(few(images[[0]]), wanted[[0]])  # forgotten
    assert (few.asked, few.computed) == (12, 6)
    assert few(images[:0]).shape == (0, 512)


@settings(max_examples=25)
@given(
    st.integers(0, 2**31),
    st.sampled_from([(3, 5, 3, 1, 1), (8, 16, 1, 2, 0), (16, 8, 3, 2, 1), (3, 4, 7, 2, 0)]),
    st.booleans(),
    st.booleans(),
)
def test_one_dnn_and_floats_round_alike(seed: int, shape: tuple[int, ...], signed: bool, added: bool) -> None:
    if int8.convolution() is int8.by_floats:
        pytest.skip("oneDNN is not there")
    inputs, outputs, kernel, stride, padding = shape
    stream = torch.Generator().manual_seed(seed)

    def whole(low: int, high: int, *size: int) -> torch.Tensor:
        return torch.randint(low, high, size, generator=stream)

    weight = whole(-63, 64, outputs, inputs, kernel, kernel).to(torch.int8)
    scales, bias = torch.rand(outputs, generator=stream) * 0.01 + 0.001, torch.randn(outputs, generator=stream)
    part = int8.Convolution(weight, scales, bias, stride, padding, 0.03)
    maps = whole(0, 256, 2, inputs, 9, 9).to(torch.uint8).contiguous(memory_format=torch.channels_last)
    out = int8.Quantization(0.05, 128 if signed and not added else 0)
    around = None
    if added:
        shape_out = int8.by_floats(part, maps, out).shape
        values = whole(0, 256, *shape_out).to(torch.uint8).contiguous(memory_format=torch.channels_last)
        around = values, int8.Quantization(0.02, 128)
    wanted = int8.by_floats(part, maps, out, around).int()
    found = int8.by_onednn(part, maps, out, around).int()  # overwrites what is added
    assert (found - wanted).abs().max() <= 1 and (found != wanted).float().mean() < 0.02


@given(st.integers(1, 3), st.integers(2, 9), st.integers(2, 9))
def test_largest_of_cells(count: int, height: int, width: int) -> None:
    maps = torch.randint(0, 256, (count, 4, height, width), generator=torch.Generator().manual_seed(height))
    wanted = torch.nn.functional.max_pool2d(maps.float(), 3, 2, 1).to(torch.uint8)
    assert torch.equal(int8._pooled(maps.to(torch.uint8)), wanted)


def test_pictures_may_stay_away_from_onednn(frozen: FrozenEncoder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(int8, "convolution", lambda: int8.by_floats)
    network = ResNet18().eval().requires_grad_(False)
    network.load_state_dict(EXACT)
    slow = int8.IntegerResNet18(folded(network), WHOLE[RANGES])
    images = pictures(3, 64)
    torch.testing.assert_close(slow(images), frozen(images).float(), atol=0.02, rtol=0.05)


def test_missing_or_damaged_weights_are_named(weights: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CHMARL_RESNET18", str(tmp_path / "none.pt"))
    frozen_encoder.cache_clear()
    with pytest.raises(CheckpointError, match=r"none\.pt.*training\.pretrain.*CHMARL_RESNET18"):
        frozen_encoder("resnet18")
    (tmp_path / "cut.pt").write_bytes(weights.read_bytes()[:1000])
    with pytest.raises(CheckpointError, match=r"cut\.pt"):
        frozen_encoder("resnet18", str(tmp_path / "cut.pt"))
    torch.save({"conv1.weight": torch.zeros(3)}, tmp_path / "other.pt")
    with pytest.raises(CheckpointError, match=r"other\.pt"):
        frozen_encoder("resnet18", str(tmp_path / "other.pt"))
    torch.save({**EXACT, RANGES: torch.ones(3)}, tmp_path / "ranges.pt")
    with pytest.raises(CheckpointError, match=r"ranges\.pt.*20 ranges"):
        frozen_encoder("resnet18", str(tmp_path / "ranges.pt"))


def test_a_network_fits_no_other_frozen_weights(frozen: FrozenEncoder, monkeypatch: pytest.MonkeyPatch) -> None:
    space = spaces.Box(0, 255, (64, 64, 3), np.uint8)
    monkeypatch.setattr("chmarl_pb.learning.networks.images.frozen_encoder", lambda name: frozen)
    encode = build_encoder(space, 8, "resnet18")
    state = encode.state_dict()
    assert sum(value.numel() for value in state.values() if isinstance(value, torch.Tensor)) < 1_000_000
    encode.load_state_dict(state)
    other = FrozenEncoder("resnet18", EXACT)
    monkeypatch.setattr("chmarl_pb.learning.networks.images.frozen_encoder", lambda name: other)
    with pytest.raises(RuntimeError, match="other weights"):
        build_encoder(space, 8, "resnet18").load_state_dict(state)
    turned = build_encoder(spaces.Box(0, 255, (3, 64, 64), np.uint8), 8, "resnet18")
    assert turned(pictures(2, 64).permute(0, 3, 1, 2)).shape == (2, 8)


def test_networks_that_look_through_it_are_copied_without_it(frozen: FrozenEncoder) -> None:
    holder: Any = torch.nn.Linear(2, 2)
    holder.eye = frozen
    copied = copy.deepcopy(holder)
    assert copied.eye is frozen and copied.weight is not holder.weight
