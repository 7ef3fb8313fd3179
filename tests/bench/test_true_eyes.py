"""What pictures truly show, as the detector would tell it if it made no mistakes."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from benchmarks.true_eyes import TRUE, TrueEyes, detections_of
from chmarl_pb import catalog
from chmarl_pb.learning.networks.detections import LABELS, detections
from chmarl_pb.learning.storage.checkpoint import CheckpointError

MUG, SOFA, ROBOT = (LABELS.index(name) for name in ("mug", "sofa", "humanoid"))


def test_truth_is_what_a_sure_detector_finds() -> None:
    segmentation = np.full((128, 128), -1)
    segmentation[40:48, 80:96], segmentation[64:128, :], segmentation[0, :3] = 0, 1, 3  # the last has too few pixels
    logits = torch.full((len(LABELS) + len(catalog.COLOURS), 32, 32), -20.0)
    logits[MUG, 10:12, 20:24], logits[SOFA, 16:32] = 20.0, 20.0
    names = ("mug_1", "bedroom/sofa_1", "bedroom/wall_1", "fork_1")
    found = detections_of(segmentation, ("mug", "sofa", "wall", "fork"), names)
    torch.testing.assert_close(found[:, :4], detections(logits)[:, :4], atol=0.02, rtol=0)  # a cell is 0.06 wide
    assert found[MUG, 0] == 1 and found[LABELS.index("fork"), 0] == 0


def test_a_class_has_the_colour_of_its_most_pixels() -> None:
    segmentation = np.full((128, 128), -1)
    segmentation[:8, :8], segmentation[20:40, 20:40], segmentation[100:, :] = 0, 1, 2
    found = detections_of(segmentation, ("mug", "mug", "sofa"), ("mug_3", "mug_7", "bedroom/sofa_1"))
    assert found[MUG, 4:].tolist() == [7, 1] and found[SOFA, 4:].tolist() == [0, 0]


@pytest.mark.parametrize(
    ("name", "told"),
    [("none", set()), ("receptacles", {SOFA}), ("objects", {MUG}), ("robots", {ROBOT}), ("all", {MUG, SOFA, ROBOT})],
)
def test_the_truth_is_told_of_some_classes(name: str, told: set[int]) -> None:
    assert set(range(len(LABELS))[TRUE[name]]) & {MUG, SOFA, ROBOT} == told


@pytest.mark.parametrize("encoder", [None, SimpleNamespace(name="resnet18")])
def test_only_what_the_detector_finds_can_be_put_right(encoder: object) -> None:
    with pytest.raises(CheckpointError, match="do not see by the detector"):
        TrueEyes(SimpleNamespace(batched=SimpleNamespace(encoder=encoder)), None, slice(0))
