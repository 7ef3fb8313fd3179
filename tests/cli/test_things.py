"""``chmarl-pb things``: files become things whole or not at all."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chmarl_pb.cli import main
from chmarl_pb.homes.catalog_file import load_catalog
from chmarl_pb.homes.furniture import load_model
from tests.helpers.own_things import BOX, shape, urdf


@pytest.fixture
def wedge(tmp_path: Path) -> Path:
    """A mesh in centimetres whose y points up: 30 wide, 20 high, 10 deep, away from its origin."""
    mesh = trimesh.creation.box((30, 20, 10))
    mesh.apply_translation((100, 50, -7))
    path = tmp_path / "wedge.stl"
    mesh.export(path)
    return path


def add(file: Path, *words: str, folder: Path) -> int:
    return main(["things", "add", str(file), "--catalog", str(folder / "things.toml"), *words])


def test_mesh_becomes_an_object(wedge: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = (
        "--class",
        "brick",
        "--scale",
        "0.01",
        "--up",
        "y",
        "--names",
        "some clay",
        "--out",
        str(tmp_path / "b.png"),
    )
    assert add(wedge, *words, folder=tmp_path / "own") == 0
    shown = capsys.readouterr().out
    assert "0.300 x 0.100 x 0.200 m" in shown and "brick, some clay".replace("some ", "") in shown
    assert (tmp_path / "b.png").stat().st_size > 1000
    row = load_catalog(tmp_path / "own" / "things.toml").classes["brick"]
    assert row.names[1].number == "mass" and b'<box size="0.30000 0.10000 0.20000"/>' in row.model[0][1]
    assert main(["things", "check", str(tmp_path / "own" / "things.toml")]) == 0
    assert main(["things", "list", "--catalog", str(tmp_path / "own" / "things.toml")]) == 0
    assert "  94 graspable  brick" in capsys.readouterr().out


def test_furniture_stands_where_its_layout_puts_it(wedge: Path, tmp_path: Path) -> None:
    table = tmp_path / "table.urdf"
    top, leg = shape('<box size="1 0.5 0.04"/>', "2 0 0.7"), shape('<box size="0.1 0.1 0.68"/>', "2 0 0.34")
    table.write_text(urdf([top, leg], [top, leg]))
    assert add(table, "--class", "lectern", "--kind", "receptacle", folder=tmp_path) == 0
    known = load_catalog(tmp_path / "things.toml")
    model = load_model("lectern", known)
    assert model.thing_class == "lectern" and len(model.link.collisions) == 2
    assert np.allclose([*model.low, *model.high], [-0.5, -0.25, 0, 0.5, 0.25, 0.72], atol=1e-4)
    assert load_model(str(tmp_path / "lectern.urdf"), known).thing_class == "lectern"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--class", "mug", "--scale", "0.01"), "one of the benchmark's"),
        (("--class", "Brick", "--scale", "0.01"), "lower-case letters"),
        (("--class", "brick"), "too big to grasp"),
        (("--class", "brick", "--scale", "0.0001"), "too small to grasp"),
        (("--class", "brick", "--scale", "0.01", "--mass", "9"), "weighs 9 kg"),
        (("--class", "brick", "--scale", "nan"), "a scale of nan"),
        (("--class", "brick", "--scale", "0.01", "--names", "the Brick"), "without an article"),
        (("--class", "shed", "--kind", "scenery"), "furniture has at most 4 m"),
    ],
)
def test_refused_file_leaves_nothing_behind(
    words: tuple[str, ...], message: str, wedge: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own").mkdir()
    assert add(wedge, *words, folder=tmp_path / "own") == 2
    shown = capsys.readouterr().err
    assert message in shown and shown.count("\n") == 1 and ".tmp" not in shown
    assert not list((tmp_path / "own").iterdir())


def test_second_thing_stands_after_the_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "one.urdf"
    file.write_text(urdf([shape(BOX, colour="red")], [shape(BOX)]))
    assert add(file, "--class", "alpha", folder=tmp_path) == add(file, "--class", "beta", folder=tmp_path) == 0
    before = (tmp_path / "things.toml").read_text()
    assert add(file, "--class", "beta", folder=tmp_path) == 2
    assert "is there already" in capsys.readouterr().err and (tmp_path / "things.toml").read_text() == before
    ids = load_catalog(tmp_path / "things.toml").class_ids
    assert ids["beta"] == ids["alpha"] + 1 == 95
