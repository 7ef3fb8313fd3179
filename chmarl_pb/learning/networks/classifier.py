"""What ResNet-18 learns from views of homes: which classes a picture shows, and where; and how well it does."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.networks.detection_metrics import recognition_metrics
from chmarl_pb.learning.networks.detections import THINGS
from chmarl_pb.learning.networks.frozen import with_hash
from chmarl_pb.learning.networks.int8 import RANGES, compact, ranges_of
from chmarl_pb.learning.networks.labelled_views import Views
from chmarl_pb.learning.networks.residual import FEATURES, ResNet18, folded

SMALL = 0.6  # share of the epochs with pictures of half the size, which take a quarter of the time


class Classifier(nn.Module):
    """ResNet-18 with three linear heads, which are thrown away afterwards."""

    learning_rate, batch = 2e-3, 64
    views, epochs = 20_000, 6  # to learn from, and passes over them
    #: (split, whether among lookalikes) -> share of the views.
    sources = {("train", False): 1.0}  # noqa: RUF012
    #: Name of a measurement -> its views.
    checks = {"home_6": ("val-unseen", False)}  # noqa: RUF012

    def __init__(self) -> None:
        """Make the layers."""
        super().__init__()
        self.network = ResNet18()
        self.cells = nn.Conv2d(FEATURES, THINGS, 1)
        self.present = nn.Linear(FEATURES, THINGS)
        self.centres = nn.Linear(FEATURES, 2 * THINGS)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return logits of cells (B, C, GRID, GRID) and of presence (B, C), and centres (B, C, 2)."""
        maps = self.network.maps(images)
        features = maps.mean(dim=(2, 3))
        return self.cells(maps), self.present(features), self.centres(features).unflatten(1, (-1, 2))

    def loss(self, views: Views, rows: np.ndarray, done: float) -> Tensor:
        """Return the sum of three losses on some views: two cross-entropies and, of what is present, a distance.

        Args:
            views: with labels.
            rows: numbers of the views.
            done: share of the training; at first, every second row and column of the pictures is left out.
        """
        every = 2 if done < SMALL else 1
        device = self.cells.weight.device
        images = torch.from_numpy(views.images[rows, ::every, ::every]).to(device)
        cells, present, centres = (
            torch.from_numpy(part[rows, :THINGS]).float().to(device)
            for part in (views.cells, views.present, views.centres)
        )
        predicted_cells, predicted_present, predicted_centres = self(images)
        shown = nn.functional.binary_cross_entropy_with_logits(predicted_present, present)
        predicted_cells = nn.functional.interpolate(predicted_cells, cells.shape[-1])  # small pictures have fewer
        placed = nn.functional.binary_cross_entropy_with_logits(predicted_cells, cells)
        far = ((predicted_centres - centres).abs().sum(dim=2) * present).sum() / present.sum().clamp(min=1)
        loss: Tensor = 10 * shown + 10 * placed + 0.3 * far  # about equal at the start
        return loss

    def finish(self, views: Views) -> None:
        """Do what is left once all is learned: nothing."""

    @torch.no_grad()
    def weights(self, images: np.ndarray) -> dict[str, Tensor]:
        """Return what is kept: weights in whole numbers, the ranges of the network, and the fingerprint of both before.

        Args:
            images: uint8 (B, height, width, 3), of which the ranges are.
        """
        network = folded(deepcopy(self.network).eval())
        ranges = {RANGES: ranges_of(network, torch.from_numpy(images))}
        return with_hash({**compact(network), **ranges}, {**self.network.state_dict(), **ranges})

    def features(self, images: Tensor) -> Tensor:
        """Return what the frozen network gives, in float32."""
        features: Tensor = self.network(images)
        return features

    @torch.no_grad()
    def measure(self, encode: Callable[[Tensor], Tensor], views: Views) -> dict[str, Any]:
        """Return how well classes are recognised from frozen features, see ``recognition_metrics``."""
        parts = [encode(torch.from_numpy(views.images[first : first + 128])) for first in range(0, len(views), 128)]
        features = torch.cat(parts).float()
        centres = self.centres(features).unflatten(1, (-1, 2))
        return recognition_metrics(self.present(features).numpy(), centres.numpy(), views)
