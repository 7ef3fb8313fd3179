"""The detector: what its cells are taught, what it tells of a picture, and who reads it."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from chmarl_pb import catalog
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import MissingExtraError
from chmarl_pb.learning.networks import build_encoder, int8
from chmarl_pb.learning.networks.colour_table import LEVELS, SHARES, ColourTable, codes_of
from chmarl_pb.learning.networks.detection_losses import detection_loss, targets
from chmarl_pb.learning.networks.detections import (
    HEADS,
    LABELS,
    PLACE,
    SHAPE,
    THING,
    THINGS,
    DetectionEncoder,
    GroundedDetectionEncoder,
    detections,
    share_of,
)
from chmarl_pb.learning.networks.detector import Detector, build, read
from chmarl_pb.learning.networks.frozen import FrozenEncoder, frozen_encoder
from chmarl_pb.learning.networks.kept_features import FeatureEnv
from chmarl_pb.learning.networks.match import Wanted
from chmarl_pb.learning.networks.parts import Asked
from chmarl_pb.learning.networks.pyramid import CELL, IntegerPyramid, Pyramid, pyramid_ranges
from chmarl_pb.learning.networks.tables import EMBEDDING
from chmarl_pb.learning.policies.eyes import DetectorEyes
from chmarl_pb.learning.storage.checkpoint import CheckpointError
from tests.helpers.frozen_weights import pictures
from training.onnx_file import write_onnx

NOTHING = len(LABELS)
OUTPUTS = len(LABELS) + len(catalog.COLOURS)  # logits of a cell
CLASSES = len(catalog.BENCHMARK.rows) + 1
GRASPABLE, RECEPTACLE = LABELS.index("mug"), LABELS.index("sofa")


RED = catalog.COLOUR_IDS["red"]


@pytest.fixture(scope="module")
def weights() -> dict[str, torch.Tensor]:
    """Random weights with ranges."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        detector = Detector()
        torch.nn.init.normal_(detector.cells.weight)
        assert detector.cells.bias is not None
        torch.nn.init.zeros_(detector.cells.bias)  # so that something is seen
        images = pictures(8, 64)
        codes = torch.unique(codes_of(images))[::3].int()  # some colours are known, and tell something
        shares = torch.randint(256, (len(codes), SHARES)).to(torch.uint8)
        detector.colours = ColourTable(codes, shares, torch.randn(2, LEVELS))
        return detector.weights(images.numpy())


def logits_of(*cells: tuple[int, int | slice, int | slice, float], size: int = 32) -> torch.Tensor:
    """Return logits of one picture: what is not named is not there."""
    logits = torch.full((OUTPUTS, size, size), -20.0)
    logits[NOTHING:] = 0.0
    for output, row, column, value in cells:
        logits[output, row, column] = value
    return logits


@pytest.fixture(scope="module")
def encoder(weights: dict[str, torch.Tensor]) -> FrozenEncoder:
    """A detector that has learned nothing."""
    return FrozenEncoder("detector", weights)


def test_a_cell_shows_what_can_be_picked_up_before_what_carries_it() -> None:
    labels = torch.full((1, 8, 12), NOTHING, dtype=torch.uint8)
    colours = torch.zeros_like(labels)
    labels[0, :, :6] = RECEPTACLE
    labels[0, 3, 0], colours[0, 3, 0] = GRASPABLE, RED
    wanted, colour = targets(labels, colours)
    assert wanted[0].tolist() == [[GRASPABLE, RECEPTACLE, NOTHING], [RECEPTACLE, RECEPTACLE, NOTHING]]
    assert colour[0].tolist() == [[RED, 0, 0], [0, 0, 0]]
    assert CELL == 4


def test_what_is_told_well_has_a_small_loss() -> None:
    labels, colours = (torch.zeros(1, 32, 32, dtype=torch.uint8) for _ in range(2))
    labels[:] = NOTHING
    labels[0, :4, 4:8], colours[0, :4, 4:8] = GRASPABLE, RED
    hue = NOTHING + RED - 1
    told = logits_of((GRASPABLE, 0, 1, 20.0), (hue, 0, 1, 20.0), size=8)
    other = logits_of((GRASPABLE, 0, 1, 20.0), (hue + 1, 0, 1, 20.0), size=8)
    too_much = logits_of((GRASPABLE, 0, 1, 20.0), (hue, 0, 1, 20.0), (RECEPTACLE, 5, 5, 20.0), size=8)
    losses = [float(detection_loss(part[None], labels, colours)) for part in (told, other, too_much, logits_of(size=8))]
    assert losses[0] < 1e-3 and min(losses[1:]) > 1


def test_detections_say_how_sure_where_how_large_and_in_which_colour() -> None:
    hue = NOTHING + RED - 1
    found = detections(logits_of((GRASPABLE, 0, slice(30, 32), 20.0), (hue, 0, slice(30, 32), 5.0)))
    assert found.shape == SHAPE
    confidence, *rest, colour, sure = found[GRASPABLE].tolist()  # two cells in the corner at the top right
    assert confidence == pytest.approx(1.0)
    assert rest == pytest.approx([1 - 1 / 31, -1.0, np.log2(3) / np.log2(1025)], abs=1e-4)
    assert colour == RED and sure == pytest.approx(np.exp(5) / (np.exp(5) + 10), abs=1e-3)
    assert not found[torch.arange(NOTHING) != GRASPABLE].any()


def test_half_a_confidence_halves_place_and_size() -> None:
    half, sure = (detections(logits_of((RECEPTACLE, 3, 4, value), size=8))[RECEPTACLE] for value in (0.0, 30.0))
    torch.testing.assert_close(half, sure / 2)
    assert not sure[4:].any()  # receptacles have no colour by name


def test_detectors_from_before_robots_were_told_know_things_alone(weights: dict[str, torch.Tensor]) -> None:
    known = torch.cat([torch.arange(THINGS), torch.arange(NOTHING, OUTPUTS)])
    before = {name: part[known] if name.startswith("cells.") else part for name, part in weights.items()}
    images = pictures(3, 64)
    found, now = FrozenEncoder("detector", before), FrozenEncoder("detector", weights)
    assert (found.shape, now.shape) == ((THINGS, 6), SHAPE)
    assert now(images)[:, THINGS:].any() and torch.equal(found(images), now(images)[:, :THINGS])
    assert GroundedDetectionEncoder(classes=THINGS).locates < GroundedDetectionEncoder().locates  # no directions
    with pytest.raises(RuntimeError, match="of 5 classes"):
        build(
            {name: part[: 5 + len(catalog.COLOURS)] if name == "cells.bias" else part for name, part in weights.items()}
        )


def test_whole_numbers_are_near_floats_and_the_same_by_either_way(monkeypatch: pytest.MonkeyPatch) -> None:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = Pyramid().eval().requires_grad_(False).fold()
    images = pictures(3, 70)  # no multiple of 32: maps are cut to each other
    ranges = pyramid_ranges(network, images)
    whole = IntegerPyramid(network, ranges)
    found, exact = whole(images), network(images)
    assert found.dtype == torch.uint8 and found.shape == exact.shape
    assert (found * whole.unit - exact).abs().mean() < 0.03 * exact.abs().mean()
    monkeypatch.setattr("chmarl_pb.learning.networks.pyramid.convolution", lambda: int8.by_floats)
    assert torch.equal(IntegerPyramid(network, ranges)(images), found)
    with pytest.raises(RuntimeError, match="ranges are needed"):
        IntegerPyramid(network, ranges[1:])


def test_a_picture_is_seen_alike_whatever_it_is_seen_with(encoder: FrozenEncoder) -> None:
    images = pictures(19, 64)  # more than are computed at once
    together = encoder(images)
    assert together.shape == (19, *SHAPE) and together.dtype == torch.float16
    encoder._known.clear()
    assert torch.equal(torch.cat([encoder(images[number : number + 1]) for number in range(19)]), together)


def test_an_encoder_can_be_sent_to_other_processes(encoder: FrozenEncoder) -> None:
    images = pictures(2, 64)
    found, copy = encoder(images), pickle.loads(pickle.dumps(encoder))
    assert copy is not encoder and copy.fingerprint == encoder.fingerprint
    assert torch.equal(copy(images), found)


def test_agents_read_detections_by_their_instruction(encoder: FrozenEncoder) -> None:
    env = FeatureEnv(HouseholdEnv("visual", split="val-unseen", image_size=64), encoder)
    space = env.observation_space("humanoid")
    observations, _ = env.reset(seed=0)
    assert space.contains(observations["humanoid"])
    torch.manual_seed(0)
    encode = build_encoder(space, 16, "detector")
    seen = {key: torch.from_numpy(part)[None] for key, part in observations["humanoid"].items()}
    blank = seen | {"image": torch.zeros_like(seen["image"])}
    other = seen | {"instruction": seen["instruction"].flip(1).clamp(max=1)}
    assert encode(seen).shape == (1, 16)
    assert not torch.equal(encode(seen), encode(blank)) and not torch.equal(encode(seen), encode(other))
    env.close()


def test_gates_open_by_the_words_of_an_instruction() -> None:
    torch.manual_seed(0)
    part, detected = DetectionEncoder(), torch.zeros(1, *SHAPE)
    detected[0, GRASPABLE, :PLACE] = torch.tensor([0.8, 0.4, -0.2, 0.3])  # in no known colour
    one, other = (part(detected, Asked(words))[0] for words in torch.randn(2, 1, EMBEDDING))
    assert torch.equal(one[:EMBEDDING], other[:EMBEDDING])  # the sum over all classes
    gated, else_gated = one[EMBEDDING:].view(HEADS, -1), other[EMBEDDING:].view(HEADS, -1)
    assert (gated[:, 0] != else_gated[:, 0]).all()
    gates = gated[:, :1] / 0.8
    torch.testing.assert_close(gated[:, :PLACE], gates * detected[0, GRASPABLE, :PLACE])


@pytest.mark.parametrize("size", [32, 128, 256])
def test_the_part_of_a_picture_that_a_thing_fills_does_not_depend_on_its_size(size: int) -> None:
    half, output = size // 8, GRASPABLE
    row = detections(logits_of((output, slice(0, half), slice(0, half), 6.0), size=size // 4))[output]
    assert share_of(float(row[3] / row[0])) == pytest.approx(0.25, abs=1e-4)


def test_weights_without_ranges_are_refused(weights: dict[str, torch.Tensor], tmp_path: Path) -> None:
    torch.save({name: value for name, value in weights.items() if name != "ranges"}, tmp_path / "weights.pt")
    with pytest.raises(CheckpointError, match="no weights of detector: no ranges"):
        frozen_encoder("detector", str(tmp_path / "weights.pt"))
    with pytest.raises(CheckpointError, match=r"training\.pretrain --network detector"):
        frozen_encoder("detector", str(tmp_path / "none.pt"))


@pytest.mark.parametrize(
    ("part", "change", "words"),
    [
        ("cells.bias", lambda part: part * torch.nan, "holds what is no number"),
        ("ranges", lambda part: part.double().fill_(torch.inf), "holds what is no number"),
        ("colours.shares", lambda part: part[:10].contiguous(), "shares of .* colours are not"),
        ("colours.shares", lambda part: part.float(), "shares of .* colours are not"),
        ("colours.codes", lambda part: part - 2**21, "codes of colours are no such codes"),
        ("colours.odds", lambda part: part[:1].clone(), "odds of colours are not"),
    ],
)
def test_weights_whose_parts_do_not_fit_are_refused(
    part: str, change: Callable[[torch.Tensor], torch.Tensor], words: str, weights: dict[str, torch.Tensor],
    tmp_path: Path,
) -> None:  # fmt: skip
    torch.save(weights | {part: change(weights[part])}, tmp_path / "weights.pt")
    with pytest.raises(CheckpointError, match=f"no weights of detector: .*{words}"):
        frozen_encoder("detector", str(tmp_path / "weights.pt"))


def test_a_table_of_colours_is_whole(weights: dict[str, torch.Tensor], tmp_path: Path) -> None:
    torch.save({name: value for name, value in weights.items() if name != "colours.odds"}, tmp_path / "weights.pt")
    with pytest.raises(CheckpointError, match="a part of the table of colours is missing"):
        frozen_encoder("detector", str(tmp_path / "weights.pt"))


def test_agents_are_told_whether_the_colour_is_asked_for(encoder: FrozenEncoder) -> None:
    env = FeatureEnv(HouseholdEnv("visual", split="val-unseen", image_size=64), encoder)
    observations, _ = env.reset(seed=0)
    torch.manual_seed(0)
    encode = build_encoder(env.observation_space("humanoid"), 16, "detector", "grounded")
    seen = {key: torch.from_numpy(part)[None] for key, part in observations["humanoid"].items()}
    image = torch.zeros_like(seen["image"])
    image[0, GRASPABLE] = torch.tensor([1.0, 0.0, 0.0, 0.5, RED, 0.9])
    other = image.clone()
    other[0, GRASPABLE, 4] = RED + 1
    assert not torch.equal(encode(seen | {"image": image}), encode(seen | {"image": other}))
    env.close()


def test_what_is_not_seen_tells_a_grounded_pool_nothing(encoder: FrozenEncoder) -> None:
    torch.manual_seed(0)
    part, wanted = GroundedDetectionEncoder(), Wanted(torch.zeros(1, 2, CLASSES))
    wanted.classes[0, 0, catalog.BENCHMARK.class_ids[LABELS[GRASPABLE]]] = 1.0
    asked = Asked(torch.zeros(1, EMBEDDING), wanted)
    empty, one = torch.zeros(1, *SHAPE), torch.zeros(1, *SHAPE)
    one[0, GRASPABLE, :4] = torch.tensor([0.5, 0.1, -0.2, 0.3])
    assert not part(empty, asked).any()
    total, about_x, about_y = part(one, asked).split([THING, *[(part.size - THING) // 2] * 2], dim=1)
    assert total.any() and not about_y.any()
    torch.testing.assert_close(about_x[0, :4], one[0, GRASPABLE, :4])


def test_a_grounded_pool_has_the_mean_of_what_is_seen_and_where_it_is() -> None:
    torch.manual_seed(0)
    part = GroundedDetectionEncoder()
    asked = Asked(torch.zeros(1, EMBEDDING), Wanted(torch.zeros(1, 2, CLASSES)))
    pairs = torch.zeros(3, *SHAPE)
    pairs[0, GRASPABLE, 0] = pairs[1, RECEPTACLE, 0] = pairs[2, [GRASPABLE, RECEPTACLE], 0] = 1.0
    first, second, both = (part(pair[None], asked)[:, :THING] for pair in pairs)
    torch.testing.assert_close(both, (first + second) / 2)
    moved = pairs[:1].clone()
    moved[0, GRASPABLE, 1] = 1.0
    assert not torch.equal(part(moved, asked)[:, :THING], first)


def test_among_lookalikes_a_class_in_another_colour_is_not_what_is_asked_for() -> None:
    torch.manual_seed(0)
    part = GroundedDetectionEncoder(lookalikes=True)
    wanted = Wanted(torch.zeros(1, 2, CLASSES), torch.zeros(1, 2, len(catalog.COLOURS) + 1))
    wanted.classes[0, :, catalog.BENCHMARK.class_ids[LABELS[GRASPABLE]]] = 1.0
    wanted.colours[0, 0, RED] = 1.0  # type: ignore[index]
    asked = Asked(torch.zeros(1, EMBEDDING), wanted)
    red, blue, unsure = (torch.zeros(1, *SHAPE) for _ in range(3))
    for picture, colour, sure in ((red, RED, 1.0), (blue, RED + 1, 1.0), (unsure, RED + 1, 0.25)):
        picture[0, GRASPABLE] = torch.tensor([1.0, 0.0, 0.0, 0.5, colour, sure])
    about_x = [part(picture, asked)[0, THING].item() for picture in (red, blue, unsure)]
    assert [round(one, 5) for one in about_x] == [1.0, 0.0, 0.75]
    places = part.places(blue, asked).view(2, -1)
    assert not places[0].any() and places[1].max() > 0.9  # Y has no colour
    assert part.places(red, asked).view(2, -1)[0].max() > 0.9


def test_eyes_see_what_the_detector_is_sure_of(encoder: FrozenEncoder, monkeypatch: pytest.MonkeyPatch) -> None:
    logits = logits_of(
        (GRASPABLE, 0, slice(30, 32), 20.0), (NOTHING + RED - 1, 0, slice(30, 32), 5.0),
        (RECEPTACLE, slice(16, 32), slice(None), 0.5),  # 62 per cent
    )  # fmt: skip
    found = detections(logits).half()[None]
    monkeypatch.setattr(encoder, "_network", lambda images: found.float())
    picture = np.zeros((128, 128, 3), np.uint8)
    mug, sofa = DetectorEyes(encoder, 0.5)(picture)
    assert (mug.name, sofa.name) == ("mug", "sofa") and (mug.colour, sofa.colour) == (RED, 0)
    assert (mug.across, mug.down) == pytest.approx((30.5 / 31, 0.0), abs=2e-3)
    assert mug.share == pytest.approx(2 / 1024, rel=0.05) and sofa.share == pytest.approx(0.5, rel=0.05)
    assert [sight.name for sight in DetectorEyes(encoder, 0.9)(picture)] == ["mug"]


def test_an_onnx_file_computes_the_same(weights: dict[str, torch.Tensor], tmp_path: Path) -> None:
    pytest.importorskip("onnxscript")
    onnxruntime = pytest.importorskip("onnxruntime")
    detector, images = read(weights), pictures(3, 128)
    write_onnx(detector, tmp_path / "detector.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "detector.onnx")
    confidence, cells = session.run(None, {"images": images.numpy()})
    expected = detector(images)
    np.testing.assert_allclose(confidence, torch.sigmoid(expected[:, :NOTHING].amax(dim=(2, 3))), atol=1e-5)
    np.testing.assert_allclose(cells, expected, atol=1e-4)
    for _ in range(20):  # nor does it depend on its threads
        np.testing.assert_array_equal(session.run(None, {"images": images.numpy()})[1], cells)
    whole = build(weights)(images)[..., 0]
    np.testing.assert_allclose(confidence * (whole > 0).numpy(), whole, atol=0.05)


def test_without_its_packages_no_onnx_file_is_written(
    weights: dict[str, torch.Tensor], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("chmarl_pb.extras.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match="an ONNX file needs the extra 'onnx'"):
        write_onnx(read(weights), tmp_path / "detector.onnx")
    assert not list(tmp_path.iterdir())
