"""The map: the home from above with the robots, their trails and what they see, X and the Ys."""

from collections import deque
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.frames.canvas import CARD, ITEM, ROBOTS, TARGET, Colour, badge
from chmarl_pb.frames.motion_player import Scene, yaw
from chmarl_pb.frames.recording import Recording
from chmarl_pb.rendering.plan_view import PlanView, draw_plan
from chmarl_pb.robots.model import RobotModel

Image = NDArray[np.uint8]
Point = tuple[float, float]

CONE_LENGTH = 1.7  # metres of a driving robot's view cone
BODY_RADIUS = 0.27  # metres of a driving robot's mark
_ROTOR_ARM, _ROTOR_RADIUS = 0.24, 0.14  # metres of a flying robot's mark
_RIM = 0.07  # metres of the white rim of marks
_BADGE = 10  # pixels
_TRAIL_WIDTH, _FADING = 3, 150  # pixels, and shots until a trail has faded
_FRESHEST, _FAINTEST = 0.85, 0.3  # strength of a trail at first and at last
_ARROW = ((0.0, 0.72), (2.45, 0.68), (np.pi, 0.25), (-2.45, 0.68))  # angle (radians), distance (radii)
_SHIFT = 4  # binary digits of OpenCV's subpixel coordinates


class PlanMap:
    """The map of one recording.

    Attributes:
        plan: the picture of the empty home.
    """

    def __init__(self, recording: Recording, width: int, height: int):
        """Draw the empty home into a size in pixels, and mark every Y."""
        self.plan: PlanView = draw_plan(recording.home, width, height)
        self._item_badge = badge("X", ITEM, _BADGE)
        self._models, self._colours = recording.models, dict(zip(recording.models, ROBOTS, strict=False))
        self._trails: dict[str, deque[Point]] = {robot: deque() for robot in self._models}
        self._worn = {robot: np.zeros(self.plan.rgb.shape[:2], dtype=np.uint8) for robot in self._models}
        self.mark(recording)

    def mark(self, recording: Recording) -> None:
        """Mark another X and other Ys from now on."""
        self._item = recording.item
        self._base = self.plan.rgb.copy()
        for name in recording.targets:
            _stamp(self._base, badge("Y", TARGET, _BADGE), self.plan.pixel(*recording.home.receptacles[name].centre))

    def draw(self, scene: Scene) -> Image:
        """Draw the next moment; the trails grow to it."""
        picture = self._base.copy()
        for robot, colour in self._colours.items():
            _blend(picture, self._grow_trail(robot, scene), 1.0, colour)
        for robot, model in self._models.items():
            field = [self.plan.pixel(*point) for point in field_of_view(scene, robot, model)]
            _fill(picture, field, self._colours[robot], 0.13 if model.flies else 0.2)
        x, y, _ = scene.objects[self._item][0]
        _stamp(picture, self._item_badge, self.plan.pixel(x, y))
        for robot in reversed(self._models):
            self._draw_robot(picture, scene, robot, self._colours[robot])
        return picture

    def _grow_trail(self, robot: str, scene: Scene) -> Image:
        """Return how strong a robot's trail is in each pixel: fresh parts fade, older ones stay faint for good."""
        trail, worn = self._trails[robot], self._worn[robot]
        x, y, _ = scene.robots[robot][0]
        trail.append(self.plan.pixel(x, y))
        if len(trail) > _FADING:
            _stroke(worn, trail.popleft(), trail[0], _FAINTEST)
        strength = worn.copy()
        for number, (first, second) in enumerate(pairwise(trail), start=_FADING - len(trail)):
            _stroke(strength, first, second, _FAINTEST + (_FRESHEST - _FAINTEST) * number / _FADING)
        return strength

    def _draw_robot(self, picture: Image, scene: Scene, robot: str, colour: Colour) -> None:
        discs, arrow = robot_mark(scene, robot, self._models[robot])
        for grown, shade in ((_RIM, CARD), (0.0, colour)):
            for x, y, radius in discs:
                reach = round((radius + grown) * self.plan.scale * 2**_SHIFT)
                cv2.circle(picture, _fixed(self.plan.pixel(x, y)), reach, shade, -1, cv2.LINE_AA, _SHIFT)
        tip = np.array([_fixed(self.plan.pixel(*point)) for point in arrow], dtype=np.int32)
        cv2.fillPoly(picture, [tip], CARD, cv2.LINE_AA, _SHIFT)


def field_of_view(scene: Scene, robot: str, model: RobotModel) -> list[Point]:
    """Return the corners (metres) of what a robot's camera covers: a cone, or a square on the floor if it flies."""
    (x, y, z), _ = scene.eye(robot, model)
    half = np.radians(model.camera.fov) / 2
    if model.flies:
        reach = float(z * np.tan(half))
        return [(x + i * reach, y + j * reach) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    angles = yaw(scene.robots[robot][1]) + np.linspace(-half, half, 13)
    arc = [(x + CONE_LENGTH * float(np.cos(a)), y + CONE_LENGTH * float(np.sin(a))) for a in angles]
    return [(x, y), *arc]


def robot_mark(scene: Scene, robot: str, model: RobotModel) -> tuple[list[tuple[float, float, float]], list[Point]]:
    """Return a robot's mark in metres: discs (x, y, radius), and the corners of the arrow that shows its heading.

    A robot that drives is one disc; one that flies has four rotors around a smaller one.
    """
    (x, y, _), quaternion = scene.robots[robot]
    heading = yaw(quaternion)
    body = 0.8 * BODY_RADIUS if model.flies else BODY_RADIUS
    discs = [(x, y, body)]
    if model.flies:
        discs += [(x + i * _ROTOR_ARM, y + j * _ROTOR_ARM, _ROTOR_RADIUS) for i in (-1, 1) for j in (-1, 1)]
    arrow = [(x + r * body * float(np.cos(heading + a)), y + r * body * float(np.sin(heading + a))) for a, r in _ARROW]
    return discs, arrow


def _fixed(point: Point) -> tuple[int, int]:
    """Return a pixel in OpenCV's fixed-point coordinates."""
    return round(point[0] * 2**_SHIFT), round(point[1] * 2**_SHIFT)


def _stroke(strength: Image, first: Point, second: Point, value: float) -> None:
    """Draw a piece of a trail with a strength from 0 to 1."""
    if first != second:
        cv2.line(strength, _fixed(first), _fixed(second), round(255 * value), _TRAIL_WIDTH, cv2.LINE_AA, _SHIFT)


def _fill(picture: Image, corners: list[Point], colour: Colour, strength: float) -> None:
    """Lay a translucent polygon with a soft edge over a picture."""
    mask = np.zeros(picture.shape[:2], dtype=np.uint8)
    cv2.fillPoly(mask, [np.array([_fixed(corner) for corner in corners], dtype=np.int32)], 255, cv2.LINE_AA, _SHIFT)
    _blend(picture, mask, strength, colour)


def _blend(picture: Image, strength: Image, share: float, colour: Colour) -> None:
    """Lay a share of a colour over a picture, as strongly as ``strength`` (0 to 255) says in each pixel."""
    left, top, width, height = cv2.boundingRect(strength)  # most of a map is not touched
    place, strong = picture[top : top + height, left : left + width], strength[top : top + height, left : left + width]
    touched = strong > 0
    under = place[touched]
    alpha = strong[touched, None] * np.float32(share / 255)
    place[touched] = under + alpha * (np.array(colour, dtype=np.float32) - under) + np.float32(0.5)


def _stamp(picture: Image, sprite: Image, middle: Point) -> None:
    """Put a sprite with alpha on a picture, cut off at its edges."""
    side = sprite.shape[0]
    left, top = round(middle[0] - side / 2), round(middle[1] - side / 2)
    x0, y0 = max(left, 0), max(top, 0)
    x1, y1 = min(left + side, picture.shape[1]), min(top + side, picture.shape[0])
    if x0 >= x1 or y0 >= y1:
        return
    part = sprite[y0 - top : y1 - top, x0 - left : x1 - left].astype(np.float32)
    alpha = part[..., 3:] / 255
    under = picture[y0:y1, x0:x1]
    under[:] = under + alpha * (part[..., :3] - under) + 0.5
