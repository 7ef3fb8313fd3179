"""A robot of a user as PyBullet and both renderers may read it: all meshes as plain OBJ of one colour each.

PyBullet's importers end the process on many a broken mesh, and only plain meshes are drawn by our own rasteriser.
"""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from chmarl_pb.assets import URDF_DIR
from chmarl_pb.errors import AssetError
from chmarl_pb.homes.paint import ColouredTriangles, triangles_by_colour
from chmarl_pb.homes.plain import plain_mesh
from chmarl_pb.homes.source import Source
from chmarl_pb.kept import Kept
from chmarl_pb.robots.robot_urdf import Piece, read_robot

#: The robots of the package.
FOLDER = URDF_DIR / "robots"

_KEPT: Kept["_Robot"] = Kept(64)


def plain_robot(urdf: Path) -> Path:
    """Return the URDF of a robot for PyBullet: its own if that is plain, else a copy, kept while the process runs.

    Raises:
        AssetError: its URDF or one of its meshes cannot be used.
    """
    return urdf if urdf.parent == FOLDER else _read(urdf).plain


def robot_hash(urdf: Path) -> str | None:
    """Return the sha256 of the files of a robot; None if it is the package's, or the URDF is the only one.

    Raises:
        AssetError: its URDF or one of its meshes cannot be used.
    """
    return None if urdf.parent == FOLDER else _read(urdf).content


class _Robot(NamedTuple):
    """A robot of the user's: the URDF that PyBullet gets, and the sha256 of its files if they are several."""

    plain: Path
    content: str | None


def _read(urdf: Path) -> _Robot:
    try:
        return _KEPT.get(urdf, urdf, lambda: _copied(urdf))
    except ValueError as error:
        raise error if isinstance(error, AssetError) else AssetError(f"{urdf}: {str(error)[:500]}") from error


def _copied(urdf: Path) -> tuple[_Robot, tuple[Path, ...]]:
    """Return a robot, with a copy of its URDF where one is needed, and its files."""
    source = Source(urdf, "robot")
    copy = _Copy(*read_robot(source))
    plain, files = _written(urdf, copy.files) if copy.files else urdf, source.files
    return _Robot(plain, source.content if len(files) > 1 else None), files


def _written(urdf: Path, files: Mapping[str, bytes]) -> Path:
    """Write files into a folder of their own and return the path of the first one."""
    try:
        _folders.append(tempfile.TemporaryDirectory(prefix="chmarl-robot-"))
        folder = Path(_folders[-1].name)
        for name, content in files.items():
            (folder / name).write_bytes(content)
    except OSError as error:
        raise AssetError(
            f"{urdf}: cannot be copied for PyBullet ({error.strerror}); make room, or name another folder by TMPDIR"
        ) from error
    return folder / next(iter(files))


_folders: list[tempfile.TemporaryDirectory[str]] = []


class _Copy:
    """The files of a plain copy.

    Attributes:
        files: name -> content, the URDF first; empty if nothing has to be changed.
    """

    def __init__(self, root: Element, pieces: Sequence[Piece]):
        """Put plain shapes in the place of those that are not plain."""
        self._meshes = dict[str, bytes]()
        odd = [piece for piece in pieces if not _is_plain(piece)]
        for piece in odd:
            self._change(piece)
        self.files = {"robot.urdf": tostring(root), **self._meshes} if _centre(root) or odd else {}

    def _change(self, piece: Piece) -> None:
        piece.link.remove(piece.element)
        piece.link.extend(list(self._seen(piece) if piece.element.tag == "visual" else self._solid(piece)))

    def _seen(self, visual: Piece) -> Iterator[Element]:
        """Yield a visual for each colour."""
        for part in (part for shape in visual.shapes for part in triangles_by_colour(shape, np.eye(4))):
            rgba = " ".join(f"{channel:.3g}" for channel in (*part.colour, 1.0))
            element = self._element("visual", part)
            SubElement(SubElement(element, "material", name=rgba), "color", rgba=rgba)
            yield element

    def _solid(self, collision: Piece) -> Iterator[Element]:
        """Yield a collision, its mesh a plain copy."""
        for mesh in (shape.mesh for shape in collision.shapes if shape.mesh is not None):
            ((name, content),) = mesh.solid.items()
            self._meshes[name] = content
            for element in collision.element.iterfind("geometry/mesh"):
                element.set("filename", name)
        yield collision.element

    def _element(self, tag: str, part: ColouredTriangles) -> Element:
        name, content = plain_mesh(part.corners, part.normals)
        self._meshes[name] = content
        element = Element(tag)
        SubElement(SubElement(element, "geometry"), "mesh", filename=name)
        return element


def _is_plain(piece: Piece) -> bool:
    """Return whether PyBullet and our own rasteriser can read a piece as it is: a box, or solid without a mesh."""
    seen = piece.element.tag == "visual"
    return all(shape.kind == "box" or (shape.mesh is None and not seen) for shape in piece.shapes)


def _centre(root: Element) -> bool:
    """Let the base's inertial frame be its own, which PyBullet moves it by; return whether it was another.

    The base is fixed or put where it is: its masses do not matter.
    """
    children = {child.get("link") for child in root.iterfind("joint/child")}
    found = [
        (inertial, origin)
        for link in root.iterfind("link")
        if link.get("name") not in children
        for inertial in link.iterfind("inertial")
        for origin in inertial.findall("origin")
    ]
    for inertial, origin in found:
        inertial.remove(origin)
    return bool(found)
