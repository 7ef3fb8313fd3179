"""The plan of a home: drawn once from straight above, with the scale that ties it to metres."""

from contextlib import closing
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.home import Home
from chmarl_pb.world import Client, loaded_home
from chmarl_pb.world.bullet import pybullet

_HEIGHT = 200.0  # metres of the camera over the floor: so far that walls show no sides
_MARGIN = 0.25  # metres around the floors
_OVERSAMPLING = 2
#: Of pictures of homes for people.
LIGHT = {
    "lightDirection": (-5, -9, 16),
    "lightColor": (1.0, 1.0, 1.0),
    "lightAmbientCoeff": 0.62,
    "lightDiffuseCoeff": 0.42,
    "lightSpecularCoeff": 0.0,
}


@dataclass(frozen=True, eq=False)
class PlanView:
    """A picture from above.

    Attributes:
        rgb: (height, width, 3) uint8; what lies outside the home is white.
        corner: x and y in metres of the picture's top left corner.
        scale: pixels in a metre.
    """

    rgb: NDArray[np.uint8]
    corner: tuple[float, float]
    scale: float

    def pixel(self, x: float, y: float) -> tuple[float, float]:
        """Return where (column, row) a point of the world in metres is drawn."""
        return (x - self.corner[0]) * self.scale, (self.corner[1] - y) * self.scale


def draw_plan(home: Home, width: int, height: int) -> PlanView:
    """Draw a home's plan as large as it fits into a size in pixels."""
    with closing(Client()) as client, loaded_home(client.number, home):
        return plan_in(client.number, home, width, height)


def plan_in(client: int, home: Home, width: int, height: int) -> PlanView:
    """Draw the plan of a home that is loaded in a client; see :func:`draw_plan`."""
    low, high = home.bounds[0] - _MARGIN, home.bounds[1] + _MARGIN
    scale = float(min(width / (high - low)[0], height / (high - low)[1]))
    columns, rows = (round(float(side) * scale) for side in high - low)
    middle = ((low + high) / 2).tolist()
    view = pybullet.computeViewMatrix((*middle, _HEIGHT), (*middle, 0.0), (0.0, 1.0, 0.0))
    near = _HEIGHT - 5.0
    half_width, half_height = columns / scale / 2 * near / _HEIGHT, rows / scale / 2 * near / _HEIGHT
    projection = pybullet.computeProjectionMatrix(
        -half_width, half_width, -half_height, half_height, near, _HEIGHT + 1.0
    )
    _, _, rgba, _, _ = pybullet.getCameraImage(
        columns * _OVERSAMPLING, rows * _OVERSAMPLING, view, projection, shadow=0,
        renderer=pybullet.ER_TINY_RENDERER, physicsClientId=client, **LIGHT,
    )  # fmt: skip
    shape = (rows * _OVERSAMPLING, columns * _OVERSAMPLING, 4)
    rgb = np.reshape(rgba, shape)[..., :3].astype(np.uint8)
    smooth = cv2.resize(rgb, (columns, rows), interpolation=cv2.INTER_AREA)
    corner = (middle[0] - columns / scale / 2, middle[1] + rows / scale / 2)
    return PlanView(np.asarray(smooth, dtype=np.uint8), corner, scale)
