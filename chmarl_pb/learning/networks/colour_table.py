"""What the colours of single pixels tell: a table of all colours that objects were seen in, counted over views.

The simulator draws things in plain colours under one light, without textures or noise, so few colours are shared: an
object of four pixels is mostly known by them alone, and no convolution has to learn it. Real cameras are not so kind.
"""

from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from chmarl_pb import catalog
from chmarl_pb.learning.networks.detections import LABELS, OBJECTS
from chmarl_pb.learning.networks.pyramid import CELL
from chmarl_pb.rendering.renderer import VISIBLE_PIXELS

if TYPE_CHECKING:
    from chmarl_pb.learning.networks.labelled_views import Views  # needs PyBullet

SHARES = OBJECTS + len(catalog.COLOURS)  # columns of a table
LEVELS = 256  # of evidence

_BITS = 7  # of each brightness: neighbours are one colour
_LEAST = 0.02  # share of a colour's pixels that an object has, for it to count


class ColourTable(nn.Module):
    """Colours of pixels -> logits of cells, which are added to those of the network.

    The evidence of a class in a cell is the mean share that it has of the colours of the cell's pixels, of those that
    can show it at all, and of four at least. That of a colour by name is taken likewise.
    """

    codes: Tensor
    shares: Tensor
    odds: Tensor
    rows: Tensor

    def __init__(
        self, codes: Tensor | None = None, shares: Tensor | None = None, odds: Tensor | None = None,
        classes: int = len(LABELS),
    ) -> None:  # fmt: skip
        """Take a table; without one there is no evidence.

        Args:
            codes: (K,) int32 the colours, see :func:`codes_of`.
            shares: (K, SHARES) uint8 how large a part of a colour's pixels is of each object, in steps of 1 / 255, and
                of those of objects whose colour has a name, of each name.
            odds: (2, LEVELS) what evidence adds to the logits of a class, and of a colour by name.
            classes: number of the logits of a cell before those of colours.

        Raises:
            RuntimeError: the parts do not fit each other.
        """
        super().__init__()
        if codes is not None:
            _check(codes, shares, odds)
        self._classes = classes
        self.register_buffer("codes", torch.empty(0, dtype=torch.int32) if codes is None else codes)
        self.register_buffer("shares", torch.empty(0, SHARES, dtype=torch.uint8) if shares is None else shares)
        self.register_buffer("odds", torch.zeros(2, LEVELS) if odds is None else odds)
        kind = torch.int16 if len(self.codes) < 2**15 else torch.int32
        rows = torch.zeros(2 ** (3 * _BITS), dtype=kind)  # of each colour in the table, from 1 on; 0: none
        rows[self.codes.long()] = torch.arange(1, len(self.codes) + 1, dtype=kind)
        self.register_buffer("rows", rows, persistent=False)

    def levels(self, images: Tensor) -> Tensor:
        """Return the evidence (B, rows, columns, SHARES), int64 below LEVELS, of uint8 (B, height, width, 3) images."""
        (picture, cell), found = self._found(images)
        rows, columns = _cells_of(images)
        levels = torch.zeros(len(images), rows * columns, SHARES, dtype=torch.int64)
        levels[picture, cell] = found
        return levels.view(len(images), rows, columns, SHARES)

    def _found(self, images: Tensor) -> tuple[tuple[Tensor, Tensor], Tensor]:
        """Return the cells with a known colour, by picture and number (N) each, and their evidence (N, SHARES).

        Sums are those of whole numbers, and exact.
        """
        rows, columns = _cells_of(images)
        numbers = self.rows[codes_of(images)]
        picture, row, column = torch.nonzero(numbers, as_tuple=True)
        places = (picture * rows + row // CELL) * columns + column // CELL
        cells, of_pixel = torch.unique(places, return_inverse=True)
        shares = self.shares[numbers[picture, row, column].long() - 1].float()
        sums = torch.zeros(len(cells), SHARES).index_add_(0, of_pixel, shares)
        pixels = torch.zeros_like(sums).index_add_(0, of_pixel, (shares > 0).float())
        return (cells // (rows * columns), cells % (rows * columns)), levels_of(sums, pixels)

    def forward(self, images: Tensor) -> Tensor:
        """Return what is added to the logits (B, classes + colours, rows, columns) of (B, height, width, 3) images."""
        (picture, cell), found = self._found(images)
        rows, columns = _cells_of(images)
        nothing = self.worth(torch.zeros(SHARES, dtype=torch.int64))
        logits = nothing.unsqueeze(1).repeat(len(images), 1, rows * columns)
        logits[picture, :, cell] = self.worth(found)
        return logits.view(len(images), len(nothing), rows, columns)

    def worth(self, levels: Tensor) -> Tensor:
        """Return what evidence (..., SHARES) adds to the logits (..., classes + colours)."""
        logits = torch.zeros(*levels.shape[:-1], self._classes + len(catalog.COLOURS))
        logits[..., :OBJECTS] = self.odds[0][levels[..., :OBJECTS]]
        logits[..., self._classes :] = self.odds[1][levels[..., OBJECTS:]]
        return logits


def _check(codes: Tensor, shares: Tensor | None, odds: Tensor | None) -> None:
    """Refuse parts of a table that do not fit each other.

    Raises:
        RuntimeError: they do not.
    """
    whole = codes.dtype == torch.int32 and codes.ndim == 1 and bool(((codes >= 0) & (codes < 2 ** (3 * _BITS))).all())
    if not whole:
        raise RuntimeError("codes of colours are no such codes")
    if shares is None or shares.dtype != torch.uint8 or shares.shape != (len(codes), SHARES):
        raise RuntimeError(f"shares of {len(codes)} colours are not ({len(codes)}, {SHARES}) bytes")
    if odds is not None and (not odds.is_floating_point() or odds.shape != (2, LEVELS)):
        raise RuntimeError(f"odds of colours are not (2, {LEVELS}) numbers")


def _cells_of(images: Tensor) -> tuple[int, int]:
    """Return the rows and columns of cells of pictures (B, height, width, 3)."""
    return -(-images.shape[1] // CELL), -(-images.shape[2] // CELL)


def levels_of(sums: Tensor, pixels: Tensor) -> Tensor:
    """Return evidence, int64, from the sums of the shares of a cell's colours, and the pixels that have any."""
    return (sums / pixels.clamp(min=VISIBLE_PIXELS)).floor().long()


def codes_of(images: Tensor) -> Tensor:
    """Return the colours (B, height, width), int32, of the pixels of uint8 pictures (B, height, width, 3)."""
    red, green, blue = (images >> 8 - _BITS).int().unbind(dim=-1)
    return (red << 2 * _BITS) + (green << _BITS) + blue


def counted_colours(views: "Views", rows: NDArray[np.integer]) -> tuple[Tensor, Tensor]:
    """Return codes and shares of a :class:`ColourTable`, from the labels of some views."""
    pixels = np.zeros(2 ** (3 * _BITS))
    width = max(len(LABELS), len(catalog.COLOURS)) + 1
    counts: list[dict[int, int]] = [{}, {}]
    for part in np.array_split(rows, max(len(rows) // 500, 1)):
        codes = codes_of(torch.from_numpy(views.images[part])).numpy()
        pixels += np.bincount(codes.ravel(), minlength=len(pixels))
        objects = views.labels[part] < OBJECTS
        for found, labels, known in zip(counts, (views.labels, views.colours), (0, 1), strict=True):
            shown = objects & (labels[part] >= known)
            keys, numbers = np.unique(codes[shown] * width + labels[part][shown], return_counts=True)
            for key, number in zip(keys.tolist(), numbers.tolist(), strict=True):
                found[key] = found.get(key, 0) + number
    of_class, of_colour = (_split(found, width) for found in counts)
    whole = np.bincount(of_colour[0], of_colour[2], minlength=len(pixels))
    share = of_class[2] / (pixels[of_class[0]] + 1)
    kept = share > _LEAST
    codes = np.unique(of_class[0][kept])
    shares = np.zeros((len(codes), SHARES))
    shares[np.searchsorted(codes, of_class[0][kept]), of_class[1][kept]] = share[kept]
    named = np.isin(of_colour[0], codes)
    where, colour, number = (column[named] for column in of_colour)
    shares[np.searchsorted(codes, where), OBJECTS + colour - 1] = number / (whole[where] + 1)
    return torch.from_numpy(codes.astype(np.int32)), torch.from_numpy((shares * 255).round().astype(np.uint8))


def _split(found: dict[int, int], width: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return codes, labels and numbers of pixels."""
    keys = np.fromiter(found, np.int64, len(found))
    return keys // width, keys % width, np.fromiter(found.values(), np.int64, len(found))
