"""What an instruction asks for, read by rule: ``parse_instruction`` knows all names, so nothing has to be learned.

This is what the built-in searches do, in place of the :class:`~chmarl_pb.learning.networks.match.Match` that is taught
by the same rule and has to generalise to words that training never shows.
"""

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.networks.match import ROLES, ROOMS, Wanted, named_by
from chmarl_pb.learning.networks.parts import PartEncoder, one_hot_of
from chmarl_pb.learning.networks.tables import EMBEDDING, Table


class Parsed(nn.Module):
    """Tells which classes are X and Y as :class:`~chmarl_pb.learning.networks.match.Match` does, but by rule.

    What is not named is nothing: of an instruction of several objects no class is X. A colour or a room that is not
    named is any.
    """

    def __init__(self, classes: int, colours: int = 0):
        """Know the numbers of ids of classes and of colours, 0 where instructions name none; both with padding."""
        super().__init__()
        self.classes, self.colours = classes, colours

    def forward(self, tokens: Tensor) -> Wanted:
        """Return what instructions ask for, from token ids (B, L)."""
        labels = _labels(tokens)
        wanted = Wanted(one_hot_of(labels[:, 0], self.classes))
        if not self.colours:
            return wanted
        colours = one_hot_of(labels[:, 1], self.colours) + (labels[:, 1] < 0).unsqueeze(2)
        return wanted._replace(colours=colours, rooms=one_hot_of(labels[:, 2, 0].clamp(min=0), 1 + len(ROOMS)))


class ParsedInstruction(PartEncoder):
    """The embeddings of the classes that an instruction names; among lookalikes also of X's colour, and Y's room."""

    def __init__(self, classes: Table, colours: Table | None = None):
        """Use tables of classes and, among lookalikes, of colours."""
        super().__init__()
        self.classes, self.colours = classes, colours
        self._parsed = Parsed(len(classes.weight), 0 if colours is None else len(colours.weight))
        self.size = ROLES * EMBEDDING + (0 if colours is None else EMBEDDING + 1 + len(ROOMS))

    def forward(self, tokens: Tensor) -> Tensor:
        """Return (B, size) from token ids (B, length)."""
        wanted: Wanted = self._parsed(tokens)
        parts = [(wanted.classes @ self.classes.weight).flatten(1)]
        if self.colours is not None and wanted.colours is not None and wanted.rooms is not None:
            one = nn.functional.normalize(wanted.colours[:, 0], p=1, dim=-1)  # the mean where any will do
            parts += [one @ self.colours.weight, wanted.rooms]
        return torch.cat(parts, dim=1)

    def total(self, tokens: Tensor) -> Tensor:
        """Return the sum of the embeddings of both classes, (B, EMBEDDING)."""
        total: Tensor = (self._parsed(tokens).classes @ self.classes.weight).sum(dim=1)
        return total


def _labels(tokens: Tensor) -> Tensor:
    """Return the ids that instructions (B, L) name, (B, 3, ROLES), negative for none; see ``named_by``."""
    different, place = tokens.unique(dim=0, return_inverse=True)
    labels = np.stack([named_by(row) for row in different.cpu().numpy()])
    return torch.from_numpy(labels).to(tokens.device)[place]
