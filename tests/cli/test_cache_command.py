"""`chmarl-pb cache`: what is kept is shown and cleared, and the view store is filled."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from chmarl_pb.cli import main
from chmarl_pb.executors import Local
from chmarl_pb.files import cache_folder
from chmarl_pb.homes.generate.store import generate_home
from chmarl_pb.homes.home import Home
from chmarl_pb.rendering.home_views import HomeViews
from chmarl_pb.rendering.view_store import view_store
from chmarl_pb.robots.file import find_model
from chmarl_pb.sensing import view_filling as fill
from chmarl_pb.tasks.verdict import _keep
from tests.helpers.stored_views import SIZE, looks, used


def test_the_command_shows_and_clears(folder: Path, home: Home, capsys: pytest.CaptureFixture[str]) -> None:
    looks(home)
    assert main(["cache"]) == 0
    shown = capsys.readouterr().out
    assert str(folder) in shown and "4 files" in shown and "small_humanoid_24" in shown
    assert main(["cache", "--clear"]) == 0
    assert list(folder.iterdir()) == []
    assert main(["cache"]) == 0
    assert "0 files" in capsys.readouterr().out


def test_generated_homes_and_trials_are_shown_and_cleared(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    generate_home(3)
    _keep("0" * 64, cache_folder(), ())
    assert main(["cache"]) == 0
    shown = capsys.readouterr().out
    assert "1 generated homes, 0." in shown and "1 trials of homes, 0.0 MB" in shown
    assert main(["cache", "--clear"]) == 0
    assert "removed 1 generated homes" in capsys.readouterr().out
    assert not list(folder.parent.rglob("*.*"))


def test_what_others_keep_in_the_cache_is_not_cleared(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cache, homes = folder.parent, generate_home(3).parent
    _keep("0" * 64, cache_folder(), ())
    (homes / ".generated-3.urdf-ab12_xyz.tmp").touch()  # of a process that was killed
    own = [cache / "homes" / "my.urdf", homes / "notes.txt", homes / "meshes" / "my.obj", cache / "trials" / "my.json"]
    for file in own:
        file.write_text("mine")
    assert main(["cache", "--clear"]) == 0
    assert {file for file in cache.rglob("*") if not file.is_dir()} == set(own)
    shown = capsys.readouterr().out
    assert "removed 1 generated homes" in shown and f"{own[3]}: is not of the cache, and is left" in shown
    for file in own:
        file.unlink()
    generate_home(3)
    assert main(["cache", "--clear"]) == 0
    assert not (cache / "homes").exists()


def test_links_in_the_cache_are_not_followed(folder: Path, tmp_path: Path) -> None:
    cache, homes = folder.parent, generate_home(3).parent
    elsewhere = tmp_path / "elsewhere"
    homes.rename(elsewhere)
    _keep("0" * 64, elsewhere, ())
    (elsewhere / "some.views").touch()
    before = {file: file.read_bytes() for file in elsewhere.rglob("*") if file.is_file()}
    for name in ("homes/generated-1", "trials", "views"):
        (cache / name).symlink_to(elsewhere)
    assert main(["cache", "--clear"]) == 0
    assert [file for file in cache.rglob("*") if file.is_symlink()] == []
    assert before == {file: file.read_bytes() for file in elsewhere.rglob("*") if file.is_file()}


@pytest.mark.parametrize("name", ["homes", "trials", "views"])
def test_what_is_no_folder_is_named_and_the_rest_is_cleared(
    name: str, folder: Path, home: Home, capsys: pytest.CaptureFixture[str]
) -> None:
    (blocking := folder.parent / name).parent.mkdir(exist_ok=True)
    blocking.write_text("mine")
    if name != "homes":
        generate_home(3)
    if name != "trials":
        _keep("0" * 64, cache_folder(), ())
    if name != "views":
        looks(home)
    assert main(["cache", "--clear"]) == 2
    said = capsys.readouterr().err
    assert f"{blocking} is no folder, so nothing is kept there; move it away" in said and said.count("\n") == 1
    assert [file for file in folder.parent.rglob("*") if file.is_file()] == [blocking]


@pytest.fixture
def seen_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the views in which visibility is decided be small, to be drawn fast."""
    monkeypatch.setattr(fill, "VISIBILITY_SIZE", SIZE)


def fill_command(home: Home, *more: str) -> int:
    return main(["cache", "--fill", str(home.path), "--size", str(SIZE), "--workers", "1", *more])


@pytest.mark.usefixtures("seen_small")
def test_filling_draws_each_view_once(
    folder: Path, home: Home, draws: list[int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert fill_command(home) == 0
    store = view_store()
    assert store is not None
    count = sum(file.poses for file in store.files)
    assert len(draws) == count > 2000 and set(draws) == {SIZE}
    assert f"{used(folder) / 2**20:,.1f} MB" in capsys.readouterr().out
    draws.clear()
    assert fill_command(home) == 0
    assert "0 are missing" in capsys.readouterr().out
    HomeViews(home).look(find_model("drone"), 5, SIZE)
    assert not draws


@pytest.mark.usefixtures("seen_small", "folder")
def test_filling_goes_on_after_an_interruption(home: Home, draws: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    look, missing = HomeViews.look, fill.Filling([str(home.path)], SIZE).missing
    draws.clear()

    def interrupted(views: HomeViews, *place: Any) -> object:
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
    assert sum(fill.draw(jobs, Local(2))) == sum(len(job.poses) for job in jobs) == before - filling.missing


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
