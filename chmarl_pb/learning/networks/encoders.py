"""Encoders: a batch of observations -> one feature vector each.

:func:`build_encoder` reads the observation space alone. Of our own keys (``observation_keys.py``), a scene graph goes
through a graph convolution, tokens through an embedding; any picture goes through a convolutional network; every other
key is flattened.
"""

from collections.abc import Callable, Mapping
from typing import Any, cast

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.lookup import look_up
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS
from chmarl_pb.learning.networks.graphs import GatedGraphEncoder, GraphEncoder
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.networks.numbers import GoalEncoder, Numbers
from chmarl_pb.learning.networks.parts import FlatEncoder, Part, TokenEncoder, flattened, id_count
from chmarl_pb.learning.networks.tables import Table, word_table
from chmarl_pb.learning.observation_keys import (
    IMAGE,
    INSTRUCTION,
    NODE_CLASS,
    goals,
    graphs,
    is_features,
    is_picture,
    named,
    tokens,
)

GRAPH_POOLS: dict[str, type[GraphEncoder]] = {"mean": GraphEncoder, "gated": GatedGraphEncoder}


def build_encoder(
    space: spaces.Space[Any],
    size: int = 128,
    image_encoder: str = "cnn",
    graph_pool: str = "mean",
    numbers_past: bool = False,
    word_vectors: bool = False,
) -> nn.Module:
    """Return a module that encodes batches of a space's observations.

    >>> encoder = build_encoder(spaces.Dict({"range": spaces.Box(0, 10, (8,))}), size=16)
    >>> encoder({"range": torch.zeros(3, 8)}).shape
    torch.Size([3, 16])

    The module takes one tensor, or a dict of tensors for a Dict, with any leading dimensions, which it flattens to
    one: it returns (B, size), float32. Our keys may have a robot's name before them (``humanoid_image``). Graphs may be
    cut to fewer rows than their space has.

    Args:
        space: a Box, a Discrete, or a Dict of these.
        size: number of features.
        image_encoder: of pictures: a name in ``IMAGE_ENCODERS``; where ``FeatureEnv`` gives features in their place,
            the name in ``FROZEN_ENCODERS`` of what they come from.
        graph_pool: how a scene graph's nodes are pooled: "mean", or "gated" by the instruction.
        numbers_past: whether our keys of a few numbers, ``messages``, ``self`` and the bits of ``goal``, are also
            appended to the features as they are; see :class:`chmarl_pb.learning.networks.numbers.Numbers`.
        word_vectors: whether words and classes come from static word vectors, of which a linear map is learned, so that
            synonyms that training never shows are understood; see :mod:`chmarl_pb.tasks.language.vectors`.

    Raises:
        ValueError: the space is of another kind, or there is no such encoder.
        CheckpointError: there are no weights of ResNet-18.
    """
    if isinstance(space, spaces.Dict):
        return DictEncoder(space, size, image_encoder, graph_pool, numbers_past, word_vectors)
    part = _flat_or_image(space, image_encoder)
    return nn.Sequential(part, nn.Linear(part.size, size), nn.ReLU(), nn.Linear(size, size), nn.ReLU())


class DictEncoder(nn.Module):
    """Encodes each part of a Dict by itself, and all of them together by two linear layers.

    Attributes:
        size: number of features, with the numbers that go past the layers.
    """

    def __init__(
        self,
        space: spaces.Dict,
        size: int,
        image_encoder: str,
        graph_pool: str,
        numbers_past: bool = False,
        word_vectors: bool = False,
    ):
        """Make the parts that a space needs."""
        super().__init__()
        self.space, pool = space, look_up("graph_pool", graph_pool, GRAPH_POOLS)
        tables: dict[int, Table] = {}  # one table for each size of vocabulary: instruction and feedback share it
        parts: dict[str, Part] = {}
        self.graphs, self._tokens, goal, pictures = graphs(space), tokens(space), goals(space), named(space, IMAGE)
        inside = {key for others in self.graphs.values() for key in others}
        for key, box in space.spaces.items():
            if key in self.graphs:
                parts[key] = pool(box, space[self.graphs[key][0]], word_vectors)
            elif key in self._tokens:
                count = id_count(box)
                parts[key] = TokenEncoder(tables.setdefault(count, word_table(count, word_vectors)))
            elif key in goal:
                parts[key] = GoalEncoder(box, word_vectors)
            elif key not in inside:
                parts[key] = _flat_or_image(box, image_encoder, key in pictures, word_vectors)
        self.keys, self.parts = tuple(parts), nn.ModuleList(parts.values())
        width = sum(part.size for part in parts.values())
        self.joint = nn.Sequential(nn.Linear(width, size), nn.ReLU(), nn.Linear(size, size), nn.ReLU())
        self.numbers = Numbers(space) if numbers_past else None
        self.size = size + (self.numbers.size if self.numbers else 0)

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """Return (B, size)."""
        flat = {key: flattened(observation[key], box.shape) for key, box in self.space.spaces.items()}
        features = []
        for key, part in zip(self.keys, self.parts, strict=True):
            beside = [flat[other] for other in self.graphs.get(key, ())]
            if part.asks:
                beside.append(self._asked(_instruction_beside(key), flat))
            features.append(part(flat[key], *beside))
        joint = self.joint(torch.cat(features, dim=1))
        return torch.cat([joint, self.numbers(observation)], dim=1) if self.numbers else joint

    def _asked(self, key: str, flat: Mapping[str, Tensor]) -> Tensor:
        """Return the sum of the embeddings of an instruction's words, (B, EMBEDDING)."""
        if key not in self._tokens:
            raise ValueError(f"pooling by the instruction needs its tokens, {key!r}, in the observation")
        return cast(TokenEncoder, self.parts[self.keys.index(key)]).total(flat[key])


def _flat_or_image(
    space: spaces.Space[Any], image_encoder: str, ours: bool = False, word_vectors: bool = False
) -> Part:
    """Return what encodes a part of a space; features of pictures are known under our own key alone."""
    if isinstance(space, spaces.Box) and is_picture(space):
        return look_up("image_encoder", image_encoder, IMAGE_ENCODERS)(space.shape)
    if ours and is_features(space):
        kind = look_up("image_encoder", image_encoder, FROZEN_ENCODERS)
        if space.shape != kind.shape:
            raise ValueError(
                f"pictures have features of shape {space.shape}, not those of {image_encoder}: {kind.shape}"
            )
        return kind.reader(word_vectors)
    if isinstance(space, spaces.Box | spaces.Discrete):
        return FlatEncoder(space)
    raise ValueError(f"{space} cannot be encoded; use a Box, a Discrete, or a Dict of these")


def _instruction_beside(key: str) -> str:
    """Return the key of the instruction beside that of a graph's nodes or of a picture: both have the same prefix."""
    return key.removesuffix(NODE_CLASS).removesuffix(IMAGE) + INSTRUCTION


#: Name -> what makes the encoder of a space: called with the space, the number of features, and the names of the
#: encoder of pictures and of the pool of graphs; where a run asks for it, also with ``word_vectors=True``.
ENCODERS: dict[str, Callable[..., nn.Module]] = {"household": build_encoder}
