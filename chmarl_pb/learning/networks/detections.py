"""What a detector tells of a picture, and how agents read it.

A row for each of ``LABELS``, with six numbers: how sure it is that the picture shows the class, that times the column,
the row and the size of what is shown, the id of the colour, and how sure it is of that. The direction follows from the
column: with half the opening angle a, what is in the column x lies atan(x tan a) to the right of the camera's axis.
"""

from functools import cache
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb import catalog
from chmarl_pb.learning.networks.bearings import SIZE as BEARINGS
from chmarl_pb.learning.networks.bearings import bearings_of
from chmarl_pb.learning.networks.cells import SIZE as TAKEN
from chmarl_pb.learning.networks.cells import cells_of
from chmarl_pb.learning.networks.match import ROLES
from chmarl_pb.learning.networks.parts import Asked, PartEncoder
from chmarl_pb.learning.networks.tables import EMBEDDING, Table, VectorTable, class_table, colour_table
from chmarl_pb.tasks.language.vectors import class_vectors

OBJECTS = len(catalog.BENCHMARK.graspables)
#: The classes that are to be seen: what can be picked up, what that is placed on, robots.
LABELS = (*catalog.BENCHMARK.graspables, *catalog.BENCHMARK.receptacles, *catalog.BENCHMARK.robots)
THINGS = len(LABELS) - len(catalog.BENCHMARK.robots)  # classes that are no robots; they come first
PLACE = 4  # numbers of a class before those of its colour
SHAPE = (len(LABELS), PLACE + 2)
SHAPES = (SHAPE, (THINGS, PLACE + 2))  # the second: of detectors from before robots were told
_IDS = tuple(catalog.BENCHMARK.class_ids[name] for name in LABELS)
HEADS, KEY = 16, 32  # questions that are asked of each class, and numbers in each
THING, VALUE = 64, 16  # features of a class that is seen, and those of them that are told of X and of Y

_CLOSED = 3.0  # gates are nearly closed at first: sigmoid(-3) is 0.05
CELLS = 32 * 32  # of the detector, in a picture of 128 x 128: sizes are told in these, however large a picture is
_LEAST = 0.02  # confidence below which a class counts as not shown
_ROBOT = 0.5  # confidence from which on a robot counts as seen, for directions from it
_STEPS, _MOST = 64, 1024  # of logits of colours: steps in 1, and most steps on each side of 0


def detections(logits: Tensor) -> Tensor:
    """Return (C, 6) from the logits (C + colours, rows, columns) of one picture, of the first C of ``LABELS``.

    In a row: the confidence, that of the surest cell; the confidence times the mean column and the mean row of the
    cells that are at least half as sure, both in [-1, 1], and times the size, see :func:`share_of`; then, of what can
    be picked up, the id of the likeliest colour in these cells, and how sure it is. Of classes below
    ``_LEAST`` all is 0.

    Sums are those of whole numbers, and exact; all else is computed in float64 from few numbers.
    """
    rows, columns = logits.shape[1:]
    flat, classes = logits.flatten(1), len(logits) - len(catalog.COLOURS)
    confidence = torch.sigmoid(flat[:classes].amax(dim=1).double())
    found = torch.zeros(classes, PLACE + 2, dtype=torch.float64)
    seen = torch.nonzero(confidence >= _LEAST).squeeze(1)
    sure = confidence[seen].unsqueeze(1)
    cells = (flat[seen] >= torch.logit(sure / 2).float()).float()
    count, column, row = (cells @ _grid(rows, columns)).double().unbind(dim=1)
    size = torch.log2(1.0 + count * (CELLS / (rows * columns))) / np.log2(1.0 + CELLS)
    places = torch.stack([_centred(column / count, columns), _centred(row / count, rows), size], dim=1)
    found[seen, 0], found[seen, 1:PLACE] = sure.squeeze(1), places * sure
    objects = seen < OBJECTS
    found[seen[objects], PLACE:] = _colours(flat[classes:], cells[objects], count[objects])
    return found.float()


Size = TypeVar("Size", float, Tensor)


def share_of(size: Size) -> Size:
    """Return what part of a picture something fills, 0 to 1, from its size: the logarithm of that, 1 for all."""
    share: Size = ((1.0 + CELLS) ** size - 1) / CELLS
    return share


@cache
def _grid(rows: int, columns: int) -> Tensor:
    """Return (cells, 3) one, the column and the row of each cell."""
    row, column = np.indices((rows, columns))
    return torch.from_numpy(np.stack([np.ones_like(row), column, row], axis=-1).reshape(-1, 3).astype(np.float32))


def _centred(places: Tensor, count: int) -> Tensor:
    """Return places in [-1, 1] from such from 0 to count - 1."""
    return 2 * places / max(count - 1, 1) - 1


def _colours(hues: Tensor, cells: Tensor, count: Tensor) -> Tensor:
    """Return id and probability (N, 2) of the likeliest colour in some cells (N, rows * columns) of each object."""
    steps = (hues * _STEPS).round().clamp(-_MOST, _MOST)  # whole: their sums are exact
    mean = (cells @ steps.T).double() / (count * _STEPS).unsqueeze(1)
    sure, number = mean.softmax(dim=1).max(dim=1)
    return torch.stack([number + 1, sure], dim=1)


class DetectionEncoder(PartEncoder):
    """Detections, pooled by what the instruction asks for, beside the sum over all classes.

    Each of ``HEADS`` gates, in (0, 1), compares a class with the words of the instruction; a head is the sum of the
    detections behind its gates, so it holds whether such a thing is seen, where, and whether in a colour that the words
    ask for.
    """

    asks = True

    def __init__(self, meaning: nn.Linear | None = None, classes: int = len(LABELS)):
        """Make the tables.

        Args:
            meaning: map of word vectors that the table of classes is made by; None: it is learned row by row.
            classes: number of the first of ``LABELS`` that are detected.
        """
        super().__init__()
        self.size = EMBEDDING + HEADS * (PLACE + 1)
        if meaning is not None:
            self.classes: Table = VectorTable(class_vectors()[list(_IDS[:classes])], classes, meaning)
        else:
            self.classes = nn.Embedding(classes, EMBEDDING)
        self.key = nn.Linear(EMBEDDING, HEADS * KEY)
        self.query = nn.Linear(EMBEDDING, HEADS * KEY)
        self.colour = nn.Linear(EMBEDDING, len(catalog.COLOURS))

    def forward(self, detected: Tensor, asked: Asked) -> Tensor:
        """Return (B, size) from detections (B, C, 6) and what the instruction asks for."""
        detected = detected.float()
        keys = self.key(self.classes.weight).unflatten(1, (HEADS, KEY))
        match = torch.einsum("chd,bhd->bhc", keys, self.query(asked.words).unflatten(1, (HEADS, KEY)))
        painted = _painted(detected, _by_words(self.colour, asked))
        seen = torch.cat([detected[..., :PLACE], painted.unsqueeze(2)], dim=2)
        return torch.cat(
            [detected[..., 0] @ self.classes.weight, (torch.sigmoid(match - _CLOSED) @ seen).flatten(1)], dim=1
        )


class GroundedDetectionEncoder(PartEncoder):
    """Features of each class that is seen, by its name and place: their mean, and what X, and Y, is like.

    How likely a class is X or Y follows from the words of the instruction, and among lookalikes from the colour that it
    is seen in; see :class:`chmarl_pb.learning.networks.match.Match`. For each of the two there is how surely it is
    seen, where, whether in a colour that the words ask for, and some of its features; as for the nodes of graphs.
    """

    asks = True
    matches = True
    takes: Tensor
    size = THING + ROLES * (PLACE + 1 + VALUE)

    def __init__(self, meaning: nn.Linear | None = None, lookalikes: bool = False, classes: int = len(LABELS)):
        """Make the layers.

        Args:
            meaning: map of word vectors that the table of classes is made by; None: it is learned row by row.
            lookalikes: whether instructions name the colour of X.
            classes: number of the first of ``LABELS`` that are detected; without robots there are no directions.
        """
        super().__init__()
        self._ids, self._robots = list(_IDS[:classes]), classes > THINGS
        self.locates = TAKEN + BEARINGS * self._robots
        self.classes = class_table(len(catalog.BENCHMARK.rows) + 1, meaning)
        self.colours: Table | None = colour_table(len(catalog.COLOURS) + 1, meaning) if lookalikes else None
        self.colour = None if lookalikes else nn.Linear(EMBEDDING, len(catalog.COLOURS))
        self.named, self.placed = nn.Linear(EMBEDDING, THING), nn.Linear(PLACE - 1, THING, bias=False)
        self.second, self.value = nn.Linear(THING, THING), nn.Linear(THING, VALUE)
        self.register_buffer("takes", _takes()[:, :classes], persistent=False)

    def forward(self, detected: Tensor, asked: Asked) -> Tensor:
        """Return (B, size) from detections (B, C, 6) and what the instruction asks for."""
        detected = detected.float()
        sure = detected[..., :1]
        places = detected[..., 1:PLACE] / sure.clamp(min=_LEAST)
        things = torch.relu(self.second(torch.relu(self.named(self.classes.weight[self._ids]) + self.placed(places))))
        total = (sure * things).sum(dim=1) / sure.sum(dim=1).clamp(min=1)
        painted = _painted(detected, self._wanted_colours(asked)).unsqueeze(2)
        seen = torch.cat([detected[..., :PLACE], painted, sure * self.value(things)], dim=2)
        return torch.cat([total, (self._likely(detected, asked) @ seen).flatten(1)], dim=1)

    def places(self, detected: Tensor, asked: Asked) -> Tensor:
        """Return in which cells X and Y can be taken, and in which directions from another robot they are.

        What a picture shows is taken to be in one room. (B, locates).
        """
        detected = detected.float()
        sure = detected[..., 0]
        column, row, size = (detected[..., 1:PLACE] / sure.clamp(min=_LEAST).unsqueeze(2)).unbind(dim=2)
        u, v, share = (1 + column) / 2, (1 + row) / 2, share_of(size)
        likely = self._likely(detected, asked)
        seen, others = likely * sure.unsqueeze(1), (1 - likely) * self.takes * sure.unsqueeze(1)
        in_cells = cells_of(seen, others, u, v, share)
        if not self._robots:
            return in_cells
        robots = (sure >= _ROBOT) & ~self.takes.any(dim=0)
        one_room = torch.zeros_like(sure, dtype=torch.int64)
        return torch.cat([in_cells, bearings_of(seen, robots, one_room, u, v)], dim=1)

    def _likely(self, detected: Tensor, asked: Asked) -> Tensor:
        """Return how likely each class is X, and Y, (B, ROLES, C): X less so in another colour than its own."""
        assert asked.wanted is not None
        classes = asked.wanted.classes[..., self._ids]
        if self.colours is None:
            return classes
        other = detected[..., 5] * (1 - _of_seen(detected, self._wanted_colours(asked)))  # how surely it is another
        return torch.stack([classes[:, 0] * (1 - other), classes[:, 1]], dim=1)

    def _wanted_colours(self, asked: Asked) -> Tensor:
        """Return how likely each id of a colour (B, ids) is that of X."""
        if self.colour is not None:
            return _by_words(self.colour, asked)
        assert asked.wanted is not None and asked.wanted.colours is not None
        return asked.wanted.colours[:, 0]


def _takes() -> Tensor:
    """Return (ROLES, C) whether a Pick, and a Place, can take things of a class."""
    number = torch.arange(len(LABELS))
    return torch.stack([number < OBJECTS, (number >= OBJECTS) & (number < THINGS)]).float()


def _by_words(colour: nn.Linear, asked: Asked) -> Tensor:
    """Return how likely each id of a colour (B, ids) is asked for, by all words alike; none is that of id 0."""
    return nn.functional.pad(torch.sigmoid(colour(asked.words)), (1, 0))


def _painted(detected: Tensor, wanted: Tensor) -> Tensor:
    """Return (B, C) how surely each class is seen in a colour (B, ids) that is asked for."""
    return detected[..., 0] * detected[..., 5] * _of_seen(detected, wanted)


def _of_seen(detected: Tensor, wanted: Tensor) -> Tensor:
    """Return (B, C) how likely the colours that classes are seen in are asked for, from those of all ids (B, ids)."""
    return wanted.gather(1, detected[..., 4].long())


def reader(shape: tuple[int, ...], meaning: nn.Linear | None, grounded: bool, lookalikes: bool) -> PartEncoder:
    """Return what reads detections; ``grounded``, by how likely each class is X, and Y, perhaps among lookalikes."""
    classes = shape[0]
    return GroundedDetectionEncoder(meaning, lookalikes, classes) if grounded else DetectionEncoder(meaning, classes)
