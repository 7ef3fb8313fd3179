"""The detector: what its cells are taught, what it tells of a picture, and who reads it."""

from pathlib import Path

import numpy as np
import pytest
import torch

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning.networks import build_encoder
from chmarl_pb.learning.networks.detections import LABELS, SHAPE, detections
from chmarl_pb.learning.networks.detector import CELL, Detector, targets
from chmarl_pb.learning.networks.frozen import FrozenEncoder, frozen_encoder
from chmarl_pb.learning.networks.kept_features import FeatureEnv
from chmarl_pb.learning.policies.eyes import DetectorEyes
from chmarl_pb.learning.runs.checkpoint import CheckpointError
from tests.helpers.frozen_weights import pictures
from training.pretrain import with_ranges

NOTHING = len(LABELS)
GRASPABLE, RECEPTACLE = LABELS.index("mug"), LABELS.index("sofa")


@pytest.fixture(scope="module")
def weights() -> dict[str, torch.Tensor]:
    """Random weights with ranges."""
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return with_ranges(Detector().eval(), pictures(8, 64).numpy())


@pytest.fixture(scope="module")
def encoder(weights: dict[str, torch.Tensor]) -> FrozenEncoder:
    """A detector that has learned nothing."""
    return FrozenEncoder("detector", weights)


def test_a_cell_shows_what_can_be_picked_up_before_what_carries_it() -> None:
    labels = torch.full((1, 8, 12), NOTHING, dtype=torch.uint8)
    labels[0, :, :6] = RECEPTACLE
    labels[0, 3, 0] = GRASPABLE
    assert targets(labels)[0].tolist() == [[GRASPABLE, RECEPTACLE, NOTHING], [RECEPTACLE, RECEPTACLE, NOTHING]]
    assert CELL == 4


def test_detections_say_how_sure_where_and_how_large() -> None:
    logits = torch.zeros(NOTHING + 1, 32, 32)
    logits[NOTHING] = 20.0
    logits[GRASPABLE, 0, 30:] = 40.0  # two cells in the corner at the top right
    found = detections(logits)
    assert found.shape == SHAPE
    confidence, *rest = found[GRASPABLE].tolist()
    assert confidence == pytest.approx(1.0)
    assert rest == pytest.approx([1 - 1 / 31, -1.0, np.log2(3) / np.log2(1025)], abs=1e-4)
    assert not found[torch.arange(NOTHING) != GRASPABLE].any()


def test_half_a_confidence_halves_all() -> None:
    logits = torch.zeros(NOTHING + 1, 4, 4)
    logits[NOTHING] = logits[RECEPTACLE] = 30.0
    sure = logits.clone()
    sure[NOTHING] = 0.0
    torch.testing.assert_close(detections(logits)[RECEPTACLE], detections(sure)[RECEPTACLE] / 2)


def test_a_picture_is_seen_alike_whatever_it_is_seen_with(encoder: FrozenEncoder) -> None:
    images = pictures(5, 64)
    together = encoder(images)
    assert together.shape == (5, *SHAPE) and together.dtype == torch.float16
    encoder._known.clear()
    assert torch.equal(torch.cat([encoder(images[number : number + 1]) for number in range(5)]), together)


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


def test_weights_without_ranges_are_refused(weights: dict[str, torch.Tensor], tmp_path: Path) -> None:
    torch.save({name: value for name, value in weights.items() if name != "ranges"}, tmp_path / "weights.pt")
    with pytest.raises(CheckpointError, match="no weights of detector: no ranges"):
        frozen_encoder("detector", str(tmp_path / "weights.pt"))
    with pytest.raises(CheckpointError, match=r"training\.pretrain --network detector"):
        frozen_encoder("detector", str(tmp_path / "none.pt"))


def test_eyes_see_what_the_detector_is_sure_of(encoder: FrozenEncoder, monkeypatch: pytest.MonkeyPatch) -> None:
    logits = torch.zeros(NOTHING + 1, 32, 32)
    logits[NOTHING] = 20.0
    logits[GRASPABLE, 0, 30:] = 40.0
    logits[RECEPTACLE, 16:, :] = 20.5  # 62 per cent
    found = detections(logits).half()[None]
    monkeypatch.setattr(encoder, "_network", lambda images: found.float())
    picture = np.zeros((128, 128, 3), np.uint8)
    mug, sofa = DetectorEyes(encoder, 0.5)(picture)
    assert (mug.name, sofa.name) == ("mug", "sofa")
    assert (mug.across, mug.down) == pytest.approx((30.5 / 31, 0.0), abs=2e-3)
    assert mug.share == pytest.approx(2 / 1024, rel=0.05) and sofa.share == pytest.approx(0.5, rel=0.05)
    assert [sight.name for sight in DetectorEyes(encoder, 0.9)(picture)] == ["mug"]
