"""A picture of a home for people: the plan from above with room names, and a view as into a doll's house."""

import zlib
from collections.abc import Sequence
from contextlib import closing
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from chmarl_pb.catalog import class_of
from chmarl_pb.errors import OptionError
from chmarl_pb.files import check_apart, replacing
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.homes.problem import Problem
from chmarl_pb.homes.solids import bounds
from chmarl_pb.reading import read_regular
from chmarl_pb.rendering.plan_view import LIGHT, plan_in
from chmarl_pb.world import Client, loaded_home, quiet
from chmarl_pb.world.bodies import link_names
from chmarl_pb.world.bullet import pybullet

Array = npt.NDArray[Any]

_OVERSAMPLING = 2
_MARGIN = 1.04
_TOWARDS_CAMERA = (-118.0, 54.0)  # degrees: from +x, and over the horizon
_DISTANCE = 2.2  # of the camera from the middle, in diagonals of the home
_BEFORE = 0.3  # metres in front of a wall, where a floor shows that it is an inner wall
_PLATE = 250
_INK = (45, 45, 45)
_COLOURS = {"error": (214, 32, 32), "warning": (236, 140, 0)}  # of the marks of problems
_HEAD = 33  # bytes of a PNG: its signature and its first chunk
_TEXT = b"tEXtSoftware\0chmarl-pb"
#: A chunk that says who has drawn a PNG.
_MARK = (len(_TEXT) - 4).to_bytes(4, "big") + _TEXT + zlib.crc32(_TEXT).to_bytes(4, "big")
_MOST_BYTES = 64 * 2**20  # of a picture
_VIEW = 400  # width and height of each view of a model, pixels
_SIDES = (30.0, 120.0, 210.0, 300.0)  # azimuths of the views of a model, degrees


def preview(
    home: str | Path | Home, out_png: str | Path, size: tuple[int, int] = (1800, 900), marks: Sequence[Problem] = ()
) -> Path:
    """Render a home's plan and doll's-house view side by side and return the picture's path.

    Args:
        home: the home, or its name or path.
        out_png: the picture to write.
        size: width and height of the picture in pixels.
        marks: problems; each that has a position is marked on the plan with its number, from 1.

    Raises:
        HomeError: the home cannot be loaded.
        OptionError: the picture's name does not end in .png, or it is one of the home's.
        WriteError: the picture cannot be written.
    """
    _check_name(out_png)
    home, half = home if isinstance(home, Home) else load_home(home), size[0] // 2
    check_apart(Path(out_png), home.files)
    with closing(Client()) as client, loaded_home(client.number, home) as body:
        plan = _plan(client.number, home, (half, size[1]), marks)
        _open_front(client.number, body, home)
        low, high = bounds([solid for thing in home.structure for solid in thing.solids])
        house = _render(client.number, low, high, _TOWARDS_CAMERA, (size[0] - half, size[1]))
    _write([plan, house], Path(out_png))
    return Path(out_png)


def preview_model(urdf: Path, out_png: Path) -> Path:
    """Draw a model from four sides and return the picture's path.

    Args:
        urdf: of the model, which has been read and found good, see :mod:`chmarl_pb.homes.catalog_file`.
        out_png: the picture to write.

    Raises:
        OptionError: the picture's name does not end in .png.
        WriteError: the picture cannot be written.
    """
    _check_name(out_png)
    with closing(Client()) as client:
        with quiet():
            body = pybullet.loadURDF(str(urdf), useFixedBase=True, physicsClientId=client.number)
        low, high = (np.array(corner) for corner in pybullet.getAABB(body, physicsClientId=client.number))
        _write([_render(client.number, low, high, (side, 25.0), (_VIEW, _VIEW)) for side in _SIDES], out_png)
    return out_png


def _check_name(out_png: str | Path) -> None:
    if Path(out_png).suffix.lower() != ".png":
        raise OptionError(f"{out_png}: the picture is a PNG; let its name end in .png")


def _write(panels: list[Array], out_png: Path) -> None:
    """Write pictures side by side."""
    content = cv2.imencode(".png", np.hstack(panels)[:, :, ::-1])[1].tobytes()
    with replacing(out_png) as temporary:
        temporary.write_bytes(content[:_HEAD] + _MARK + content[_HEAD:])


def is_preview(path: Path) -> bool:
    """Return whether a file is a picture that was drawn here."""
    try:
        return _MARK in read_regular(path, _MOST_BYTES)[: _HEAD + len(_MARK)]
    except ValueError:
        return False


def _plan(client: int, home: Home, size: tuple[int, int], marks: Sequence[Problem]) -> Array:
    """Return the plan, with the name of each room in the middle of its largest floor, and problems where they are."""
    width, height = size
    plan = plan_in(client, home, width, height)
    rows, columns = plan.rgb.shape[:2]
    panel = np.full((height, width, 3), 255, dtype=np.uint8)
    top, left = (height - rows) // 2, (width - columns) // 2
    panel[top : top + rows, left : left + columns] = plan.rgb
    for room in home.rooms.values():
        x, y = max(room.floors, key=lambda floor: np.ptp(floor, axis=0).prod()).mean(axis=0)
        column, row = plan.pixel(x, y)
        _label(panel, room.name, (round(left + column), round(top + row)))
    for number, problem in enumerate(marks, start=1):
        if problem.position is not None:
            column, row = plan.pixel(*problem.position[:2])
            _mark(panel, number, (round(left + column), round(top + row)), _COLOURS[problem.severity])
    return panel


def _open_front(client: int, body: int, home: Home) -> None:
    """Make the outer walls on the south and west invisible, so that a view from there looks into the rooms."""
    floors = [(floor.min(axis=0), floor.max(axis=0)) for room in home.rooms.values() for floor in room.floors]
    for link, name in enumerate(link_names(client, body)):
        low, high = np.array(pybullet.getAABB(body, link, physicsClientId=client))[:, :2]
        width, depth = high - low
        before = (low + high) / 2 - ([0, _BEFORE] if width > depth else [_BEFORE, 0])
        if class_of(name) == "wall" and not any((f[0] < before).all() and (before < f[1]).all() for f in floors):
            pybullet.changeVisualShape(body, link, rgbaColor=(1, 1, 1, 0), physicsClientId=client)


def _render(client: int, low: Array, high: Array, towards: tuple[float, float], size: tuple[int, int]) -> Array:
    """Return the smoothed colour picture (height x width x 3, uint8) that a box just fills.

    Args:
        client: PyBullet client id.
        low: low corner of the box, metres.
        high: high corner of the box.
        towards: the camera, from +x and over the horizon, degrees.
        size: width and height in pixels.
    """
    turn, lift = np.radians(towards)
    away = np.array([np.cos(lift) * np.cos(turn), np.cos(lift) * np.sin(turn), np.sin(lift)])
    centre, reach = (low + high) / 2, _DISTANCE * float(np.linalg.norm(high - low))
    view = pybullet.computeViewMatrix(centre + reach * away, centre, (0, 0, 1))
    corners = np.array([[*corner, 1.0] for corner in product(*zip(low, high, strict=True))])
    seen = corners @ np.reshape(view, (4, 4))
    slopes = seen[:, :2] / -seen[:, 2:3]
    middle, half = (slopes.max(axis=0) + slopes.min(axis=0)) / 2, np.ptp(slopes, axis=0) / 2 * _MARGIN
    half = np.maximum(half, half[::-1] * [size[0] / size[1], size[1] / size[0]])
    near, far = 0.5 * reach, 1.5 * reach
    left, bottom, right, top = near * np.concatenate([middle - half, middle + half])
    projection = pybullet.computeProjectionMatrix(left, right, bottom, top, near, far)
    width, height = (_OVERSAMPLING * side for side in size)
    pixels = pybullet.getCameraImage(
        width, height, view, projection, shadow=0, renderer=pybullet.ER_TINY_RENDERER,
        flags=pybullet.ER_NO_SEGMENTATION_MASK, physicsClientId=client, **LIGHT,
    )[2]  # fmt: skip
    colours = np.reshape(pixels, (height, width, 4))[:, :, :3].astype(np.uint8)
    return cv2.resize(colours, size, interpolation=cv2.INTER_AREA)


def _label(picture: Array, text: str, centre: tuple[int, int]) -> None:
    """Write a name on a light, half transparent plate around a pixel."""
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, picture.shape[0] / 1700
    (width, height), _ = cv2.getTextSize(text, font, scale, 1)
    left, base, pad = centre[0] - width // 2, centre[1] + height // 2, height // 2
    plate = picture[max(base - height - pad, 0) : base + pad, max(left - pad, 0) : left + width + pad]
    plate[:] = (plate + 3.0 * _PLATE) / 4
    cv2.putText(picture, text, (left, base), font, scale, _INK, 1, cv2.LINE_AA)


def _mark(picture: Array, number: int, centre: tuple[int, int], colour: tuple[int, int, int]) -> None:
    """Draw a ring around a pixel, and a number beside it; what lies outside of the picture is drawn at its edge."""
    height, width = picture.shape[:2]
    radius = height // 45
    x, y = (int(np.clip(at, radius, most - radius)) for at, most in zip(centre, (width, height), strict=True))
    cv2.circle(picture, (x, y), radius, (255, 255, 255), height // 150 + 2, cv2.LINE_AA)
    cv2.circle(picture, (x, y), radius, colour, height // 225 + 1, cv2.LINE_AA)
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, height / 1300
    for ink, thick in (((255, 255, 255), 5), (colour, 2)):
        cv2.putText(picture, str(number), (x + radius, y - radius // 2), font, scale, ink, thick, cv2.LINE_AA)
