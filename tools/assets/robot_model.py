"""A robot model: links with solids and coloured meshes, joints; written as a URDF file with OBJ meshes.

Lengths are metres, angles radians, masses kilograms. Meshes and solids are given in the frame of their link.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tools.assets.meshes import Mesh, shaded, write_obj

COLOURS = {
    "shell": (0.94, 0.93, 0.90),
    "accent": (0.07, 0.56, 0.60),
    "dark": (0.17, 0.19, 0.23),
    "grey": (0.55, 0.58, 0.62),
    "glow": (0.55, 0.95, 0.98),
}


@dataclass(frozen=True)
class Solid:
    """A box (x, y, z), or an upright cylinder (radius, height), with its centre in the link's frame."""

    size: tuple[float, ...]
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def inertia(self, mass: float) -> tuple[float, float, float]:
        """Return the principal moments of the solid about its centre, in kg m2."""
        if len(self.size) == 2:
            radius, height = self.size
            side = mass * (3 * radius**2 + height**2) / 12
            return side, side, mass * radius**2 / 2
        x, y, z = (s**2 for s in self.size)
        return mass * (y + z) / 12, mass * (x + z) / 12, mass * (x + y) / 12


@dataclass(frozen=True)
class Link:
    """A link: its mass is spread over the first solid; a link with meshes collides with all its solids.

    Attributes:
        name: its name.
        mass: in kilograms.
        solids: its body.
        meshes: colour name to the mesh of that colour.
        rotor: inertia that the joint's geared motor adds about every axis, in kg m2.
    """

    name: str
    mass: float
    solids: Sequence[Solid]
    meshes: Mapping[str, Mesh] = field(default_factory=dict)
    rotor: float = 0.0


@dataclass(frozen=True)
class Joint:
    """A joint at ``xyz``, ``rpy`` in the parent's frame; fixed without limits.

    ``limits`` are lower, upper (rad or m), effort (N m or N) and velocity (rad/s or m/s).
    """

    name: str
    parent: str
    child: str
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)
    kind: str = "fixed"
    axis: tuple[int, int, int] = (0, 0, 1)
    limits: tuple[float, float, float, float] | None = None


def write_robot(name: str, links: Sequence[Link], joints: Sequence[Joint], folder: Path) -> Path:
    """Write ``<name>.urdf`` and its meshes; return the URDF's path."""
    robot = ET.Element("robot", name=name)
    for colour in sorted({colour for link in links for colour in link.meshes}):
        rgba = " ".join(f"{c:g}" for c in (*COLOURS[colour], 1))
        ET.SubElement(ET.SubElement(robot, "material", name=colour), "color", rgba=rgba)
    for link in links:
        _add_link(robot, name, link)
        for colour, mesh in link.meshes.items():
            write_obj(mesh, folder / "meshes" / f"{name}_{link.name}_{colour}.obj")
    for joint in joints:
        _add_joint(robot, joint)
    ET.indent(robot)
    path = folder / f"{name}.urdf"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text('<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n", newline="\n")
    return path


def _add_link(robot: ET.Element, name: str, link: Link) -> None:
    """Append a link element."""
    element = ET.SubElement(robot, "link", name=link.name)
    inertial = ET.SubElement(element, "inertial")
    _add_origin(inertial, link.solids[0].centre)
    ET.SubElement(inertial, "mass", value=f"{link.mass:g}")
    xx, yy, zz = (f"{moment + link.rotor:.6g}" for moment in link.solids[0].inertia(link.mass))
    ET.SubElement(inertial, "inertia", ixx=xx, ixy="0", ixz="0", iyy=yy, iyz="0", izz=zz)
    for colour in link.meshes:
        visual = ET.SubElement(element, "visual")
        filename = f"meshes/{name}_{link.name}_{colour}.obj"
        ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=filename)
        ET.SubElement(visual, "material", name=colour)
    for solid in link.solids if link.meshes else ():
        collision = ET.SubElement(element, "collision")
        _add_origin(collision, solid.centre)
        geometry = ET.SubElement(collision, "geometry")
        if len(solid.size) == 2:
            ET.SubElement(geometry, "cylinder", radius=f"{solid.size[0]:g}", length=f"{solid.size[1]:g}")
        else:
            ET.SubElement(geometry, "box", size=_text(solid.size))


def _add_joint(robot: ET.Element, joint: Joint) -> None:
    """Append a joint element."""
    element = ET.SubElement(robot, "joint", name=joint.name, type=joint.kind)
    _add_origin(element, joint.xyz, joint.rpy)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if joint.limits is not None:
        ET.SubElement(element, "axis", xyz=_text(joint.axis))
        names = ("lower", "upper", "effort", "velocity")
        ET.SubElement(element, "limit", {n: f"{v:g}" for n, v in zip(names, joint.limits, strict=True)})


def _add_origin(element: ET.Element, xyz: Sequence[float], rpy: Sequence[float] = (0, 0, 0)) -> None:
    """Append an origin element."""
    ET.SubElement(element, "origin", xyz=_text(xyz), rpy=_text(rpy))


def _text(numbers: Sequence[float]) -> str:
    """Return numbers as URDF text, rounded to a micrometre or microradian."""
    return " ".join(f"{round(float(n), 6) + 0.0:.7g}" for n in numbers)


def plate(outline: ArrayLike, x: float) -> Mesh:
    """Return a flat convex plate at ``x`` that faces +x; the outline's axes become y and z."""
    points = np.asarray(outline, dtype=float)
    corners = np.column_stack([np.full(len(points), x), points])
    return shaded(np.stack([corners[[0, i, i + 1]] for i in range(1, len(corners) - 1)]))
