"""The files of the view store: whatever happens to them, nothing wrong is handed out and nothing is an error."""

import os
import resource
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from chmarl_pb.homes.home import Home
from chmarl_pb.rendering import view_file
from chmarl_pb.rendering.home_views import HomeViews
from chmarl_pb.rendering.view_store import ViewStore, view_memory, view_store
from tests.helpers.stored_views import (
    LOOKS,
    POSES,
    SIZE,
    VIEW,
    assert_all_equal,
    assert_equal,
    drawn_in_memory,
    filled,
    looks,
    only_file,
    opened,
    picture,
    used,
)

# What happens to the files


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
    store = view_store()
    assert store is not None
    for entry in store.entries():
        entry.path.unlink()
    folder.rmdir()
    assert_all_equal(seen, expected[:6])
    assert_all_equal([views.look(*look).picture for look in LOOKS], expected)
    assert_all_equal(looks(home), expected)
    assert used(folder) > 0


# The limit


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


def test_the_memory_of_views_is_read_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    assert view_memory() == 384 * 2**20
    monkeypatch.setenv("CHMARL_VIEW_MEMORY", "16")
    assert view_memory() == 16 * 2**20
    monkeypatch.setenv("CHMARL_VIEW_MEMORY", "1.5 GB")
    with pytest.warns(RuntimeWarning, match="CHMARL_VIEW_MEMORY=1.5 GB is not a whole number of MB"):
        assert view_memory() == 384 * 2**20


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

    def refuse(path: str | Path, flags: int, *rest: int) -> int:
        if flags & os.O_RDWR:
            raise PermissionError(13, "Permission denied", str(path))
        return real(path, flags, *rest)

    monkeypatch.setattr("os.open", refuse)


def test_a_store_that_cannot_be_written_is_read(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    filled(tmp_path, "whole")
    filled(tmp_path, "short")
    os.truncate(tmp_path / "short.views", 5000)
    request.getfixturevalue("read_only")
    file = opened(tmp_path, "whole")
    assert_equal(file.get(3, VIEW), picture(3))
    assert file.put(3, VIEW, picture(4)) is None
    view_file.warn_of.cache_clear()
    view_file.warn.cache_clear()
    with pytest.warns(RuntimeWarning, match="memory only"):
        assert ViewStore(tmp_path, 2**30).open("short", POSES, SIZE) is None
    with pytest.warns(RuntimeWarning, match="Permission denied|No such file"):
        assert ViewStore(tmp_path, 2**30).open("absent", POSES, SIZE) is None


def test_a_disk_that_fills_up_is_one_warning(tmp_path: Path) -> None:
    file = opened(tmp_path)
    view_file.warn_of.cache_clear()
    view_file.warn.cache_clear()
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
