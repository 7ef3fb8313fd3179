"""Scene graphs: a graph convolution over all graphs of a batch at once.

Letters: B graphs in the batch, N real nodes of all of them.
"""

from dataclasses import dataclass
from typing import Any

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.networks.parts import Part, id_count
from chmarl_pb.learning.networks.tables import EMBEDDING, class_table, embedding

GRAPH = 64  # features of a node after each graph convolution
HEADS, KEY, VALUE = 8, 32, 16  # of gated pooling: questions that are asked of each node, and numbers in each

_CLOSED = 3.0  # gates are nearly closed at first: sigmoid(-3) is 0.05


class GraphEncoder(Part):
    """Class and state embeddings -> two graph convolutions -> mean over the nodes.

    A convolution is that of Kipf and Welling 2017 (https://arxiv.org/abs/1609.02907, eq. 2) with the bias inside,
    ReLU(D^-1/2 (A + I) D^-1/2 (H W + b)): A counts the relations between two nodes, whatever their kind and direction,
    and D is the degree with the self loop. An empty graph has the features 0.
    """

    size = GRAPH

    def __init__(self, classes: spaces.Space[Any], states: spaces.Space[Any], word_vectors: bool = False):
        """Make tables for the ids in two spaces; 0 is padding."""
        super().__init__()
        self.classes, self.states = class_table(id_count(classes), word_vectors), embedding(id_count(states))
        self.first = nn.Linear(2 * EMBEDDING, GRAPH)
        self.second = nn.Linear(GRAPH, GRAPH)

    def forward(self, node_class: Tensor, node_state: Tensor, edges: Tensor) -> Tensor:
        """Return (B, GRAPH) from classes (B, nodes), states (B, nodes), edges (B, edges, 3)."""
        real = node_class > 0  # padding is left out: (N) nodes of all graphs, one after the other
        return _mean(self.convolved(real, node_class, node_state, edges), real)

    def convolved(self, real: Tensor, node_class: Tensor, node_state: Tensor, edges: Tensor) -> Tensor:
        """Return (N, GRAPH) of all real nodes after both convolutions."""
        spread = _propagation(real, edges)
        nodes = self._embedded(node_class[real].long(), node_state[real].long())
        nodes = torch.relu(spread(nodes))
        return torch.relu(spread(self.second(nodes)))

    def _embedded(self, node_class: Tensor, node_state: Tensor) -> Tensor:
        """Return H W + b of the first convolution; the product is taken once for each class and state, not node."""
        by_class = self.classes.weight @ self.first.weight[:, :EMBEDDING].T + self.first.bias
        by_state = self.states.weight @ self.first.weight[:, EMBEDDING:].T
        return by_class.index_select(0, node_class) + by_state.index_select(0, node_state)


class GatedGraphEncoder(GraphEncoder):
    """The same convolutions, but pooled by what the instruction asks for, beside the mean.

    A mean over all nodes blurs whether the one thing that counts is among them. Here each of ``HEADS`` gates, in
    (0, 1), compares a node's class with the words of the instruction; a head is the sum of what lies behind its
    gates, so it tells whether such a node is there, its state and what it is related to.
    """

    size = GRAPH + HEADS * (VALUE + 1)
    asks = True

    def __init__(self, classes: spaces.Space[Any], states: spaces.Space[Any], word_vectors: bool = False):
        """Make tables for the ids in two spaces; 0 is padding."""
        super().__init__(classes, states, word_vectors)
        self.key = nn.Linear(EMBEDDING, HEADS * KEY)
        self.query = nn.Linear(EMBEDDING, HEADS * KEY)
        self.value = nn.Linear(GRAPH, HEADS * VALUE)

    def forward(self, node_class: Tensor, node_state: Tensor, edges: Tensor, words: Tensor | None = None) -> Tensor:
        """Return (B, size); ``words`` is the sum of the embeddings of the instruction's words, (B, EMBEDDING)."""
        assert words is not None
        real = node_class > 0
        graph, ids = real.nonzero(as_tuple=True)[0], node_class[real].long()
        nodes = self.convolved(real, node_class, node_state, edges)
        keys = self.key(self.classes.weight).unflatten(1, (HEADS, KEY))
        match = torch.einsum("chd,bhd->bch", keys, self.query(words).unflatten(1, (HEADS, KEY)))  # of class and words
        gates = torch.sigmoid(match.flatten(0, 1).index_select(0, graph * len(keys) + ids) - _CLOSED)
        pooled = (self.value(nodes).unflatten(1, (HEADS, VALUE)) * gates.unsqueeze(2)).flatten(1)
        heads = torch.cat([pooled, gates], dim=1)
        pooled = heads.new_zeros(len(real), heads.shape[1]).index_add_(0, graph, heads)
        return torch.cat([_mean(nodes, real), pooled], dim=1)


def _mean(nodes: Tensor, real: Tensor) -> Tensor:
    """Return the means (B, F) of the features (N, F) of each graph's nodes; 0 for an empty graph."""
    total = nodes.new_zeros(len(real), nodes.shape[1]).index_add_(0, real.nonzero(as_tuple=True)[0], nodes)
    return total / real.sum(dim=1, keepdim=True).clamp(min=1)


@dataclass(frozen=True)
class _Propagation:
    """The matrix D^-1/2 (A + I) D^-1/2 of all graphs of a batch, (N, N), row after row.

    A graph of the benchmark has about 10 nodes of at most 96: for 928 graphs, the gradient step of one robot, dense
    matrices take 145 + 100 ms (forward + backward; 33 + 19 ms if cut to the largest graph), this one 14 + 14 ms.

    Attributes:
        columns: of the numbers that are not 0.
        starts: (N + 1) where the rows begin, and the end of the last.
        values: the numbers.
    """

    columns: Tensor
    starts: Tensor
    values: Tensor

    def __call__(self, features: Tensor) -> Tensor:
        """Return the product with features (N, F)."""
        return nn.functional.embedding_bag(
            self.columns, features, self.starts, mode="sum", per_sample_weights=self.values, include_last_offset=True
        )


def _propagation(real: Tensor, edges: Tensor) -> _Propagation:
    """Return what spreads features over the graphs of a batch.

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
    return _Propagation(columns, starts, values)
