"""Flat pictures and letters that lie a millimetre above a surface.

A decal is drawn in the x-y plane, x to the right and y up, and faces +z. ``front`` stands it up to face -y, ``both``
adds a copy that faces +y, ``bent`` wraps it around an upright cylinder. Lengths are metres.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from tools.assets.meshes import Mesh, at_height, ears, join, ngon, rectangle, shaded

#: Distance of a decal from its surface.
GAP = 0.001

#: Strokes of capital letters: polylines through points "xy" on a grid 2 wide and 4 high.
LETTERS = {
    "A": ("00 14 20", "02 22"),
    "C": ("24 04 00 20",),
    "D": ("00 04 14 23 21 10 00",),
    "E": ("24 04 00 20", "02 22"),
    "F": ("24 04 00", "02 22"),
    "G": ("24 04 00 20 22 12",),
    "H": ("00 04", "20 24", "02 22"),
    "I": ("10 14",),
    "J": ("24 20 00 01",),
    "K": ("00 04", "24 02 20"),
    "L": ("04 00 20",),
    "M": ("00 04 12 24 20",),
    "N": ("00 04 20 24",),
    "O": ("00 04 24 20 00",),
    "P": ("00 04 24 22 02",),
    "R": ("00 04 24 22 02", "02 20"),
    "S": ("24 04 02 22 20 00",),
    "T": ("04 24", "14 10"),
    "U": ("04 00 20 24",),
    "V": ("04 10 24",),
    "W": ("04 00 12 20 24",),
    "Y": ("04 12 24", "12 10"),
}


def patch(outline: ArrayLike) -> Mesh:
    """Return a flat counterclockwise polygon."""
    points = np.asarray(outline, dtype=float)
    return shaded(at_height(points, 0.0)[ears(points)])


def panel(x: float, y: float) -> Mesh:
    """Return a flat centred rectangle."""
    return patch(rectangle(x, y))


def disc(radius: float, corners: int = 10) -> Mesh:
    """Return a flat centred disc."""
    return patch(ngon(radius, corners))


def line(start: tuple[float, float], end: tuple[float, float], width: float) -> Mesh:
    """Return a flat bar between two points, half its width longer at both ends."""
    (x, y), run = start, np.subtract(end, start)
    length, angle = float(np.hypot(*run)), float(np.arctan2(run[1], run[0]))
    return panel(length + width, width).moved(x=length / 2).turned("z", angle).moved(x, y)


def lettering(text: str, height: float, length: float) -> Mesh:
    """Return a centred line of capital letters.

    Args:
        text: letters of ``LETTERS``.
        height: height of the letters.
        length: length of the line.
    """
    advance = length / len(text)
    stroke = 0.25 * min(height, advance)
    across, up = (0.78 * advance - stroke) / 2, (height - stroke) / 4
    bars = []
    for place, letter in enumerate(text):
        middle = (place - (len(text) - 1) / 2) * advance
        for polyline in LETTERS[letter]:
            points = [(middle + (int(x) - 1) * across, (int(y) - 2) * up) for x, y in map(tuple, polyline.split())]
            bars += [line(start, end, stroke) for start, end in pairwise(points)]
    return join(*bars)


def climbing(decal: Mesh) -> Mesh:
    """Turn a decal a quarter to the left, so that its text reads upwards."""
    return decal.turned("z", np.pi / 2)


def upright(mesh: Mesh) -> Mesh:
    """Tip a mesh up about the x axis, so that its upper side faces -y."""
    return mesh.turned("x", np.pi / 2)


def twice(mesh: Mesh) -> Mesh:
    """Add a copy turned half around the z axis."""
    return join(mesh, mesh.turned("z", np.pi))


def front(decal: Mesh, y: float, z: float) -> Mesh:
    """Stand a decal up on the surface at -``y`` that faces -y, its origin at height ``z``."""
    return upright(decal).moved(0.0, -y - GAP, z)


def both(decal: Mesh, y: float, z: float) -> Mesh:
    """Stand a decal up on the surfaces at -``y`` and +``y``."""
    return twice(front(decal, y, z))


def bent(decal: Mesh, radius: float, z: float) -> Mesh:
    """Wrap a decal around an upright cylinder, its origin towards -y at height ``z``."""

    def wrap(points: np.ndarray) -> np.ndarray:
        angle = points[..., 0] / radius
        reach = radius + GAP + points[..., 2]
        return np.stack([reach * np.sin(angle), -reach * np.cos(angle), points[..., 1] + z], axis=-1)

    return shaded(wrap(decal.triangles))
