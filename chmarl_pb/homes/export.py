"""Take a home elsewhere: as plain URDF with its meshes, for any simulator, and as binary glTF, for viewers."""

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh as untyped_trimesh
from PIL import Image

from chmarl_pb.files import check_apart, check_ending, replacing
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.mesh import Mesh
from chmarl_pb.homes.plain import write_links
from chmarl_pb.homes.shape import Shape
from chmarl_pb.homes.solids import Points
from chmarl_pb.homes.urdf import Link

trimesh: Any = untyped_trimesh
_GAMMA = 2.2  # of screens
_WHITE = (1.0, 1.0, 1.0, 1.0)


def export_urdf(home: Home, path: Path) -> Path:
    """Write a home as one URDF of plain elements; its meshes, as OBJ, go into ``meshes`` beside it.

    Links keep names and poses; those without geometry are left out, materials stand in each visual.

    Args:
        home: the home.
        path: the file to write; its name ends in ``.urdf``.

    Raises:
        OptionError: the name ends in something else, or the file is one of the home's.
        WriteError: the files cannot be written.
    """
    check_ending(path, ".urdf")
    check_apart(path, home.files)
    with TemporaryDirectory() as scratch:
        text = write_links(home.links, Path(scratch), str(home.name), relative="meshes")
        for file in sorted(Path(scratch).iterdir()):
            with replacing(path.parent / "meshes" / file.name) as temporary:
                temporary.write_bytes(file.read_bytes())
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def export_gltf(home: Home, path: Path) -> Path:
    """Write what is visible of a home as binary glTF with y up: a node for each shape, named after its link.

    Args:
        home: the home.
        path: the file to write; its name ends in ``.glb``.

    Raises:
        OptionError: the name ends in something else.
        WriteError: the file cannot be written.
    """
    check_ending(path, ".glb")
    turn = trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
    with replacing(path) as temporary:
        temporary.write_bytes(gltf_of(home.links, turn))
    return path


def gltf_of(links: Iterable[Link], frame: Points) -> bytes:
    """Return what is visible of some links as binary glTF: a node for each shape, named after its link.

    Args:
        links: of a home.
        frame: of the home in the file, 4 x 4.
    """
    scene = trimesh.Scene()
    for link in links:
        for number, shape in enumerate(link.visuals or link.collisions):
            place = frame @ link.frame @ shape.origin.frame
            scene.add_geometry(_body(shape), node_name=f"{link.name} {number}", transform=place)
    data: bytes = scene.export(file_type="glb")
    return data


def linear(colour: Sequence[float]) -> list[float]:
    """Return a colour (red, green, blue from 0 to 1, opacity) as glTF has it: in shares of light, not of the screen."""
    red, green, blue, opacity = colour
    return [*(share**_GAMMA for share in (red, green, blue)), opacity]


def _body(shape: Shape) -> Any:
    """Return a shape as triangles with its colour."""
    sizes = shape.sizes
    if shape.mesh is not None:
        body = _triangles(shape.mesh)
        body.apply_scale(sizes["scale"])
    elif shape.kind == "box":
        body = trimesh.creation.box(sizes["size"])
    elif shape.kind == "cylinder":
        body = trimesh.creation.cylinder(sizes["radius"][0], sizes["length"][0], sections=24)
    else:
        body = trimesh.creation.icosphere(radius=sizes["radius"][0], subdivisions=2)
    picture = None if shape.mesh is None or shape.mesh.texture is None else Image.open(io.BytesIO(shape.mesh.texture))
    colour = shape.colour or _WHITE
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=linear(colour), baseColorTexture=picture, metallicFactor=0.0, roughnessFactor=0.9,
        alphaMode="BLEND" if colour[3] < 1 else None, doubleSided=True,
    )  # fmt: skip
    body.visual = trimesh.visual.TextureVisuals(uv=getattr(body.visual, "uv", None), material=material)
    return body


def _triangles(mesh: Mesh) -> Any:
    """Return a mesh whose corners are vertices of their own, so that each has its texture point."""
    vertex, point, _ = np.moveaxis(mesh.corners.reshape(-1, 3), 1, 0)
    body: Any = trimesh.Trimesh(mesh.vertices[vertex], np.arange(len(vertex)).reshape(-1, 3), process=False)
    if mesh.texture is not None:
        body.visual = trimesh.visual.TextureVisuals(uv=np.where(point[:, None] < 0, 0.0, mesh.texture_points[point]))
    return body
