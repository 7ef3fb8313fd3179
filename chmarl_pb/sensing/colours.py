"""The colours of the objects in a scene graph, by which lookalikes are told apart."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chmarl_pb.catalog import COLOURS, colour_of
from chmarl_pb.sensing.scene_graph import MAX_NODES
from chmarl_pb.sensing.sensors import View


class NodeColourSensor:
    """The colour of each node of the scene graph: ``node_color``, ids of ``COLOURS``; 0 for all that is no object."""

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the space of the ids."""
        return {"node_color": spaces.Box(0, len(COLOURS), (MAX_NODES,), np.int16)}

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the ids."""
        row = np.zeros(MAX_NODES, np.int16)
        row[: len(view.seen)] = [0 if name in view.models else colour_of(name) for name in view.seen]
        return {"node_color": row}
