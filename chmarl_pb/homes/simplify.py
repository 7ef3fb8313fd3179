"""Fewer triangles that look nearly the same: what is imported is brought within the budget of its kind."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from chmarl_pb.homes.paint import ColouredTriangles
from chmarl_pb.homes.solids import Points

_CREASE = float(np.radians(40))  # edges whose triangles turn by more stay sharp
_NOTHING = 1e-10  # square metres: smaller triangles are left out
_WELDED = 5  # decimals of a metre to which corners are one point


def simplified(parts: Sequence[ColouredTriangles], most: int) -> tuple[ColouredTriangles, ...]:
    """Return parts that have at most so many triangles together, each as many as its share; they may keep some more.

    Args:
        parts: of one thing, metres.
        most: triangles.
    """
    count = sum(len(part.corners) for part in parts)
    if count <= most:
        return tuple(parts)
    return tuple(_simplified(part, max(4, most * len(part.corners) // count)) for part in parts)


def _simplified(part: ColouredTriangles, most: int) -> ColouredTriangles:
    import fast_simplification  # only here: most things are within the budget
    import trimesh

    points, numbers = np.unique(np.round(part.corners.reshape(-1, 3), _WELDED), axis=0, return_inverse=True)
    faces = numbers.reshape(-1, 3)
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    points, faces = fast_simplification.simplify(points, faces[whole], target_count=most)
    body = trimesh.Trimesh(points, faces, process=False)
    body.update_faces(body.area_faces > _NOTHING)
    body = trimesh.graph.smooth_shade(body, angle=_CREASE)
    normals: Points = np.asarray(body.vertex_normals)[body.faces]
    return replace(part, corners=np.asarray(body.triangles), normals=normals)
