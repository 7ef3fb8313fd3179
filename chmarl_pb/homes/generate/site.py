"""One room being furnished: finds a place for a group of furniture and puts it there. Lengths in centimetres."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from chmarl_pb.catalog import room_kind
from chmarl_pb.homes.generate.draws import Draws
from chmarl_pb.homes.generate.free_floor import FreeFloor
from chmarl_pb.homes.generate.groups import Group, Piece
from chmarl_pb.homes.generate.looks import Looks, Pair, channels
from chmarl_pb.homes.generate.plan import Box
from chmarl_pb.homes.generate.spots import (
    TURNS,
    Pose,
    Spots,
    Stretch,
    along_walls,
    in_middle,
    inside,
    placed,
    placed_at,
)
from chmarl_pb.homes.layout import Furniture

MOST = 62
"""Pieces of furniture and scenery in a home: two fewer than a scene graph has room for."""

_NARROW = ("towel_rack", "bookshelf")  # receptacles over which nothing hangs: their tops are needed whole
_AIR = 45  # over these
_TRIES = 6  # places of a group that are tested for the ways that they leave


@dataclass
class Site:
    """A room of a home that is being furnished.

    Attributes:
        room: its name.
        boxes: its rectangles.
        walls: its walls without doorways, longest first.
        floor: of the whole home.
        looks: of the whole home.
        draws: where choices come from.
        things: all furniture of the home so far, to which more is added.
        parts: the parts in this room with their places.
    """

    room: str
    boxes: tuple[Box, ...]
    walls: tuple[Stretch, ...]
    floor: FreeFloor
    looks: Looks
    draws: Draws
    things: list[Furniture]
    parts: list[tuple[Piece, Pose]] = field(default_factory=list)
    _colours: dict[str, Pair] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """The room's kind."""
        return room_kind(self.room)

    @property
    def area(self) -> int:
        """Its area in square decimetres."""
        return sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in self.boxes) // 100

    def count(self, thing_class: str) -> int:
        """Return how many things of a class stand in the room."""
        return sum(part.thing_class == thing_class for part, _ in self.parts)

    def against_wall(self, group: Group, prefer: str = "any", walls: Sequence[Stretch] | None = None) -> bool:
        """Put a group with its back to a wall, and tell whether there was a place."""
        return self._put(group, along_walls(group, self.walls if walls is None else walls, prefer))

    def in_middle(self, group: Group, prefer: str = "middle") -> bool:
        """Put a group into the middle of the room, and tell whether there was a place."""
        return self._put(group, in_middle(self.boxes, prefer))

    def at(self, group: Group, pose: Pose) -> bool:
        """Put a group at one place, and tell whether it can stand there."""
        turn, none = TURNS.index((pose.yaw, pose.mirror)), np.zeros(1, dtype=np.int64)
        return self._put(group, Spots(np.array([[pose.x], [pose.y]]), none + turn, none))

    def _put(self, group: Group, spots: Spots) -> bool:
        if len(self.things) + len(group.parts) > MOST or not len(spots.costs):
            return False
        free = self._free(group, spots)
        if not len(free.costs):
            return False
        order = np.lexsort((self.draws.keys(len(free.costs)), free.costs))
        return any(self._admit(group, free.pose(number)) for number in order[:_TRIES])

    def _free(self, group: Group, spots: Spots) -> Spots:
        """Return the places at which a group stands within the room, free of all that stands there already."""
        solid, rugs = group.solid, [part for part in group.parts if part.thing_class == "rug"]
        floor = [*group.keep, *([group.around] if group.margin else [])]
        areas = [*(part.area for part in (*solid, *rugs)), *floor]
        boxes = placed_at(areas, spots)
        within = np.asarray(inside(boxes, self.boxes).all(axis=0))
        spots, boxes = spots.take(within), boxes[:, :, within]
        clear = self.floor.clear(boxes[:, : len(solid)], [(part.z, part.top) for part in solid])
        spots, boxes = spots.take(clear), boxes[:, :, clear]
        return spots.take(self.floor.unblocked(boxes[:, len(areas) - len(floor) :]))

    def _admit(self, group: Group, pose: Pose) -> bool:
        admitted = self.floor.admit(
            [
                (*placed(part.area, pose), part.z, part.top + _AIR * (part.thing_class in _NARROW))
                for part in group.solid
            ],
            [placed(area, pose) for area in group.keep],
            [[placed(area, pose) for area in areas] for areas in group.stands],
        )
        if admitted:
            for part in group.parts:
                self.parts.append((part, pose))
                self.things.append(self._thing(part, pose))
        return admitted

    def _thing(self, part: Piece, pose: Pose) -> Furniture:
        x, y, _, _ = placed((part.u, part.v, part.u, part.v), pose)
        yaw = (pose.yaw + pose.mirror * part.turn) % 360
        if part.thing_class not in self._colours:  # those of one class and room are a set
            self._colours[part.thing_class] = self.looks.of(part.thing_class, self.draws)
        first, second = (channels(colour) if colour else None for colour in self._colours[part.thing_class])
        return Furniture(self.room, part.model, (x / 100, y / 100, part.z / 100), float(yaw), first, second)
