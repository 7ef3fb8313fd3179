"""What a detector tells of a picture, and how agents read it.

A row for each of ``LABELS``, with four numbers: how sure it is that the picture shows the class, and that times the
column, the row and the size of what is shown.
"""

import torch
from torch import Tensor, nn

from chmarl_pb import catalog
from chmarl_pb.learning.networks.match import ROLES
from chmarl_pb.learning.networks.parts import Asked, Part
from chmarl_pb.learning.networks.tables import EMBEDDING, Table, VectorTable, class_table
from chmarl_pb.tasks.language.vectors import class_vectors

LABELS = (*catalog.BENCHMARK.graspables, *catalog.BENCHMARK.receptacles)  # the classes that are to be seen
SHAPE = (len(LABELS), 4)
_IDS = tuple(catalog.BENCHMARK.class_ids[name] for name in LABELS)
HEADS, KEY = 16, 32  # questions that are asked of each class, and numbers in each

_CLOSED = 3.0  # gates are nearly closed at first: sigmoid(-3) is 0.05
_LEAST = 0.05  # confidence below which a class counts as not shown


def detections(logits: Tensor) -> Tensor:
    """Return (C, 4) from the logits (C + 1, rows, columns) of one picture.

    In a row: the confidence, that of the surest cell; and the confidence times the mean column and the mean row of the
    cells that are at least half as sure, both in [-1, 1], and times the logarithm of their number, 1 for all.
    """
    shown = logits.softmax(dim=0)[:-1]
    rows, columns = shown.shape[1:]
    confidence = shown.amax(dim=(1, 2))
    confidence = torch.where(confidence < _LEAST, 0.0, confidence)
    cells = (2 * shown >= confidence.view(-1, 1, 1)) & (confidence > 0).view(-1, 1, 1)
    count = cells.sum(dim=(1, 2))
    across, down = cells.sum(dim=1).float(), cells.sum(dim=2).float()
    column = (across @ torch.linspace(-1, 1, columns)) / count.clamp(min=1)
    row = (down @ torch.linspace(-1, 1, rows)) / count.clamp(min=1)
    size = torch.log2(1.0 + count) / torch.log2(torch.tensor(1.0 + rows * columns))
    return torch.stack([torch.ones_like(column), column, row, size], dim=1) * confidence.unsqueeze(1)


class DetectionEncoder(Part):
    """Detections, pooled by what the instruction asks for, beside the sum over all classes.

    Each of ``HEADS`` gates, in (0, 1), compares a class with the words of the instruction; a head is the sum of the
    detections behind its gates, so it holds whether such a thing is seen, and where. Grounded, there are two more
    heads, whose gates are how likely a class is that of X, and that of Y.
    """

    asks = True

    def __init__(self, meaning: nn.Linear | None = None, grounded: bool = False):
        """Make the tables.

        Args:
            meaning: map of word vectors that the table of classes is made by; None: it is learned row by row.
            grounded: whether X and Y have heads of their own.
        """
        super().__init__()
        self.matches = grounded
        self.size = EMBEDDING + (HEADS + ROLES * grounded) * SHAPE[1]
        self.classes: Table
        if grounded:
            self.classes = class_table(len(catalog.BENCHMARK.rows) + 1, meaning)
        elif meaning is not None:
            self.classes = VectorTable(class_vectors()[list(_IDS)], SHAPE[0], meaning)
        else:
            self.classes = nn.Embedding(SHAPE[0], EMBEDDING)
        self.key = nn.Linear(EMBEDDING, HEADS * KEY)
        self.query = nn.Linear(EMBEDDING, HEADS * KEY)

    def forward(self, detected: Tensor, asked: Asked) -> Tensor:
        """Return (B, size) from detections (B, C, 4) and what the instruction asks for."""
        detected = detected.float()
        rows = self.classes.weight[list(_IDS)] if self.matches else self.classes.weight
        keys = self.key(rows).unflatten(1, (HEADS, KEY))
        match = torch.einsum("chd,bhd->bhc", keys, self.query(asked.words).unflatten(1, (HEADS, KEY)))
        gates = torch.sigmoid(match - _CLOSED)
        if self.matches:
            assert asked.wanted is not None
            gates = torch.cat([gates, asked.wanted.classes[..., list(_IDS)]], dim=1)
        return torch.cat([detected[..., 0] @ rows, (gates @ detected).flatten(1)], dim=1)
