"""The drone's model: a quadrotor with a camera below it. Its origin is its centre; +x is forward, z up."""

import numpy as np

from tools.assets.meshes import Mesh, at_height, join, lathe, loft, ngon, rectangle, rounded_rectangle, shaded
from tools.assets.robot_model import Joint, Link, Solid, plate


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
    light = plate(rectangle(0.07, 0.018), 0.098).moved(z=0.004)
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
