"""An arm as boxes: where its links are in many configurations at once, without touching the simulation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.robots.arm import JOINTS, Configuration
from chmarl_pb.robots.clearance import Boxes, Obstacles
from chmarl_pb.world.bullet import pybullet as p

Array: TypeAlias = NDArray[np.float64]

_LEAST = 0.005  # metres: PyBullet gives a link without collision geometry a box smaller than this
_MIDDLE, _LEVEL = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
_OWN = 0.008  # metres that the arm may come into its own body's boxes, which are rounder than they are


@dataclass(frozen=True)
class Parts:
    """What of a body is its arm; the humanoid's is the default.

    Attributes:
        joints: names of the joints that move it, each after those that it hangs on.
        hand: name of the link that grasps.
        grasp: the point between the fingertips in its frame, metres.
        fingers: names of the links that touch what is grasped.
        kept_off: names of the links that keep off the robot's own body; the shoulder is always at the trunk.
        lifts: whether the first joint raises the trunk, rather than a part of the arm.
    """

    joints: tuple[str, ...] = JOINTS
    hand: str = "grasp"
    grasp: tuple[float, float, float] = (0.0, 0.0, 0.0)
    fingers: tuple[str, ...] = ("left_finger", "right_finger")
    kept_off: tuple[str, ...] = ("forearm", "hand", "left_finger", "right_finger")
    lifts: bool = True


class ArmBoxes:
    """One box around each link that the arm's joints move, and the grasp point.

    Attributes:
        links: names of the links.
        numbers: PyBullet's link indices of them.
        fingers: numbers of those that touch what is grasped.
        halves: (b, 3) half of their boxes' extents, metres.
    """

    def __init__(self, client: int, body: int, parts: Parts = Parts()):
        """Measure a loaded robot; its joints are put back."""
        self._parts = parts
        infos = [p.getJointInfo(body, i, physicsClientId=client) for i in range(p.getNumJoints(body, client))]
        before = [p.getJointState(body, info[0], physicsClientId=client)[0] for info in infos]
        base = p.getBasePositionAndOrientation(body, physicsClientId=client)
        p.resetBasePositionAndOrientation(body, _MIDDLE, _LEVEL, physicsClientId=client)
        for info in infos:
            p.resetJointState(body, info[0], 0.0, physicsClientId=client)
        self._measure(client, body, infos)
        for info, position in zip(infos, before, strict=True):
            p.resetJointState(body, info[0], position, physicsClientId=client)
        p.resetBasePositionAndOrientation(body, *base, physicsClientId=client)

    def _measure(self, client: int, body: int, infos: Sequence[tuple[Any, ...]]) -> None:
        """Read joints' axes and links' boxes off the body with all joints at zero and its base at the origin."""
        numbers = {info[1].decode(): info[0] for info in infos}
        states = {
            i[0]: p.getLinkState(body, i[0], computeForwardKinematics=True, physicsClientId=client) for i in infos
        }
        states[-1] = (_MIDDLE, _LEVEL)  # the base
        parents = {info[0]: info[16] for info in infos}
        self._joints = []  # of each joint: number of the one that moves it, whether it turns, its axis, a point of it
        order = {numbers[name]: place for place, name in enumerate(self._parts.joints)}
        for name in self._parts.joints:
            info = infos[numbers[name]]
            rotation = np.reshape(p.getMatrixFromQuaternion(states[info[0]][5]), (3, 3))
            turns = info[2] == p.JOINT_REVOLUTE
            self._joints.append((_mover(info[16], parents, order), turns, rotation @ info[13], states[info[0]][4]))
        moved = {info[0]: _mover(info[0], parents, order) for info in infos}
        first = int(self._parts.lifts)
        boxes = {
            i: np.array(p.getAABB(body, i, physicsClientId=client)) for i, mover in moved.items() if mover >= first
        }
        boxes = {i: box for i, box in boxes.items() if np.ptp(box, axis=0).max() > _LEAST}
        self.links, self.numbers = tuple(infos[i][12].decode() for i in boxes), tuple(boxes)
        self._movers = np.array([moved[i] for i in boxes])
        self._centres = np.array([box.mean(axis=0) for box in boxes.values()])
        self.halves = np.array([np.ptp(box, axis=0) / 2 for box in boxes.values()])
        own = [number for number, name in enumerate(self.links) if name in self._parts.kept_off]
        self.fingers = [number for number, name in enumerate(self.links) if name in self._parts.fingers]
        self._kept_off = np.array([*own, len(self.links)])  # the last: what the gripper holds
        fixed = [-1, *(i for i, mover in moved.items() if mover < 0)]
        lifted = [i for i, mover in moved.items() if 0 <= mover < first]
        self._trunk = _own_body(client, body, lifted, states)
        self._chassis = _own_body(client, body, fixed, states)
        hand = next(info[0] for info in infos if info[12].decode() == self._parts.hand)
        turn = np.reshape(p.getMatrixFromQuaternion(states[hand][5]), (3, 3))
        self._grasp = np.array(states[hand][4]) + turn @ self._parts.grasp, moved[hand]

    def place(self, configurations: Sequence[Configuration] | Array) -> tuple[Boxes, Array]:
        """Return where the links are in the frame of the robot's base.

        Args:
            configurations: (n, joints).

        Returns:
            Their boxes, and the grasp points (n, 3).
        """
        values = np.asarray(configurations, dtype=float).reshape(-1, len(self._parts.joints))
        count = len(values)
        turns = [np.broadcast_to(np.eye(3), (count, 3, 3))]
        shifts = [np.zeros((count, 3))]
        for (mover, revolves, axis, point), value in zip(self._joints, values.T, strict=True):
            turn, shift = turns[mover + 1], shifts[mover + 1]
            if revolves:
                own = _turns(axis, value)
                turns.append(turn @ own)
                shifts.append(shift + turn @ point - turns[-1] @ point)
            else:
                turns.append(turn)
                shifts.append(shift + (turn @ axis) * value[:, None])
        all_turns, all_shifts = np.stack(turns, axis=1), np.stack(shifts, axis=1)
        rotations, movers = all_turns[:, self._movers + 1], self._movers + 1
        middles = (rotations @ self._centres[:, :, None])[..., 0] + all_shifts[:, movers]
        point, mover = self._grasp
        grasps = all_turns[:, mover + 1] @ point + all_shifts[:, mover + 1]
        return Boxes(middles, rotations, self.halves), grasps

    def own_depths(self, boxes: Boxes, lifts: Array) -> Array:
        """Return how deep (n,) the forearm, the hand and what it holds stand in the robot's own body, metres.

        Args:
            boxes: of the links and, after them, of what the gripper holds, in the frame of the base.
            lifts: (n,) how far the trunk is raised, metres.
        """
        some = self._kept_off[self._kept_off < boxes.middles.shape[1]]
        shapes = boxes.only(some)
        below = shapes.middles - lifts[:, None, None] * (0.0, 0.0, 1.0)
        trunk = self._trunk.depth(Boxes(below, shapes.axes, shapes.halves), -_OWN)
        depths: Array = np.maximum(trunk, self._chassis.depth(shapes, -_OWN)).max(axis=1)
        return depths


def _own_body(client: int, body: int, links: Sequence[int], states: dict[int, tuple[Any, ...]]) -> Obstacles:
    """Return the collision boxes of some links, with all joints at zero; other shapes count as their bounding box."""
    prisms = []
    for link in links:
        for shape in p.getCollisionShapeData(body, link, physicsClientId=client):
            low, high = p.getAABB(body, link, physicsClientId=client)
            if shape[2] == p.GEOM_BOX and np.allclose(states[link][1], _LEVEL):
                middle, half = np.add(states[link][0], shape[5]), np.array(shape[3]) / 2
                low, high = middle - half, middle + half
            outline = np.array([(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])])
            prisms.append((outline, low[2], high[2]))
    return Obstacles(prisms)


def _mover(link: int, parents: dict[int, int], order: dict[int, int]) -> int:
    """Return the place among the arm's joints of the one that moves a link, -1 if none does."""
    while link >= 0 and link not in order:
        link = parents[link]
    return order[link] if link >= 0 else -1


def _turns(axis: Array, angles: Array) -> Array:
    """Return rotations (n, 3, 3) about a unit axis."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turns: Array = (
        np.eye(3) + np.sin(angles)[:, None, None] * cross + (1 - np.cos(angles))[:, None, None] * (cross @ cross)
    )
    return turns
