"""A detector of classes: which of the benchmark's things a picture shows, where, and how large.

The stem and the first layer of ResNet-18 say of each cell of 4 x 4 pixels what it shows; it is trained on the
segmentation of random views (``python -m training.pretrain --network detector``). It never sees a test home. Agents get
its detections in the place of the picture (:mod:`chmarl_pb.learning.networks.detections`).
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb import catalog
from chmarl_pb.learning.networks.detection_metrics import recognition_metrics
from chmarl_pb.learning.networks.detections import LABELS, detections
from chmarl_pb.learning.networks.int8 import RANGES, IntegerResNet18
from chmarl_pb.learning.networks.residual import ResNet18, folded

if TYPE_CHECKING:
    from chmarl_pb.learning.networks.labelled_views import Views  # needs PyBullet

CELL = 4  # pixels

_GRASPABLE = 10.0  # weight of a cell that shows one


class Detector(nn.Module):
    """The beginning of ResNet-18, and a linear layer for each cell."""

    learning_rate, batch = 3e-3, 64
    views, epochs = 60_000, 4  # to learn from, and passes over them

    def __init__(self) -> None:
        """Make the layers."""
        super().__init__()
        self.network = ResNet18(depth=1)
        self.cells = nn.Conv2d(self.network.features, len(LABELS) + 1, 1)

    def forward(self, images: Tensor) -> Tensor:
        """Return logits (B, C + 1, rows, columns) of the cells of uint8 pictures (B, height, width, 3)."""
        logits: Tensor = self.cells(self.network.maps(images))
        return logits

    def loss(self, views: "Views", rows: np.ndarray, done: float) -> Tensor:
        """Return the cross-entropy of what the cells of some views show; few cells show graspables, so they weigh more.

        Args:
            views: with labels.
            rows: numbers of the views.
            done: share of the training; nothing depends on it.
        """
        wanted = targets(torch.from_numpy(views.labels[rows]))
        logits = self(torch.from_numpy(views.images[rows])).float()
        weights = torch.tensor([_GRASPABLE if name in catalog.BENCHMARK.graspables else 1.0 for name in LABELS] + [1.0])
        return nn.functional.cross_entropy(logits, wanted, weights)

    def weights(self) -> dict[str, Tensor]:
        """Return what is kept of it."""
        return self.state_dict()

    def features(self, images: Tensor) -> Tensor:
        """Return what the frozen network gives, in float32."""
        return torch.stack([detections(logits) for logits in self(images)])

    @torch.no_grad()
    def measure(self, encode: Callable[[Tensor], Tensor], views: "Views") -> dict[str, Any]:
        """Return how well classes are recognised from detections, see ``recognition_metrics``."""
        parts = [encode(torch.from_numpy(views.images[first : first + 128])) for first in range(0, len(views), 128)]
        found = torch.cat(parts).float()
        return recognition_metrics(
            found[..., 0].numpy(), (found[..., 1:3] / found[..., :1].clamp(min=1e-3)).numpy(), views
        )


def targets(labels: Tensor) -> Tensor:
    """Return what each cell shows, (B, rows, columns), from labels of pixels (B, height, width).

    A graspable counts before a receptacle, and that before nothing, however few pixels it has in the cell: this is
    the order of ``LABELS``.
    """
    return -nn.functional.max_pool2d(-labels.float(), CELL).long()


def build(weights: dict[str, Tensor]) -> Callable[[Tensor], Tensor]:
    """Return what computes the detections (B, C, 4) of uint8 pictures (B, height, width, 3).

    Raises:
        RuntimeError: the weights do not fit.
    """
    detector = Detector()
    detector.load_state_dict({name: value for name, value in weights.items() if name != RANGES})
    if RANGES not in weights:
        raise RuntimeError(f"no {RANGES}")
    detector.eval().requires_grad_(False)
    network = IntegerResNet18(folded(detector.network), weights[RANGES])
    # One picture at a time: floats differ in the last bit with the size of the batch.
    return lambda images: torch.stack([detections(detector.cells(part[None])[0]) for part in network.maps(images)])
