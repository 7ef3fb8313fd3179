"""What an arm can touch where it is driven: the home, the objects that stand in it, and its own robot's body."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chmarl_pb.navigation.free_space import GRIP, Size
from chmarl_pb.robots.arm_boxes import ArmBoxes
from chmarl_pb.robots.clearance import Boxes, Obstacles
from chmarl_pb.world import World

Array: TypeAlias = NDArray[np.float64]

_REACH = 1.6  # metres from the base within which an arm and what it holds can be
_LEVEL = 0.005  # metres above a surface that still belong to it
_UPRIGHT = np.eye(3)


@dataclass(frozen=True)
class Touching:
    """What counts as touching.

    Attributes:
        load: extents of the object in the gripper, metres; None if it is empty.
        margin: metres that are to be kept free.
        level: height of the surface that fingers may touch, where they reach for an object, metres; or None.
    """

    load: Size | None = None
    margin: float = 0.0
    level: float | None = None


class Surroundings:
    """A home with its objects around one robot's arm.

    A posture is a configuration of the arm's joints and the yaw, relative to the base, of what the gripper holds.
    """

    def __init__(self, shape: ArmBoxes, home: Obstacles, world: World, ignoring: Collection[str]):
        """Look at a world as it is now.

        Args:
            shape: of the arm.
            home: the home's solids.
            world: the world.
            ignoring: names of objects that do not count; those in grippers never do.
        """
        self._shape = shape
        skipped = {*ignoring, *world.state.held}
        poses = world.state.objects.poses.items()
        objects = [_prism(pose, world.size(name)) for name, pose in poses if name not in skipped]
        self._home, self._objects = home, Obstacles(objects)
        self._fingers = np.isin(np.arange(len(shape.links)), shape.fingers)

    def depths(self, postures: ArrayLike, bases: ArrayLike, touching: Touching) -> Array:
        """Return how deep (n,) the arm or its load stands in something, metres; 0: nowhere.

        Args:
            postures: (n, joints + 1), or one for all bases.
            bases: (n, 3) x, y and yaw of the base, or one for all postures.
            touching: what counts.
        """
        postures, bases = np.atleast_2d(np.asarray(postures, dtype=float)), np.atleast_2d(bases)
        boxes = self._boxes(postures, touching)
        own = self._shape.own_depths(boxes, postures[:, 0])
        placed = boxes.at(*bases.T)
        low, high = bases[:, :2].min(axis=0) - _REACH, bases[:, :2].max(axis=0) + _REACH
        home, objects = (some.near((*low, 0.0), (*high, 4.0)) for some in (self._home, self._objects))
        found: Array = np.maximum(objects.depth(placed, touching.margin).max(axis=1), own)
        if touching.level is None:
            found = np.maximum(found, home.depth(placed, touching.margin).max(axis=1))
            return found
        fingers = np.append(self._fingers, np.zeros(len(placed.halves) - len(self._fingers), dtype=bool))
        above = home.near((*low, touching.level + _LEVEL), (*high, 4.0))
        for some, solids in ((fingers, above), (~fingers, home)):
            found = np.maximum(found, solids.depth(placed.only(some), touching.margin).max(axis=1))
        return found

    def _boxes(self, postures: Array, touching: Touching) -> Boxes:
        """Return the boxes of arm and load in the frame of the base."""
        boxes, grasps = self._shape.place(postures[:, :-1])
        if touching.load is None:
            return boxes
        width, depth, height = touching.load
        c, s = np.cos(postures[:, -1]), np.sin(postures[:, -1])
        turn = np.zeros((len(postures), 1, 3, 3))
        turn[:, 0, :2, 0], turn[:, 0, :2, 1] = np.stack([c, s], axis=1), np.stack([-s, c], axis=1)
        turn[:, 0, 2, 2] = 1.0
        middle = np.add(grasps, (0.0, 0.0, (0.5 - GRIP) * height))
        return Boxes(
            np.concatenate([boxes.middles, middle[:, None]], axis=1),
            np.concatenate([boxes.axes, turn], axis=1),
            np.vstack([boxes.halves, np.array([width, depth, height]) / 2]),
        )


def _prism(pose: tuple[tuple[float, ...], tuple[float, ...]], size: Size) -> tuple[Array, float, float]:
    """Return the outline, bottom and top of an object that stands."""
    (x, y, z), quaternion = pose
    yaw = 2 * np.arctan2(quaternion[2], quaternion[3])
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (size[0] / 2, size[1] / 2)
    return corners @ np.array([(c, s), (-s, c)]) + (x, y), z, z + size[2]
