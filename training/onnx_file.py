"""The detector as an ONNX file, for other libraries; ``python -m training.pretrain --network detector --onnx FILE``."""

from pathlib import Path

import torch
from torch import Tensor, nn

from chmarl_pb import extras
from chmarl_pb.files import replacing
from chmarl_pb.learning.networks.colour_table import ColourTable, codes_of, levels_of
from chmarl_pb.learning.networks.detector import Detector, read
from chmarl_pb.learning.networks.frozen import read_weights
from chmarl_pb.learning.networks.pyramid import CELL
from chmarl_pb.learning.storage.checkpoint import reading
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE


class Exported(nn.Module):
    """What the file computes, in float32.

    Input ``images``, uint8 (B, 128, 128, 3). Outputs ``confidence`` (B, classes), how sure the detector is that a
    picture shows each of ``LABELS``, and ``cells`` (B, classes + colours, 32, 32), the logits of cells of 4 x 4 pixels.
    """

    def __init__(self, detector: Detector):
        """Take a trained detector."""
        super().__init__()
        self.detector = detector

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Return confidence and cells."""
        cells, table = self.detector.cells(self.detector.network(images)), self.detector.colours
        if len(table.codes):
            cells = cells + table.worth(_levels(table, images)).permute(0, 3, 1, 2)
        return torch.sigmoid(cells[:, : self.detector.classes].amax(dim=(2, 3))), cells


def _levels(table: ColourTable, images: Tensor) -> Tensor:
    """Return the same as ``table.levels``, from the shares of all pixels, most of which are zeros.

    It takes longer, but scatters nothing: onnxruntime adds to one row from several threads, and loses some of it.
    """
    shares = nn.functional.pad(table.shares.float(), (0, 0, 1, 0))[table.rows[codes_of(images).long()].long()]
    cells = shares.unflatten(2, (-1, CELL)).unflatten(1, (-1, CELL))
    return levels_of(cells.sum(dim=(2, 4)), (cells > 0).float().sum(dim=(2, 4)))


def read_detector(path: Path) -> Detector:
    """Return the detector in a file of weights, in floats.

    Raises:
        CheckpointError: there is none, or its weights do not fit.
    """
    with reading(path):
        return read(read_weights(path, "detector"))


def write_onnx(detector: Detector, path: Path) -> None:
    """Write a trained detector as an ONNX file for any number of pictures of 128 x 128 pixels.

    Raises:
        MissingExtraError: the packages for it are not there.
    """
    extras.check("an ONNX file", "onnx", "onnx", "onnxscript")
    images = torch.zeros(2, VISIBILITY_SIZE, VISIBILITY_SIZE, 3, dtype=torch.uint8)
    with replacing(path) as temporary:
        torch.onnx.export(
            Exported(detector).eval(), (images,), str(temporary), input_names=["images"],
            output_names=["confidence", "cells"], dynamic_shapes=({0: torch.export.Dim("pictures", min=1)},),
            dynamo=True, external_data=False, verbose=False,
        )  # fmt: skip
