"""The chain of joints in a URDF from a robot's base to its hand: pure geometry, read without PyBullet.

Every problem is a ``ValueError`` that names the joint or link, what is wrong with it and how to mend it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeAlias
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.source import MOST_URDF_BYTES, safe_xml, shown
from chmarl_pb.reading import read_regular
from chmarl_pb.robots.inverse import Links

Array: TypeAlias = NDArray[np.float64]

MOVING = ("revolute", "continuous", "prismatic")
_SPEED, _EFFORT = 1.0, 200.0  # of a joint whose URDF names none: rad/s or m/s, N or N m


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of a URDF.

    Attributes:
        name: its name.
        kind: its type in the URDF.
        parent: link that it hangs on.
        child: link that it moves.
        frame: (4, 4) its place on the parent.
        axis: (3,) unit vector in its own frame.
        lower: lower limit, radians or metres.
        upper: upper limit.
        effort: highest force, N or N m.
        speed: highest, rad/s or m/s.
    """

    name: str
    kind: str
    parent: str
    child: str
    frame: Array
    axis: Array
    lower: float
    upper: float
    effort: float
    speed: float

    @property
    def moves(self) -> bool:
        """Whether it is no fixed joint."""
        return self.kind in MOVING


class Tree:
    """The links and joints of a robot's URDF.

    Attributes:
        joints: name -> joint, in the order of the file.
        links: names of the links.
    """

    def __init__(self, urdf: Path):
        """Read a URDF.

        Raises:
            ValueError: it cannot be read, or its links and joints are no tree.
        """
        root = safe_xml(read_regular(urdf, MOST_URDF_BYTES))
        names = [element.get("name", "") for element in root.iterfind("link")]
        joints = [_joint(element) for element in root.iterfind("joint")]
        for kind, all_names in (("link", names), ("joint", [joint.name for joint in joints])):
            for name in all_names:
                if all_names.count(name) > 1:
                    raise ValueError(f"two {kind}s are named {shown(name)}; rename one")
        self.links, self.joints = tuple(names), {joint.name: joint for joint in joints}
        self._above = {joint.child: joint for joint in joints}
        for joint in joints:
            for link in (joint.parent, joint.child):
                if link not in names:
                    raise ValueError(f"joint {shown(joint.name)} names the link {shown(link)}, which is not there")
            if self._above[joint.child] is not joint:
                raise ValueError(f"two joints have the child {shown(joint.child)}; a robot is a tree")
        for link in names:
            self.path(link)

    def path(self, link: str) -> list[Joint]:
        """Return the joints from the base to a link.

        Raises:
            ValueError: there is no such link, or the way to it goes in a circle.
        """
        if link not in self.links:
            raise ValueError(f"no link is named {shown(link)}; the links are {', '.join(self.links)}")
        found: list[Joint] = []
        while link in self._above:
            if len(found) == len(self.joints):
                raise ValueError(f"the joints at link {shown(link)} go in a circle; a robot is a tree")
            found.append(self._above[link])
            link = found[-1].parent
        return found[::-1]


@dataclass(frozen=True, eq=False)
class Chain:
    """The joints that move a hand.

    Attributes:
        joints: from the base to the hand; fixed ones are left out.
        frames: (n + 1, 4, 4) from each joint's moved frame to the next one's, from the base to the first and from the
            last to the grasp point.
        pointing: (3,) where the gripper points, in the frame of the grasp point; zeros if that is not known.
    """

    joints: tuple[Joint, ...]
    frames: Array
    pointing: Array

    @cached_property
    def links(self) -> Links:
        """The same as arrays for :mod:`chmarl_pb.robots.inverse`."""
        return Links(
            np.ascontiguousarray(self.frames[:, :3, :3]),
            np.ascontiguousarray(self.frames[:, :3, 3]),
            np.array([joint.axis for joint in self.joints]),
            np.array([joint.kind == "prismatic" for joint in self.joints]),
            np.array([joint.lower for joint in self.joints]),
            np.array([joint.upper for joint in self.joints]),
            self.pointing,
        )

    @cached_property
    def mount(self) -> Array:
        """Where its first joint is on the base, x, y, z in metres."""
        place: Array = self.frames[0, :3, 3]
        return place


def chain_to(tree: Tree, hand: str, grasp: Sequence[float]) -> Chain:
    """Return the chain from a robot's base to a point of its hand.

    Args:
        tree: its links and joints.
        hand: the link that grasps.
        grasp: the point between its fingertips in its frame; the gripper points there from the link's origin.

    Raises:
        ValueError: no joint moves the hand.
    """
    frames, joints, frame = [], [], np.eye(4)
    for joint in tree.path(hand):
        frame = frame @ joint.frame
        if joint.moves:
            frames.append(frame)
            joints.append(joint)
            frame = np.eye(4)
    if not joints:
        raise ValueError(f"no joint moves the link {shown(hand)}; a hand hangs on a chain of movable joints")
    offset = np.asarray(grasp, dtype=float)
    length = float(np.linalg.norm(offset))
    point = np.eye(4)
    point[:3, 3] = offset
    return Chain(tuple(joints), np.stack([*frames, frame @ point]), offset / (length or 1.0))


def _joint(element: Element) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")
    if kind not in (*MOVING, "fixed"):
        raise ValueError(f"joint {shown(name)} is of the type {kind!r}; use one of: fixed, {', '.join(MOVING)}")
    origin, limit, axis = element.find("origin"), element.find("limit"), element.find("axis")
    numbers = {} if limit is None else limit.attrib
    lower, upper = _number(name, numbers, "lower", 0.0), _number(name, numbers, "upper", 0.0)
    if kind == "continuous":
        lower, upper = -np.pi, np.pi
    elif kind != "fixed" and lower >= upper:
        raise ValueError(f"joint {shown(name)} has no range to move in; write <limit lower=... upper=...> into it")
    direction = np.array(_vector(name, axis, "xyz", (1.0, 0.0, 0.0)))
    length = float(np.linalg.norm(direction))
    if length == 0 and kind != "fixed":
        raise ValueError(f"joint {shown(name)} has an axis of no length; write <axis xyz=...> into it")
    effort, speed = _number(name, numbers, "effort", 0.0), _number(name, numbers, "velocity", 0.0)
    return Joint(
        name, kind, _end(element, "parent"), _end(element, "child"),
        _frame(_vector(name, origin, "xyz", (0.0, 0.0, 0.0)), _vector(name, origin, "rpy", (0.0, 0.0, 0.0))),
        direction / (length or 1.0), lower, upper, effort if effort > 0 else _EFFORT, speed if speed > 0 else _SPEED,
    )  # fmt: skip


def _end(element: Element, end: str) -> str:
    found = element.find(end)
    return "" if found is None else found.get("link", "")


def _number(joint: str, values: Mapping[str, str], key: str, default: float) -> float:
    try:
        value = float(values.get(key, default))
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(f"joint {shown(joint)}: <limit {key}={values[key]!r}> is not a number")
    return value


def _vector(joint: str, element: Element | None, key: str, default: tuple[float, float, float]) -> list[float]:
    text = None if element is None else element.get(key)
    try:
        values = list(default) if text is None else [float(part) for part in text.split()]
    except ValueError:
        values = []
    if len(values) != 3 or not np.isfinite(values).all():
        raise ValueError(f"joint {shown(joint)}: {key}={text!r} is not three numbers")
    return values


def _frame(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """Return a frame (4, 4) from a place and a turn as a URDF writes them."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    frame = np.eye(4)
    frame[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    frame[:3, 3] = xyz
    return frame
