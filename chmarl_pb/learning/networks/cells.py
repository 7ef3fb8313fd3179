"""In which cells of a robot's picture a Pick takes X, and a Place goes onto Y: what actions that point have to know."""

import torch
from torch import Tensor

from chmarl_pb.learning.networks.match import ROLES
from chmarl_pb.robots.pointing import CELLS, GRID

SIZE = ROLES * len(CELLS)  # numbers for one picture

_LEAST = 1e-4  # share of a picture, about two pixels of 128 x 128, below which what a cell shows hardly counts


def cells_of(likely: Tensor, others: Tensor, u: Tensor, v: Tensor, share: Tensor) -> Tensor:
    """Return (B, SIZE) how likely X, and Y, is what an action at each cell takes; in the order of these actions.

    An action takes what has most pixels in its cell. A thing is told by the middle of its pixels and their share of the
    picture, so it is taken for a square, as by :func:`chmarl_pb.policies.aiming.aims_at`.

    Args:
        likely: (B, ROLES, things) how surely each thing is seen and is X, and Y; 0 for what is not in the picture.
        others: (B, ROLES, things) how surely each is seen and is something else that the same action could take.
        u: (B, things) of the middle of each, from the left, in [0, 1].
        v: the same from the top.
        share: (B, things) the part of the picture that each covers.
    """
    pixels = _in_cells(u, v, share).unsqueeze(1)
    own, other = ((part.unsqueeze(3) * pixels).amax(dim=2) for part in (likely, others))
    return (own / (own + other + _LEAST)).flatten(1)


def _in_cells(u: Tensor, v: Tensor, share: Tensor) -> Tensor:
    """Return (B, things, cells) the share of the picture that squares cover in each cell."""
    half = share.clamp(min=0).sqrt().unsqueeze(2) / 2
    edges = torch.linspace(0, 1, GRID + 1, device=u.device)
    across, down = (
        (torch.minimum(middle + half, edges[1:]) - torch.maximum(middle - half, edges[:-1])).clamp(min=0)
        for middle in (u.unsqueeze(2), v.unsqueeze(2))
    )
    return (down.unsqueeze(3) * across.unsqueeze(2)).flatten(2)
