"""COLLADA files: the triangles of their scene, in metres; skins, instances of nodes and colours are not read."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.mesh import MOST_TRIANGLES, Mesh
from chmarl_pb.homes.solids import Points
from chmarl_pb.homes.source import safe_xml

_TRANSFORMS = {"matrix": 16, "translate": 3, "rotate": 4, "scale": 3}
_REFUSED = {"lookat", "skew", "instance_node", "instance_controller"}  # in a node
_FACES = {"triangles", "polylist"}
_OTHER_FACES = {"polygons", "trifans", "tristrips"}
_MOST_INSTANCES = 1000
_LONGEST_ROW = 16  # numbers of one vertex in an array


def read_dae(content: bytes) -> Mesh:
    """Return all triangles of a COLLADA file's scene as one mesh.

    Raises:
        ValueError: it is not COLLADA, damaged, or holds what is not read.
    """
    if not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        raise ValueError("is not COLLADA: it does not begin with '<'; export it anew")
    root = safe_xml(content)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise ValueError(f"is not COLLADA: its root is <{root.tag[:40]}>; export it anew")
    try:
        with np.errstate(all="ignore"):  # what overflows is found when the mesh is checked
            return _Scene(root).mesh()
    except (ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"COLLADA that cannot be read: {error}; export it as OBJ") from error


class _Scene:
    """The scene of a COLLADA file."""

    def __init__(self, root: Element):
        self._root = root
        self._ids = {element.get("id"): element for element in root.iter() if element.get("id")}
        self._shapes: dict[str, tuple[Points, Points, NDArray[np.int64]]] = {}

    def mesh(self) -> Mesh:
        """Return all its triangles, scaled to metres."""
        unit = self._root.find("asset/unit")
        scale = 1.0 if unit is None else float(unit.get("meter", "1"))
        vertices, normals, corners = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 3, 3), dtype=np.int64)]
        starts, triangles = np.zeros(3, dtype=np.int64), 0
        for number, (matrix, url) in enumerate(self._instances()):
            points, directions, numbers = self._shape(url)
            triangles += len(numbers)
            if triangles > MOST_TRIANGLES or number == _MOST_INSTANCES:
                raise ValueError(f"more than {MOST_TRIANGLES:,} triangles or {_MOST_INSTANCES:,} instances of geometry")
            turned = directions @ np.linalg.pinv(matrix[:3, :3])
            if not (np.abs(turned).max(axis=1, initial=0) > 0).all():
                turned, numbers = turned[:0], np.where(np.arange(3) == 2, -1, numbers)
            vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
            normals.append(turned)
            corners.append(np.where(numbers >= 0, numbers + starts, -1))
            starts += len(points), 0, len(turned)
        return Mesh(
            np.concatenate(vertices) * scale, np.concatenate(corners), np.concatenate(normals), np.zeros((0, 2))
        )

    def _instances(self) -> Iterator[tuple[Points, str]]:
        """Yield the matrix (4 x 4) and the geometry's URL of each thing in the scene."""
        scene = self._root.find("scene/instance_visual_scene")
        left = [(node, np.eye(4)) for node in self._at("" if scene is None else scene.get("url", ""), "visual_scene")]
        while left:
            node, matrix = left.pop()
            if node.tag == "instance_geometry":
                yield matrix, node.get("url", "")
            elif node.tag == "node":
                for element in node:
                    if element.tag in _REFUSED:
                        raise ValueError(f"<{element.tag}> in a <node> is not read")
                    if element.tag in _TRANSFORMS:
                        matrix = matrix @ _transform(element)
                left += [(element, matrix) for element in reversed(node)]

    def _at(self, url: str, tag: str) -> Element:
        found = self._ids.get(url[1:]) if url.startswith("#") else None
        if found is None or found.tag != tag:
            raise ValueError(f"no <{tag}> is called {url[:40]!r}")
        return found

    def _shape(self, url: str) -> tuple[Points, Points, NDArray[np.int64]]:
        """Return vertices, normals, and the numbers of both at the corners of triangles."""
        if url not in self._shapes:
            mesh = self._at(url, "geometry").find("mesh")
            parts = [] if mesh is None else [self._part(faces) for faces in mesh if faces.tag in _FACES]
            if mesh is None or any(faces.tag in _OTHER_FACES for faces in mesh):
                raise ValueError("only <mesh> of <triangles> or <polylist> is read")
            starts = np.cumsum([[0, 0, 0], *([len(part[0]), 0, len(part[1])] for part in parts)], axis=0)
            self._shapes[url] = (
                np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)]),
                np.concatenate([np.zeros((0, 3)), *(part[1] for part in parts)]),
                np.concatenate(
                    [np.zeros((0, 3, 3), dtype=np.int64)]
                    + [np.where(part[2] >= 0, part[2] + start, -1) for part, start in zip(parts, starts, strict=False)]
                ),
            )
        return self._shapes[url]

    def _part(self, faces: Element) -> tuple[Points, Points, NDArray[np.int64]]:
        """Return the same of one group of faces."""
        inputs = {element.get("semantic"): element for element in faces.findall("input")}
        offsets = {semantic: int(element.get("offset", "0")) for semantic, element in inputs.items()}
        if "VERTEX" not in inputs or not 0 <= min(offsets.values()) <= max(offsets.values()) < _LONGEST_ROW:
            raise ValueError("faces without an <input> of VERTEX, or with an offset out of range")
        vertices = self._at(inputs["VERTEX"].get("source", ""), "vertices")
        shared = {element.get("semantic"): element.get("source", "") for element in vertices.findall("input")}
        points = self._rows(shared.get("POSITION", ""))
        rows = np.array(_integers(faces.findtext("p"))).reshape(-1, max(offsets.values()) + 1)
        corners = np.full((len(rows), 3), -1)
        corners[:, 0] = rows[:, offsets["VERTEX"]]
        normals: Points = np.zeros((0, 3))
        if "NORMAL" in inputs:
            normals, corners[:, 2] = self._rows(inputs["NORMAL"].get("source", "")), rows[:, offsets["NORMAL"]]
        elif "NORMAL" in shared:
            normals, corners[:, 2] = self._rows(shared["NORMAL"]), corners[:, 0]
        if (rows < 0).any() or (corners[:, [0, 2]] >= (len(points), len(normals))).any():
            raise ValueError("a face names a vertex or a normal that is not there")
        return points, normals, corners[_fans(faces, len(rows))]

    def _rows(self, url: str) -> Points:
        """Return the rows (n, 3) of a <source>."""
        source = self._at(url, "source")
        accessor = source.find("technique_common/accessor")
        if accessor is None:
            raise ValueError(f"<source id={url[1:40]!r}> has no <accessor>")
        numbers = np.array([float(word) for word in (source.findtext("float_array") or "").split()])
        count, stride, offset = (int(accessor.get(key, default)) for key, default in
                                 (("count", ""), ("stride", "1"), ("offset", "0")))  # fmt: skip
        if not (3 <= stride <= _LONGEST_ROW and 0 <= offset and 0 <= count <= (len(numbers) - offset) // stride):
            raise ValueError(f"<source id={url[1:40]!r}> has fewer numbers than its <accessor> says, or rows below 3")
        return numbers[offset : offset + count * stride].reshape(count, stride)[:, :3]


def _transform(element: Element) -> Points:
    """Return the matrix (4 x 4) of a transformation of a node."""
    numbers = np.array([float(word) for word in (element.text or "").split()])
    if len(numbers) != _TRANSFORMS[element.tag] or not (np.abs(numbers) < 1e9).all():
        raise ValueError(f"<{element.tag}> has not {_TRANSFORMS[element.tag]} finite numbers")
    matrix: Points = np.eye(4)
    if element.tag == "matrix":
        matrix = numbers.reshape(4, 4)
    elif element.tag == "translate":
        matrix[:3, 3] = numbers
    elif element.tag == "scale":
        matrix[:3, :3] = np.diag(numbers)
    elif (length := np.linalg.norm(numbers[:3])) > 0:
        x, y, z = numbers[:3] / length
        angle = np.radians(numbers[3])
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


def _integers(text: str | None) -> list[int]:
    return [int(word) for word in (text or "").split()]


def _fans(faces: Element, corners: int) -> NDArray[np.int64]:
    """Return the rows (triangles, 3) of corners that make triangles of a group of faces."""
    if faces.tag == "triangles":
        if corners % 3:
            raise ValueError("<triangles> with a number of corners that 3 does not divide")
        return np.arange(corners).reshape(-1, 3)
    counts = _integers(faces.findtext("vcount"))
    if any(count < 3 for count in counts) or sum(counts) != corners:
        raise ValueError("<polylist> whose <vcount> does not fit its <p>")
    starts = np.cumsum([0, *counts])
    rows = [
        (start, start + k, start + k + 1)
        for start, count in zip(starts, counts, strict=False)
        for k in range(1, count - 1)
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 3)
