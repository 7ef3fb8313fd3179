"""A batch of scene graphs without their padding: real nodes one after the other, rooms, and what spreads along edges.

Letters: B graphs in the batch, N real nodes of all of them.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor, nn

from chmarl_pb.catalog import RELATION_IDS

_IN_ROOM = RELATION_IDS["in_room"]


@dataclass(frozen=True)
class Nodes:
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
    ) -> "Nodes":  # fmt: skip
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
    def ends(self) -> tuple[Tensor, Tensor, Tensor]:
        """Relation, source and target (E) of all edges between nodes, these by their numbers.

        Relation 0 is padding, and edges to padding are left out, too.
        """
        numbers = self.real.flatten().cumsum(0).sub_(1).view(self.real.shape)
        numbers = nn.functional.pad(numbers.masked_fill(~self.real, -1), (0, 1), value=-1)  # for an end that is no node
        graph, row = (self.edges[..., 2] > 0).nonzero(as_tuple=True)
        found = self.edges[graph, row].long()
        ends = numbers[graph.unsqueeze(1), found[:, :2].clamp(max=self.real.shape[1])]
        there = (ends >= 0).all(dim=1)
        source, target = ends[there].unbind(dim=1)
        return found[there, 2], source, target

    @cached_property
    def rooms(self) -> Tensor:
        """(N) the number of the node of the room that each node is in, or -1."""
        kinds, things, rooms = self.ends
        is_in = kinds == _IN_ROOM
        return torch.full_like(self.classes, -1).index_copy_(0, things[is_in], rooms[is_in])


def padded(nodes: Tensor, real: Tensor) -> Tensor:
    """Return the numbers of nodes (N, ...) by graph, (B, nodes, ...), with 0 for padding."""
    found = nodes.new_zeros(*real.shape, *nodes.shape[1:])
    found[real] = nodes
    return found


def mean_of(nodes: Tensor, real: Tensor) -> Tensor:
    """Return the means (B, F) of the features (N, F) of each graph's nodes; 0 for an empty graph."""
    return sum_of(nodes, real) / real.sum(dim=1, keepdim=True).clamp(min=1)


def sum_of(nodes: Tensor, real: Tensor) -> Tensor:
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


def propagation(graph: Nodes) -> _Propagation:
    """Return what spreads features over the graphs of a batch."""
    _, one, other = graph.ends
    loops = torch.arange(len(graph.classes), device=graph.real.device)
    rows, columns = torch.cat([one, other, loops]), torch.cat([other, one, loops])
    degree = torch.bincount(rows, minlength=len(loops))
    root = degree.float().rsqrt()
    columns = columns[rows.argsort()]
    values = root.repeat_interleave(degree) * root[columns]
    starts = nn.functional.pad(degree.cumsum(0), (1, 0))
    return _Propagation(columns, starts, values)
