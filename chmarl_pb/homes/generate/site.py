"""One room being furnished: finds a place for a group of furniture and puts it there. Lengths in centimetres."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import room_kind
from chmarl_pb.homes.generate.draws import Draws
from chmarl_pb.homes.generate.free_floor import FreeFloor
from chmarl_pb.homes.generate.groups import Area, Group, Part, extent
from chmarl_pb.homes.generate.looks import Looks, Pair, channels
from chmarl_pb.homes.generate.plan import Box
from chmarl_pb.homes.generate.spots import Pose, Spots, Stretch, along_walls, in_middle, inside, placed
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
    parts: list[tuple[Part, Pose]] = field(default_factory=list)
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
        values = [np.array([value], dtype=np.int64) for value in pose]
        return self._put(group, Spots(np.stack(values[:2], axis=1), values[2], values[3], np.zeros(1, dtype=np.int64)))

    def _put(self, group: Group, spots: Spots) -> bool:
        if len(self.things) + len(group.parts) > MOST or not len(spots.costs):
            return False
        left = np.flatnonzero(self._fits(group, spots))
        order = left[np.lexsort((self.draws.keys(len(left)), spots.costs[left]))] if len(left) else left
        for number in order[:_TRIES].tolist():
            x, y = spots.origins[number].tolist()
            if self._admit(group, Pose(x, y, int(spots.yaws[number]), int(spots.mirrors[number]))):
                return True
        return False

    def _fits(self, group: Group, spots: Spots) -> NDArray[np.bool_]:
        """Return at which places a group stands within the room, free of all that stands there already."""
        fits = np.ones(len(spots.costs), dtype=bool)
        for yaw in np.unique(spots.yaws).tolist():
            for mirror in np.unique(spots.mirrors).tolist():
                same = np.flatnonzero((spots.yaws == yaw) & (spots.mirrors == mirror))
                fits[same] = self._fits_turned(group, Pose(0, 0, yaw, mirror), spots.origins[same])
        return fits

    def _fits_turned(self, group: Group, pose: Pose, origins: NDArray[np.int64]) -> NDArray[np.bool_]:
        offsets: NDArray[np.int64] = np.concatenate([origins, origins], axis=1)

        def there(area: Area) -> NDArray[np.int64]:
            return offsets + np.array(placed(area, pose), dtype=np.int64)

        fits = np.ones(len(origins), dtype=bool)
        for part in group.parts:
            if not fits.any():
                return fits
            boxes = there(part.area)
            fits &= inside(boxes, self.boxes)
            if extent(part.model).thing_class != "rug":
                fits &= self.floor.clear(boxes, part.z, part.top)
        for area in group.keep:
            fits &= self.floor.unblocked(there(area)) & inside(there(area), self.boxes)
        if group.margin:
            u0, v0, u1, v1 = group.area
            wide = there((u0 - group.margin, v0 - group.margin, u1 + group.margin, v1 + group.margin))
            fits &= self.floor.unblocked(wide) & inside(wide, self.boxes)
        return fits

    def _admit(self, group: Group, pose: Pose) -> bool:
        solid = [part for part in group.parts if part.thing_class != "rug"]
        admitted = self.floor.admit(
            [(*placed(part.area, pose), part.z, part.top + _AIR * (part.thing_class in _NARROW)) for part in solid],
            [placed(area, pose) for area in group.keep],
            [[placed(area, pose) for area in areas] for areas in group.stands],
        )
        if admitted:
            for part in group.parts:
                self.parts.append((part, pose))
                self.things.append(self._thing(part, pose))
        return admitted

    def _thing(self, part: Part, pose: Pose) -> Furniture:
        x, y, _, _ = placed((part.u, part.v, part.u, part.v), pose)
        yaw = (pose.yaw + pose.mirror * part.turn) % 360
        if part.thing_class not in self._colours:  # those of one class and room are a set
            self._colours[part.thing_class] = self.looks.of(part.thing_class, self.draws)
        first, second = (channels(colour) if colour else None for colour in self._colours[part.thing_class])
        return Furniture(self.room, part.model, (x / 100, y / 100, part.z / 100), float(yaw), first, second)
