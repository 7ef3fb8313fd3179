"""A detector of classes: which things and robots a picture shows, where, how large, and in which colour.

A pyramid of features (:mod:`chmarl_pb.learning.networks.pyramid`) and a linear layer say of each cell of 4 x 4 pixels
what it shows, and a table of colours (:mod:`chmarl_pb.learning.networks.colour_table`) adds what single pixels tell of
objects; they are trained on the segmentation of random views (``python -m training.pretrain --network detector``)
in homes of training and in generated ones of the endless split. They never see a validation or test home. Agents get
the detections in the place of the picture (:mod:`chmarl_pb.learning.networks.detections`).
"""

from collections.abc import Callable
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb import catalog
from chmarl_pb.learning.networks.colour_odds import fit_odds
from chmarl_pb.learning.networks.colour_table import ColourTable, counted_colours
from chmarl_pb.learning.networks.detection_losses import detection_loss
from chmarl_pb.learning.networks.detection_metrics import detection_metrics
from chmarl_pb.learning.networks.detections import LABELS, THINGS, detections
from chmarl_pb.learning.networks.int8 import RANGES
from chmarl_pb.learning.networks.pyramid import FEATURES, IntegerPyramid, Pyramid, pyramid_ranges
from chmarl_pb.learning.networks.view_parts import batch_of

if TYPE_CHECKING:
    from chmarl_pb.learning.networks.labelled_views import Views  # needs PyBullet

PARTS = 0.7  # share of the epochs that see parts of the views, which take a quarter of the time

_HELD = 20  # one of so many layouts is not counted, for the weight of colours to be fitted on
_COUNTED = 32_000  # most views whose colours are counted

_RARE = 0.01  # share of the cells that show a class, as it is believed before training
_COLOURS = "colours."  # before the names of the table's parts, in a file of weights
_AT_ONCE = 8  # pictures, whose maps fit the cache
_HEAD_LEVELS = 127  # of the last layer's weights, on each side of 0


class Detector(nn.Module):
    """The pyramid, a linear layer for each cell, and the table of colours, which is counted after they have learned.

    Attributes:
        classes: number of the first of ``LABELS`` that it knows.
    """

    learning_rate, batch = 3e-3, 64
    views, epochs = 96_000, 8  # to learn from, and passes over them
    #: (split, whether among lookalikes) -> share of the views.
    sources = {("train", False): 1 / 3, ("generated", True): 2 / 3}  # noqa: RUF012
    #: Name of a measurement -> its views.
    checks = {"home_6": ("val-unseen", False), "generated_val": ("generated-val", True)}  # noqa: RUF012

    def __init__(self, classes: int = len(LABELS)) -> None:
        """Make the layers; a detector learns all classes."""
        super().__init__()
        self.classes = classes
        self.network = Pyramid()
        self.cells = nn.Conv2d(FEATURES, classes + len(catalog.COLOURS), 1)
        assert self.cells.bias is not None
        nn.init.normal_(self.cells.weight, std=0.01)
        nn.init.zeros_(self.cells.bias)
        nn.init.constant_(self.cells.bias[:classes], float(np.log(_RARE / (1 - _RARE))))
        self.colours = ColourTable(classes=classes)

    def forward(self, images: Tensor) -> Tensor:
        """Return logits (B, classes + colours, rows, columns) of the cells of uint8 pictures (B, height, width, 3).

        First come those of the classes, each for itself, then those of the colours, one of which an object has.
        """
        logits: Tensor = self.cells(self.network(images))
        return logits + self.colours(images) if len(self.colours.codes) else logits

    def loss(self, views: "Views", rows: np.ndarray, done: float) -> Tensor:
        """Return the loss on some views, see ``detection_loss``.

        Args:
            views: with labels.
            rows: numbers of the views.
            done: share of the training; at first only parts of the views are seen, see ``batch_of``.
        """
        rng = np.random.default_rng([int(rows[0]), round(done * 1e6)])
        parts, device = batch_of(views, rows, rng, whole=done >= PARTS), self.cells.weight.device
        images, labels, colours = (torch.from_numpy(part).to(device) for part in parts)
        return detection_loss(self(images).float(), labels, colours)

    def finish(self, views: "Views") -> None:
        """Count the colours of the views, once all else is learned, and fit how much they count."""
        from chmarl_pb.learning.networks.labelled_views import LAYOUT_VIEWS  # needs PyBullet

        held = np.arange(len(views)) // LAYOUT_VIEWS % _HELD == _HELD - 1
        rows, others = np.flatnonzero(~held), np.flatnonzero(held)
        counted = counted_colours(views, rows[:: -(-len(rows) // _COUNTED)])
        self.colours = ColourTable(*counted, classes=self.classes)
        fit_odds(self.eval(), views, others if len(others) else rows)

    @torch.no_grad()
    def weights(self, images: np.ndarray) -> dict[str, Tensor]:
        """Return what is kept of it: weights with their normalisations folded in, in half precision, and ranges.

        Args:
            images: uint8 (B, height, width, 3), of which the ranges are.
        """
        network = deepcopy(self.network).eval().fold()
        kept = {f"network.{name}": value for name, value in network.state_dict().items()}
        kept |= {f"cells.{name}": value for name, value in self.cells.state_dict().items()}
        halved = {name: value.half().contiguous() for name, value in kept.items()}
        halved |= {_COLOURS + name: value.contiguous() for name, value in self.colours.state_dict().items()}
        return halved | {RANGES: pyramid_ranges(network, torch.from_numpy(images))}

    def features(self, images: Tensor) -> Tensor:
        """Return what the frozen network gives, in float32."""
        return torch.stack([detections(logits) for logits in self(images)])

    @torch.no_grad()
    def measure(self, encode: Callable[[Tensor], Tensor], views: "Views") -> dict[str, Any]:
        """Return how well classes are recognised from detections, see ``detection_metrics``."""
        parts = [encode(torch.from_numpy(views.images[first : first + 128])) for first in range(0, len(views), 128)]
        return detection_metrics(torch.cat(parts).float().numpy(), views)


def read(weights: dict[str, Tensor]) -> Detector:
    """Return the detector with kept weights, in floats; its normalisations are folded.

    Those from before there was a table of colours have none, and those from before robots were told know things alone.

    Raises:
        RuntimeError: the weights do not fit.
    """
    classes = len(weights["cells.bias"]) - len(catalog.COLOURS)
    if classes not in (THINGS, len(LABELS)):
        raise RuntimeError(f"of {classes} classes")
    detector = Detector(classes).eval().requires_grad_(False)
    detector.network.fold()
    table = {name.removeprefix(_COLOURS): value for name, value in weights.items() if name.startswith(_COLOURS)}
    if table and len(table) < len(detector.colours.state_dict()):
        raise RuntimeError("a part of the table of colours is missing")
    detector.colours = ColourTable(**table, classes=classes)
    rest = {name: value.float() for name, value in weights.items() if name != RANGES and not name.startswith(_COLOURS)}
    detector.load_state_dict(rest | {_COLOURS + name: part for name, part in detector.colours.state_dict().items()})
    if RANGES not in weights:
        raise RuntimeError(f"no {RANGES}")
    return detector


def build(weights: dict[str, Tensor]) -> Callable[[Tensor], Tensor]:
    """Return what computes the detections (B, C, 6) of uint8 pictures (B, height, width, 3).

    All is computed in whole numbers up to the logits, which are float32 with exact sums: they do not depend on the
    batch or the number of threads.

    Raises:
        RuntimeError: the weights do not fit.
    """
    detector = read(weights)
    network = IntegerPyramid(detector.network, weights[RANGES])
    head, bias = detector.cells.weight.flatten(1), detector.cells.bias
    assert bias is not None
    steps = head.abs().amax(dim=1, keepdim=True).clamp(min=1e-12) / _HEAD_LEVELS
    whole, steps, shift = (head / steps).round(), steps * network.unit, bias.unsqueeze(1)

    def detect(images: Tensor) -> Tensor:
        found = []
        for some in images.split(_AT_ONCE):
            for maps, colours in zip(network(some), detector.colours(some), strict=True):
                # Sums of whole numbers below 2 ** 24 are exact in float32, in any order.
                sums = whole @ maps.permute(1, 2, 0).flatten(0, 1).float().T
                found.append(detections((sums * steps + shift).unflatten(1, maps.shape[1:]) + colours))
        return torch.stack(found)

    return detect
