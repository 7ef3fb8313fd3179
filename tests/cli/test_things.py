"""``chmarl-pb things``: files become things whole or not at all."""

import threading
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from chmarl_pb.catalog import Catalog
from chmarl_pb.cli import main
from chmarl_pb.homes.catalog_file import load_catalog
from chmarl_pb.homes.furniture import load_model
from chmarl_pb.homes.imports import Wish, add_thing
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
        (("--class", "duck", "--scale", "0.01", "--names", "duck \N{DUCK}"), "--names = \"['duck \N{DUCK}']\" is not"),
        (("--class", "duck", "--scale", "0.01", "--names", "duck \udcff"), "of lower-case letters a to z and digits"),
        (("--class", "duck", "--scale", "0.01", "--held-out", "duck\x7f"), "--held-out = "),
        (("--class", "duck", "--scale", "0.01", "--states", "wet \N{DROPLET}"), "--states = "),
        (("--class", "duck\N{DUCK}", "--scale", "0.01"), "--class = 'duck\N{DUCK}'; a class is lower-case letters"),
        (("--class", "../duck", "--scale", "0.01"), "--class = '../duck'"),
        (("--class", "brick", "--scale", "0.01", "--out", "/dev/full"), "let its name end in .png"),
        (
            ("--class", "brick", "--scale", "0.01", "--out", "/proc/nowhere/b.png"),
            "/proc/nowhere/b.png: cannot be written",
        ),
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


@pytest.mark.parametrize("out", ["paint.png", "link.png"])
def test_a_picture_is_not_drawn_over_what_is_read(out: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"box.mtl": "newmtl m\nmap_Kd paint.png\n"}
    corners = [(x, y, z) for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1)]
    faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"]
    files["box.obj"] = "mtllib box.mtl\nusemtl m\nvt 0 0\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    files["box.obj"] += "".join(f"f {' '.join(f'{corner}/1' for corner in face.split())}\n" for face in faces)
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    Image.new("RGB", (4, 4), "green").save(tmp_path / "paint.png")
    (tmp_path / "link.png").symlink_to("paint.png")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    words = ("--class", "green_box", "--out", str(tmp_path / out))
    assert add(tmp_path / "box.obj", *words, folder=tmp_path) == 2
    assert f"{out}: would be written over, but is read here" in capsys.readouterr().err
    assert before == {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert add(tmp_path / "box.obj", *words[:3], str(tmp_path / "drawn.png"), folder=tmp_path) == 0


def test_a_picture_that_cannot_be_drawn_leaves_the_catalogue_as_it_was(wedge: Path, tmp_path: Path) -> None:
    own = tmp_path / "own"
    assert add(wedge, "--class", "brick", "--scale", "0.01", folder=own) == 0
    before = {path: path.read_bytes() for path in own.iterdir()}
    words = ("--class", "stone", "--scale", "0.01", "--out")
    assert add(wedge, *words, "/proc/nowhere/stone.png", folder=own) == 2
    assert before == {path: path.read_bytes() for path in own.iterdir()}
    assert add(wedge, *words, str(tmp_path / "stone.png"), folder=own) == 0


def test_things_that_are_added_at_once_are_all_there(tmp_path: Path) -> None:
    file, path = tmp_path / "one.urdf", tmp_path / "things.toml"
    file.write_text(urdf([shape(BOX, colour="red")], [shape(BOX)]))
    add_thing(file, Wish("alpha"), path)
    met = threading.Barrier(2)

    def load(catalog_file: Path) -> Catalog:
        with suppress(threading.BrokenBarrierError):
            met.wait(0.5)  # for the other, if both may read before one has written
        return load_catalog(catalog_file)

    threads = [threading.Thread(target=add_thing, args=(file, Wish(name), path, load)) for name in ("beta", "gamma")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {"alpha", "beta", "gamma"} <= set(load_catalog(path).classes)
    assert not list(tmp_path.glob(".*"))


def test_a_catalogue_behind_a_link_is_added_to(wedge: Path, tmp_path: Path) -> None:
    assert add(wedge, "--class", "brick", "--scale", "0.01", folder=tmp_path / "own") == 0
    (tmp_path / "things.toml").symlink_to(tmp_path / "own" / "things.toml")
    assert add(wedge, "--class", "stone", "--scale", "0.01", folder=tmp_path) == 0
    assert {"brick", "stone"} <= set(load_catalog(tmp_path / "things.toml").classes)
    assert (tmp_path / "things.toml").is_symlink() and (tmp_path / "own" / "stone.urdf").is_file()
