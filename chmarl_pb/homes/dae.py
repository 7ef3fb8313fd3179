"""COLLADA files: the triangles of their scene, in metres; skins, instances of nodes and colours are not read."""

import io
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np

from chmarl_pb.homes.mesh import MOST_TRIANGLES, Mesh
from chmarl_pb.homes.source import safe_xml

_REFUSED = ("instance_node", "instance_controller")  # the former can double with every node
#: What has no part in the triangles, and may be wrong.
_LEFT_OUT = {
    *(f"library_{kind}" for kind in ("animations", "cameras", "effects", "images", "lights", "materials")),
    *("bind_material", "extra", "instance_camera", "instance_light"),
}  # fmt: skip
_MOST_INSTANCES = 1000


def read_dae(content: bytes) -> Mesh:
    """Return all triangles of a COLLADA file's scene as one mesh.

    Raises:
        ValueError: it is not COLLADA, damaged, or holds what is not read.
    """
    if not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        raise ValueError("is not COLLADA: it does not begin with '<'; export it anew")
    root = safe_xml(content)
    if _tag(root) != "COLLADA":
        raise ValueError(f"is not COLLADA: its root is <{_tag(root)[:40]}>; export it anew")
    unread = _unread(root)
    try:
        _simplify(root)
        with np.errstate(all="ignore"):  # what overflows is found when the mesh is checked
            return replace(_joined(ElementTree.tostring(root)), unread=unread)
    except Exception as error:  # the reader raises nearly anything
        reason = str(error).partition("\n")[0][:200]
        raise ValueError(f"COLLADA that cannot be read: {reason}; export it as OBJ") from error


def _unread(root: ElementTree.Element) -> tuple[str, ...]:
    """Return what the file says that is not read; see :class:`chmarl_pb.homes.mesh.Mesh`."""
    looks = any(_tag(element) == "library_effects" for element in root)
    axis = next((element.text for element in root.iter() if _tag(element) == "up_axis"), None) or "Z_UP"
    return (*(("colours",) if looks else ()), *(("up axis",) if axis.strip() != "Z_UP" else ()))


def _simplify(root: ElementTree.Element) -> None:
    """Leave out what is not read; raise a ValueError if that would change the triangles."""
    instances = 0
    for parent in list(root.iter()):
        for element in list(parent):
            if _tag(element) in _REFUSED:
                raise ValueError(f"<{_tag(element)}> in a <node> is not read")
            if _tag(element) in _LEFT_OUT:
                parent.remove(element)
            instances += _tag(element) == "instance_geometry"
    if instances > _MOST_INSTANCES:
        raise ValueError(f"more than {_MOST_INSTANCES:,} instances of geometry")


def _tag(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2]


def _joined(content: bytes) -> Mesh:
    """Return the triangles of all things in the scene."""
    import collada  # only here: few homes have such files

    file = collada.Collada(io.BytesIO(content), ignore=())
    parts: list[Any] = [(np.zeros((0, 3)), np.zeros((0, 3, 3), dtype=np.int64), np.zeros((0, 3)))]
    starts, triangles = np.zeros(3, dtype=np.int64), 0
    for thing in file.scene.objects("geometry"):
        turn, shift = thing.matrix[:3, :3].astype(float), thing.matrix[:3, 3]
        for faces in thing.original.primitives:
            if isinstance(faces, collada.lineset.LineSet) or not len(faces):
                continue
            faces = faces if isinstance(faces, collada.triangleset.TriangleSet) else faces.triangleset()
            triangles += len(faces)
            if triangles > MOST_TRIANGLES:
                raise ValueError(f"more than {MOST_TRIANGLES:,} triangles")
            normals = np.zeros((0, 3)) if faces.normal is None else faces.normal @ np.linalg.pinv(turn)
            normals = normals if (np.abs(normals).max(axis=1, initial=0) > 0).all() else normals[:0]
            corners = np.full((len(faces), 3, 3), -1)
            corners[..., 0] = faces.vertex_index + starts[0]
            if len(normals):
                corners[..., 2] = faces.normal_index + starts[2]
            parts.append((faces.vertex @ turn.T + shift, corners, normals))
            starts += len(faces.vertex), 0, len(normals)
    vertices, all_corners, all_normals = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Mesh(vertices * (file.assetInfo.unitmeter or 1.0), all_corners, all_normals, np.zeros((0, 2)))
