"""How much the colours of pixels count beside what the network says: fitted by logistic regression on views."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from chmarl_pb.learning.networks.colour_table import LEVELS
from chmarl_pb.learning.networks.detection_losses import targets
from chmarl_pb.learning.networks.detections import OBJECTS

if TYPE_CHECKING:
    from chmarl_pb.learning.networks.detector import Detector
    from chmarl_pb.learning.networks.labelled_views import Views

_MOST = 400  # views that suffice
_NEAR = 1e-3  # weight of the squared distance from where the numbers begin


def log_odds() -> Tensor:
    """Return (LEVELS,) what evidence of each level is worth before anything is fitted."""
    share = torch.arange(LEVELS) / (LEVELS - 1)
    return torch.log((share + 0.01) / (1.01 - share))


def fit_odds(detector: "Detector", views: "Views", rows: NDArray[np.integer]) -> None:
    """Let the network's logits and the evidence of colours add up to how likely classes and colours are.

    Of objects, shift + scale * logit + weight * log odds of the evidence, in the surest cell of a picture, is to tell
    whether the picture shows the class; of colours, scale * logit + weight * log odds is to tell that of a cell. All
    objects share these numbers. The scale goes into the last layer, the rest into the table.

    Args:
        detector: with a table that was counted over other views; its odds and its last layer are changed.
        views: with labels.
        rows: numbers of views to fit them on.
    """
    rows, worth = rows[np.linspace(0, len(rows), min(_MOST, len(rows)), endpoint=False).astype(int)], log_odds()
    with torch.no_grad():
        images = torch.from_numpy(views.images[rows])
        logits = torch.cat([detector.cells(detector.network(part)) for part in images.split(32)])
        evidence = worth[torch.cat([detector.colours.levels(part) for part in images.split(32)])].permute(0, 3, 1, 2)
    shown = torch.from_numpy(views.present[rows, :OBJECTS]).float()
    _, colour = targets(torch.from_numpy(views.labels[rows]), torch.from_numpy(views.colours[rows]))
    known = colour > 0
    hues, named = (part.permute(0, 2, 3, 1)[known] for part in (logits[:, detector.classes :], evidence[:, OBJECTS:]))
    classes, objects = logits[:, :OBJECTS].flatten(2), evidence[:, :OBJECTS].flatten(2)

    def of_pictures(numbers: Tensor) -> Tensor:
        surest = (numbers[0] + numbers[1] * classes + numbers[2] * objects).amax(dim=2)
        return nn.functional.binary_cross_entropy_with_logits(surest, shown)

    def of_colours(numbers: Tensor) -> Tensor:
        return nn.functional.cross_entropy(numbers[1] * hues + numbers[2] * named, colour[known] - 1)

    shift, scale, weight = _fitted(of_pictures).tolist()
    _, hue_scale, hue_weight = (_fitted(of_colours) if len(hues) else torch.tensor([0.0, 1.0, 0.0])).tolist()
    detector.colours.odds = torch.stack([shift + weight * worth, hue_weight * worth])
    assert detector.cells.bias is not None
    for part in (detector.cells.weight, detector.cells.bias):
        part.data[:OBJECTS] *= scale
        part.data[detector.classes :] *= hue_scale


def _fitted(loss: Callable[[Tensor], Tensor]) -> Tensor:
    """Return shift, scale and weight of the least loss."""
    begin = torch.tensor([0.0, 1.0, 1.0])
    numbers = begin.clone().requires_grad_()
    optimizer = torch.optim.LBFGS([numbers], max_iter=40, line_search_fn="strong_wolfe")

    def closure() -> float:
        optimizer.zero_grad()
        value = loss(numbers) + _NEAR * ((numbers - begin) ** 2).sum()
        value.backward()
        return value.item()

    optimizer.step(closure)
    return numbers.detach()
