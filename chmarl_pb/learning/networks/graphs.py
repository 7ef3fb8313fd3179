"""Scene graphs: a graph convolution over all graphs of a batch at once.

Letters: B graphs in the batch, N real nodes of all of them.
"""

from typing import Any

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.networks.graph_batch import Nodes, mean_of, propagation, sum_of
from chmarl_pb.learning.networks.parts import Asked, PartEncoder, id_count
from chmarl_pb.learning.networks.tables import EMBEDDING, Table, class_table, colour_table, embedding

GRAPH = 64  # features of a node after each graph convolution
VIEW = 3  # numbers of a node's place in the picture
HEADS, KEY, VALUE = 8, 32, 16  # of gated pooling: questions that are asked of each node, and numbers in each

_CLOSED = 3.0  # gates are nearly closed at first: sigmoid(-3) is 0.05


class GraphEncoder(PartEncoder):
    """Class and state embeddings -> two graph convolutions -> mean over the nodes.

    A convolution is that of Kipf and Welling 2017 (https://arxiv.org/abs/1609.02907, eq. 2) with the bias inside,
    ReLU(D^-1/2 (A + I) D^-1/2 (H W + b)): A counts the relations between two nodes, whatever their kind and direction,
    and D is the degree with the self loop. An empty graph has the features 0. Where nodes have colours, or places in
    the robot's picture, these are features of a node beside its class and state.
    """

    size = GRAPH

    def __init__(
        self,
        classes: spaces.Space[Any],
        states: spaces.Space[Any],
        meaning: nn.Linear | None = None,
        colours: spaces.Space[Any] | None = None,
        views: bool = False,
    ):
        """Make tables for the ids in spaces; 0 is padding.

        Args:
            classes: of ``node_class``.
            states: of ``node_state``.
            meaning: map of word vectors that tables are made by; None: they are learned row by row.
            colours: of ``node_color``, if there is one.
            views: whether there is a ``node_view``.
        """
        super().__init__()
        self.classes, self.states = class_table(id_count(classes), meaning), embedding(id_count(states))
        self.first = nn.Linear(2 * EMBEDDING, GRAPH)
        self.second = nn.Linear(GRAPH, GRAPH)
        self.colours: Table | None = None if colours is None else colour_table(id_count(colours), meaning)
        self.painted = None if colours is None else nn.Linear(EMBEDDING, GRAPH, bias=False)
        self.placed = nn.Linear(VIEW, GRAPH, bias=False) if views else None

    def forward(
        self,
        node_class: Tensor,
        node_state: Tensor,
        edges: Tensor,
        color: Tensor | None = None,
        view: Tensor | None = None,
        asked: Asked | None = None,
    ) -> Tensor:
        """Return (B, size).

        Args:
            node_class: (B, nodes) ids of classes.
            node_state: (B, nodes) ids of states.
            edges: (B, edges, 3).
            color: (B, nodes) ids of colours, if the encoder knows of them.
            view: (B, nodes, 3) places in the picture, if the encoder knows of them.
            asked: what the instruction asks for; the mean does not need it.
        """
        graph = Nodes.of(node_class, node_state, edges, color, view)
        nodes = self._convolved(graph)
        return torch.cat([mean_of(nodes, graph.real), *self._heads(nodes, graph, asked)], dim=1)

    def _heads(self, nodes: Tensor, graph: Nodes, asked: Asked | None) -> list[Tensor]:
        """Return what is pooled beside the mean, (B, features) each, from the convolved nodes (N, GRAPH)."""
        return []

    def _convolved(self, graph: Nodes) -> Tensor:
        """Return (N, GRAPH) of all real nodes after both convolutions."""
        spread = propagation(graph)
        nodes = torch.relu(spread(self._embedded(graph)))
        return torch.relu(spread(self.second(nodes)))

    def _embedded(self, graph: Nodes) -> Tensor:
        """Return H W + b of the first convolution; the product is taken once for each class and state, not node."""
        by_class = self.classes.weight @ self.first.weight[:, :EMBEDDING].T + self.first.bias
        by_state = self.states.weight @ self.first.weight[:, EMBEDDING:].T
        nodes = by_class.index_select(0, graph.classes) + by_state.index_select(0, graph.states)
        if self.colours is not None and self.painted is not None and graph.colours is not None:
            nodes = nodes + self.painted(self.colours.weight).index_select(0, graph.colours)
        if self.placed is not None and graph.views is not None:
            nodes = nodes + self.placed(graph.views)
        return nodes


class GatedGraphEncoder(GraphEncoder):
    """The same convolutions, but pooled by what the instruction asks for, beside the mean.

    A mean over all nodes blurs whether the one thing that counts is among them. Here each of ``HEADS`` gates, in
    (0, 1), compares a node's class with the words of the instruction; a head is the sum of what lies behind its
    gates, so it tells whether such a node is there, its state and what it is related to.
    """

    size = GRAPH + HEADS * (VALUE + 1)
    asks = True

    def __init__(self, *tables: Any):
        """Make tables for the ids in spaces; see :class:`GraphEncoder`."""
        super().__init__(*tables)
        self.key = nn.Linear(EMBEDDING, HEADS * KEY)
        self.query = nn.Linear(EMBEDDING, HEADS * KEY)
        self.value = nn.Linear(GRAPH, HEADS * VALUE)

    def _heads(self, nodes: Tensor, graph: Nodes, asked: Asked | None) -> list[Tensor]:
        """Return the sums behind the gates, and the sums of the gates."""
        assert asked is not None
        keys = self.key(self.classes.weight).unflatten(1, (HEADS, KEY))
        match = torch.einsum("chd,bhd->bch", keys, self.query(asked.words).unflatten(1, (HEADS, KEY)))
        match = match.flatten(0, 1).index_select(0, graph.graphs * len(keys) + graph.classes)  # of class and words
        gates = torch.sigmoid(match - _CLOSED)
        pooled = (self.value(nodes).unflatten(1, (HEADS, VALUE)) * gates.unsqueeze(2)).flatten(1)
        return [sum_of(torch.cat([pooled, gates], dim=1), graph.real)]
