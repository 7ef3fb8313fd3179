"""Weights that are told no directions from another robot."""

import torch
from torch import nn

from benchmarks.directions import hide_directions
from chmarl_pb.learning.networks import bearings, cells
from chmarl_pb.learning.networks.detections import LABELS, SHAPE, GroundedDetectionEncoder
from tests.learning.test_cells import asked


def test_directions_are_zeros_and_cells_as_they_were() -> None:
    encoder, detected = GroundedDetectionEncoder(), torch.zeros(1, *SHAPE)
    detected[0, LABELS.index("humanoid"), :4] = torch.tensor([1.0, -0.5, 0.5, 0.3])
    detected[0, LABELS.index("mug"), :4] = torch.tensor([1.0, 0.1, -0.3, 0.2])
    told = encoder.places(detected, asked())
    hide_directions(nn.ModuleList([encoder]))
    found = encoder.places(detected, asked())
    assert told[:, cells.SIZE :].any() and not found[:, cells.SIZE :].any()
    assert torch.equal(found[:, : cells.SIZE], told[:, : cells.SIZE]) and told.shape[1] == cells.SIZE + bearings.SIZE
