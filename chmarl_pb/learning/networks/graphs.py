"""Scene graphs: a graph convolution over all graphs of a batch at once.

Letters: B graphs in the batch, N real nodes of all of them.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.catalog import BENCHMARK, RELATION_IDS
from chmarl_pb.learning.networks import bearings, cells
from chmarl_pb.learning.networks.match import ROLES, ROOMS, Wanted
from chmarl_pb.learning.networks.parts import Asked, Part, id_count
from chmarl_pb.learning.networks.tables import EMBEDDING, Table, class_table, colour_table, embedding

GRAPH = 64  # features of a node after each graph convolution
VIEW = 3  # numbers of a node's place in the picture
HEADS, KEY, VALUE = 8, 32, 16  # of gated pooling: questions that are asked of each node, and numbers in each

_IN_ROOM, _HELD = RELATION_IDS["in_room"], BENCHMARK.state_ids["held"]
_ROBOTS = [BENCHMARK.class_ids[row.name] for row in BENCHMARK.rows if row.kind == "robot"]
_CLOSED = 3.0  # gates are nearly closed at first: sigmoid(-3) is 0.05


class GraphEncoder(Part):
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
        graph = _Nodes.of(node_class, node_state, edges, color, view)
        nodes = self._convolved(graph)
        return torch.cat([_mean(nodes, graph.real), *self._heads(nodes, graph, asked)], dim=1)

    def _heads(self, nodes: Tensor, graph: "_Nodes", asked: Asked | None) -> list[Tensor]:
        """Return what is pooled beside the mean, (B, features) each, from the convolved nodes (N, GRAPH)."""
        return []

    def _convolved(self, graph: "_Nodes") -> Tensor:
        """Return (N, GRAPH) of all real nodes after both convolutions."""
        spread = _propagation(graph.real, graph.edges)
        nodes = torch.relu(spread(self._embedded(graph)))
        return torch.relu(spread(self.second(nodes)))

    def _embedded(self, graph: "_Nodes") -> Tensor:
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

    def _heads(self, nodes: Tensor, graph: "_Nodes", asked: Asked | None) -> list[Tensor]:
        """Return the sums behind the gates, and the sums of the gates."""
        assert asked is not None
        keys = self.key(self.classes.weight).unflatten(1, (HEADS, KEY))
        match = torch.einsum("chd,bhd->bch", keys, self.query(asked.words).unflatten(1, (HEADS, KEY)))
        match = match.flatten(0, 1).index_select(0, graph.graphs * len(keys) + graph.classes)  # of class and words
        gates = torch.sigmoid(match - _CLOSED)
        pooled = (self.value(nodes).unflatten(1, (HEADS, VALUE)) * gates.unsqueeze(2)).flatten(1)
        return [_sum(torch.cat([pooled, gates], dim=1), graph.real)]


class GroundedGraphEncoder(GraphEncoder):
    """The same convolutions, with attention to the nodes that are X and to those that are Y, beside the mean.

    How likely a node is either follows from its class, and colour or room, and from the words of the instruction; see
    :class:`chmarl_pb.learning.networks.match.Match`. For each of the two there is how likely it is among the nodes, and
    the mean of the nodes with these weights: their features and, where nodes have one, their place in the picture.
    """

    asks = True
    matches = True
    takes: Tensor

    def __init__(self, *tables: Any):
        """Make tables for the ids in spaces; see :class:`GraphEncoder`."""
        super().__init__(*tables)
        self.value = nn.Linear(GRAPH, VALUE)
        self.locates = (cells.SIZE + bearings.SIZE) * (self.placed is not None)
        self.size = GRAPH + ROLES * (1 + VALUE + VIEW * bool(self.locates))
        self.register_buffer("takes", _takes(len(self.classes.weight)), persistent=False)

    def _heads(self, nodes: Tensor, graph: "_Nodes", asked: Asked | None) -> list[Tensor]:
        """Return whether X and Y are there, and what they are like."""
        assert asked is not None and asked.wanted is not None
        gates = _likely(graph, asked.wanted)
        index = graph.graphs.unsqueeze(1).expand_as(gates)
        there = gates.new_zeros(len(graph.real), ROLES).scatter_reduce(0, index, gates, "amax")
        values = self.value(nodes)
        if graph.views is not None:
            values = torch.cat([values, graph.views], dim=1)
        pooled = _sum((gates.unsqueeze(2) * values.unsqueeze(1)).flatten(1), graph.real).unflatten(1, (ROLES, -1))
        return [there, (pooled / _sum(gates, graph.real).clamp(min=1).unsqueeze(2)).flatten(1)]

    def places(
        self, node_class: Tensor, node_state: Tensor, edges: Tensor, color: Tensor | None, view: Tensor, asked: Asked
    ) -> Tensor:
        """Return in which cells X and Y can be taken, and in which directions from another robot they are."""
        assert asked.wanted is not None
        graph = _Nodes.of(node_class, node_state, edges, color, view)
        likely = _padded(_likely(graph, asked.wanted), graph.real).transpose(1, 2)  # (B, ROLES, nodes)
        u, v, share = view[:, : node_class.shape[1]].float().unbind(dim=2)
        ids = node_class.long()
        standing = ((node_state != _HELD) & (share > 0)).unsqueeze(1)
        others = (1 - likely) * self.takes[:, ids].transpose(0, 1)
        robots = torch.isin(ids, torch.tensor(_ROBOTS, device=ids.device))
        rooms = _padded(graph.rooms + 1, graph.real) - 1
        return torch.cat(
            [
                cells.cells_of(likely * standing, others * standing, u, v, share),
                bearings.bearings_of(likely * standing, robots, rooms, u, v),
            ],
            dim=1,
        )


def _takes(count: int) -> Tensor:
    """Return (ROLES, ids) whether a Pick, and a Place, can take things of a class; of users' own classes it may."""
    found = torch.zeros(ROLES, count)
    for role, kind in enumerate((BENCHMARK.graspables, BENCHMARK.receptacles)):
        found[role, [BENCHMARK.class_ids[name] for name in kind]] = 1
    found[:, len(BENCHMARK.rows) + 1 :] = 1
    return found


def _likely(graph: "_Nodes", wanted: Wanted) -> Tensor:
    """Return how likely each node is X, and Y, (N, ROLES)."""
    of_x, of_y = wanted.classes[graph.graphs, :, graph.classes].unbind(dim=1)
    if wanted.colours is not None and graph.colours is not None:
        of_x = of_x * wanted.colours[graph.graphs, 0, graph.colours]
    if wanted.rooms is not None:
        fits = wanted.rooms[:, :1].repeat(1, wanted.classes.shape[2])  # a thing in whatever room, if none is named
        fits[:, list(ROOMS)] += wanted.rooms[:, 1:]
        kinds = torch.where(graph.rooms < 0, 0, graph.classes[graph.rooms])
        of_y = of_y * fits[graph.graphs, kinds]
    return torch.stack([of_x, of_y], dim=1)


@dataclass(frozen=True)
class _Nodes:
    """The real nodes of all graphs of a batch, one after the other.

    Attributes:
        real: (B, nodes) which are not padding.
        edges: (B, edges, 3) of the graphs.
        classes: (N) ids.
        states: (N) ids.
        colours: (N) ids, if the encoder knows of them.
        views: (N, VIEW), if the encoder knows of them.
    """

    real: Tensor
    edges: Tensor
    classes: Tensor
    states: Tensor
    colours: Tensor | None
    views: Tensor | None

    @classmethod
    def of(
        cls, node_class: Tensor, node_state: Tensor, edges: Tensor, color: Tensor | None, view: Tensor | None
    ) -> "_Nodes":  # fmt: skip
        """Return the nodes of graphs without their padding; see :meth:`GraphEncoder.forward`."""
        real = node_class > 0
        return cls(
            real, edges, node_class[real].long(), node_state[real].long(),
            None if color is None else color[:, : real.shape[1]][real].long(),
            None if view is None else view[:, : real.shape[1]][real].float(),
        )  # fmt: skip

    @cached_property
    def graphs(self) -> Tensor:
        """(N) the number of each node's graph."""
        return self.real.nonzero(as_tuple=True)[0]

    @cached_property
    def rooms(self) -> Tensor:
        """(N) the number of the node of the room that each node is in, or -1."""
        _, kinds, things, rooms = _ends(self.real, self.edges)
        is_in = kinds == _IN_ROOM
        return torch.full_like(self.classes, -1).index_copy_(0, things[is_in], rooms[is_in])


def _ends(real: Tensor, edges: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return graph, relation, source and target (E) of all edges between real nodes, these by their numbers.

    Args:
        real: (B, nodes) which nodes are not padding.
        edges: (B, edges, 3) source, target and relation, which is 0 for padding; edges to padding are left out.
    """
    numbers = real.flatten().cumsum(0).sub_(1).view(real.shape)  # of the nodes in the batch
    numbers = nn.functional.pad(numbers.masked_fill(~real, -1), (0, 1), value=-1)  # for an end that is no node
    graph, row = (edges[..., 2] > 0).nonzero(as_tuple=True)
    found = edges[graph, row].long()
    ends = numbers[graph.unsqueeze(1), found[:, :2].clamp(max=real.shape[1])]
    there = (ends >= 0).all(dim=1)
    one, other = ends[there].unbind(dim=1)
    return graph[there], found[there, 2], one, other


def _padded(nodes: Tensor, real: Tensor) -> Tensor:
    """Return the numbers of nodes (N, ...) by graph, (B, nodes, ...), with 0 for padding."""
    found = nodes.new_zeros(*real.shape, *nodes.shape[1:])
    found[real] = nodes
    return found


def _mean(nodes: Tensor, real: Tensor) -> Tensor:
    """Return the means (B, F) of the features (N, F) of each graph's nodes; 0 for an empty graph."""
    return _sum(nodes, real) / real.sum(dim=1, keepdim=True).clamp(min=1)


def _sum(nodes: Tensor, real: Tensor) -> Tensor:
    """Return the sums (B, F) of the features (N, F) of each graph's nodes."""
    return nodes.new_zeros(len(real), nodes.shape[1]).index_add_(0, real.nonzero(as_tuple=True)[0], nodes)


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
        product: Tensor = _Symmetric.apply(features, self.columns, self.starts, self.values)
        return product


class _Symmetric(torch.autograd.Function):
    """The product of a symmetric sparse matrix with features, whose gradient is the product with the same matrix.

    torch's own gradient sorts all numbers of the matrix by their columns first, and takes three times as long.
    """

    @staticmethod
    def forward(ctx: Any, features: Tensor, columns: Tensor, starts: Tensor, values: Tensor) -> Tensor:
        """Return the product (N, F); see :class:`_Propagation`."""
        ctx.save_for_backward(columns, starts, values)
        return _product(features, columns, starts, values)

    @staticmethod
    def backward(ctx: Any, *wanted: Tensor) -> tuple[Tensor | None, ...]:
        """Return the gradient of the features alone."""
        return _product(wanted[0], *ctx.saved_tensors), None, None, None


def _product(features: Tensor, columns: Tensor, starts: Tensor, values: Tensor) -> Tensor:
    return nn.functional.embedding_bag(
        columns, features, starts, mode="sum", per_sample_weights=values, include_last_offset=True
    )


def _propagation(real: Tensor, edges: Tensor) -> _Propagation:
    """Return what spreads features over the graphs of a batch; see :func:`_ends`."""
    _, _, one, other = _ends(real, edges)
    loops = torch.arange(int(real.sum()), device=real.device)
    rows, columns = torch.cat([one, other, loops]), torch.cat([other, one, loops])
    degree = torch.bincount(rows, minlength=len(loops))
    root = degree.float().rsqrt()
    columns = columns[rows.argsort()]
    values = root.repeat_interleave(degree) * root[columns]
    starts = nn.functional.pad(degree.cumsum(0), (1, 0))
    return _Propagation(columns, starts, values)
