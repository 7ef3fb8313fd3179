"""In which cell of a robot's picture X and Y lie: what a Pick or a Place that points has to be told."""

import torch
from torch import Tensor, nn

from chmarl_pb.learning.networks.match import ROLES
from chmarl_pb.robots.pointing import CELLS, GRID

SIZE = ROLES * len(CELLS)  # numbers for one picture


def cells_of(likely: Tensor, u: Tensor, v: Tensor) -> Tensor:
    """Return (B, SIZE) how likely X, and Y, is in each cell; cells are in the order of the actions that point at them.

    Args:
        likely: (B, ROLES, things) how likely each thing is X, and Y; 0 for what is not in the picture.
        u: (B, things) of the middle of each, from the left, in [0, 1].
        v: the same from the top.
    """
    row, column = ((place * GRID).long().clamp(0, GRID - 1) for place in (v, u))
    there = nn.functional.one_hot(row * GRID + column, len(CELLS)).to(likely.dtype)
    return torch.clamp(likely @ there, max=1).flatten(1)
