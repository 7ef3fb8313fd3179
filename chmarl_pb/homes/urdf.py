"""Read the URDF of a home into links with their convex solids; what is unsafe or broken is left out and listed.

All that PyBullet will load is parsed here first, within limits: see :mod:`chmarl_pb.homes.plain`.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from xml.etree.ElementTree import Element

import numpy as np

from chmarl_pb.homes.link_shapes import Numbered, Shapes, check_numbers_of
from chmarl_pb.homes.problem import Findings, Refused, raise_first
from chmarl_pb.homes.shape import Origin, Shape, read_origin
from chmarl_pb.homes.solids import Points, Solid
from chmarl_pb.homes.source import Source, safe_xml

#: How many of each element a home may have.
MOST = {
    "link": 2000, "joint": 2000, "visual": 2000, "collision": 600, "mesh": 4000, "material": 4000, "texture": 4000,
}  # fmt: skip
_LONGEST_LINE = 1000  # PyBullet by itself, in which homes work as well, cuts a URDF's lines at 1,023 characters
_LONGEST_VALUE = 400  # characters of an attribute


@dataclass(frozen=True, eq=False)
class Link:
    """One link of a home.

    Attributes:
        name: its name.
        frame: in the world, 4 x 4.
        origin: the same, as the URDF writes it where it is joined to the root.
        visuals: what a camera sees; if there are none, it sees the collisions.
        collisions: what is solid.
        solids: convex pieces of its collisions, in the world frame.
    """

    name: str
    frame: Points
    origin: Origin
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]
    solids: tuple[Solid, ...]

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """All its visuals and collisions."""
        return self.visuals + self.collisions


def read_links(source: Source, found: Findings) -> tuple[Link, ...]:
    """Return the links of a home's URDF in the order of the file, as far as they can be read.

    Args:
        source: the files of the home.
        found: gets an error for each part that is broken and left out.

    Raises:
        Refused: the file is missing, unsafe, not a URDF, or larger than a home can be.
    """
    tree = read_tree(source, found)
    shapes = Shapes(tree.root, source, found)
    read = [(name, *place, *shapes.of(tree.links[name])) for name, place in tree.places.items()]
    shapes.check_hulls()
    return tuple([_link(*parts, found) for parts in read])


@dataclass(frozen=True, eq=False)
class LinkTree:
    """The links of a URDF and how they hang together.

    Attributes:
        root: the whole XML.
        links: name -> its element.
        places: name -> frame (4 x 4) in the world, and its origin there; without links that go round.
    """

    root: Element
    links: dict[str, Element]
    places: dict[str, tuple[Points, Origin]]


def read_tree(source: Source, found: Findings, kinds: tuple[str, ...] = ("fixed",)) -> LinkTree:
    """Return the links of a URDF where they are while no joint is moved, as far as they can be read.

    Args:
        source: the files that it is made of.
        found: gets an error for each link and joint that is broken.
        kinds: types of joints that there may be.

    Raises:
        Refused: the file is missing, unsafe, not a URDF, or larger than a home can be.
    """
    root = _root(source)
    _check_counts(root)
    links = _links(root, found)
    _check_kinds(root, found, kinds, source.whole)
    joints = _joints(root, links, found)
    return LinkTree(root, links, _places(links, joints, found))


def read_whole(source: Source) -> tuple[Link, ...]:
    """Return the links of the URDF of one thing.

    Raises:
        AssetError: a part of it is broken; the message is of the first.
    """
    found, links = Findings(source.urdf), tuple[Link, ...]()
    try:
        links = read_links(source, found)
    except Refused as refused:
        found.error(*refused.args)
    raise_first(found.errors, source.whole)
    return links


def _root(source: Source) -> Element:
    """Parse XML without DTDs and entities, and within what PyBullet can read."""
    text = source.read_urdf()
    lengths = [len(line) for line in text.splitlines()]
    if max(lengths, default=0) > _LONGEST_LINE:
        number = next(number for number, length in enumerate(lengths) if length > _LONGEST_LINE)
        raise Refused(
            f"line {number + 1} has {lengths[number]} characters, but PyBullet reads at most {_LONGEST_LINE}; "
            "write one XML element on a line"
        )
    try:
        root = safe_xml(text)
    except ValueError as error:
        raise Refused(str(error)) from error
    if any("xacro" in element.tag for element in root.iter()):
        raise Refused("it holds xacro, which is no URDF yet; run xacro, which writes one")
    if root.tag != "robot":
        raise Refused(f"the root element is <{root.tag[:_LONGEST_VALUE]}>, a URDF has <robot>; export it as URDF")
    if not root.get("name"):
        raise Refused("PyBullet cannot load this URDF, for <robot> has no name; write <robot name=...>")
    return root


def _check_counts(root: Element) -> None:
    """Check how much there is before anything is made of it."""
    counts = Counter(element.tag for element in root.iter())
    for tag, most in MOST.items():
        if counts[tag] > most:
            raise Refused(f"{counts[tag]:,} <{tag}> elements, at most {most:,} are read; remove or join some")
    pairs = chain.from_iterable(map(Element.items, root.iter()))
    if max(map(len, chain.from_iterable(pairs)), default=0) <= _LONGEST_VALUE:
        return
    for element in root.iter():
        for name, value in element.attrib.items():
            if len(value) > _LONGEST_VALUE or len(name) > _LONGEST_VALUE:
                raise Refused(
                    f"<{element.tag[:40]} {name[:40]}={value[:40]!r}...> has {len(value):,} characters, "
                    f"at most {_LONGEST_VALUE} are read; shorten it"
                )


def _links(root: Element, found: Findings) -> dict[str, Element]:
    """Return the links by their names, of those of one name the first."""
    links: dict[str, Element] = {}
    names = Counter(link.get("name", "") for link in root.findall("link"))
    for link in root.findall("link"):
        links.setdefault(link.get("name", ""), link)
    for name, count in names.items():
        if not name:
            found.error(f"link {name!r} stands {count} times; give every link its own name")
            del links[name]
        elif count > 1:
            found.error(f"it stands {count} times; give every link its own name", name)
    return links


def _check_kinds(root: Element, found: Findings, kinds: tuple[str, ...], whole: str) -> None:
    """List the joints of other types than there may be."""
    must = f"a {whole} must not move, make it 'fixed'" if kinds == ("fixed",) else f"use one of: {', '.join(kinds)}"
    links = {link.get("name", "") for link in root.findall("link")}
    for joint in root.findall("joint"):
        if joint.get("type") not in kinds:
            child = _referred(joint, "child")
            problem = f"joint {joint.get('name', '')!r} is {joint.get('type')!r}; {must}"
            found.error(problem, child if child in links else "")


_Joints = dict[str, tuple[str, Origin]]  # child -> parent and its place there


def _joints(root: Element, links: dict[str, Element], found: Findings) -> _Joints:
    """Return how the links hang together, and list what keeps the joints from making one tree of them."""
    joints: _Joints = {}
    taken: dict[str, str] = {}
    for joint in root.findall("joint"):
        name, parent, child = joint.get("name", ""), _referred(joint, "parent"), _referred(joint, "child")
        for problem in _joint_problems(joint, taken, links, child in joints):
            found.error(f"joint {name!r} {problem}", child if child in links else "")
        taken.setdefault(name, child)
        if parent in links and child in links and child not in joints:
            joints[child] = parent, Origin()
            with found.listing(child, f"joint {name!r}: "):
                check_numbers_of(joint)
                joints[child] = parent, read_origin(joint)
    roots = [name for name in links if name not in joints]
    if len(roots) > 1:  # with none, links go round: that is found when they are placed
        found.error(f"links {roots[:4]} have no parent; join all but one of them by fixed joints")
    return joints


def _joint_problems(
    joint: Element, others: dict[str, str], links: dict[str, Element], has_parent: bool
) -> Iterator[str]:
    """Yield what is wrong with a joint; ``others`` tells which link each joint before it leads to."""
    name, child = joint.get("name", ""), _referred(joint, "child")
    if not name:
        yield f"to {child!r} has no name; give every joint its own"
    elif name in others:
        yield f"stands twice, to {others[name]!r} and to {child!r}; give every joint its own name"
    for end in (_referred(joint, "parent"), child):
        if end not in links:
            yield f"names the link {end!r}, which does not exist; add the link or the name"
    if has_parent:
        yield f"gives link {child!r} a second parent; a URDF is a tree, remove one of the joints"


def _referred(joint: Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _places(links: dict[str, Element], joints: _Joints, found: Findings) -> dict[str, tuple[Points, Origin]]:
    """Return the frame (4 x 4) of every link in the world, and its origin there; without those that go round."""
    places: dict[str, tuple[Points, Origin]] = {}
    for link in links:
        chain = [link]
        while chain[-1] in joints and chain[-1] not in places and len(chain) <= len(joints) + 1:
            chain.append(joints[chain[-1]][0])
        if len(chain) > len(joints) + 1:
            found.error("it is its own ancestor; a URDF is a tree, remove one of the joints", link)
            continue
        for name in reversed(chain):
            if name not in places:
                places[name] = _place(*joints[name], joints, places) if name in joints else (np.eye(4), Origin())
    return {name: places[name] for name in links if name in places}


def _place(
    parent: str, origin: Origin, joints: _Joints, places: dict[str, tuple[Points, Origin]]
) -> tuple[Points, Origin]:
    frame = places[parent][0] @ origin.frame
    return frame, origin if parent not in joints else Origin.of(frame)


def _link(
    name: str, frame: Points, origin: Origin, visuals: Numbered, collisions: Numbered, found: Findings
) -> Link:  # fmt: skip
    """Return a link with those of its shapes that lie near the origin and have a volume, where they are solid."""
    seen = []
    for number, shape in visuals:
        with found.listing(name, f"visual {number}: "):
            shape.check_place(frame)
            seen.append(shape)
    hard, solids = [], []
    for number, shape in collisions:
        with found.listing(name, f"collision {number}: "):
            shape.check_place(frame)
            solids.append(shape.solid(frame))
            hard.append(shape)
    return Link(name, frame, origin, tuple(seen), tuple(hard), tuple(solids))
