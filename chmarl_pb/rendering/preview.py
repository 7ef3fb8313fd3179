"""A picture of a home for people: the plan from above with room names, and a view as into a doll's house."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from chmarl_pb.catalog import class_of, room_of
from chmarl_pb.errors import HomeError, OptionError
from chmarl_pb.files import replacing
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.rendering.plan_view import LIGHT
from chmarl_pb.world import Client, loaded_home
from chmarl_pb.world.bullet import pybullet

Array = npt.NDArray[Any]

_OVERSAMPLING = 2
_MARGIN = 1.04
_BEFORE = 0.3  # metres in front of a wall, where a floor shows that it is an inner wall
_PLATE = 250
_INK = (45, 45, 45)


@dataclass(frozen=True)
class _Camera:
    """View and projection of one panel as 4 x 4 matrices that act on columns, and its size in pixels."""

    view: Array
    projection: Array
    width: int
    height: int

    def pixels(self, point: Array) -> tuple[int, int]:
        """Return the pixel (column, row) where a point of the world (metres) is drawn."""
        clip = self.projection @ self.view @ np.append(point, 1.0)
        x, y = clip[:2] / clip[3]
        return round((x + 1) / 2 * self.width), round((1 - y) / 2 * self.height)


def preview(urdf_path: str | Path, out_png: str | Path, size: tuple[int, int] = (1800, 900)) -> Path:
    """Render a home's plan and doll's-house view side by side and return the picture's path.

    Args:
        urdf_path: the home.
        out_png: the picture to write.
        size: width and height of the picture in pixels.

    Raises:
        HomeError: the home cannot be loaded.
        OptionError: the picture's name does not end in .png.
        WriteError: the picture cannot be written.
    """
    if Path(out_png).suffix.lower() != ".png":
        raise OptionError(f"{out_png}: the picture is a PNG; let its name end in .png")
    with _loaded(load_home(urdf_path)) as (client, home):
        low, high = _bounds(client, home)
        half = size[0] // 2
        plan = _camera(low, high, azimuth=-90.0, elevation=90.0, distance=12.0, size=(half, size[1]))
        house = _camera(low, high, azimuth=-118.0, elevation=54.0, distance=2.2, size=(size[0] - half, size[1]))
        panels = [_render(client, plan)]
        _open_front(client, home)
        panels.append(_render(client, house))
        for room, centre in _room_centres(client, home).items():
            _label(panels[0], room, plan.pixels(centre))
    picture = np.hstack(panels)[:, :, ::-1]
    with replacing(Path(out_png)) as temporary:
        temporary.write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    return Path(out_png)


@contextmanager
def _loaded(home: Home) -> Iterator[tuple[int, int]]:
    """Load a home into a client of its own; yield the client and the home's body id."""
    with closing(Client()) as client, loaded_home(client.number, home) as body:
        yield client.number, body


def _boxes(client: int, home: int) -> dict[str, Array]:
    """Return the axis-aligned box (low, high; metres) of each link."""
    links = range(pybullet.getNumJoints(home, physicsClientId=client))
    names = [pybullet.getJointInfo(home, link, physicsClientId=client)[12].decode() for link in links]
    return {
        name: np.array(pybullet.getAABB(home, link, physicsClientId=client))
        for name, link in zip(names, links, strict=True)
    }


def _bounds(client: int, home: int) -> tuple[Array, Array]:
    boxes = [box for name, box in _boxes(client, home).items() if class_of(name) in ("floor", "wall")]
    if not boxes:
        raise HomeError("the home has no link <room>/floor_<n> or <room>/wall_<n> to draw")
    return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)


def _open_front(client: int, home: int) -> None:
    """Make the outer walls on the south and west invisible, so that a view from there looks into the rooms."""
    boxes = _boxes(client, home)
    floors = [box[:, :2] for name, box in boxes.items() if class_of(name) == "floor"]
    for link, (name, box) in enumerate(boxes.items()):
        size, foot = (box[1] - box[0])[:2], box.mean(axis=0)[:2]
        before = foot - ([0, _BEFORE] if size[0] > size[1] else [_BEFORE, 0])
        if class_of(name) == "wall" and not any((f[0] < before).all() and (before < f[1]).all() for f in floors):
            pybullet.changeVisualShape(home, link, rgbaColor=(1, 1, 1, 0), physicsClientId=client)


def _room_centres(client: int, home: int) -> dict[str, Array]:
    """Return the centre of the largest floor of each room, in metres."""
    centres: dict[str, tuple[float, Array]] = {}
    for name, box in _boxes(client, home).items():
        area = float(np.prod((box[1] - box[0])[:2]))
        if class_of(name) == "floor" and area > centres.get(room_of(name), (0.0, box))[0]:
            centres[room_of(name)] = area, box.mean(axis=0)
    return {room: centre for room, (_, centre) in centres.items()}


def _camera(
    low: Array, high: Array, azimuth: float, elevation: float, distance: float, size: tuple[int, int]
) -> _Camera:
    """Return a camera whose picture the box from low to high just fills.

    Args:
        low: low corner of the box, in metres.
        high: high corner of the box, in metres.
        azimuth: direction from the box to the camera, in degrees from +x.
        elevation: angle of that direction over the horizon, in degrees.
        distance: of the camera from the box's centre, in diagonals of the box.
        size: width and height in pixels.
    """
    turn, lift = np.radians([azimuth, elevation])
    away = np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    centre, reach = (low + high) / 2, distance * float(np.linalg.norm(high - low))
    up = (0, 1, 0) if elevation > 89 else (0, 0, 1)
    view = _matrix(pybullet.computeViewMatrix(centre + reach * away, centre, up))
    corners = np.array([[*corner, 1.0] for corner in product(*zip(low, high, strict=True))])
    seen = corners @ view.T
    slopes = seen[:, :2] / -seen[:, 2:3]
    middle, half = (slopes.max(axis=0) + slopes.min(axis=0)) / 2, np.ptp(slopes, axis=0) / 2 * _MARGIN
    half = np.maximum(half, half[::-1] * [size[0] / size[1], size[1] / size[0]])
    near, far = 0.5 * reach, 1.5 * reach
    left, bottom, right, top = near * np.concatenate([middle - half, middle + half])
    return _Camera(view, _matrix(pybullet.computeProjectionMatrix(left, right, bottom, top, near, far)), *size)


def _matrix(columns: tuple[float, ...]) -> Array:
    """Return PyBullet's column-major 16 numbers as a 4 x 4 array."""
    return np.reshape(columns, (4, 4)).T


def _render(client: int, camera: _Camera) -> Array:
    """Return the smoothed colour picture (height x width x 3, uint8) that a camera sees."""
    width, height = camera.width * _OVERSAMPLING, camera.height * _OVERSAMPLING
    pixels = pybullet.getCameraImage(
        width,
        height,
        camera.view.T.ravel().tolist(),
        camera.projection.T.ravel().tolist(),
        shadow=0,
        renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_NO_SEGMENTATION_MASK,
        physicsClientId=client,
        **LIGHT,
    )[2]
    colours = np.reshape(pixels, (height, width, 4))[:, :, :3].astype(np.uint8)
    return cv2.resize(colours, (camera.width, camera.height), interpolation=cv2.INTER_AREA)


def _label(picture: Array, text: str, centre: tuple[int, int]) -> None:
    """Write a name on a light, half transparent plate around a pixel."""
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, picture.shape[0] / 1700
    (width, height), _ = cv2.getTextSize(text, font, scale, 1)
    left, base, pad = centre[0] - width // 2, centre[1] + height // 2, height // 2
    plate = picture[max(base - height - pad, 0) : base + pad, max(left - pad, 0) : left + width + pad]
    plate[:] = (plate + 3.0 * _PLATE) / 4
    cv2.putText(picture, text, (left, base), font, scale, _INK, 1, cv2.LINE_AA)
