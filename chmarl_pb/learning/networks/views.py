"""In which directions robots have looked, in which rooms: what a search has to keep, and a GRU learns to count late."""

import math
from collections.abc import Mapping

import torch
from gymnasium import spaces
from torch import Tensor

from chmarl_pb.learning.observation_keys import SELF, named
from chmarl_pb.navigation.lattice import HEADINGS

_AFTER_ROOMS = 3  # numbers of ``self``: cosine and sine of the heading, whether it holds something


class Views:
    """The view that a robot has by its own state: its room, its heading, and whether its hand is empty.

    Attributes:
        size: number of views there are, of all robots whose states are observed.
    """

    def __init__(self, space: spaces.Space[object]):
        """Find the robots' own states in a space.

        Raises:
            ValueError: there are none.
        """
        keys = space.spaces if isinstance(space, spaces.Dict) else {}
        shapes = {key: keys[key].shape or (0,) for key in named(keys, SELF)}
        if not shapes:
            raise ValueError(f"views_past needs the robots' own states, {SELF!r}, in the observation; leave it out")
        self._keys = tuple(shapes)
        self.size = sum(2 * HEADINGS * (shape[-1] - _AFTER_ROOMS) for shape in shapes.values())

    def __call__(self, observation: Mapping[str, Tensor]) -> Tensor:
        """Return the present views as ones among zeros, (..., size); nothing but zeros where there is only padding."""
        return torch.cat([_view(observation[key].float()) for key in self._keys], dim=-1)


def _view(state: Tensor) -> Tensor:
    """Return the view (..., 2 * HEADINGS * rooms) of a robot's own state (..., rooms + 3)."""
    rooms, (cosine, sine, holds) = state[..., :-_AFTER_ROOMS], state[..., -_AFTER_ROOMS:].unbind(dim=-1)
    heading = torch.round(torch.atan2(sine, cosine) * HEADINGS / (2 * math.pi)).long() % HEADINGS
    facing = torch.nn.functional.one_hot(2 * heading + (holds > 0).long(), 2 * HEADINGS).to(rooms.dtype)
    return (rooms.unsqueeze(-1) * facing.unsqueeze(-2)).flatten(-2)
