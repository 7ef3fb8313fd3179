"""What moves as binary glTF: a file for each frame of an object or a robot."""

from typing import Any

import trimesh as untyped_trimesh

from chmarl_pb.homes.export import linear
from chmarl_pb.rendering.movables import Movables

trimesh: Any = untyped_trimesh


def frames_of(movables: Movables, name: str) -> list[bytes]:
    """Return, for each frame of a body in order, what is fixed to it as binary glTF.

    Args:
        movables: the bodies; they say where the frames are.
        name: of the body.
    """
    models, body = movables.models, movables.numbers[name]
    parts = range(models.first_part[body], models.first_part[body + 1])
    frames: dict[int, Any] = {}
    for part in parts:
        scene = frames.setdefault(int(models.frame[part]), trimesh.Scene())
        scene.add_geometry(_part(movables, part))
    return [frames[number].export(file_type="glb") for number in sorted(frames)]


def _part(movables: Movables, part: int) -> Any:
    """Return a part as triangles with its colour."""
    models = movables.models
    first, last = models.first_vertex[part : part + 2]
    corners = models.corners[models.first_triangle[part] : models.first_triangle[part + 1], :3] - first
    mesh = trimesh.Trimesh(models.vertices[first:last], corners, process=False)
    colour = linear([*(models.colour[part] / 255).tolist(), 1.0])
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=colour, metallicFactor=0.0, roughnessFactor=0.9, doubleSided=True
    )
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh
