"""The parts of an encoder: each turns one key of an observation into features. Here: words, numbers, features."""

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.networks.match import Wanted
from chmarl_pb.learning.networks.tables import EMBEDDING, Table

FEATURES = 512  # of a picture, after a frozen network


class Asked(NamedTuple):
    """What the instruction says.

    Attributes:
        words: (B, EMBEDDING) the sum of the embeddings of its words.
        wanted: how likely each class is that of X, and of Y; None where nothing compares them.
    """

    words: Tensor
    wanted: Wanted | None = None


class PartEncoder(nn.Module):
    """Encodes one part of an observation.

    Attributes:
        size: number of its features.
        asks: whether it also takes what the instruction says, ``asked``.
        matches: whether it needs ``asked.wanted``, too.
        locates: how many numbers its method ``places``, with the arguments of ``forward``, returns, which tells where X
            and Y lie: see :mod:`chmarl_pb.learning.networks.cells` and :mod:`~chmarl_pb.learning.networks.bearings`; 0
            without one.
    """

    size: int
    asks = False
    matches = False
    locates = 0


class TokenEncoder(PartEncoder):
    """The mean of the embeddings of a sentence's words; 0 is padding."""

    size = EMBEDDING

    def __init__(self, words: Table):
        """Use a table of words."""
        super().__init__()
        self.words = words

    def forward(self, tokens: Tensor) -> Tensor:
        """Return (B, EMBEDDING) from token ids (B, length)."""
        return nn.functional.embedding_bag(tokens.long(), self.words.weight, mode="mean", padding_idx=0)

    def total(self, tokens: Tensor) -> Tensor:
        """Return the sum of the embeddings, (B, EMBEDDING): no word is weaker in a longer sentence."""
        return nn.functional.embedding_bag(tokens.long(), self.words.weight, mode="sum", padding_idx=0)


class FeatureEncoder(PartEncoder):
    """A linear layer to 512 on features of a picture that come from a frozen network (as in CH-MARL)."""

    size = FEATURES

    def __init__(self, count: int = FEATURES):
        """Make the layer for a number of features."""
        super().__init__()
        self.linear = nn.Sequential(nn.Linear(count, FEATURES), nn.ReLU())

    def forward(self, features: Tensor) -> Tensor:
        """Return (B, 512) from float16 features (B, count)."""
        encoded: Tensor = self.linear(features.float())
        return encoded


class FlatEncoder(PartEncoder):
    """The numbers as they are; a Discrete, and each component of a MultiDiscrete, as one-hot."""

    starts: Tensor

    def __init__(self, space: spaces.Space[Any]):
        """Know the size of a space."""
        super().__init__()
        self.shape = space.shape or ()
        self.counts: list[int] = []
        starts = np.zeros(0, dtype=np.int64)
        if isinstance(space, spaces.Discrete):
            self.counts, starts = [int(space.n)], np.array([space.start], dtype=np.int64)
        elif isinstance(space, spaces.MultiDiscrete):
            self.counts, starts = space.nvec.ravel().tolist(), np.asarray(space.start, dtype=np.int64).ravel()
        self.register_buffer("starts", torch.from_numpy(starts), persistent=False)
        self.size = sum(self.counts) or math.prod(self.shape)

    def forward(self, values: Tensor) -> Tensor:
        """Return (B, size)."""
        flat = flattened(values, self.shape).reshape(-1, math.prod(self.shape))
        if not self.counts:
            return flat.float()
        rows = (flat.long() - self.starts).unbind(dim=1)
        return torch.cat([one_hot_of(row, count) for row, count in zip(rows, self.counts, strict=True)], dim=1)


def one_hot_of(numbers: Tensor, count: int) -> Tensor:
    """Return numbers (...) as one-hot (..., count); zeros for one that is none of them: it is nobody's, or unknown."""
    known = (numbers >= 0) & (numbers < count)
    return nn.functional.one_hot(numbers.clamp(0, count - 1), count).float() * known.unsqueeze(-1)


def flattened(values: Tensor, shape: tuple[int, ...] | None) -> Tensor:
    """Return the values with one leading dimension; graphs may be cut to fewer rows than their space has."""
    rank = len(shape or ())
    return values.reshape(-1, *values.shape[values.dim() - rank :])


def id_count(space: spaces.Space[Any]) -> int:
    """Return the number of ids in a Box of ids, with 0.

    Raises:
        ValueError: the space is no Box.
    """
    if not isinstance(space, spaces.Box):
        raise ValueError(f"{space} is not a Box of ids")
    return int(space.high.max()) + 1
