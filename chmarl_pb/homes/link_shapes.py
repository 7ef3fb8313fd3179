"""Read the shapes of links, with the meshes that they name, within limits on what they hold in all."""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import PurePosixPath
from typing import Any
from xml.etree.ElementTree import Element

from chmarl_pb.homes.mesh import MOST_TRIANGLES, Mesh
from chmarl_pb.homes.problem import Findings, Refused
from chmarl_pb.homes.shape import SIZES, Numbers, Shape, numbers_of, read_mesh, read_shape
from chmarl_pb.homes.source import Source

#: Vertices of the mesh of one collision, and of all: of their convex hulls.
MOST_HULL_POINTS, MOST_POINTS_OF_HULLS = 4000, 20_000
#: Of all textures, three a pixel, as often as they are used: TinyRenderer copies one for each.
MOST_PICTURE_BYTES = 256 * 2**20

#: Shapes of one kind of a link, each with its number among them, counted from 1.
Numbered = list[tuple[int, Shape]]

_SMALLEST = 1e-5  # metres
_MOST_TURN = 4 * math.pi  # radians; what is beyond are degrees
_LONGEST = 40  # characters of an element's name in a message
#: Element -> attribute -> how many finite numbers it holds.
Rules = Mapping[str, Mapping[str, int]]
_NUMBERS: Rules = {
    "origin": {"xyz": 3, "rpy": 3},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
    "color": {"rgba": 4},
    "mass": {"value": 1},
}
_NONE: Mapping[str, int] = {}
_OPTIONAL = {"xyz", "rpy", "scale"}
_LENGTHS = {"size", "radius", "length"}


def check_numbers_of(part: Element, rules: Rules = _NUMBERS) -> None:
    """Check the numbers of an element and all in it.

    Raises:
        ValueError: they are not finite numbers, or out of range.
    """
    _check_numbers(part.iter(), rules)


def _check_numbers(elements: Iterable[Element], rules: Rules = _NUMBERS) -> None:
    for element in elements:
        for name, count in rules.get(element.tag, _NONE).items():
            text = element.get(name)
            if text is not None or name not in _OPTIONAL:
                problem = _problem_with(name, count, text or "")
                if problem:
                    raise ValueError(f"<{element.tag} {name}={text!r}> {problem}")


@lru_cache(maxsize=2**14)
def _problem_with(name: str, count: int, text: str) -> str:
    """Return what is wrong with the numbers of an attribute, or nothing; a home has the same ones again and again."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        return f"is not {count} finite numbers; fix it"
    if name in _LENGTHS and not min(numbers) > 0:
        return "is not above 0; fix it"
    if name in _LENGTHS and min(numbers) < _SMALLEST:
        return f"is below {_SMALLEST} m, too small to be there; make it larger or remove it"
    if name == "rpy" and max(map(abs, numbers)) > _MOST_TURN:
        return "turns it several times; angles are in radians, 90 degrees are 1.5708"
    if name == "scale" and 0 in numbers:
        return "leaves nothing of the mesh; fix it"
    if name == "rgba" and not 0 <= min(numbers) <= max(numbers) <= 1:
        return "is not within 0 and 1; divide by 255 what counts to 255"
    return ""


class Shapes:
    """Reads the shapes of links, and counts what they hold in all."""

    def __init__(self, root: Element, source: Source, found: Findings):
        """Read the colours that have names."""
        self._source, self._found = source, found
        self._meshes: dict[str, Mesh] = {}
        self._hulls: list[tuple[str, str, int]] = []
        self._triangles = self._pictures = 0
        self._colours: dict[str, Numbers] = {}
        for material in root.iter("material"):
            with suppress(ValueError):  # it is listed where it stands
                check_numbers_of(material)
                if rgba := numbers_of(material.find("color"), "rgba"):
                    self._colours[material.get("name", "")] = rgba
        for part in root:
            if part.tag not in ("link", "joint"):
                with found.listing("", f"{part.tag} {part.get('name', '')!r}: "):
                    self._check_part(part)

    def of(self, link: Element) -> tuple[Numbered, Numbered]:
        """Return the visuals and the collisions of a link, each with its number, without those that are broken."""
        name = link.get("name", "")
        shapes: dict[str, Numbered] = {"visual": [], "collision": []}
        counts: dict[str, int] = {}
        for part in link:
            number = counts[part.tag] = counts.get(part.tag, 0) + 1
            if part.tag not in shapes:
                with self._found.listing(name):
                    self._check_part(part)
                continue
            with self._found.listing(name, f"{part.tag} {number}: "):
                shape = self._shape(part, name)
                pieces = shape.in_colours if part.tag == "visual" else (shape,)
                shapes[part.tag] += [(number, piece) for piece in pieces]
        return shapes["visual"], shapes["collision"]

    def check_hulls(self) -> None:
        """Check how many points the convex hulls of collisions are to be made of.

        Raises:
            Refused: they are too many.
        """
        total = 0
        for link, name, points in self._hulls:
            total += points
            if points > MOST_HULL_POINTS or total > MOST_POINTS_OF_HULLS:
                raise Refused(
                    f"mesh {name!r}: a collision has at most {MOST_HULL_POINTS:,} vertices, and all have "
                    f"{MOST_POINTS_OF_HULLS:,}; give it a simpler mesh", link,
                )  # fmt: skip

    def _check_part(self, part: Element) -> None:
        """Check the numbers of an element, and the files of textures in it."""
        self._check_elements(list(part.iter()))

    def _check_elements(self, elements: Sequence[Element]) -> None:
        _check_numbers(elements)
        for element in elements:
            if element.tag == "texture":
                self._named("texture", element.get("filename", ""))

    def _shape(self, part: Element, link: str) -> Shape:
        """Return a <visual> or <collision> of a link.

        Raises:
            ValueError: it is broken.
            Refused: there are too many triangles or pixels.
        """
        elements = list(part.iter())
        for element in elements:
            if element.tag == "geometry" and [child.tag in SIZES for child in element] != [True]:
                held = ", ".join(f"<{child.tag[:_LONGEST]}>" for child in element) or "nothing"
                raise ValueError(f"a <geometry> has one of {', '.join(sorted(SIZES))}, and nothing else; it has {held}")
        self._check_elements(elements)
        for element in elements:
            if element.tag == "mesh":
                self._add_mesh(element.get("filename", ""), link, part.tag)
        return read_shape(part, self._colours, self._meshes)

    def _add_mesh(self, name: str, link: str, tag: str) -> None:
        if name not in self._meshes:
            self._meshes[name] = self._named("mesh", name)
        mesh = self._meshes[name]
        self._triangles += len(mesh.corners)
        self._pictures += len(mesh.texture or b"")
        if self._triangles > MOST_TRIANGLES or self._pictures > MOST_PICTURE_BYTES:
            raise Refused(
                f"mesh {name!r}: too much in all, with each mesh and its texture as often as they are used: at most "
                f"{MOST_TRIANGLES:,} triangles and {MOST_PICTURE_BYTES // 3:,} pixels; make some smaller", link,
            )  # fmt: skip
        if tag == "collision":
            self._hulls.append((link, name, len(mesh.used_vertices)))

    def _named(self, tag: str, name: str) -> Any:
        """Read a mesh, or the file of a texture: PyBullet draws textures of meshes alone."""
        try:
            return read_mesh(name, self._source) if tag == "mesh" else self._source.named(name)
        except ValueError as error:
            problem = str(error)
            if problem.endswith("does not exist"):
                near = _near(name, self._source)
                if near == name:
                    problem += f"; add it, or take the line that names it out of {name!r}"
                else:
                    problem += f"; write {near!r}, as it is called" if near else f"; add the file or remove the {tag}"
            raise ValueError(f"{tag} {name!r}: {problem}") from error


def _near(name: str, source: Source) -> str:
    """Return the name of a file that differs from a name only in its case or by backslashes, or nothing."""
    wanted = PurePosixPath(name.replace("\\", "/"))
    with suppress(ValueError, OSError):
        for file in sorted(source.inside(source.urdf.parent, str(wanted)).parent.iterdir()):
            if file.name.lower() == wanted.name.lower():
                return str(wanted.with_name(file.name))
    return ""
