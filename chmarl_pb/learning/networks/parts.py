"""The parts of an encoder: each turns one key of an observation into features. Here: words, numbers, features."""

import math
from typing import Any

from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.networks.tables import EMBEDDING, Table

FEATURES = 512  # of a picture, after a frozen network


class Part(nn.Module):
    """Encodes one part of an observation.

    Attributes:
        size: number of its features.
        asks: whether it also takes the sum of the embeddings of the instruction's words, as its last argument.
    """

    size: int
    asks = False


class TokenEncoder(Part):
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


class FeatureEncoder(Part):
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


class FlatEncoder(Part):
    """The numbers as they are; a Discrete as one-hot."""

    def __init__(self, space: spaces.Space[Any]):
        """Know the size of a space."""
        super().__init__()
        self.shape = space.shape or ()
        self.count = int(space.n) if isinstance(space, spaces.Discrete) else None
        self.start = int(space.start) if isinstance(space, spaces.Discrete) else 0
        self.size = self.count or math.prod(self.shape)

    def forward(self, values: Tensor) -> Tensor:
        """Return (B, size)."""
        flat = flattened(values, self.shape)
        if self.count is not None:
            counted = flat.long() - self.start
            return nn.functional.one_hot(counted.clamp(min=0), self.count).float() * (counted >= 0).unsqueeze(-1)
        return flat.flatten(start_dim=1).float() if self.shape else flat.unsqueeze(1).float()


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
