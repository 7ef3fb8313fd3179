"""The detector as eyes of policies that read scene graphs, ``search@detector``: entry point ``chmarl_pb.eyes``."""

import numpy as np
import torch
from numpy.typing import NDArray

from chmarl_pb.learning.networks.detections import LABELS, PLACE, THINGS, share_of
from chmarl_pb.learning.networks.frozen import FrozenEncoder, frozen_encoder
from chmarl_pb.learning.threads import threads
from chmarl_pb.policies.eyes import Sight

SURE = 0.02  # confidence from which on a class counts as seen, chosen on validation tasks by benchmarks.eyes


class DetectorEyes:
    """Sees the classes that a detector is sure of.

    Attributes:
        fingerprint: sha256 of the detector's weights.
    """

    def __init__(self, detector: FrozenEncoder, sure: float = SURE):
        """Take a detector, and the confidence from which on a class counts as seen, 0 to 1."""
        self.fingerprint = detector.fingerprint
        self._detector, self._sure = detector, sure

    @threads(1)
    def __call__(self, image: NDArray[np.uint8]) -> list[Sight]:
        """Return the things in a picture (height, width, 3), one of each class; robots are left out."""
        found = self._detector(torch.from_numpy(image)[None])[0].double().numpy()
        return [
            self._sight(number, found[number])
            for number in np.flatnonzero(found[:THINGS, 0] >= max(self._sure, 1e-6)).tolist()
        ]

    def _sight(self, number: int, row: NDArray[np.float64]) -> Sight:
        """Return a thing from its row of detections, whose place and size are times the confidence."""
        column, line, size = (row[1:PLACE] / row[0]).tolist()
        return Sight(LABELS[number], (column + 1) / 2, (line + 1) / 2, share_of(size), int(row[PLACE]))


def detector() -> DetectorEyes:
    """Return eyes with the weights in the detector's default file.

    Raises:
        CheckpointError: there are none; they are made by ``python -m training.pretrain --network detector``.
    """
    return DetectorEyes(frozen_encoder("detector"))
