"""A robot that flies guides one that grasps: it hovers over X, then over Y, and tells the direction of that from there.

Directions are those of its picture, whose upper edge is +y. Everything in it is taken to be at one height.
"""

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import RELATION_IDS, Catalog
from chmarl_pb.policies.aiming import nodes_of
from chmarl_pb.policies.belief.scouts import STAY, Place
from chmarl_pb.policies.sights import classes_of_nodes, places_in_view

SPAN = 4.0  # metres that a robot that flies sees across at the height of things
_NEAR = 0.5  # metres within which a thing is too far below for the robot that drives: it had better step aside
_IN_ROOM = RELATION_IDS["in_room"]

Observation = dict[str, NDArray[Any]]


class Guide:
    """What one robot that flies does for one that grasps in one episode, once it has found something."""

    def __init__(self, rooms: tuple[str, ...], graspers: Collection[str], known: Catalog):
        """Get to know the rooms, the classes of robots that grasp, and those of things."""
        self._rooms, self._graspers, self._catalog = rooms, tuple(graspers), known
        self._from: dict[tuple[int, int], tuple[float, Place]] = {}  # row and room -> the most central view of a thing
        self._carried = False

    def see(
        self, observation: Observation, names: tuple[Collection[str], Collection[str]], place: Place | None
    ) -> bool:
        """Note what is in view, and return whether X stands there.

        Args:
            observation: of the robot that flies.
            names: the classes of X, and of Y.
            place: where it flies; None: where it has begun.
        """
        standing = places_in_view(observation, {}, self._rooms, self._catalog)
        found = any(name in names[0] for name, _ in standing)
        was_here = any(row == 0 and at == place for (row, _), (_, at) in self._from.items())
        self._carried = not found and (self._carried or was_here or bool(self.held(observation) & set(names[0])))
        for row, kinds in enumerate(names):
            for name, room in standing:
                if name in kinds and room in self._rooms:
                    self._keep((row, self._rooms.index(room)), self._views(observation, (name,)), place)
        return found

    def _keep(self, key: tuple[int, int], views: NDArray[np.float64], place: Place | None) -> None:
        """Remember the view in which a thing of a row and a room is nearest to the middle."""
        off = float(abs(views - 0.5).max(axis=1).min())
        if place is None:
            self._from.setdefault(key, (1.0, (key[1], (0, 0))))
        elif key not in self._from or off < self._from[key][0]:
            self._from[key] = off, place

    def action(self, board: NDArray[Any], place: Place | None) -> str:
        """Return the next action on the way to where it hovers; ``board`` has the rooms in which X and Y are known."""
        target = self._target(board)
        if target is None or target == place:
            return STAY
        if place is None or place[0] != target[0]:
            return f"goto_{self._rooms[target[0]]}"
        right, forward = target[1][0] - place[1][0], target[1][1] - place[1][1]
        if right:
            return "move_right" if right > 0 else "move_left"
        return "move_forward" if forward > 0 else "move_backward"

    def _target(self, board: NDArray[Any]) -> Place | None:
        """Return where to hover: over X, if it has found that itself and it is still there, else over Y."""
        mine = [at for (row, _), (_, at) in self._from.items() if row == 0]
        if mine and not self._carried:
            return mine[0]
        room = next(iter(np.flatnonzero(board[1]).tolist()), None)
        return None if room is None else self._from.get((1, room), (1.0, (room, (0, 0))))[1]

    def bearing(self, observation: Observation, name: str) -> float | None:
        """Return the direction of a thing in view from the robot that grasps, if that is in view in the same room."""
        if not self._rooms_of(observation, self._graspers) & self._rooms_of(observation, (name,)):
            return None
        robots, things = (self._views(observation, names) for names in (self._graspers, (name,)))
        if not len(robots) or not len(things):
            return None
        away = (things - robots[0]) * (SPAN, -SPAN)
        right, forward = away[np.hypot(*away.T).argmin()].tolist()
        if np.hypot(right, forward) < _NEAR:
            aside, towards = np.array([-forward, right]), (0.5 - robots[0]) * (SPAN, -SPAN)
            right, forward = (aside if aside @ towards > 0 else -aside).tolist()
        return float(np.arctan2(forward, right))

    def is_in(self, observation: Observation, room: str) -> bool:
        """Return whether a robot that grasps is in view in a room."""
        standing = places_in_view(observation, {}, self._rooms, self._catalog)
        return any(name in self._graspers and where == room for name, where in standing)

    def held(self, observation: Observation) -> set[str]:
        """Return the classes of what is held in view."""
        held = observation["node_state"] == self._catalog.state_ids["held"]
        classes = classes_of_nodes(observation, self._catalog)
        return {classes[number] for number in np.flatnonzero(held).tolist()}

    def _rooms_of(self, observation: Observation, names: Collection[str]) -> set[int]:
        """Return the nodes of the rooms in which things of some classes are in view: walls are not seen from above."""
        classes = classes_of_nodes(observation, self._catalog)
        edges = observation["edges"][observation["edges"][:, 2] == _IN_ROOM, :2].tolist()
        return {room for node, room in edges if classes[node] in names}

    def _views(self, observation: Observation, names: Collection[str]) -> NDArray[np.float64]:
        """Return (n, 2) where things of some classes are in the picture."""
        nodes = nodes_of(observation, names, self._catalog)
        return nodes.views[[number for number, name in enumerate(nodes.names) if name in names], :2]
