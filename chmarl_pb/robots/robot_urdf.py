"""Read the URDF of a user's robot: checked as a home's is, and for what PyBullet wants of what moves."""

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree.ElementTree import Element

from chmarl_pb.homes.link_shapes import Shapes, check_numbers_of
from chmarl_pb.homes.problem import Findings, Refused, raise_first
from chmarl_pb.homes.shape import Shape
from chmarl_pb.homes.source import Source
from chmarl_pb.homes.urdf import LinkTree, read_tree
from chmarl_pb.robots.chain import MOVING

#: Types of joints that PyBullet knows; those that no arm has stay where they are.
JOINTS = ("fixed", *MOVING, "floating", "planar", "spherical")

_READ = ("link", "joint", "material")  # what stands beside them is for other simulators
_MOST_SHAPES = 600  # visuals, and as many collisions
_LIMITED = ("revolute", "prismatic")
_NUMBERS = {"axis": {"xyz": 3}, "inertia": {"ixx": 1, "iyy": 1, "izz": 1}}


class Piece(NamedTuple):
    """One <visual> or <collision> of a link.

    Attributes:
        link: the element that it stands in.
        element: itself.
        shapes: what it is: of a visual, a shape for each colour of its mesh.
    """

    link: Element
    element: Element
    shapes: list[Shape]


def read_robot(source: Source) -> tuple[Element, list[Piece]]:
    """Return the XML of a robot's URDF, and its visuals and collisions.

    Raises:
        AssetError: a part of it is broken; the message is of the first.
    """
    found, read = Findings(source.urdf), (Element("robot"), list[Piece]())
    try:
        read = _read(source, found)
    except Refused as refused:
        found.error(*refused.args)
    raise_first(found.errors, source.whole)
    return read


def _read(source: Source, found: Findings) -> tuple[Element, list[Piece]]:
    tree = read_tree(source, found, JOINTS)
    if not tree.links:
        raise Refused("it has no links; write at least one <link name=...> with a <visual>")
    for other in [child for child in tree.root if child.tag not in _READ]:
        tree.root.remove(other)
    for tag in ("visual", "collision"):
        if (count := sum(1 for _ in tree.root.iter(tag))) > _MOST_SHAPES:
            raise Refused(f"{count:,} <{tag}> elements, at most {_MOST_SHAPES:,} are read; join some")
    for joint in tree.root.findall("joint"):
        with found.listing("", f"joint {joint.get('name', '')!r}: "):
            _check_joint(joint)
    shapes = Shapes(tree.root, source, found)
    return tree.root, [piece for name in tree.places for piece in _pieces(tree, name, shapes, found)]


def _check_joint(joint: Element) -> None:
    if joint.get("type") in _LIMITED and joint.find("limit") is None:
        raise ValueError("has no <limit>; write <limit lower=... upper=... effort=... velocity=...> into it")
    check_numbers_of(joint, _NUMBERS)


def _pieces(tree: LinkTree, name: str, shapes: Shapes, found: Findings) -> Iterator[Piece]:
    """Yield the visuals and collisions of a link, each near the origin."""
    link, (frame, _) = tree.links[name], tree.places[name]
    with found.listing(name):
        _check_link(link)
    for tag, numbered in zip(("visual", "collision"), shapes.of(link), strict=True):
        for number, element in enumerate(link.findall(tag), start=1):
            piece = Piece(link, element, [shape for of, shape in numbered if of == number])
            with found.listing(name, f"{tag} {number}: "):
                for shape in piece.shapes:
                    shape.check_place(frame)
            yield piece


def _check_link(link: Element) -> None:
    for inertial in link.findall("inertial"):
        for tag in ("mass", "inertia"):
            if inertial.find(tag) is None:
                raise ValueError(f"its <inertial> has no <{tag}>; write one into it, or remove the <inertial>")
        check_numbers_of(inertial, _NUMBERS)
    for visual in link.findall("visual"):
        unnamed = any(material.get("name") is None for material in visual.findall("material"))
        if unnamed and visual.find("geometry/box") is not None:  # others are written anew
            raise ValueError("the <material> of a box has no name; write <material name=...>")
