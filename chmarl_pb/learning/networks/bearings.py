"""In which direction X and Y lie from another robot in the picture: what a robot that flies has to know to guide it."""

import torch
from torch import Tensor

from chmarl_pb.learning.networks.match import ROLES

SIZE = ROLES * 3  # numbers for one picture

_NEARER = 0.1  # how much less likely a thing counts a picture's width farther away: of things alike the nearest counts


def bearings_of(likely: Tensor, robots: Tensor, rooms: Tensor, u: Tensor, v: Tensor) -> Tensor:
    """Return (B, SIZE) of X, and Y: how likely it is in view in the room of another robot, that times the direction.

    A direction is the cosine and the sine of its angle from the right of the picture towards its upper edge.

    Args:
        likely: (B, ROLES, things) how likely each thing is X, and Y.
        robots: (B, things) bool, which are robots; the first counts.
        rooms: (B, things) numbers of the rooms that they are in, below 0 for none.
        u: (B, things) of the middle of each, from the left, in [0, 1].
        v: the same from the top.
    """
    robot = robots.int().argmax(dim=1, keepdim=True)
    right, up = u - u.gather(1, robot), v.gather(1, robot) - v
    away = torch.hypot(right, up)
    room = rooms.gather(1, robot)
    there = likely * ((rooms == room) & (room >= 0) & robots.any(dim=1, keepdim=True)).unsqueeze(1)
    nearest = (there.detach() - _NEARER * away.unsqueeze(1)).argmax(dim=2, keepdim=True)
    direction = torch.stack([torch.ones_like(right), right / away.clamp(min=1e-6), up / away.clamp(min=1e-6)], dim=2)
    found = direction.unsqueeze(1).expand(-1, ROLES, -1, -1).gather(2, nearest.unsqueeze(3).expand(-1, -1, -1, 3))
    return (there.gather(2, nearest).unsqueeze(3) * found).flatten(1)
