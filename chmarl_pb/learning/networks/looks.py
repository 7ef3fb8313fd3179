"""Where a robot has looked in an episode: the headings that it has had in each room, by its own observation."""

from collections.abc import Mapping
from typing import Any

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.observation_keys import SELF, named

HEADINGS = 12  # steps of 30 degrees, by which the benchmark's robots turn
_AFTER = 3  # numbers of a robot's own state behind the rooms: cosine and sine of its heading, whether it holds


class Looks(nn.Module):
    """Remembers the headings, and tells them as the robot turns: which are left to look to from where it stands.

    Attributes:
        state_size: numbers that are kept from step to step.
        size: numbers that are told: for each own state in the observation, of the robot's present room whether it has
            looked in each of the headings, counted to the left from its present one, and which of them was the first;
            of each room the share of the headings.
    """

    def __init__(self, space: spaces.Space[Any]):
        """Find the own states in a space.

        Raises:
            ValueError: there are none.
        """
        super().__init__()
        found = space.spaces if isinstance(space, spaces.Dict) else {}
        self._rooms = {key: spaces.flatdim(found[key]) - _AFTER for key in named(found, SELF)}
        if min(self._rooms.values(), default=0) < 1:
            raise ValueError("looks_past: no observation has a self with rooms and a heading; leave it out")
        self.state_size = sum(2 * rooms * HEADINGS for rooms in self._rooms.values())
        self.size = sum(rooms + 2 * HEADINGS for rooms in self._rooms.values())

    def forward(self, observation: Mapping[str, Tensor], before: Tensor | None) -> tuple[Tensor, Tensor]:
        """Return what is told (B, T, size), and what is kept after each step (B, T, state_size).

        Args:
            observation: tensors with the leading dimensions (B, T).
            before: (B, state_size) what was kept; None at the beginning.
        """
        told, kept, sizes = [], [], [2 * rooms * HEADINGS for rooms in self._rooms.values()]
        befores = [None] * len(sizes) if before is None else before.split(sizes, dim=1)
        for key, known in zip(self._rooms, befores, strict=True):
            own = observation[key].float()
            looks, first = _looked(_look(own), None if known is None else known.unflatten(1, (2, -1, HEADINGS)))
            told.append(_told(own, looks, first))
            kept += [looks.flatten(2), first.flatten(2)]
        return torch.cat(told, dim=2), torch.cat(kept, dim=2)


def _heading(own: Tensor) -> Tensor:
    """Return (B, T) the number of the heading of own states (B, T, N)."""
    angle = torch.atan2(own[..., -2], own[..., -3])
    return (angle * (HEADINGS / (2 * torch.pi))).round().long() % HEADINGS


def _look(own: Tensor) -> Tensor:
    """Return (B, T, rooms, HEADINGS) in which room and heading a robot looks."""
    heading = nn.functional.one_hot(_heading(own), HEADINGS).to(own.dtype)
    return own[..., :-_AFTER].unsqueeze(3) * heading.unsqueeze(2)


def _looked(look: Tensor, before: Tensor | None) -> tuple[Tensor, Tensor]:
    """Return (B, T, rooms, HEADINGS) in which headings a robot has looked so far, and the first one in each room."""
    before = look.new_zeros(len(look), 2, *look.shape[2:]) if before is None else before
    looks = torch.maximum(look.cummax(dim=1).values, before[:, :1])
    known = torch.cat([before[:, :1], looks[:, :-1]], dim=1).amax(dim=3, keepdim=True)
    first = torch.maximum((look * (1 - known)).cummax(dim=1).values, before[:, 1:])
    return looks, first


def _told(own: Tensor, looks: Tensor, first: Tensor) -> Tensor:
    """Return (B, T, 2 * HEADINGS + rooms) what a robot is told of where it has looked."""
    order = (_heading(own).unsqueeze(2) + torch.arange(HEADINGS, device=own.device)) % HEADINGS
    room = own[..., :-_AFTER].unsqueeze(3)
    here = [(room * part).sum(dim=2).gather(2, order) for part in (looks, first)]
    return torch.cat([*here, looks.mean(dim=3)], dim=2)
