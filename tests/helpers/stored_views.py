"""Pictures of noise, and of a small home, in the view store."""

from pathlib import Path

import numpy as np
import pytest

from chmarl_pb.homes.home import Home
from chmarl_pb.rendering.camera import Picture
from chmarl_pb.rendering.home_views import HomeViews
from chmarl_pb.rendering.view_file import ViewFile
from chmarl_pb.rendering.view_store import ViewStore
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.registry import TEAM

POSES, SIZE = 20, 24
VIEW = tuple(float(number) for number in range(16))
LOOKS = [(robot, pose, size) for robot in map(find_model, TEAM) for pose in (0, 7, 3) for size in (24, 32)]


def picture(seed: int, size: int = SIZE) -> Picture:
    """A picture of noise."""
    rng = np.random.default_rng(seed)
    shape = (size, size)
    return Picture(
        rng.integers(2**32, size=shape, dtype=np.uint32),
        rng.random(shape, dtype=np.float32),
        rng.integers(-1, 300, size=shape, dtype=np.int16),
    )


def assert_equal(one: Picture | None, other: Picture) -> None:
    assert one is not None
    for field in ("colour", "depth", "segmentation"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))
        assert getattr(one, field).dtype == getattr(other, field).dtype


def looks(home: Home) -> list[Picture]:
    """The pictures of some poses, as a process would get them that has just begun."""
    views = HomeViews(home)
    return [views.look(*look).picture for look in LOOKS]


def drawn_in_memory(home: Home, monkeypatch: pytest.MonkeyPatch) -> list[Picture]:
    with monkeypatch.context() as patch:
        patch.setenv("CHMARL_CACHE", "off")
        return looks(home)


def assert_all_equal(some: list[Picture], others: list[Picture]) -> None:
    for one, other in zip(some, others, strict=True):
        assert_equal(one, other)


def filled(folder: Path, name: str = "some", limit: int = 2**30) -> ViewFile:
    """A file with noise in all its slots."""
    file = ViewStore(folder, limit).open(name, POSES, SIZE)
    assert file is not None
    for pose in range(POSES):
        file.put(pose, VIEW, picture(pose))
    return file


def opened(folder: Path, name: str = "some", limit: int = 2**30) -> ViewFile:
    file = ViewStore(folder, limit).open(name, POSES, SIZE)
    assert file is not None
    return file


def only_file(folder: Path) -> Path:
    (path,) = folder.iterdir()
    return path


def used(folder: Path) -> int:
    return sum(path.stat().st_blocks * 512 for path in folder.iterdir())
