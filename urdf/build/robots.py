"""Build the URDFs and meshes of the two robots: ``python -m urdf.build.robots``.

Both robots look along +x, z is up. The humanoid's origin lies on the floor below its base, the drone's at its
centre. Meshes are written in the frame of their link; lengths in metres, masses in kilograms.
"""

import argparse
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from urdf.build.meshes import (
    Mesh,
    at_height,
    box,
    ellipsoid,
    join,
    lathe,
    loft,
    ngon,
    rectangle,
    rounded_rectangle,
    shaded,
    write_obj,
)

OUT = Path(__file__).resolve().parents[1] / "robots"

COLORS = {
    "shell": (0.94, 0.93, 0.90),
    "accent": (0.07, 0.56, 0.60),
    "dark": (0.17, 0.19, 0.23),
    "grey": (0.55, 0.58, 0.62),
    "glow": (0.55, 0.95, 0.98),
    "warm": (0.98, 0.55, 0.22),
}

#: Places of the joint centres at rest, in the humanoid's frame.
TORSO = (0.0, 0.0, 0.80)
HEAD = (0.0, 0.0, 1.22)
CAMERA = (0.12, 0.0, 1.5)
SHOULDER = (0.06, -0.17, 1.03)
CAMERA_PITCH = 0.349066

#: Lengths from joint centre to joint centre, and from the wrist to the point between the fingertips.
UPPER_ARM, FOREARM, HAND = 0.37, 0.35, 0.28

#: Angles of the tucked arm: the upper arm leans back, the elbow bends, the hand hangs.
TUCK_SHOULDER, TUCK_ELBOW, TUCK_WRIST = -0.8, 2.35, -1.35


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
    """A link: mass spread over the first solid, all solids collide, meshes by colour are drawn."""

    name: str
    mass: float
    solids: Sequence[Solid]
    meshes: Mapping[str, Mesh] = field(default_factory=dict)


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


def humanoid() -> tuple[list[Link], list[Joint]]:
    """Return the mobile manipulator: base, lifting torso, head with camera, right arm with gripper."""
    links = [
        Link("footprint", 0.01, [Solid((0.02, 0.02, 0.02))]),
        Link("chassis", 30.0, [Solid((0.22, 0.30), (0, 0, 0.15))], _chassis()),
        Link("torso", 8.0, [Solid((0.20, 0.28, 0.37), (0, 0, 0.185)), *_tucked_solids()], _torso()),
        Link("head", 2.0, [Solid((0.20, 0.27, 0.30), (0, 0, 0.155))], _head()),
        Link("camera", 0.01, [Solid((0.02, 0.02, 0.02))]),
    ]
    joints = [
        Joint("footprint_chassis", "footprint", "chassis"),
        Joint("torso_lift", "chassis", "torso", TORSO, kind="prismatic", limits=(-0.48, 0.30, 900.0, 0.35)),
        Joint("torso_head", "torso", "head", _between(TORSO, HEAD)),
        Joint("head_camera", "head", "camera", _between(HEAD, CAMERA), (0, CAMERA_PITCH, 0)),
    ]
    arm_links, arm_joints = _arm()
    return links + arm_links, joints + arm_joints


def _arm() -> tuple[list[Link], list[Joint]]:
    """Return the right arm: three crossing axes in the shoulder, one in the elbow, three in the wrist.

    At zero it hangs straight down. Pitch joints lift it forward, the elbow bends it forward.
    """
    small = [Solid((0.07, 0.07, 0.07))]
    fingers = {side: _finger(sign) for side, sign in (("left", 1), ("right", -1))}
    links = [
        Link("shoulder", 1.0, small, {"accent": _ball(0.075)}),
        Link("shoulder_side", 0.5, small),
        Link("upper_arm", 1.6, [Solid((0.08, 0.08, 0.30), (0, 0, -0.20))], {"shell": _limb(UPPER_ARM, 0.055, 0.042)}),
        Link("forearm", 1.2, [Solid((0.07, 0.07, 0.30), (0, 0, -0.18))], _forearm()),
        Link("wrist", 0.3, [Solid((0.06, 0.06, 0.06))]),
        Link("wrist_side", 0.2, [Solid((0.05, 0.05, 0.05))]),
        Link("hand", 0.5, [Solid((0.06, 0.12, 0.12), (0, 0, -0.10))], _palm()),
        *(Link(f"{side}_finger", 0.08, [Solid((0.03, 0.02, 0.13), (0, s * 0.01, -0.065))], {"grey": mesh})
          for (side, mesh), s in zip(fingers.items(), (1, -1), strict=True)),
        Link("grasp", 0.01, [Solid((0.01, 0.01, 0.01))]),
    ]  # fmt: skip
    forward, side, along = (0, -1, 0), (1, 0, 0), (0, 0, 1)
    elbow, wrist = (0.0, 0.0, -UPPER_ARM), (0.0, 0.0, -FOREARM)
    chain = [
        ("shoulder_pitch", "torso", "shoulder", _between(TORSO, SHOULDER), forward, (-1.2, 2.9, 90.0, 2.0)),
        ("shoulder_roll", "shoulder", "shoulder_side", (0.0, 0.0, 0.0), side, (-2.0, 0.7, 90.0, 2.0)),
        ("upper_arm_roll", "shoulder_side", "upper_arm", (0.0, 0.0, 0.0), along, (-2.3, 2.3, 60.0, 2.0)),
        ("elbow_pitch", "upper_arm", "forearm", elbow, forward, (0.0, 2.6, 60.0, 2.0)),
        ("forearm_roll", "forearm", "wrist", wrist, along, (-2.8, 2.8, 25.0, 2.5)),
        ("wrist_pitch", "wrist", "wrist_side", (0.0, 0.0, 0.0), forward, (-1.8, 1.8, 25.0, 2.5)),
        ("wrist_roll", "wrist_side", "hand", (0.0, 0.0, 0.0), side, (-1.3, 1.3, 25.0, 2.5)),
    ]
    joints = [
        Joint(name, parent, child, xyz, kind="revolute", axis=axis, limits=limits)
        for name, parent, child, xyz, axis, limits in chain
    ]
    for name, sign in (("left_finger", 1), ("right_finger", -1)):
        root = (0.0, 0.0, -0.165)
        joints.append(
            Joint(f"{name}_slide", "hand", name, root, (0, 0, 0), "prismatic", (0, sign, 0), (0.0, 0.05, 60.0, 0.2))
        )
    joints.append(Joint("hand_grasp", "hand", "grasp", (0.0, 0.0, -HAND), (0.0, np.pi / 2, 0.0)))
    return links, joints


def _chassis() -> dict[str, Mesh]:
    """Return the round base with a dark skirt and the fixed stage of the lifting column."""
    skirt = lathe([(0.20, 0.01), (0.22, 0.09)], 10)
    cover = lathe([(0.22, 0.09), (0.20, 0.23), (0, 0.30)], 10)
    return {"dark": join(skirt, lathe([(0.10, 0.26), (0.07, 0.80)], 8)), "shell": cover}


def _torso() -> dict[str, Mesh]:
    """Return the trunk with its light, the neck, the moving stage of the column and the tucked left arm."""
    sizes = [(-0.01, 0.15, 0.18), (0.06, 0.19, 0.25), (0.27, 0.21, 0.31), (0.37, 0.13, 0.19)]
    trunk = loft([at_height(rounded_rectangle(x, y, 0.3 * x, 1), z) for z, x, y in sizes])
    light = _plate(ngon(0.035, 6), 0.108).moved(z=0.225)
    neck = lathe([(0.06, 0.35), (0.06, 0.43)], 6)
    stage = lathe([(0.055, -0.32), (0.055, 0.0)], 6)
    left = [
        _tucked(mesh, level)
        for level, mesh in enumerate((_limb(UPPER_ARM, 0.055, 0.042), _limb(FOREARM, 0.045, 0.034)))
    ]
    joints = join(*(_tucked(_ball(radius), level) for level, radius in enumerate((0.075, 0.052, 0.042))))
    mitt = _tucked(box(0.06, 0.10, 0.16).moved(z=-0.19), 2)
    return {"shell": join(trunk, *left), "accent": joints, "glow": light, "dark": join(neck, stage), "grey": mitt}


def _head() -> dict[str, Mesh]:
    """Return the head: a soft block with ears and a dark visor with two eyes and the camera's lens."""
    sizes = [(0.0, 0.14, 0.20), (0.06, 0.20, 0.28), (0.24, 0.20, 0.27), (0.31, 0.13, 0.18)]
    skull = loft([at_height(rounded_rectangle(x, y, 0.3 * x, 1), z) for z, x, y in sizes])
    ear = lathe([(0.055, 0.0), (0, 0.03)], 6).moved(z=0.137).turned("x", -np.pi / 2)
    ears = join(ear, ear.scaled(y=-1)).moved(z=0.15)
    visor = _plate(rounded_rectangle(0.22, 0.14, 0.045, 1), 0.104).moved(z=0.145)
    eye = _plate(ngon(0.03, 8), 0.108)
    eyes = join(*(eye.moved(y=y, z=0.145) for y in (-0.052, 0.052)))
    return {"shell": skull, "accent": ears, "dark": visor, "glow": eyes}


def _forearm() -> dict[str, Mesh]:
    """Return the elbow's ball and the forearm."""
    return {"accent": _ball(0.052), "shell": _limb(FOREARM, 0.045, 0.034)}


def _palm() -> dict[str, Mesh]:
    """Return the wrist and the block that carries the fingers."""
    return {"accent": _ball(0.042), "dark": box(0.06, 0.13, 0.13).moved(z=-0.17)}


def _finger(sign: int) -> Mesh:
    """Return a finger beside the closing plane; ``sign`` +1 lies on +y."""
    return box(0.032, 0.02, 0.13).moved(y=sign * 0.01, z=-0.13)


def _tucked(mesh: Mesh, level: int) -> Mesh:
    """Move a mesh from the frame of the left upper arm (0), forearm (1) or hand (2) to the torso's."""
    angle = TUCK_SHOULDER + (TUCK_ELBOW if level > 0 else 0.0) + (TUCK_WRIST if level > 1 else 0.0)
    x, y, z = _tucked_centre(level)
    return mesh.turned("y", -angle).moved(x, y, z)


def _tucked_centre(level: int) -> np.ndarray:
    """Return the centre of the left shoulder (0), elbow (1) or wrist (2) in the torso's frame."""
    centre = np.array(_between(TORSO, SHOULDER)) * (1, -1, 1)
    angle = TUCK_SHOULDER
    for length, bend in ((UPPER_ARM, TUCK_ELBOW), (FOREARM, TUCK_WRIST))[:level]:
        centre = centre + length * np.array([np.sin(angle), 0.0, -np.cos(angle)])
        angle += bend
    return centre


def _tucked_solids() -> list[Solid]:
    """Return boxes round the left arm, in the torso's frame."""
    shoulder, elbow, wrist = (_tucked_centre(level) for level in range(3))
    spans = [(shoulder, elbow), (elbow, wrist), (wrist, wrist - (0, 0, 0.17))]
    return [Solid(tuple(np.round(np.abs(b - a) + 0.08, 3)), tuple(np.round((a + b) / 2, 3))) for a, b in spans]


def drone() -> tuple[list[Link], list[Joint]]:
    """Return the quadrotor: one body, and the camera below it that looks straight down."""
    solids = [Solid((0.46, 0.46, 0.06), (0, 0, 0.0)), Solid((0.14, 0.14, 0.14), (0, 0, -0.005))]
    links = [Link("body", 1.2, solids, _quadrotor()), Link("camera", 0.01, [Solid((0.02, 0.02, 0.02))])]
    return links, [Joint("body_camera", "body", "camera", (0.0, 0.0, -0.075), (0.0, np.pi / 2, 0.0))]


def _quadrotor() -> dict[str, Mesh]:
    """Return the drone's body, booms, rotors, feet, front light and lens."""
    hull = [(-0.035, 0.12, 0.10), (-0.01, 0.19, 0.15), (0.02, 0.18, 0.14), (0.05, 0.10, 0.08)]
    body = loft([at_height(rounded_rectangle(x, y, 0.3 * x, 1), z) for z, x, y in hull])
    booms, motors, blades = [], [], []
    for number, (x, y) in enumerate(0.178 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])):
        heading = np.arctan2(y, x)
        booms.append(_boom().turned("z", heading))
        motors.append(lathe([(0, -0.03), (0.03, -0.02), (0.024, 0.035), (0, 0.035)], 5).moved(x, y))
        blades.append(_rotor().turned("z", heading + (0.5 if number % 2 else -0.5)).moved(x, y, 0.04))
    foot = loft([at_height(ngon(r, 3), z) for r, z in ((0.008, -0.073), (0.012, -0.015))], caps=False)
    feet = [foot.moved(x, y) for x in (-0.075, 0.075) for y in (-0.075, 0.075)]
    lens = lathe([(0.0, -0.07), (0.026, -0.07), (0.034, -0.03)], 8)
    light = _plate(rectangle(0.07, 0.018), 0.098).moved(z=0.004)
    return {
        "shell": body,
        "grey": join(*booms, *feet),
        "accent": join(*motors),
        "dark": join(*blades, lens),
        "glow": light,
    }


def _boom() -> Mesh:
    """Return a boom along +x from the hull to the motor."""
    ends = [(0.05, 0.02), (0.25, 0.013)]
    rings = [np.column_stack([np.full(4, x), r * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])]) for x, r in ends]
    return loft(rings, caps=False)


def _rotor() -> Mesh:
    """Return two blades along x with both faces."""
    blade = np.array([[0.012, -0.008, 0.0], [0.115, -0.018, 0.006], [0.115, 0.01, 0.0], [0.012, 0.008, 0.0]])
    corners = np.stack([blade[[0, i, i + 1]] for i in (1, 2)])
    both = shaded(np.concatenate([corners, corners[:, ::-1] - (0, 0, 0.002)]))
    return join(both, both.turned("z", np.pi))


def _ball(radius: float) -> Mesh:
    """Return a coarse ball about the origin."""
    return ellipsoid(2 * radius, 2 * radius, 2 * radius, 5, 3).moved(z=-radius)


def _limb(length: float, top: float, bottom: float) -> Mesh:
    """Return an open limb that hangs from the origin along -z, with its radii at both ends."""
    return lathe([(bottom, -length), (top, 0.0)], 6)


def _plate(outline: ArrayLike, x: float) -> Mesh:
    """Return a flat convex plate at ``x`` that faces +x; the outline's axes become y and z."""
    points = np.asarray(outline, dtype=float)
    corners = np.column_stack([np.full(len(points), x), points])
    return shaded(np.stack([corners[[0, i, i + 1]] for i in range(1, len(corners) - 1)]))


def _between(parent: Sequence[float], child: Sequence[float]) -> tuple[float, float, float]:
    """Return the child's place in the frame of its unturned parent."""
    x, y, z = (round(c - p, 6) for p, c in zip(parent, child, strict=True))
    return x, y, z


def write_robot(name: str, links: Sequence[Link], joints: Sequence[Joint], folder: Path = OUT) -> Path:
    """Write ``<name>.urdf`` and its meshes; return the URDF's path."""
    robot = ET.Element("robot", name=name)
    for color in sorted({color for link in links for color in link.meshes}):
        rgba = " ".join(f"{c:g}" for c in (*COLORS[color], 1))
        ET.SubElement(ET.SubElement(robot, "material", name=color), "color", rgba=rgba)
    for link in links:
        _add_link(robot, name, link)
        for color, mesh in link.meshes.items():
            write_obj(mesh, folder / "meshes" / f"{name}_{link.name}_{color}.obj")
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
    xx, yy, zz = (f"{moment:.6g}" for moment in link.solids[0].inertia(link.mass))
    ET.SubElement(inertial, "inertia", ixx=xx, ixy="0", ixz="0", iyy=yy, iyz="0", izz=zz)
    for color in link.meshes:
        visual = ET.SubElement(element, "visual")
        filename = f"meshes/{name}_{link.name}_{color}.obj"
        ET.SubElement(ET.SubElement(visual, "geometry"), "mesh", filename=filename)
        ET.SubElement(visual, "material", name=color)
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


def main() -> None:
    """Write both robots."""
    argparse.ArgumentParser(description=main.__doc__).parse_args()
    for name, build in (("humanoid", humanoid), ("drone", drone)):
        print(write_robot(name, *build()))


if __name__ == "__main__":
    main()
