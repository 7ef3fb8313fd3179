"""In which directions a robot has looked, in which rooms: what a search has to keep, and a GRU learns to count late.

Searches turn at a room's anchor, to which a Goto always leads in the same way, so a direction is told by how far the
robot has turned since it came there. Anchors face other ways in other homes; this is the same in all.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.observation_keys import SELF
from chmarl_pb.navigation.lattice import HEADINGS

_AFTER_ROOMS = 3  # numbers of ``self``: cosine and sine of the heading, whether it holds something
_FACING = 2 * HEADINGS  # turns since it came to the anchor, with its hand empty and with something in it


class Seen(NamedTuple):
    """What is told of views at each step.

    Attributes:
        numbers: (B, T, size) the present view, those of the present room so far, and those of all rooms so far.
        after: (B, kept) what is to be kept after the last step.
    """

    numbers: Tensor
    after: Tensor


class Views:
    """The views that a robot has had in an episode, by its own state and its own actions.

    The first actions of the benchmark's robots are Goto, one for each room, in the order of the rooms in ``self``.

    Attributes:
        size: how many numbers tell of them.
        kept: how many numbers have to be kept from step to step.
    """

    def __init__(self, space: spaces.Space[Any]):
        """Find the robot's own state in a space.

        Raises:
            ValueError: there is none.
        """
        own = space.spaces.get(SELF) if isinstance(space, spaces.Dict) else None
        if own is None or not own.shape or own.shape[0] <= _AFTER_ROOMS:
            raise ValueError(f"views_past needs the robot's own state, {SELF!r}, in the observation; leave it out")
        self._rooms = own.shape[0] - _AFTER_ROOMS  # the last is none of the named ones
        self.size = (self._rooms + 2) * _FACING
        self.kept = self._rooms * _FACING + 1

    def __call__(self, observation: Mapping[str, Tensor], last_action: Tensor, before: Tensor | None) -> Seen:
        """Return what is told of views.

        Args:
            observation: tensors with the leading dimensions (B, T); zeros where there is only padding.
            last_action: (B, T, K) the robot's own action of the step before, negative for none.
            before: (B, kept) what was kept after the step before; None: the episodes begin.
        """
        state = observation[SELF].float()
        rooms, (cosine, sine, holds) = state[..., : self._rooms], state[..., self._rooms :].unbind(dim=-1)
        heading = torch.round(torch.atan2(sine, cosine) * HEADINGS / (2 * math.pi)).long() % HEADINGS
        before = state.new_zeros(len(state), self.kept) if before is None else before
        came = _last(heading + 1, self._arrived(rooms, last_action[..., 0]), before[:, -1].long())
        facing = nn.functional.one_hot(2 * ((heading + 1 - came) % HEADINGS) + (holds > 0), _FACING).to(rooms.dtype)
        facing = facing * (came > 0).unsqueeze(-1)
        now = rooms.unsqueeze(-1) * facing.unsqueeze(-2)
        so_far = torch.maximum(now.cummax(dim=1).values, before[:, :-1].unflatten(1, (1, self._rooms, _FACING)))
        here = (rooms.unsqueeze(-1) * so_far).sum(dim=-2)
        after = torch.cat([so_far[:, -1].flatten(1), came[:, -1:].to(rooms.dtype)], dim=1)
        return Seen(torch.cat([facing, here, so_far.flatten(-2)], dim=-1), after)

    def _arrived(self, rooms: Tensor, action: Tensor) -> Tensor:
        """Return whether an action (B, T) was the Goto of the room (B, T, rooms) where the robot is."""
        goto = (action >= 0) & (action < self._rooms - 1)
        there = rooms.gather(-1, action.clamp(0, self._rooms - 1).unsqueeze(-1)).squeeze(-1)
        return goto & (there > 0)


def _last(values: Tensor, chosen: Tensor, before: Tensor) -> Tensor:
    """Return at each step the last value (B, T) that was chosen so far, and before the first the one before (B)."""
    steps = torch.arange(1, values.shape[1] + 1, device=values.device)
    latest = (steps * chosen).cummax(dim=1).values
    return torch.where(latest > 0, values.gather(1, (latest - 1).clamp(min=0)), before.unsqueeze(1))
