"""Write a URDF as text, one element on each line: what yourdfpy would write, many times as fast.

The text is the same on every machine: numbers are rounded to six digits, and there are no negative zeros.
"""

from collections.abc import Iterable, Iterator
from functools import lru_cache
from xml.sax.saxutils import escape

import numpy as np
import yourdfpy
from trimesh.transformations import euler_from_matrix

DIGITS = 6


def urdf_bytes(robot: yourdfpy.Robot) -> bytes:
    """Return the URDF of a robot of fixed joints, whose links have no mass."""
    return ("\n".join(_lines(robot)) + "\n").encode()


def _lines(robot: yourdfpy.Robot) -> Iterator[str]:
    yield "<?xml version='1.0' encoding='utf-8'?>"
    yield f"<robot{_named(robot.name)}>"
    for link in robot.links:
        yield _LINK.format(_named(link.name))
        for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
            for shape in shapes:
                yield from _shape(tag, shape)
        yield "  </link>"
    for joint in robot.joints:
        names = _named(joint.name), *map(_quoted, (joint.type, joint.parent, joint.child))
        yield _JOINT.format(*names, _origin(joint.origin.tobytes()))
    yield "</robot>"


_LINK = """\
  <link{}>
    <inertial>
      <origin xyz="0 0 0" rpy="0 0 0" />
      <mass value="0" />
      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0" />
    </inertial>"""
_JOINT = """\
  <joint{} type={}>
    <parent link={} />
    <child link={} />
    {}
  </joint>"""
_MATERIAL = """\
      <material{}>
        <color rgba="{}" />
      </material>"""


def _shape(tag: str, shape: yourdfpy.Visual | yourdfpy.Collision) -> Iterator[str]:
    yield f"    <{tag}{_named(shape.name)}>\n      <geometry>\n        {_geometry(shape.geometry)}\n      </geometry>"
    if shape.origin is not None:
        yield f"      {_origin(shape.origin.tobytes())}"
    if tag == "visual":
        yield _MATERIAL.format(_named(shape.material.name), _words(shape.material.color.rgba))
    yield f"    </{tag}>"


def _geometry(geometry: yourdfpy.Geometry) -> str:
    if geometry.box is not None:
        return f'<box size="{_words(geometry.box.size)}" />'
    if geometry.cylinder is not None:
        radius, length = geometry.cylinder.radius, geometry.cylinder.length
        return f'<cylinder radius="{_number(radius)}" length="{_number(length)}" />'
    if geometry.sphere is not None:
        return f'<sphere radius="{_number(geometry.sphere.radius)}" />'
    scale = geometry.mesh.scale
    scaled = "" if scale is None else f' scale="{_words(np.broadcast_to(scale, 3))}"'
    return f"<mesh filename={_quoted(geometry.mesh.filename)}{scaled} />"


@lru_cache(maxsize=4096)
def _origin(frame: bytes) -> str:
    """Return the element of a frame (4 x 4 numbers); most shapes of furniture have one of a few."""
    matrix = np.frombuffer(frame).reshape(4, 4)
    angles = euler_from_matrix(matrix)
    return f'<origin xyz="{_words(matrix[:3, 3])}" rpy="{_words(angles)}" />'


def _named(name: str | None) -> str:
    return "" if name is None else f" name={_quoted(name)}"


@lru_cache(maxsize=4096)
def _quoted(text: str) -> str:
    return f'"{escape(text, {chr(34): "&quot;"})}"'


def _words(numbers: Iterable[float]) -> str:
    return " ".join(map(_number, numbers))


@lru_cache(maxsize=4096)
def _number(number: float) -> str:
    """Return a number's shortest text with at most six digits after the point."""
    return f"{round(float(number), DIGITS) + 0.0:.{DIGITS}f}".rstrip("0").rstrip(".")
