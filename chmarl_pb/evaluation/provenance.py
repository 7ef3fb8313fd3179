"""What a result depends on beside its options: home, tasks, versions, source code, machine."""

import json
import os
import platform
import re
from collections.abc import Iterable
from dataclasses import asdict, fields
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType

import chmarl_pb
from chmarl_pb.assets import URDF_DIR
from chmarl_pb.fingerprint import fingerprint, name_of, sha256_of
from chmarl_pb.homes.home import load_home
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.plain_robot import robot_hash
from chmarl_pb.tasks.splits import fixed_homes
from chmarl_pb.tasks.tidy_task import AnyTask

#: Endings of files with data, see :func:`source_hash`.
DATA = (".json", ".npz", ".txt")
#: Folders of this package whose data decides what its own policies do, beside their code.
LEARNED = ("policies", "tasks/language")
_PACKAGES = ("numpy", "scipy", "gymnasium", "pettingzoo", "trimesh", "yourdfpy")


def home_hash(home: str) -> str:
    """Return the sha256 of a home as its files are now: its URDF and all files that it names.

    A generated home with fixed tasks is not made for this: that it has the hash is checked when it is played in.

    Args:
        home: name of a packaged home or path of a URDF.

    Raises:
        HomeError: the home cannot be used.
    """
    return fixed_homes().get(home) or load_home(home).content


def home_hashes(tasks: Iterable[AnyTask]) -> dict[str, str]:
    """Return home -> its hash, see :func:`home_hash`, of all homes of tasks.

    Raises:
        HomeError: a home cannot be used.
    """
    return {home: home_hash(home) for home in sorted({task.home for task in tasks})}


def is_told(model: RobotModel) -> bool:
    """Return whether something tells a robot's class, if it has one, apart from others of its name."""
    return model.make is None or fingerprint(model.make) is not None


def robots_hash(models: Iterable[RobotModel]) -> dict[str, str]:
    """Return kind of robot -> sha256 of what is known of it and of its files."""

    def known(model: RobotModel) -> str:
        make = None if model.make is None else (name_of(model.make), fingerprint(model.make))
        facts = {fact.name: getattr(model, fact.name) for fact in fields(model) if fact.init}
        return repr({**facts, "urdf": model.urdf.name, "make": make})

    def parts(model: RobotModel) -> list[bytes]:
        files = robot_hash(model.urdf)
        return [known(model).encode(), model.urdf.read_bytes(), *([files.encode()] if files else [])]

    return {model.name: sha256_of(parts(model)) for model in models}


def tasks_hash(tasks: Iterable[AnyTask]) -> str:
    """Return the sha256 of tasks, in their order."""
    return sha256_of(json.dumps(asdict(task), sort_keys=True).encode() for task in tasks)


@cache
def packaged_things_hash() -> str:
    """Return the sha256 of the models of the benchmark's objects; those of furniture are part of each home's."""
    files = sorted(
        path for name in ("graspables", "textures") for path in (URDF_DIR / name).rglob("*") if path.is_file()
    )
    return sha256_of(part for path in files for part in (path.name.encode(), path.read_bytes()))


@cache
def source_hash(module: ModuleType = chmarl_pb) -> str:
    """Return the sha256 of a package's Python files: it tells versions apart.

    Args:
        module: the package; if it is this one, the data counts that its own policies and words are made of.
    """
    folder = Path(str(module.__file__)).parent
    files = {*folder.rglob("*.py")}
    if module is chmarl_pb:
        files |= {path for name in LEARNED for path in (folder / name).rglob("*") if path.suffix in DATA}
    return sha256_of(path.read_bytes() for path in sorted(files))


def versions() -> dict[str, str]:
    """Return the versions of Python, this package and what its results depend on."""
    from chmarl_pb.world.bullet import distribution  # here: it starts PyBullet

    bullet, number = distribution()
    found = {"python": platform.python_version(), "chmarl-pb": chmarl_pb.__version__, bullet: number}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found


def machine() -> dict[str, str | int]:
    """Return what this machine is."""
    return {"platform": platform.platform(), "processor": _processor(), "cores": os.cpu_count() or 0}


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        models = re.findall(r"^model name\s*:\s*(.+)$", cpuinfo.read_text(), re.MULTILINE)
        if models:
            return str(models[0])
    return platform.processor() or platform.machine()
