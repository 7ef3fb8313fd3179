"""The view store: what is on disk equals what would be drawn, for every process and every home."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chmarl_pb.errors import AssetError, HomeError
from chmarl_pb.homes.content import content_hash
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.rendering import home_views as home_views_module
from chmarl_pb.rendering.home_views import HomeViews
from chmarl_pb.rendering.plan_view import draw_plan
from chmarl_pb.rendering.view_store import view_store
from chmarl_pb.robots.file import find_model
from tests.helpers.small_homes import SMALL_HOME, home_text
from tests.helpers.stored_views import (
    assert_all_equal,
    assert_equal,
    drawn_in_memory,
    looks,
)


@pytest.fixture
def drawn_by_tinyrenderer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let homes be drawn as those are whose shapes only TinyRenderer knows."""

    def refuse(client: int, body: int) -> None:
        raise AssetError("only TinyRenderer can draw this")

    monkeypatch.setattr(home_views_module, "HomeModel", refuse)


# The pictures of a home


def test_stored_views_equal_drawn_ones_and_are_read_only(
    folder: Path, home: Home, draws: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = drawn_in_memory(home, monkeypatch)
    assert_all_equal(looks(home), expected)
    draws.clear()
    again = looks(home)
    assert_all_equal(again, expected)
    assert draws == []
    for kept in expected + again:
        assert not kept.colour.flags.writeable and not kept.depth.flags.writeable
        assert not kept.segmentation.flags.writeable


def test_stored_views_of_a_furnished_home_equal_those_drawn_in_another_order(
    folder: Path, monkeypatch: pytest.MonkeyPatch, drawn_by_tinyrenderer: None
) -> None:
    home, rng = load_home("home_2"), np.random.default_rng(0)
    poses = rng.integers(4000, size=25).tolist()
    views = HomeViews(home)
    for number, pose in enumerate(poses):
        views.look(find_model("humanoid"), pose, 64)
        if number % 3 == 0:  # somebody draws the home from elsewhere in between
            draw_plan(home, 16, 16)
    stored = HomeViews(home)
    monkeypatch.setenv("CHMARL_CACHE", "off")
    fresh = HomeViews(home)
    for pose in reversed(poses):
        look = find_model("humanoid"), pose, 64
        assert_equal(stored.look(*look).picture, fresh.look(*look).picture)


SCRIPT = """
import hashlib, json, sys
from chmarl_pb.homes.home import load_home
from chmarl_pb.rendering import home_views
from chmarl_pb.robots.file import find_model
drawn, draw = [], home_views.HomeViews.draw
home_views.HomeViews.draw = lambda *arguments: [drawn.append(1), draw(*arguments)][1]
views, digest = home_views.HomeViews(load_home(sys.argv[1])), hashlib.sha256()
for pose in range(60):
    seen = views.look(find_model("humanoid"), pose, 48).picture
    digest.update(seen.colour.tobytes() + seen.depth.tobytes() + seen.segmentation.tobytes())
print(json.dumps([len(drawn), digest.hexdigest()]))
"""


def start(home: Home) -> "subprocess.Popen[str]":
    return subprocess.Popen([sys.executable, "-c", SCRIPT, str(home.path)], stdout=subprocess.PIPE, text=True)


def result(process: "subprocess.Popen[str]") -> tuple[int, str]:
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    draws, digest = json.loads(output.splitlines()[-1])
    return draws, digest


def test_two_processes_write_at_once_and_a_third_draws_nothing(folder: Path, home: Home) -> None:
    both = [result(process) for process in [start(home), start(home)]]
    assert both[0][1] == both[1][1]
    draws, digest = result(start(home))
    assert draws == 0 and digest == both[0][1]


def test_without_a_store_nothing_is_written(folder: Path, home: Home, monkeypatch: pytest.MonkeyPatch) -> None:
    for value in ("off", ""):
        monkeypatch.setenv("CHMARL_CACHE", value)
        monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
        assert view_store() is None
        looks(home)
    assert not folder.exists()


def test_the_folder_follows_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def folder() -> Path | None:
        store = view_store()
        return None if store is None else store.folder

    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("CHMARL_CACHE", "~/mine")
    assert folder() == tmp_path / "mine/views"
    monkeypatch.delenv("CHMARL_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert folder() == tmp_path / "xdg/chmarl_pb/views"
    monkeypatch.setenv("XDG_CACHE_HOME", "not/absolute")
    assert folder() is None
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert folder() == tmp_path / ".cache/chmarl_pb/views"


def test_a_home_with_other_content_does_not_share_views(
    folder: Path, write_home: Callable[..., Path], draws: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    looks(load_home(write_home(home_text())))
    moved = load_home(write_home(home_text({**SMALL_HOME, "livingroom/desk_1": ((1.2, 0.6, 0.75), (0.1, 1.6, 0.375))})))
    draws.clear()
    seen = looks(moved)
    assert draws
    assert_all_equal(seen, drawn_in_memory(moved, monkeypatch))


def test_a_home_that_changes_after_it_was_read_is_not_drawn(folder: Path, home: Home) -> None:
    views = HomeViews(home)
    home.path.write_text(home_text({"livingroom/floor_1": SMALL_HOME["livingroom/floor_1"]}))
    with pytest.raises(HomeError, match="changed"):
        views.look(find_model("humanoid"), 0, 24)


def test_a_homes_hash_covers_the_materials_of_its_meshes(write_home: Callable[..., Path]) -> None:
    mesh = (
        "<link name=\"livingroom/stool_1\"><visual><geometry><mesh filename='stool.obj'/></geometry></visual></link>"
        '<joint name="j" type="fixed"><parent link="world"/><child link="livingroom/stool_1"/></joint>'
    )
    path = write_home(home_text(extra=mesh))
    (path.parent / "stool.obj").write_text("mtllib stool.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 1\nusemtl a\nf 1 2 3\n")
    hashes = set()
    for colour in ("1 0 0", "0 1 0"):
        (path.parent / "stool.mtl").write_text(f"newmtl a\nKd {colour}\n")
        hashes.add(content_hash(load_home(path)))
    assert len(hashes) == 2


def test_dropped_homes_keep_no_files_open(folder: Path, home: Home) -> None:
    """A remembered picture of a file would keep the file's map, and so one more handle, open."""
    before = len(os.listdir("/proc/self/fd"))
    views = HomeViews(home)
    views.look(find_model("drone"), 0, 16)
    assert len(os.listdir("/proc/self/fd")) > before
    del views
    assert len(os.listdir("/proc/self/fd")) <= before
