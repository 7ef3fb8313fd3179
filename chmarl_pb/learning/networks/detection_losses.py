"""What the detector learns by: the classes of cells, of whole pictures, and the colours of objects."""

import torch
from torch import Tensor, nn

from chmarl_pb import catalog
from chmarl_pb.learning.networks.detections import LABELS
from chmarl_pb.learning.networks.pyramid import CELL
from chmarl_pb.rendering.renderer import VISIBLE_PIXELS

_COUNT = len(LABELS)
_EMPTY = 0.05  # weight of a cell of nothing
_SHARED = -0.75  # power of the number of a thing's cells by which each of them counts


def detection_loss(logits: Tensor, labels: Tensor, colours: Tensor) -> Tensor:
    """Return the sum of three losses.

    - Of cells: cross-entropy of the classes and of nothing, whose logit is 0. A cell of a thing counts by the number of
      its cells to the power of -3/4, so that large things, which have most cells, do not drown the small ones.
    - Of pictures: cross-entropy of the surest cell of each class, which says whether the picture shows it.
    - Of colours: cross-entropy in the cells of objects whose colour is known.

    Args:
        logits: (B, classes + colours, rows, columns).
        labels: (B, height, width) uint8 number of the class in each pixel; the number of classes for none.
        colours: (B, height, width) uint8 id of the colour in each pixel; 0 for none.
    """
    wanted, colour = targets(labels, colours)
    shown = (_pixels(labels) >= VISIBLE_PIXELS).float()
    classes, hues = logits[:, :_COUNT], logits[:, _COUNT:]
    known = colour > 0
    of_colour = nn.functional.cross_entropy(hues.permute(0, 2, 3, 1)[known], colour[known] - 1, reduction="sum")
    of_colour = of_colour / known.sum().clamp(min=1)
    surest = classes.flatten(2).amax(dim=2)
    of_pictures = nn.functional.binary_cross_entropy_with_logits(surest, shown, reduction="sum")
    of_pictures = of_pictures / shown.sum().clamp(min=1)
    return _of_cells(classes, wanted, shown) + of_pictures + of_colour


def targets(labels: Tensor, colours: Tensor) -> tuple[Tensor, Tensor]:
    """Return class and colour of what each cell shows, both (B, rows, columns) int64, from labels of pixels.

    A graspable counts before a receptacle, that before a robot, and that before nothing, however few pixels it has in
    the cell: this is the order of ``LABELS``.
    """
    base = len(catalog.COLOURS) + 1
    both = labels.float() * base + colours.float()
    least = -nn.functional.max_pool2d(-both.unsqueeze(1), CELL, ceil_mode=True).squeeze(1).long()
    return least // base, least % base


def _pixels(labels: Tensor) -> Tensor:
    """Return (B, classes) number of pixels of each class."""
    count = len(labels)
    numbers = labels.long().flatten(1) + (_COUNT + 1) * torch.arange(count, device=labels.device).unsqueeze(1)
    return torch.bincount(numbers.flatten(), minlength=count * (_COUNT + 1)).view(count, -1)[:, :_COUNT]


def _of_cells(logits: Tensor, wanted: Tensor, shown: Tensor) -> Tensor:
    """Return the cross-entropy of the cells, for each thing that is shown; what is too small counts for nothing."""
    flat = wanted.flatten(1)
    cells = logits.new_zeros(len(flat), _COUNT + 1).scatter_add_(1, flat, torch.ones_like(flat, dtype=logits.dtype))
    weights = cells.clamp(min=1) ** _SHARED
    weights[:, :_COUNT] *= shown
    weights[:, _COUNT] = _EMPTY
    with_nothing = nn.functional.pad(logits, (0, 0, 0, 0, 0, 1))
    losses = nn.functional.cross_entropy(with_nothing, wanted, reduction="none")
    return (losses.flatten(1) * weights.gather(1, flat)).sum() / shown.sum().clamp(min=1)
