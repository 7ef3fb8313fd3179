"""Arms as data: what a robot file says of an arm of its own, checked against its URDF, and what follows from it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from chmarl_pb.homes.source import shown
from chmarl_pb.robots.chain import Chain, Joint, Tree
from chmarl_pb.robots.inverse import Column
from chmarl_pb.robots.motors import Configuration
from chmarl_pb.robots.workspace import Workspace, measure


@dataclass(frozen=True, eq=False)
class ArmModel:
    """One kind of arm.

    A configuration holds positions of the joints that move the hand, then of the fingers, then of all other joints of
    the robot, which stay at zero.

    Attributes:
        joints: all of these, in this order.
        chain: from the base to the grasp point.
        hand: the link that grasps.
        grasp: the point between its fingertips in its frame, metres.
        fingers: number of joints of the fingers.
        rest: configuration with nothing in the gripper.
        carry: configuration with an object in it.
        open: positions of all joints that do not move the hand, with an open gripper.
        finger_links: links that touch what is grasped.
        outer_links: links that keep off the robot's own body.
        space: what it reaches.
    """

    joints: tuple[Joint, ...]
    chain: Chain
    hand: str
    grasp: tuple[float, float, float]
    fingers: int
    rest: Configuration
    carry: Configuration
    open: Configuration
    finger_links: tuple[str, ...]
    outer_links: tuple[str, ...]
    space: Workspace

    @property
    def moving(self) -> int:
        """Number of joints that move the hand."""
        return len(self.chain.joints)


class JointList:
    """The joints that a robot file names for an arm."""

    def __init__(self, tree: Tree, names: Sequence[str], chain: Chain):
        """Sort joints into those that move the hand, fingers and others.

        Raises:
            ValueError: a joint is unknown, missing or in the wrong place.
        """
        moving = [joint.name for joint in chain.joints]
        for name in names:
            if name not in tree.joints:
                movable = [joint.name for joint in tree.joints.values() if joint.moves]
                raise ValueError(f"names {shown(name)}, which the URDF has not; its joints are {', '.join(movable)}")
            if not tree.joints[name].moves:
                raise ValueError(f"names {shown(name)}, which is fixed; leave it out")
        if list(names[: len(moving)]) != moving:
            raise ValueError(
                f"= {', '.join(names)} is no chain to the hand; begin with all joints that move it, from the base on: "
                + ", ".join(moving)
            )
        for name in names[len(moving) :]:
            if moving[-1] not in {joint.name for joint in tree.path(tree.joints[name].child)}:
                raise ValueError(f"names {shown(name)}, which is neither on the way to the hand nor a finger behind it")
        rest = [joint for joint in tree.joints.values() if joint.moves and joint.name not in names]
        self.chain, self.tree = chain, tree
        self.named = tuple(tree.joints[name] for name in names)
        self.fingers = self.named[len(moving) :]
        self.all = (*self.named, *rest)

    def finger_links(self, hand: str) -> tuple[str, ...]:
        """Return the links that touch what is grasped: the fingers, or the hand where it has none."""
        roots = {joint.child for joint in self.fingers} or {hand}
        return tuple(link for link in self.tree.links if roots & self._at_or_above(link))

    def outer_links(self) -> tuple[str, ...]:
        """Return the links from the third joint on: those before are always at the robot's body."""
        first = self.chain.joints[min(2, len(self.chain.joints) - 1)].child
        return tuple(link for link in self.tree.links if first in self._at_or_above(link))

    def _at_or_above(self, link: str) -> set[str]:
        return {link, *(joint.parent for joint in self.tree.path(link))}

    @cached_property
    def others(self) -> Configuration:
        """Where the joints stay that are not named: at zero, or as near as their limits let them."""
        rest = self.all[len(self.named) :]
        return tuple(float(np.clip(0.0, joint.lower, joint.upper)) for joint in rest)

    def posture(self, values: Sequence[float], joints: Sequence[Joint]) -> Configuration:
        """Return positions of some joints, checked.

        Raises:
            ValueError: there are too few or too many, or one is beyond the limits of its joint.
        """
        if len(values) != len(joints):
            names = ", ".join(joint.name for joint in joints)
            raise ValueError(f"has {len(values)} numbers; give {len(joints)}, one for each of {names}")
        for value, joint in zip(values, joints, strict=True):
            if not joint.lower <= value <= joint.upper:
                raise ValueError(
                    f"has {value:g} for {joint.name}, which goes from {joint.lower:.4g} to {joint.upper:.4g}"
                )
        return tuple(map(float, values))


def arm_model(
    joints: JointList, hand: str, grasp: tuple[float, float, float], rest: Configuration, carry: Configuration,
    fingers: Configuration, speeds: Sequence[float], radius: float,
) -> ArmModel:  # fmt: skip
    """Return an arm, and measure what it reaches.

    Args:
        joints: its joints.
        hand: the link that grasps.
        grasp: point in that link's frame.
        rest: positions of the named joints with nothing in the gripper.
        carry: the same with an object.
        fingers: positions of the fingers of an open gripper.
        speeds: highest, of the named joints, rad/s or m/s.
        radius: of its robot's base, which it keeps off as high as its first joint, metres.
    """
    others, links = joints.others, joints.chain.links
    space = measure(links, Column(radius, float(links.shifts[0, 2])), carry[: len(joints.chain.joints)])
    named = [replace(joint, speed=speed) for joint, speed in zip(joints.named, speeds, strict=True)]
    moved = (*named, *joints.all[len(named) :])
    resting, carrying, opened = (*rest, *others), (*carry, *others), (*fingers, *others)
    touching, outer = joints.finger_links(hand), joints.outer_links()
    return ArmModel(
        moved, joints.chain, hand, grasp, len(joints.fingers), resting, carrying, opened, touching, outer, space
    )  # fmt: skip
