"""Encoders: a batch of observations -> one feature vector each.

:func:`build_encoder` reads the observation space alone. Of our own keys, a scene graph goes through a graph
convolution, tokens through an embedding, a picture through a convolutional network; every other key is flattened.
Letters: B observations in the batch, N real nodes of all graphs of the batch, E real edges, S features.
"""

import math
import warnings
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Literal

import torch
from gymnasium import spaces
from torch import Tensor, nn

Observation = Tensor | Mapping[str, Tensor]
ImageEncoder = Literal["cnn", "resnet18"]

EMBEDDING = 32  # features of a word, of a node's class, and of its state
GRAPH = 64  # features of a node after each graph convolution
IMAGE = 256  # features of a picture

# The one product that is used of the beta state is tested.
warnings.filterwarnings("ignore", "Sparse CSR tensor support", UserWarning)

_NODE_CLASS, _NODE_STATE, _EDGES = "node_class", "node_state", "edges"
_TOKENS = ("instruction", "feedback")


def build_encoder(space: spaces.Space, size: int = 128, image_encoder: ImageEncoder = "cnn") -> nn.Module:
    """Return a module that encodes batches of a space's observations.

    The module takes one tensor, or a dict of tensors for a Dict, with any leading dimensions, which it flattens to
    one: it returns (B, size), float32. Keys may have a prefix (``humanoid_image``).

    Args:
        space: a Box, a Discrete, or a Dict of these.
        size: number of features.
        image_encoder: "cnn" is small and learns; "resnet18" is frozen, see :mod:`training.resnet`.

    Raises:
        ValueError: the space is of another kind.
    """
    if isinstance(space, spaces.Dict):
        return DictEncoder(space, size, image_encoder)
    part = _flat_or_image(space, image_encoder)
    return nn.Sequential(part, nn.Linear(part.size, size), nn.ReLU(), nn.Linear(size, size), nn.ReLU())


class Part(nn.Module):
    """Encodes one part of an observation.

    Attributes:
        size: number of its features.
    """

    size: int


class DictEncoder(nn.Module):
    """Encodes each part of a Dict by itself, and all of them together by two linear layers."""

    def __init__(self, space: spaces.Dict, size: int, image_encoder: ImageEncoder):
        """Make the parts that a space needs."""
        super().__init__()
        self.space = space
        words: dict[int, nn.Embedding] = {}  # one table for each size of vocabulary: instruction and feedback share it
        parts: dict[str, Part] = {}
        for key, box in space.spaces.items():
            if key.endswith(_NODE_CLASS):
                parts[key] = GraphEncoder(space[key], space[_beside(key, _NODE_STATE)])
            elif key.endswith(_TOKENS) and len(box.shape or ()) == 1:
                parts[key] = TokenEncoder(words.setdefault(_count(box), _embedding(_count(box))))
            elif not key.endswith((_NODE_STATE, _EDGES)):
                parts[key] = _flat_or_image(box, image_encoder)
        self.keys, self.parts = tuple(parts), nn.ModuleList(parts.values())
        width = sum(part.size for part in parts.values())
        self.joint = nn.Sequential(nn.Linear(width, size), nn.ReLU(), nn.Linear(size, size), nn.ReLU())

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """Return (B, size)."""
        flat = {key: _flattened(observation[key], box.shape) for key, box in self.space.spaces.items()}
        features = []
        for key, part in zip(self.keys, self.parts, strict=True):
            beside = (_NODE_STATE, _EDGES) if isinstance(part, GraphEncoder) else ()
            features.append(part(flat[key], *(flat[_beside(key, other)] for other in beside)))
        return self.joint(torch.cat(features, dim=1))


class GraphEncoder(Part):
    """Class and state embeddings -> two graph convolutions -> mean over the nodes.

    A convolution is that of Kipf and Welling 2017 (https://arxiv.org/abs/1609.02907, eq. 2),
    ReLU(D^-1/2 (A + I) D^-1/2 H W + b): A counts the relations between two nodes, whatever their kind and direction,
    and D is the degree with the self loop. An empty graph has the features 0.
    """

    size = GRAPH

    def __init__(self, classes: spaces.Space, states: spaces.Space):
        """Make tables for the ids in two spaces; 0 is padding."""
        super().__init__()
        self.classes, self.states = _embedding(_count(classes)), _embedding(_count(states))
        self.first = nn.Linear(2 * EMBEDDING, GRAPH)
        self.second = nn.Linear(GRAPH, GRAPH)

    def forward(self, node_class: Tensor, node_state: Tensor, edges: Tensor) -> Tensor:
        """Return (B, GRAPH) from classes (B, nodes), states (B, nodes), edges (B, edges, 3)."""
        real = node_class > 0  # padding is left out: (N) nodes of all graphs, one after the other
        spread = _propagation(real, edges)
        nodes = self._embedded(node_class[real].long(), node_state[real].long())
        nodes = torch.relu(_Product.apply(spread, nodes))
        nodes = torch.relu(_Product.apply(spread, self.second(nodes)))
        total = nodes.new_zeros(len(real), GRAPH).index_add_(0, real.nonzero(as_tuple=True)[0], nodes)
        return total / real.sum(dim=1, keepdim=True).clamp(min=1)

    def _embedded(self, node_class: Tensor, node_state: Tensor) -> Tensor:
        """Return H W + b of the first convolution; the product is taken once for each class and state, not node."""
        by_class = self.classes.weight @ self.first.weight[:, :EMBEDDING].T + self.first.bias
        by_state = self.states.weight @ self.first.weight[:, EMBEDDING:].T
        return by_class.index_select(0, node_class) + by_state.index_select(0, node_state)


class _Product(torch.autograd.Function):
    """A symmetric sparse matrix without gradient, times features."""

    @staticmethod
    def forward(ctx: Any, matrix: Tensor, features: Tensor) -> Tensor:
        ctx.matrix = matrix
        return torch.sparse.mm(matrix, features)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[None, Tensor]:
        return None, torch.sparse.mm(ctx.matrix, gradient)


def _propagation(real: Tensor, edges: Tensor) -> Tensor:
    """Return D^-1/2 (A + I) D^-1/2 of all graphs of a batch as one sparse matrix (N, N).

    Args:
        real: (B, nodes) which nodes are not padding.
        edges: (B, edges, 3) source, target and relation, which is 0 for padding; edges to padding are left out.
    """
    numbers = real.flatten().cumsum(0).sub_(1).view(real.shape)  # of the nodes in the batch
    numbers = nn.functional.pad(numbers.masked_fill(~real, -1), (0, 1), value=-1)  # for an end that is no node
    graph, row = (edges[..., 2] > 0).nonzero(as_tuple=True)
    ends = numbers[graph.unsqueeze(1), edges[graph, row, :2].long().clamp(max=real.shape[1])]
    one, other = ends[(ends >= 0).all(dim=1)].unbind(dim=1)
    loops = torch.arange(int(real.sum()), device=real.device)
    rows, columns = torch.cat([one, other, loops]), torch.cat([other, one, loops])
    degree = torch.bincount(rows, minlength=len(loops))
    root = degree.float().rsqrt()
    columns = columns[rows.argsort()]
    values = root.repeat_interleave(degree) * root[columns]
    starts = nn.functional.pad(degree.cumsum(0), (1, 0))
    return torch.sparse_csr_tensor(
        starts.int(), columns.int(), values, (len(loops), len(loops)), check_invariants=False
    )


class TokenEncoder(Part):
    """The mean of the embeddings of a sentence's words; 0 is padding."""

    size = EMBEDDING

    def __init__(self, words: nn.Embedding):
        """Use a table of words."""
        super().__init__()
        self.words = words

    def forward(self, tokens: Tensor) -> Tensor:
        """Return (B, EMBEDDING) from token ids (B, length)."""
        return nn.functional.embedding_bag(tokens.long(), self.words.weight, mode="mean", padding_idx=0)


class FlatEncoder(Part):
    """The numbers as they are; a Discrete as one-hot."""

    def __init__(self, space: spaces.Space):
        """Know the size of a space."""
        super().__init__()
        self.shape = space.shape or ()
        self.count = int(space.n) if isinstance(space, spaces.Discrete) else None
        self.size = self.count or math.prod(self.shape)

    def forward(self, values: Tensor) -> Tensor:
        """Return (B, size)."""
        flat = _flattened(values, self.shape)
        if self.count is not None:
            return nn.functional.one_hot(flat.long(), self.count).float()
        return flat.flatten(start_dim=1).float() if self.shape else flat.unsqueeze(1).float()


class ConvEncoder(Part):
    """A small convolutional network that is trained with all the rest; for pictures of any size from 32 pixels."""

    size = IMAGE

    def __init__(self, shape: tuple[int, ...]):
        """Make the layers for pictures (height, width, channels) or (channels, height, width)."""
        super().__init__()
        self.shape, self.channels_first = shape, shape[0] < shape[2]
        widths = (min(shape), 32, 48, 64, 64)
        layers: list[nn.Module] = []
        for number, (inputs, outputs) in enumerate(pairwise(widths)):
            layers += [nn.Conv2d(inputs, outputs, 5 if number == 0 else 3, stride=2, padding=2 if number == 0 else 1)]
            layers += [nn.ReLU()]
        # 4 x 4 cells keep where things are.
        self.layers = nn.Sequential(
            *layers, nn.AdaptiveAvgPool2d(4), nn.Flatten(), nn.Linear(widths[-1] * 16, IMAGE), nn.ReLU()
        )

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, IMAGE) from uint8 pictures (B, *shape)."""
        pictures = _flattened(images, self.shape)
        if not self.channels_first:
            pictures = pictures.permute(0, 3, 1, 2)
        return self.layers(pictures.float() / 255 - 0.5)


def _flat_or_image(space: spaces.Space, image_encoder: ImageEncoder) -> Part:
    if isinstance(space, spaces.Box) and len(space.shape) == 3 and space.dtype == "uint8":
        if image_encoder == "cnn":
            return ConvEncoder(space.shape)
        raise ValueError(f"image_encoder={image_encoder!r} is not known; use one of: cnn, resnet18")
    if isinstance(space, spaces.Box | spaces.Discrete):
        return FlatEncoder(space)
    raise ValueError(f"{space} cannot be encoded; use a Box, a Discrete, or a Dict of these")


def _beside(key: str, name: str) -> str:
    return key.removesuffix(_NODE_CLASS) + name


def _flattened(values: Tensor, shape: tuple[int, ...] | None) -> Tensor:
    return values.reshape(-1, *(shape or ()))


def _count(space: spaces.Space) -> int:
    if not isinstance(space, spaces.Box):
        raise ValueError(f"{space} is not a Box of ids")
    return int(space.high.max()) + 1


def _embedding(count: int) -> nn.Embedding:
    return nn.Embedding(count, EMBEDDING, padding_idx=0)
