"""How bright TinyRenderer draws a pixel of a triangle, with its own arithmetic."""

from typing import NamedTuple

import numpy as np

from chmarl_pb.compiled import compiled
from chmarl_pb.rendering.triangles import ONE, TWO, ZERO, Floats, doubles


class Light(NamedTuple):
    """Where light comes from and how it is reflected.

    Attributes:
        direction: (3,) unit vector towards the light.
        coefficients: (4,) ambient, diffuse, specular, and the exponent of the specular term.
    """

    direction: Floats
    coefficients: Floats


@compiled
def weights_at(rows, px, py):  # type: ignore[no-untyped-def]
    """Return the weights of a triangle's corners, rows of the scratch (3, 6), at a pixel."""
    ax, ay, bx, by, cx, cy = doubles(rows[0, 0], rows[0, 1], rows[1, 0], rows[1, 1], rows[2, 0], rows[2, 1])
    ux = (bx - ax) * (ay - py) - (ax - px) * (by - ay)
    uy = (ax - px) * (cy - ay) - (cx - ax) * (ay - py)
    uz = (cx - ax) * (by - ay) - (bx - ax) * (cy - ay)
    s0, s1, s2 = np.float64(-1), np.float64(1), np.float64(1)
    if abs(uz) > 1e-2:
        s0, s1, s2 = 1.0 - (ux + uy) / uz, uy / uz, ux / uz
    b0, b1, b2 = s0 / rows[0, 3], s1 / rows[1, 3], s2 / rows[2, 3]
    total = (b0 + b1) + b2
    return np.float32(b0 / total), np.float32(b1 / total), np.float32(b2 / total)


@compiled
def normal_at(normals, b0, b1, b2):  # type: ignore[no-untyped-def]
    """Return the unit normal at a pixel.

    Args:
        normals: (3, 3) at the corners, in the world.
        b0: weight of the first corner.
        b1: weight of the second.
        b2: weight of the third.
    """
    x = (normals[2, 0] * b2 + normals[1, 0] * b1) + normals[0, 0] * b0
    y = (normals[2, 1] * b2 + normals[1, 1] * b1) + normals[0, 1] * b0
    z = (normals[2, 2] * b2 + normals[1, 2] * b1) + normals[0, 2] * b0
    scale = ONE / np.sqrt((x * x + y * y) + z * z)
    return x * scale, y * scale, z * scale


@compiled
def brightness(x, y, z, light):  # type: ignore[no-untyped-def]
    """Return the share of its colour that a pixel with a unit normal shows by reflected light."""
    lx, ly, lz = light.direction[0], light.direction[1], light.direction[2]
    towards = (z * lz + y * ly) + x * lx
    twice = towards * TWO
    rx, ry, rz = x * twice - lx, y * twice - ly, z * twice - lz
    mirrored = rz * (ONE / np.sqrt((rx * rx + ry * ry) + rz * rz))
    diffuse, specular, exponent = light.coefficients[1], light.coefficients[2], light.coefficients[3]
    shine = mirrored**exponent if mirrored > ZERO else ZERO
    return diffuse * max(ZERO, towards) + specular * shine
