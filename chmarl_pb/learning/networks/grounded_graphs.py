"""Scene graphs pooled by what the instruction calls X and Y, and where in the picture those are."""

from typing import Any

import torch
from torch import Tensor, nn

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.learning.networks import bearings, cells
from chmarl_pb.learning.networks.graph_batch import Nodes, padded, sum_of
from chmarl_pb.learning.networks.graphs import GRAPH, VALUE, VIEW, GraphEncoder
from chmarl_pb.learning.networks.match import ROLES, ROOMS, Wanted
from chmarl_pb.learning.networks.parts import Asked

_HELD = BENCHMARK.state_ids["held"]
_ROBOTS = [BENCHMARK.class_ids[row.name] for row in BENCHMARK.rows if row.kind == "robot"]


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
        """Make tables for the ids in spaces; see :class:`GraphEncoder`.

        Raises:
            ValueError: a space has fewer classes than the benchmark.
        """
        super().__init__(*tables)
        if (count := len(self.classes.weight)) <= len(BENCHMARK.rows):
            raise ValueError(
                f"graph_pool='grounded' and 'parsed' tell apart the benchmark's {len(BENCHMARK.rows)} classes, and "
                f"your own after them; a space has {count - 1}: use 'mean' or 'gated'"
            )
        self.value = nn.Linear(GRAPH, VALUE)
        self.locates = (cells.SIZE + bearings.SIZE) * (self.placed is not None)
        self.size = GRAPH + ROLES * (1 + VALUE + VIEW * bool(self.locates))
        self.register_buffer("takes", _takes(len(self.classes.weight)), persistent=False)

    def _heads(self, nodes: Tensor, graph: Nodes, asked: Asked | None) -> list[Tensor]:
        """Return whether X and Y are there, and what they are like."""
        assert asked is not None and asked.wanted is not None
        gates = _likely(graph, asked.wanted)
        index = graph.graphs.unsqueeze(1).expand_as(gates)
        there = gates.new_zeros(len(graph.real), ROLES).scatter_reduce(0, index, gates, "amax")
        values = self.value(nodes)
        if graph.views is not None:
            values = torch.cat([values, graph.views], dim=1)
        pooled = sum_of((gates.unsqueeze(2) * values.unsqueeze(1)).flatten(1), graph.real).unflatten(1, (ROLES, -1))
        return [there, (pooled / sum_of(gates, graph.real).clamp(min=1).unsqueeze(2)).flatten(1)]

    def places(
        self, node_class: Tensor, node_state: Tensor, edges: Tensor, color: Tensor | None, view: Tensor, asked: Asked
    ) -> Tensor:
        """Return in which cells X and Y can be taken, and in which directions from another robot they are."""
        assert asked.wanted is not None
        graph = Nodes.of(node_class, node_state, edges, color, view)
        likely = padded(_likely(graph, asked.wanted), graph.real).transpose(1, 2)  # (B, ROLES, nodes)
        u, v, share = view[:, : node_class.shape[1]].float().unbind(dim=2)
        ids = node_class.long()
        standing = ((node_state != _HELD) & (share > 0)).unsqueeze(1)
        others = (1 - likely) * self.takes[:, ids].transpose(0, 1)
        robots = torch.isin(ids, torch.tensor(_ROBOTS, device=ids.device))
        rooms = padded(graph.rooms + 1, graph.real) - 1
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


def _likely(graph: Nodes, wanted: Wanted) -> Tensor:
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
