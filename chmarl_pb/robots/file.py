"""Robot files: a robot as a URDF and a few facts, in TOML (format: docs/robots.md)."""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.errors import AssetError
from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.homes.source import MOST_URDF_BYTES, shown
from chmarl_pb.navigation.lattice import FOOTPRINT, Footprint
from chmarl_pb.navigation.reach import Reach
from chmarl_pb.reading import read_regular
from chmarl_pb.robots.arm_model import ArmModel, JointList, arm_model
from chmarl_pb.robots.chain import Joint, Tree, chain_to
from chmarl_pb.robots.model import ALTITUDE, FOV, POSITION, SPEED, CameraMount, RobotModel, check_name
from chmarl_pb.robots.motors import Configuration
from chmarl_pb.robots.plain_robot import FOLDER, robot_hash
from chmarl_pb.robots.workspace import BEARING

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found, unused-ignore]

MOVES = ("drives", "flies")

_Read = TypeVar("_Read")
_MOST_BYTES = 2**16
_LONGEST_PROBLEM = 500  # characters


def packaged() -> list[str]:
    """Return the names of the robots that come with the package."""
    return sorted(file.stem for file in FOLDER.glob("*.toml"))


def find_model(robot: str | Path) -> RobotModel:
    """Return the model of a robot of the package, by its name, or of a robot file, by its path.

    Raises:
        AssetError: there is no such robot, or its file cannot be used.
    """
    path = Path(robot)
    if not path.suffix and path.name == str(robot):
        if str(robot) not in packaged():
            raise AssetError(
                f"no robot {shown(str(robot))}; use one of: {', '.join(packaged())}, "
                "or the path of a robot file (.toml)"
            )
        path = FOLDER / f"{robot}.toml"
    try:
        content, path = read_regular(path, _MOST_BYTES), path.resolve()
        urdf = _urdf(path, _urdf_name(path, content))
        return _read(path, content, sha256_of([read_regular(urdf, MOST_URDF_BYTES)]), _mesh_hash(urdf))
    except ValueError as error:
        if isinstance(error, AssetError):
            raise
        raise AssetError(f"{path}: {str(error)[:_LONGEST_PROBLEM]}") from error


def _mesh_hash(urdf: Path) -> str | None:
    """Return what changes with the meshes of a robot of the user's; None if they cannot be used, as is told later."""
    try:
        return robot_hash(urdf)
    except AssetError:
        return None


@lru_cache(maxsize=64)
def _urdf_name(path: Path, content: bytes) -> str:
    return _table(path, content).text("urdf")


def _table(path: Path, content: bytes) -> "_Table":
    try:
        return _Table(path, "", tomllib.loads(content.decode()))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise AssetError(f"{path}: not TOML ({error})") from error


@lru_cache(maxsize=64)
def _read(path: Path, content: bytes, _urdf_hash: str, _mesh_hash: str | None) -> RobotModel:
    """Return what a robot file says; the same file, URDF and meshes give the same model."""
    rows = _table(path, content)
    moves = rows.choice("moves", MOVES)
    make = _flying if moves == "flies" else _driving
    model = make(
        rows, name=_name(path), urdf=_urdf(path, rows.text("urdf")), camera=_camera(rows.table("camera"))
    )  # fmt: skip
    rows.finish(f" for a robot that {moves}")
    named = path.stem if path.parent == FOLDER.resolve() else path
    object.__setattr__(model, "copied_by", (find_model, (named,)))
    return model


def _flying(rows: "_Table", **facts: Any) -> RobotModel:
    return RobotModel(
        **facts, flies=True, class_name=rows.choice("class", tuple(catalog.BENCHMARK.robots), "drone"),
        altitude=rows.number("altitude", *ALTITUDE, 3.5), speed=rows.number("speed", *SPEED, 2.5),
    )  # fmt: skip


def _driving(rows: "_Table", **facts: Any) -> RobotModel:
    footprint = FOOTPRINT if (given := rows.optional_table("footprint")) is None else _footprint(given)
    table = rows.optional_table("arm")
    reach, arm = (None, None) if table is None else _arm(table, facts["urdf"], footprint)
    return RobotModel(
        **facts, class_name=rows.choice("class", tuple(catalog.BENCHMARK.robots), "humanoid"), footprint=footprint,
        speed=rows.number("speed", *SPEED, 1.2),
        turn_speed=float(np.radians(rows.number("turn_speed", 5.0, 720.0, 126.0))), reach=reach, arm=arm,
    )  # fmt: skip


def _name(path: Path) -> str:
    try:
        check_name(path.stem)
    except AssetError as error:
        raise AssetError(f"{path}: {error}") from error
    return path.stem


def _urdf(path: Path, name: str) -> Path:
    urdf = path.parent / name
    if not os.path.realpath(urdf).startswith(os.path.join(os.path.realpath(path.parent), "")):
        raise AssetError(f"{path}: urdf = {shown(name)}: leaves the robot file's folder; copy it there")
    if len(name) > _LONGEST_PROBLEM or not urdf.is_file():
        raise AssetError(f"{path}: urdf = {shown(name)}: no such file beside the robot file")
    return urdf


def _camera(rows: "_Table") -> CameraMount:
    x, y, z = rows.numbers("position", 3, *POSITION)
    camera = CameraMount(rows.number("fov", *FOV), (x, y, z), float(np.radians(rows.number("pitch", -90, 90, 0))))
    rows.finish()
    return camera


def _footprint(rows: "_Table") -> Footprint:
    footprint = Footprint(
        rows.number("radius", 0.05, 1.0, FOOTPRINT.radius),
        rows.number("low", 0.0, 0.5, FOOTPRINT.low),
        rows.number("high", 0.1, 3.0, FOOTPRINT.high),
    )
    rows.finish()
    if footprint.low >= footprint.high:
        raise AssetError(f"{rows.path}: [footprint] low = {footprint.low} is not below high = {footprint.high}")
    return footprint


def _arm(rows: "_Table", urdf: Path, footprint: Footprint) -> tuple[Reach, ArmModel | None]:
    """Return what an arm reaches, and the arm itself if it is not the humanoid's."""
    if "joints" in rows.values:
        arm = _own_arm(rows, urdf, footprint)
        rows.finish(" for an arm that names its joints")
        if arm.space.reach is None:
            raise AssetError(
                f"{rows.path}: [arm] reaches nothing outside the footprint up to 2 m high, straight ahead and "
                f"{np.degrees(BEARING):.0f} degrees to either side; mount it elsewhere, or see hand, grasp and limits"
            )
        return arm.space.reach, arm
    if "distance" not in rows.values:
        raise AssetError(
            f"{rows.path}: [arm] names neither the joints of an arm of its own nor the distance that the humanoid's "
            "reaches; name one of them, or leave out [arm]"
        )
    near, far = rows.numbers("distance", 2, 0.05, 3.0)
    low, high = rows.numbers("height", 2, 0.0, 3.0)
    reach = Reach((near, far), (low, high), float(np.radians(rows.number("bearing", 15.0, 180.0, 20.0))))
    rows.finish()
    if near >= far or low >= high:
        raise AssetError(f"{rows.path}: [arm] distance and height each name the lesser number first")
    return reach, None


def _own_arm(rows: "_Table", urdf: Path, footprint: Footprint) -> ArmModel:
    try:
        tree = Tree(urdf)
    except ValueError as error:
        raise AssetError(f"{urdf}: {str(error)[:_LONGEST_PROBLEM]}") from error
    x, y, z = rows.numbers("grasp", 3, -1.0, 1.0, [0.0, 0.0, 0.0])
    hand = rows.text("hand")
    chain = rows.checked("hand", lambda: chain_to(tree, hand, (x, y, z)))
    names = rows.texts("joints")
    joints = rows.checked("joints", lambda: JointList(tree, names, chain))
    rest, carry = (_posture(rows, key, joints, joints.named) for key in ("rest", "carry"))
    opened = _posture(rows, "open", joints, joints.fingers, [joint.upper for joint in joints.fingers])
    speeds = rows.number_list("speeds", 0.05, 10.0, [min(joint.speed, 10.0) for joint in joints.named])
    if len(speeds) != len(names):
        raise AssetError(f"{rows.path}: [arm] speeds has {len(speeds)} numbers; give {len(names)}, one for each joint")
    return arm_model(joints, hand, (x, y, z), rest, carry, opened, speeds, footprint.radius)


def _posture(
    rows: "_Table", key: str, joints: JointList, some: Sequence[Joint], default: list[float] | None = None
) -> Configuration:
    values = rows.number_list(key, -10.0, 10.0, default)
    return rows.checked(key, lambda: joints.posture(values, some))


class _Table:
    """A table of a robot file, read key by key; every problem names the file, the table and the key."""

    def __init__(self, path: Path, name: str, values: Mapping[str, Any]):
        self.path, self.name, self.values = path, name, values
        self._known: set[str] = set()

    def finish(self, where: str = "") -> None:
        """Refuse keys that nobody has asked for."""
        for key in self.values.keys() - self._known:
            raise self._problem(key, f"has no meaning{where}; use some of: {', '.join(sorted(self._known))}")

    def optional_table(self, key: str) -> "_Table | None":
        """Return a table, or None where there is none; one without keys is there."""
        self._known.add(key)
        return self.table(key) if key in self.values else None

    def table(self, key: str) -> "_Table":
        value = self._get(key, None)
        if not isinstance(value, Mapping):
            raise self._problem(key, f"= {value!r} is not a table; write [{key}]")
        return _Table(self.path, f"[{key}] ", value)

    def text(self, key: str) -> str:
        value = self._get(key, None)
        if not isinstance(value, str):
            raise self._problem(key, f"= {value!r} is not a text")
        return value

    def choice(self, key: str, known: tuple[str, ...], default: str | None = None) -> str:
        value = self._get(key, default)
        if value not in known:
            raise self._problem(key, f"= {value!r}; use one of: {', '.join(known)}")
        return str(value)

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        value = self._get(key, default)
        if not _in_range(value, low, high):
            raise self._problem(key, f"= {value!r} is not a number from {low:g} to {high:g}")
        return float(value)

    def texts(self, key: str) -> list[str]:
        value = self._get(key, None)
        if not isinstance(value, list) or not value or not all(isinstance(one, str) for one in value):
            raise self._problem(key, f"= {value!r} is not a list of names")
        return value

    def number_list(self, key: str, low: float, high: float, default: list[float] | None = None) -> list[float]:
        value = self._get(key, default)
        if not isinstance(value, list) or not all(_in_range(one, low, high) for one in value):
            raise self._problem(key, f"= {value!r} is not a list of numbers from {low:g} to {high:g}")
        return [float(one) for one in value]

    def checked(self, key: str, read: Callable[[], _Read]) -> _Read:
        """Return what is read of a key; its problems are told with the place."""
        try:
            return read()
        except ValueError as error:
            raise self._problem(key, str(error)) from error

    def numbers(self, key: str, count: int, low: float, high: float, default: list[float] | None = None) -> list[float]:
        value = self._get(key, default)
        if not isinstance(value, list) or len(value) != count or not all(_in_range(one, low, high) for one in value):
            raise self._problem(key, f"= {value!r} is not {count} numbers from {low:g} to {high:g}")
        return [float(one) for one in value]

    def _get(self, key: str, default: Any) -> Any:
        self._known.add(key)
        if key not in self.values and default is None:
            raise self._problem(key, "is missing")
        return self.values.get(key, default)

    def _problem(self, key: str, what: str) -> AssetError:
        return AssetError(f"{self.path}: {self.name}{key[:_LONGEST_PROBLEM]} {what[:_LONGEST_PROBLEM]}")


def _in_range(value: Any, low: float, high: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
