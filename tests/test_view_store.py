"""The view store: what is on disk equals what would be drawn, and nothing that happens to the files is an error."""

import json
import os
import resource
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import SMALL_HOME, home_text
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chmarl_pb.cli import main
from chmarl_pb.errors import AssetError, HomeError
from chmarl_pb.homes.content import content_hash
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.sensing import fill
from chmarl_pb.sensing import home_views as home_views_module
from chmarl_pb.sensing import view_store as view_store_module
from chmarl_pb.sensing.camera import Picture
from chmarl_pb.sensing.home_views import HomeViews
from chmarl_pb.sensing.view_store import ViewFile, ViewStore, view_store

POSES, SIZE = 20, 24
VIEW = tuple(float(number) for number in range(16))
LOOKS = [(robot, pose, size) for robot in ("humanoid", "drone") for pose in (0, 7, 3) for size in (24, 32)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store's folder of its own for one test."""
    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path / "cache"))
    view_store_module._warn.cache_clear()
    return tmp_path / "cache" / "views"


@pytest.fixture
def home(write_home: Callable[[str], Path]) -> Home:
    return load_home(write_home(home_text()))


@pytest.fixture
def drawn_by_tinyrenderer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let homes be drawn as those are whose shapes only TinyRenderer knows."""

    def refuse(client: int, body: int) -> None:
        raise AssetError("only TinyRenderer can draw this")

    monkeypatch.setattr(home_views_module, "HomeModel", refuse)


@pytest.fixture
def draws(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Grows by the size of each picture that is drawn."""
    drawn: list[int] = []
    draw = HomeViews.draw
    monkeypatch.setattr(HomeViews, "draw", lambda *arguments: [drawn.append(arguments[-1]), draw(*arguments)][1])
    return drawn


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
        views.look("humanoid", pose, 64)
        if number % 3 == 0:  # somebody draws the home from elsewhere in between
            home_views_module.render(views.client, home_views_module.CAMERAS["drone"], VIEW, 16)
    stored = HomeViews(home)
    monkeypatch.setenv("CHMARL_CACHE", "off")
    fresh = HomeViews(home)
    for pose in reversed(poses):
        assert_equal(stored.look("humanoid", pose, 64).picture, fresh.look("humanoid", pose, 64).picture)


SCRIPT = """
import hashlib, json, sys
from chmarl_pb.homes.home import load_home
from chmarl_pb.sensing import home_views
drawn, draw = [], home_views.HomeViews.draw
home_views.HomeViews.draw = lambda *arguments: [drawn.append(1), draw(*arguments)][1]
views, digest = home_views.HomeViews(load_home(sys.argv[1])), hashlib.sha256()
for pose in range(60):
    seen = views.look("humanoid", pose, 48).picture
    digest.update(seen.colour.tobytes() + seen.depth.tobytes() + seen.segmentation.tobytes())
print(json.dumps([len(drawn), digest.hexdigest()]))
"""


def start(home: Home) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", SCRIPT, str(home.path)], stdout=subprocess.PIPE, text=True)


def result(process: subprocess.Popen) -> list:
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    return json.loads(output.splitlines()[-1])


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
        views.look("humanoid", 0, 24)


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


# What happens to the files


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(writes=st.lists(st.tuples(st.integers(0, POSES - 1), st.integers(0, 3)), max_size=30))
def test_a_store_returns_what_was_put_last_and_nothing_else(tmp_path: Path, writes: list[tuple[int, int]]) -> None:
    first, second, last = opened(tmp_path), opened(tmp_path), {}
    for pose, seed in writes:
        assert_equal(first.put(pose, VIEW, picture(seed)), picture(seed))
        last[pose] = seed
    for file in (first, second, opened(tmp_path)):
        for pose in range(POSES):
            found = file.get(pose, VIEW)
            assert (found is None) == (pose not in last)
            if found is not None:
                assert_equal(found, picture(last[pose]))
    only_file(tmp_path).unlink()


def test_a_picture_of_another_camera_does_not_count(tmp_path: Path) -> None:
    filled(tmp_path)
    turned = (*VIEW[:-1], 99.0)
    assert opened(tmp_path).get(3, VIEW) is not None
    assert opened(tmp_path).get(3, turned) is None


def only_file(folder: Path) -> Path:
    (path,) = folder.iterdir()
    return path


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.integers(0, 10**9), bit=st.integers(0, 7))
def test_a_flipped_bit_is_never_handed_out(tmp_path: Path, where: int, bit: int) -> None:
    filled(tmp_path)
    path = only_file(tmp_path)
    data = bytearray(path.read_bytes())
    data[where % len(data)] ^= 1 << bit
    path.write_bytes(data)
    file, bad = opened(tmp_path), 0
    for pose in range(POSES):
        found = file.get(pose, VIEW)
        bad += found is None
        assert_equal(file.put(pose, VIEW, picture(pose)) if found is None else found, picture(pose))
    assert bad <= 1
    assert_equal(opened(tmp_path).get(3, VIEW), picture(3))
    path.unlink()


@pytest.mark.parametrize("length", [0, 1, 50, 4096, 5000, 100_000, 10_000_000])
def test_a_file_of_the_wrong_length_is_mended(tmp_path: Path, length: int) -> None:
    filled(tmp_path)
    os.truncate(only_file(tmp_path), length)
    file = opened(tmp_path)
    for pose in range(POSES):
        assert_equal(file.get(pose, VIEW) or file.put(pose, VIEW, picture(pose)), picture(pose))
    again = opened(tmp_path)
    for pose in range(POSES):
        assert_equal(again.get(pose, VIEW), picture(pose))


def test_a_file_that_is_cut_while_open_is_left_alone(tmp_path: Path) -> None:
    """To read a map beyond the end of its file would end the process."""
    file = filled(tmp_path)
    os.truncate(only_file(tmp_path), 5000)
    assert file.get(3, VIEW) is None
    assert file.put(3, VIEW, picture(3)) is None


def test_rubbish_is_not_read(tmp_path: Path) -> None:
    filled(tmp_path)
    path = only_file(tmp_path)
    path.write_bytes(np.random.default_rng(0).bytes(path.stat().st_size))
    file = opened(tmp_path)
    assert all(file.get(pose, VIEW) is None for pose in range(POSES))


def test_views_survive_the_deletion_of_the_store(folder: Path, home: Home, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = drawn_in_memory(home, monkeypatch)
    views = HomeViews(home)
    seen = [views.look(*look).picture for look in LOOKS[:6]]
    view_store().clear()  # type: ignore[union-attr]
    folder.rmdir()
    assert_all_equal(seen, expected[:6])
    assert_all_equal([views.look(*look).picture for look in LOOKS], expected)
    assert_all_equal(looks(home), expected)
    assert used(folder) > 0


# The limit


def used(folder: Path) -> int:
    return sum(path.stat().st_blocks * 512 for path in folder.iterdir())


def test_a_full_store_takes_no_more(tmp_path: Path) -> None:
    limit = 100_000
    file = opened(tmp_path, limit=limit)
    stored = [file.put(pose, VIEW, picture(pose)) for pose in range(POSES)]
    assert 0 < sum(kept is not None for kept in stored) < POSES
    assert used(tmp_path) <= limit + 8192  # the table of checksums
    for pose, kept in enumerate(stored):
        found = opened(tmp_path).get(pose, VIEW)
        assert (found is None) == (kept is None)


def test_the_file_that_was_not_used_for_longest_gives_way(tmp_path: Path) -> None:
    for name, time in (("old", 1000), ("older", 900), ("young", 1500)):
        filled(tmp_path, name)
        os.utime(tmp_path / f"{name}.views", (time, time))
    file = opened(tmp_path, "new", limit=used(tmp_path))
    assert file.put(0, VIEW, picture(0)) is not None
    assert {path.stem for path in tmp_path.iterdir()} == {"old", "young", "new"}


def test_a_file_in_use_does_not_give_way(tmp_path: Path) -> None:
    in_use = filled(tmp_path, "used")
    limit = used(tmp_path)
    new = opened(tmp_path, "new", limit)
    assert new.put(0, VIEW, picture(0)) is None
    assert_equal(in_use.get(0, VIEW), picture(0))
    del in_use
    assert new.put(0, VIEW, picture(0)) is not None
    assert {path.stem for path in tmp_path.iterdir()} == {"new"}


def test_the_limit_is_read_from_the_environment(folder: Path, home: Home, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = drawn_in_memory(home, monkeypatch)
    monkeypatch.setenv("CHMARL_CACHE_LIMIT", "0")
    assert_all_equal(looks(home), expected)
    assert used(folder) == 0
    monkeypatch.setenv("CHMARL_CACHE_LIMIT", "lots")
    with pytest.warns(RuntimeWarning, match="CHMARL_CACHE_LIMIT=lots"):
        assert_all_equal(looks(home), expected)


# Folders and disks that cannot be written


def test_a_folder_that_cannot_be_made_is_one_warning(
    folder: Path, home: Home, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = drawn_in_memory(home, monkeypatch)
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path / "file"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert_all_equal(looks(home), expected)
        assert_all_equal(looks(home), expected)
    assert [warning.category for warning in caught] == [RuntimeWarning]


@pytest.fixture
def read_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """No file can be opened for writing; permissions would not stop the superuser."""
    real = os.open

    def refuse(path: object, flags: int, *rest: int) -> int:
        if flags & os.O_RDWR:
            raise PermissionError(13, "Permission denied", str(path))
        return real(path, flags, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(view_store_module.os, "open", refuse)


def test_a_store_that_cannot_be_written_is_read(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    filled(tmp_path, "whole")
    filled(tmp_path, "short")
    os.truncate(tmp_path / "short.views", 5000)
    request.getfixturevalue("read_only")
    file = opened(tmp_path, "whole")
    assert_equal(file.get(3, VIEW), picture(3))
    assert file.put(3, VIEW, picture(4)) is None
    view_store_module._warn.cache_clear()
    with pytest.warns(RuntimeWarning, match="memory only"):
        assert ViewStore(tmp_path, 2**30).open("short", POSES, SIZE) is None
    with pytest.warns(RuntimeWarning, match="Permission denied|No such file"):
        assert ViewStore(tmp_path, 2**30).open("absent", POSES, SIZE) is None


def test_a_disk_that_fills_up_is_one_warning(tmp_path: Path) -> None:
    file = opened(tmp_path)
    view_store_module._warn.cache_clear()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, hard))
    try:
        with pytest.warns(RuntimeWarning, match="memory only") as caught:
            stored = [file.put(pose, VIEW, picture(pose)) for pose in range(POSES)]
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert len(caught) == 1
    assert stored[0] is not None and stored[-1] is None
    for pose, kept in enumerate(stored):
        if kept is not None:
            assert_equal(file.get(pose, VIEW), picture(pose))


# The command


def test_the_command_shows_and_clears(folder: Path, home: Home, capsys: pytest.CaptureFixture[str]) -> None:
    looks(home)
    assert main(["cache"]) == 0
    shown = capsys.readouterr().out
    assert str(folder) in shown and "4 files" in shown and "small_humanoid_24" in shown
    assert main(["cache", "--clear"]) == 0
    assert list(folder.iterdir()) == []
    assert main(["cache"]) == 0
    assert "0 files" in capsys.readouterr().out


@pytest.fixture
def seen_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the views in which visibility is decided be small, to be drawn fast."""
    monkeypatch.setattr(fill, "SIGHT_SIZE", SIZE)


def fill_command(home: Home, *more: str) -> int:
    return main(["cache", "--fill", str(home.path), "--size", str(SIZE), "--workers", "1", *more])


@pytest.mark.usefixtures("seen_small")
def test_filling_draws_each_view_once(
    folder: Path, home: Home, draws: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert fill_command(home) == 0
    count = sum(file.poses for file in view_store().files)
    assert len(draws) == count > 2000 and set(draws) == {SIZE}
    assert f"{used(folder) / 2**20:,.1f} MB" in capsys.readouterr().out
    draws.clear()
    assert fill_command(home) == 0
    assert "0 are missing" in capsys.readouterr().out
    HomeViews(home).look("drone", 5, SIZE)
    assert not draws


@pytest.mark.usefixtures("seen_small", "folder")
def test_filling_goes_on_after_an_interruption(home: Home, draws: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    look, missing = HomeViews.look, fill.Filling([str(home.path)], SIZE).missing
    draws.clear()

    def interrupted(views: HomeViews, *place: object) -> object:
        if len(draws) == 300:
            raise KeyboardInterrupt
        return look(views, *place)

    with monkeypatch.context() as patch:
        patch.setattr(HomeViews, "look", interrupted)
        assert fill_command(home) == 130
    assert fill.Filling([str(home.path)], SIZE).missing == missing - 300


@pytest.mark.usefixtures("seen_small", "folder")
def test_several_processes_fill_the_store(home: Home) -> None:
    filling = fill.Filling([str(home.path)], SIZE)
    jobs, before = filling.jobs()[:3], filling.missing
    assert sum(fill.draw(jobs, workers=2)) == sum(len(job.poses) for job in jobs) == before - filling.missing


@pytest.mark.usefixtures("seen_small")
def test_filling_says_before_it_starts_that_there_is_no_room(
    folder: Path, home: Home, monkeypatch: pytest.MonkeyPatch, draws: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CHMARL_CACHE_LIMIT", "10")
    assert fill_command(home) == 2
    assert "set CHMARL_CACHE_LIMIT=21 or more" in capsys.readouterr().err
    monkeypatch.setenv("CHMARL_CACHE_LIMIT", "21")
    monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=2**20))
    assert fill_command(home) == 2
    assert "the disk has 1 MB left" in capsys.readouterr().err
    assert len(draws) <= 2
    monkeypatch.setenv("CHMARL_CACHE", "off")
    assert fill_command(home) == 2


@pytest.mark.parametrize("wrong", [("--workers", "0"), ("--size", "8")])
def test_filling_refuses_wrong_numbers(folder: Path, home: Home, wrong: tuple[str, str]) -> None:
    assert fill_command(home, *wrong) == 2
    assert not folder.exists()
