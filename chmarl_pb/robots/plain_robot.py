"""A robot of a user as PyBullet and both renderers may read it: all meshes as plain OBJ of one colour each.

PyBullet's importers end the process on many a broken mesh, and only plain meshes are drawn by our own rasteriser.
"""

import tempfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from chmarl_pb.assets import URDF_DIR
from chmarl_pb.errors import AssetError
from chmarl_pb.homes.mesh import MOST_TRIANGLES
from chmarl_pb.homes.paint import Part, parts_of
from chmarl_pb.homes.plain import plain_mesh
from chmarl_pb.homes.shape import Numbers, Shape, numbers_of, read_mesh, read_shape
from chmarl_pb.homes.source import MOST_URDF_BYTES, Source, safe_xml, sha256_of, shown
from chmarl_pb.reading import read_regular

#: The robots of the package.
FOLDER = URDF_DIR / "robots"

_MOST_SHAPES = 600  # visuals, and as many collisions


def plain_robot(urdf: Path) -> Path:
    """Return the URDF of a robot for PyBullet: its own if that is plain, else a copy, kept while the process runs.

    Raises:
        AssetError: its URDF or one of its meshes cannot be used.
    """
    if urdf.parent == FOLDER:
        return urdf
    try:
        return _copied(urdf, sha256_of([read_regular(urdf, MOST_URDF_BYTES)]))
    except ValueError as error:
        raise error if isinstance(error, AssetError) else AssetError(f"{urdf}: {str(error)[:500]}") from error


@lru_cache(maxsize=64)
def _copied(urdf: Path, _hash: str) -> Path:
    """Return the copy of a URDF, or itself where none is needed."""
    source = Source(urdf)
    copy = _Copy(source, safe_xml(source.read(urdf.resolve(), MOST_URDF_BYTES)))
    return _written(urdf, copy.files) if copy.files else urdf


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

    def __init__(self, source: Source, root: Element):
        """Read all shapes.

        Raises:
            ValueError: one cannot be used.
        """
        self._source, self._triangles, self._meshes = source, 0, dict[str, bytes]()
        self.files: dict[str, bytes] = {}
        for tag in ("visual", "collision"):
            if (count := sum(1 for _ in root.iter(tag))) > _MOST_SHAPES:
                raise ValueError(f"{count:,} <{tag}> elements, at most {_MOST_SHAPES:,} are read; join some")
        colours = {
            material.get("name", ""): numbers_of(material.find("color"), "rgba") for material in root.iter("material")
        }
        colours = {name: colour for name, colour in colours.items() if colour}
        changes = [self._change(link, part, colours) for link in root.iterfind("link") for part in list(link)]
        if any([_centre(root), *changes]):
            self.files = {"robot.urdf": tostring(root), **self._meshes}

    def _change(self, link: Element, part: Element, colours: Mapping[str, Numbers]) -> bool:
        """Put plain shapes in the place of a visual or collision, if it is not plain; return whether it was not."""
        if part.tag not in ("visual", "collision"):
            return False
        try:
            shape = self._shape(part, colours)
            plain = shape.kind == "box" if shape.mesh is None else False
            if plain or (part.tag == "collision" and shape.mesh is None):
                return False
            link.remove(part)
            link.extend(list(self._seen(shape) if part.tag == "visual" else self._solid(part, shape)))
            return True
        except ValueError as error:
            raise ValueError(f"link {shown(link.get('name', ''))}: {part.tag}: {error}") from error

    def _shape(self, part: Element, colours: Mapping[str, Numbers]) -> Shape:
        name = next((mesh.get("filename", "") for mesh in part.iterfind("geometry/mesh")), "")
        try:
            meshes = {name: read_mesh(name, self._source)} if name else {}
        except ValueError as error:
            raise ValueError(f"mesh {shown(name)}: {error}") from error
        for mesh in meshes.values():
            self._triangles += len(mesh.corners)
        if self._triangles > MOST_TRIANGLES:
            raise ValueError(f"a robot has at most {MOST_TRIANGLES:,} triangles; simplify its meshes")
        return read_shape(part, colours, meshes)

    def _seen(self, shape: Shape) -> Iterator[Element]:
        """Yield a visual for each colour."""
        for part in (part for piece in shape.in_colours for part in parts_of(piece, np.eye(4))):
            rgba = " ".join(f"{channel:.3g}" for channel in (*part.colour, 1.0))
            visual = self._element("visual", part)
            SubElement(SubElement(visual, "material", name=rgba), "color", rgba=rgba)
            yield visual

    def _solid(self, collision: Element, shape: Shape) -> Iterator[Element]:
        """Yield a collision, its mesh a plain copy."""
        assert shape.mesh is not None
        ((name, content),) = shape.mesh.solid.items()
        self._meshes[name] = content
        for mesh in collision.iterfind("geometry/mesh"):
            mesh.set("filename", name)
        yield collision

    def _element(self, tag: str, part: Part) -> Element:
        name, content = plain_mesh(part.corners, part.normals)
        self._meshes[name] = content
        element = Element(tag)
        SubElement(SubElement(element, "geometry"), "mesh", filename=name)
        return element


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
