"""What needs no encoding: the few numbers that an encoder of graphs, words or pictures would drown."""

from collections.abc import Mapping
from typing import Any

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.networks.parts import PartEncoder, flattened, id_count
from chmarl_pb.learning.networks.tables import EMBEDDING, Table, class_table, colour_table
from chmarl_pb.learning.observation_keys import MESSAGES, SELF, goals, named

_HEADING = slice(-3, -1)  # of a robot's own state: cosine and sine
_IDS = 2  # of the goal's four numbers: class ids of X and Y; the others tell whether they are in view


class GoalEncoder(PartEncoder):
    """The embeddings of the classes that the goal names, and the bits as they are.

    Among lookalikes also that of X's colour, and Y's room as one-hot.
    """

    def __init__(
        self,
        goal: spaces.Space[Any],
        meaning: nn.Linear | None = None,
        attributes: spaces.Space[Any] | None = None,
    ):
        """Make tables of classes and, with attributes, of colours."""
        super().__init__()
        self.classes = class_table(id_count(goal), meaning)
        self.size = _IDS * EMBEDDING + 2
        self.colours: Table | None = None
        if isinstance(attributes, spaces.Box):
            colours, self.rooms = (int(most) + 1 for most in attributes.high)
            self.colours = colour_table(colours, meaning)
            self.size += EMBEDDING + self.rooms

    def forward(self, goal: Tensor, attributes: Tensor | None = None) -> Tensor:
        """Return (B, size) from goals (B, 4) and attributes (B, 2)."""
        parts = [self.classes(goal[:, :_IDS].long()).flatten(1), goal[:, _IDS:].float()]
        if self.colours is not None and attributes is not None:
            colour, room = attributes.long().unbind(dim=1)
            parts += [self.colours(colour), nn.functional.one_hot(room, self.rooms).float()]
        return torch.cat(parts, dim=1)


class Numbers(nn.Module):
    """The messages, the robot's own state, and whether what it is asked for is in view, in one row.

    What is heard of directions means another turn by each heading: ``turned``, there are also all messages times the
    cosine and the sine of the robot's own heading.

    Attributes:
        size: their number.
    """

    def __init__(self, space: spaces.Dict, turned: bool = False):
        """Find the keys in a space."""
        super().__init__()
        goal = goals(space)
        found = {*named(space.spaces, MESSAGES, SELF), *goal}
        # Numbers are meant: what is a choice, in an environment of one's own, has no heading and is encoded.
        self._shapes = {key: box.shape for key, box in space.spaces.items() if key in found and _is_of_numbers(box)}
        self._from = {key: _IDS if key in goal else 0 for key in self._shapes}
        self.size = sum(spaces.flatdim(space[key]) - first for key, first in self._from.items())
        heard = [(key, key.removesuffix(MESSAGES) + SELF) for key in named(space.spaces, MESSAGES)] if turned else []
        headed = {key for key in self._shapes if spaces.flatdim(space[key]) >= -_HEADING.start}
        self._turned = [(key, own) for key, own in heard if key in self._shapes and own in headed]
        self.size += sum(2 * spaces.flatdim(space[messages]) for messages, _ in self._turned)

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """Return (B, size), float32."""
        rows = {key: flattened(observation[key], shape).flatten(1).float() for key, shape in self._shapes.items()}
        turned = [rows[key].unsqueeze(1) * rows[own][:, _HEADING].unsqueeze(2) for key, own in self._turned]
        parts = [row[:, self._from[key] :] for key, row in rows.items()]
        return torch.cat([*parts, *(part.flatten(1) for part in turned)], dim=1)


def _is_of_numbers(space: spaces.Space[Any]) -> bool:
    return isinstance(space, spaces.Box | spaces.MultiBinary)
