"""The humanoid's model: a mobile base, a lifting torso, a head with a camera, one arm with a gripper.

Its origin lies on the floor below the base's centre; +x is forward, z up.
"""

from collections.abc import Sequence

import numpy as np

from tools.assets.meshes import Mesh, at_height, box, ellipsoid, join, lathe, loft, ngon, rounded_rectangle
from tools.assets.robot_model import Joint, Link, Solid, plate

#: Places of the joint centres at rest, in the humanoid's frame.
TORSO = (0.0, 0.0, 0.80)
HEAD = (0.0, 0.0, 1.22)
CAMERA = (0.12, 0.0, 1.5)
SHOULDER = (0.06, -0.17, 1.03)
CAMERA_PITCH = 0.349066

STRAIGHT = (0.0, 0.0, 0.0)

#: Lengths from joint centre to joint centre, and from the wrist to the point between the fingertips.
UPPER_ARM, FOREARM, HAND = 0.37, 0.35, 0.28

#: Angles of the tucked arm: the upper arm leans back, the elbow bends, the hand hangs.
TUCK_SHOULDER, TUCK_ELBOW, TUCK_WRIST = -0.8, 2.35, -1.35


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
    return links + _arm_links(), joints + _arm_joints()


def _arm_links() -> list[Link]:
    """Return the links of the right arm and gripper; at zero the arm hangs straight down."""
    small = [Solid((0.07, 0.07, 0.07))]
    upper = {"shell": _limb(UPPER_ARM, 0.05, 0.038)}
    fore = {"accent": _ball(0.06), "shell": _limb(FOREARM, 0.04, 0.032)}
    hand = {"accent": _ball(0.042), "dark": _palm()}
    return [
        Link("shoulder", 1.0, small, {"accent": _ball(0.078)}),
        Link("shoulder_side", 0.5, small),
        Link("upper_arm", 1.6, [Solid((0.08, 0.08, 0.30), (0, 0, -0.20))], upper),
        Link("forearm", 1.2, [Solid((0.07, 0.07, 0.30), (0, 0, -0.18))], fore),
        Link("wrist", 0.3, [Solid((0.06, 0.06, 0.06))], rotor=0.005),
        Link("wrist_side", 0.2, [Solid((0.05, 0.05, 0.05))], rotor=0.005),
        Link("hand", 0.5, [Solid((0.06, 0.12, 0.12), (0, 0, -0.10))], hand),
        _finger("left_finger", 1),
        _finger("right_finger", -1),
        Link("grasp", 0.01, [Solid((0.01, 0.01, 0.01))]),
    ]


def _arm_joints() -> list[Joint]:
    """Return three crossing axes in the shoulder, one in the elbow, three in the wrist, and the gripper's.

    Pitch joints lift the arm forward, the elbow bends it forward.
    """
    here, elbow, wrist, knuckle = ((0.0, 0.0, -z) for z in (0.0, UPPER_ARM, FOREARM, 0.165))
    forward, side, along = (0, -1, 0), (1, 0, 0), (0, 0, 1)
    chain = [
        ("shoulder_pitch", "torso", "shoulder", _between(TORSO, SHOULDER), forward, (-1.2, 2.9, 90.0, 2.0)),
        ("shoulder_roll", "shoulder", "shoulder_side", here, side, (-2.0, 0.7, 90.0, 2.0)),
        ("upper_arm_roll", "shoulder_side", "upper_arm", here, along, (-2.3, 2.3, 60.0, 2.0)),
        ("elbow_pitch", "upper_arm", "forearm", elbow, forward, (0.0, 2.6, 60.0, 2.0)),
        ("forearm_roll", "forearm", "wrist", wrist, along, (-2.8, 2.8, 25.0, 2.5)),
        ("wrist_pitch", "wrist", "wrist_side", here, forward, (-1.8, 1.8, 25.0, 2.5)),
        ("wrist_roll", "wrist_side", "hand", here, side, (-1.3, 1.3, 25.0, 2.5)),
    ]
    slide = (0.0, 0.05, 60.0, 0.2)
    return [
        *(Joint(name, parent, child, xyz, STRAIGHT, "revolute", axis, limits)
          for name, parent, child, xyz, axis, limits in chain),
        Joint("left_finger_slide", "hand", "left_finger", knuckle, STRAIGHT, "prismatic", (0, 1, 0), slide),
        Joint("right_finger_slide", "hand", "right_finger", knuckle, STRAIGHT, "prismatic", (0, -1, 0), slide),
        Joint("hand_grasp", "hand", "grasp", (0.0, 0.0, -HAND), (0.0, np.pi / 2, 0.0)),
    ]  # fmt: skip


def _chassis() -> dict[str, Mesh]:
    """Return the round base with a dark skirt and the fixed simulation of the lifting column."""
    skirt = lathe([(0.20, 0.01), (0.22, 0.09)], 10)
    cover = lathe([(0.22, 0.09), (0.20, 0.23), (0, 0.30)], 10)
    return {"dark": skirt, "shell": cover, "grey": lathe([(0.10, 0.26), (0.07, 0.80)], 8)}


def _torso() -> dict[str, Mesh]:
    """Return the trunk with its light, the neck, the moving simulation of the column and the tucked left arm."""
    sizes = [(-0.01, 0.15, 0.18), (0.06, 0.19, 0.25), (0.27, 0.21, 0.31), (0.37, 0.13, 0.19)]
    trunk = loft([at_height(rounded_rectangle(x, y, 0.3 * x, 1), z) for z, x, y in sizes])
    light = plate(ngon(0.035, 6), 0.108).moved(z=0.225)
    neck = lathe([(0.06, 0.35), (0.06, 0.43)], 6)
    simulation = lathe([(0.055, -0.32), (0.055, 0.0)], 6)
    limbs = _tucked(_limb(UPPER_ARM, 0.05, 0.038), 0), _tucked(_limb(FOREARM, 0.04, 0.032), 1)
    balls = (_tucked(_ball(radius), level) for level, radius in enumerate((0.078, 0.06, 0.042)))
    fingers = _tucked(box(0.032, 0.04, 0.13).moved(z=-0.295), 2)
    return {
        "shell": join(trunk, *limbs),
        "accent": join(*balls),
        "glow": light,
        "dark": join(neck, simulation, _tucked(_palm(), 2)),
        "grey": fingers,
    }


def _head() -> dict[str, Mesh]:
    """Return the head: a soft block with ears and a dark visor with two eyes."""
    sizes = [(0.0, 0.14, 0.20), (0.06, 0.20, 0.28), (0.24, 0.20, 0.27), (0.31, 0.13, 0.18)]
    skull = loft([at_height(rounded_rectangle(x, y, 0.3 * x, 1), z) for z, x, y in sizes])
    ear = lathe([(0.055, 0.0), (0, 0.03)], 6).moved(z=0.137).turned("x", -np.pi / 2)
    ears = join(ear, ear.scaled(y=-1)).moved(z=0.15)
    visor = plate(rounded_rectangle(0.22, 0.14, 0.045, 1), 0.104).moved(z=0.145)
    eye = plate(ngon(0.03, 8), 0.108)
    eyes = join(*(eye.moved(y=y, z=0.145) for y in (-0.052, 0.052)))
    return {"shell": skull, "accent": ears, "dark": visor, "glow": eyes}


def _palm() -> Mesh:
    """Return the block that carries the fingers."""
    return box(0.06, 0.13, 0.13).moved(z=-0.17)


def _finger(name: str, side: int) -> Link:
    """Return a finger beside the closing plane; ``side`` +1 lies on +y."""
    mesh = box(0.032, 0.02, 0.13).moved(y=side * 0.01, z=-0.13)
    return Link(name, 0.08, [Solid((0.032, 0.02, 0.13), (0, side * 0.01, -0.065))], {"grey": mesh})


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
    spans = [(shoulder, elbow), (elbow, wrist), (wrist, wrist - (0, 0, 0.29))]
    return [Solid(tuple(np.round(np.abs(b - a) + 0.08, 3)), tuple(np.round((a + b) / 2, 3))) for a, b in spans]


def _ball(radius: float) -> Mesh:
    """Return a coarse ball about the origin."""
    return ellipsoid(2 * radius, 2 * radius, 2 * radius, 5, 3).moved(z=-radius)


def _limb(length: float, top: float, bottom: float) -> Mesh:
    """Return an open limb that hangs from the origin along -z, with its radii at both ends."""
    return lathe([(bottom, -length), (top, 0.0)], 6)


def _between(parent: Sequence[float], child: Sequence[float]) -> tuple[float, float, float]:
    """Return the child's place in the frame of its unturned parent."""
    x, y, z = (round(c - p, 6) for p, c in zip(parent, child, strict=True))
    return x, y, z
