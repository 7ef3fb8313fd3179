"""Layout files, walls, and the URDFs that the assembler builds from them."""

import os
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from chmarl_pb.assets import SCENES_DIR, URDF_DIR
from chmarl_pb.catalog import BENCHMARK, ROOM_KINDS, class_of, room_kind, room_of
from chmarl_pb.errors import HomeError, OptionError
from chmarl_pb.homes.assemble import build_home
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.layout import load_layout
from chmarl_pb.homes.walls import boundary, pieces
from chmarl_pb.rendering.preview import preview
from tests.helpers.elements import inner

HOMES = [f"home_{number}" for number in range(1, 8)]

GOOD = """
name = "flat"
palette = { oak = "#c59a68" }
room = [
    { name = "kitchen", rect = [0.0, 0.0, 3.0, 3.0], floor = "oak", wall = "#eeeeee" },
    { name = "bedroom", rect = [3.0, 0.0, 6.0, 3.0], floor = "oak", wall = "#dddddd" },
]
door = [
    { between = ["kitchen", "bedroom"], position = [3.0, 1.5], width = 1.0 },
]
furniture = [
    { room = "kitchen", model = "stove_gas", against = "north", at = 1.0 },
    { room = "kitchen", model = "chair_dining", position = [1.5, 1.0], yaw = 30, color = "oak" },
    { room = "kitchen", model = "chair_dining", position = [0.5, 0.5] },
]
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "flat.toml"
    path.write_text(text, encoding="utf-8")
    return path


def links(home: str) -> list[ElementTree.Element]:
    return ElementTree.parse(SCENES_DIR / f"{home}.urdf").getroot().findall("link")


def things(home: str) -> list[str]:
    return [link.attrib["name"] for link in links(home)[1:]]


def receptacle_classes(home: str) -> set[str]:
    return {class_of(name) for name in things(home)} & set(BENCHMARK.receptacles)


def depth(one: np.ndarray, two: np.ndarray) -> float:
    """How far two convex polygons overlap, in metres: the least over the normals of their edges."""
    edges = np.concatenate([np.roll(polygon, -1, axis=0) - polygon for polygon in (one, two)])
    normals = edges[:, ::-1] * [1, -1] / np.linalg.norm(edges, axis=1, keepdims=True)
    first, second = one @ normals.T, two @ normals.T
    return float(np.minimum(first.max(0) - second.min(0), second.max(0) - first.min(0)).min())


@pytest.mark.parametrize("home", HOMES)
def test_committed_home_is_what_its_layout_builds(home: str, tmp_path: Path) -> None:
    built = build_home(SCENES_DIR / f"{home}.toml", tmp_path / f"{home}.urdf")
    assert built.read_bytes() == (SCENES_DIR / f"{home}.urdf").read_bytes()
    for mesh in (tmp_path / "meshes").iterdir():
        assert mesh.read_bytes() == (SCENES_DIR / "meshes" / mesh.name).read_bytes()


@pytest.mark.parametrize("home", HOMES)
def test_links_follow_the_convention(home: str) -> None:
    names = things(home)
    assert len(names) == len(set(names))
    assert links(home)[0].attrib["name"] == "home"
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*/[a-z][a-z_]*_[1-9][0-9]*", name) for name in names)
    for joint in ElementTree.parse(SCENES_DIR / f"{home}.urdf").getroot().findall("joint"):
        assert joint.attrib["type"] == "fixed"
        assert inner(joint, "parent").attrib["link"] == "home"
    assert all(float(inner(link, "inertial/mass").attrib["value"]) == 0 for link in links(home))


@pytest.mark.parametrize("home", HOMES)
def test_equal_material_names_have_equal_colours(home: str) -> None:
    colours: dict[str, str] = {}
    for material in ElementTree.parse(SCENES_DIR / f"{home}.urdf").getroot().iter("material"):
        rgba = inner(material, "color").attrib["rgba"]
        assert colours.setdefault(material.attrib["name"], rgba) == rgba


@pytest.mark.parametrize("home", HOMES)
def test_meshes_lie_in_the_homes_folder(home: str) -> None:
    for mesh in ElementTree.parse(SCENES_DIR / f"{home}.urdf").getroot().iter("mesh"):
        assert re.fullmatch(r"meshes/[a-z0-9_]+\.obj", mesh.attrib["filename"])
        assert (SCENES_DIR / mesh.attrib["filename"]).is_file()


def test_no_mesh_is_left_over() -> None:
    named = {
        mesh.attrib["filename"]
        for home in HOMES
        for mesh in ElementTree.parse(SCENES_DIR / f"{home}.urdf").iter("mesh")
    }
    assert {f"meshes/{file.name}" for file in (SCENES_DIR / "meshes").iterdir()} == named


@pytest.mark.parametrize("home", HOMES)
def test_nothing_overlaps(home: str) -> None:
    loaded = load_home(SCENES_DIR / f"{home}.urdf")
    for one, two in combinations((*loaded.things, *loaded.structure), 2):
        if {one.class_name, two.class_name} <= {"floor", "wall"}:
            continue
        for a, b in product(one.solids, two.solids):
            height = min(a.top, b.top) - max(a.bottom, b.bottom)
            assert height < 0.005 or depth(a.polygon, b.polygon) < 0.005, (one.name, two.name)


@pytest.mark.parametrize("home", HOMES)
def test_size_and_contents_of_a_home(home: str) -> None:
    layout = load_layout(SCENES_DIR / f"{home}.toml")
    kinds = [room_kind(room.name) for room in layout.rooms]
    assert sorted(kind for kind in kinds if kind != "hallway") == sorted(ROOM_KINDS)
    area = sum((x1 - x0) * (y1 - y0) for room in layout.rooms for x0, y0, x1, y1 in room.rects)
    assert 55 <= area <= 130
    assert 35 <= len(layout.furniture) <= 50
    assert len(receptacle_classes(home)) >= 12


def test_all_receptacle_classes_are_in_the_seen_homes() -> None:
    assert set.union(*(receptacle_classes(home) for home in HOMES[:5])) == set(BENCHMARK.receptacles)


@pytest.mark.parametrize("home", HOMES)
def test_corners_of_walls_are_closed(home: str) -> None:
    layout = load_layout(SCENES_DIR / f"{home}.toml")
    reach = layout.wall_thickness / 2
    boxes = []
    for wall in pieces(layout.rects, layout.gaps, layout.wall_thickness):
        low, high = (wall.start, wall.line - reach), (wall.end, wall.line + reach)
        boxes.append((low, high) if wall.axis == "x" else (low[::-1], high[::-1]))
    for wall in boundary(layout.rects):
        for end, dx, dy in product((wall.start, wall.end), (-0.04, 0.04), (-0.04, 0.04)):
            x, y = (end, wall.line) if wall.axis == "x" else (wall.line, end)
            point = np.array([x + dx, y + dy])
            assert any((low <= point).all() and (point <= high).all() for low, high in boxes), (x, y)


def test_names_poses_and_colours(tmp_path: Path) -> None:
    root = ElementTree.parse(build_home(write(tmp_path, GOOD))).getroot()
    names = [link.attrib["name"] for link in root.findall("link")]
    assert names[0] == "home"
    assert {"kitchen/floor_1", "bedroom/floor_1", "kitchen/stove_1", "kitchen/chair_1", "kitchen/chair_2"} < set(names)
    joints = root.findall("joint")
    origins = {inner(joint, "child").attrib["link"]: inner(joint, "origin").attrib for joint in joints}
    assert origins["kitchen/chair_1"] == {"xyz": "1.5 1 0", "rpy": "0 0 0.523599"}
    x, y, z = map(float, origins["kitchen/stove_1"]["xyz"].split())
    assert (x, z) == (1.0, 0.0)
    assert 2.5 < y < 2.95
    chair = inner(root, "link[@name='kitchen/chair_1']")
    assert "rgba_c59a68ff" in {material.attrib["name"] for material in chair.iter("material")}


def test_several_rectangles_make_one_room_without_a_wall_between(tmp_path: Path) -> None:
    rects = "rects = [[0.0, 0.0, 3.0, 3.0], [0.0, 3.0, 2.0, 5.0]]"
    path = write(tmp_path, GOOD.replace("rect = [0.0, 0.0, 3.0, 3.0]", rects))
    layout = load_layout(path)
    assert not any(w.axis == "x" and w.line == 3.0 and w.start < 1.0 < w.end for w in boundary(layout.rects))
    names = [link.attrib["name"] for link in ElementTree.parse(build_home(path)).getroot().findall("link")]
    assert "kitchen/floor_2" in names


BAD = {
    "unknown model": ('model = "stove_gas"', 'model = "stove_coal"', "furniture 1.*stove_coal"),
    "unknown key": ("width = 1.0", "width = 1.0, colour = 3", "door 1.*unknown key 'colour'"),
    "unknown top key": ('name = "flat"', 'name = "flat"\nheight = 2', "unknown key 'height'"),
    "room missing": ('{ room = "kitchen", model = "stove_gas"', '{ room = "cellar", model = "stove_gas"', "'cellar'"),
    "no name": ('name = "flat"', "", "'name' must be"),
    "door off the wall": ("position = [3.0, 1.5]", "position = [2.5, 1.5]", "door 1.*not on a wall"),
    "door past the wall's end": ("position = [3.0, 1.5]", "position = [3.0, 2.75]", "door 1.*not on a wall"),
    "door too narrow": ("width = 1.0", "width = 0.6", "door 1: 'width' must be a number of at least 1.0"),
    "door to no room": ('["kitchen", "bedroom"]', '["kitchen", "attic"]', "door 1: 'between'"),
    "outside its room": ("position = [1.5, 1.0]", "position = [2.9, 1.0]", "furniture 2.*not wholly inside 'kitchen'"),
    "no wall there": ("at = 1.0", "at = 7.0", "furniture 1: no north wall"),
    "against and position": ("at = 1.0", "at = 1.0, yaw = 3", "furniture 1: 'against'"),
    "at without against": ("position = [0.5, 0.5]", "position = [0.5, 0.5], at = 1.0", "furniture 3: 'at' needs"),
    "bad colour": ('color = "oak"', 'color = "pine"', "furniture 2: 'color' must be a colour"),
    "bad colour of the palette": ('{ oak = "#c59a68" }', '{ oak = "#c59a6" }', "palette: 'oak' must be a colour"),
    "bad number": ("yaw = 30", 'yaw = "30"', "furniture 2: 'yaw' must be a number"),
    "off the grid": ("[3.0, 0.0, 6.0, 3.0]", "[3.0, 0.0, 6.1, 3.0]", "room 2.*multiples of 0.25"),
    "empty room": ("[3.0, 0.0, 6.0, 3.0]", "[6.0, 0.0, 3.0, 3.0]", "room 2.*low x"),
    "overlapping rooms": ("[3.0, 0.0, 6.0, 3.0]", "[2.0, 0.0, 6.0, 3.0]", "room 2.*overlaps 'kitchen'"),
    "same room twice": ('name = "bedroom"', 'name = "kitchen"', "room 2.*second room"),
    "unknown kind of room": ('name = "bedroom"', 'name = "attic"', "room 2: unknown room kind 'attic'"),
    "not TOML": ("room = [", "room = [[", "cannot be read as TOML"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_layout_is_refused_with_its_place(case: str, tmp_path: Path) -> None:
    old, new, message = BAD[case]
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new, 1))
    target = tmp_path / "flat.urdf"
    target.write_text("kept")
    with pytest.raises(HomeError, match=f"{re.escape(str(path))}.*{message}"):
        build_home(path)
    assert target.read_text() == "kept"


def test_a_layout_is_not_built_over_itself(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    with pytest.raises(OptionError, match=r"flat\.toml: let the file's name end in \.urdf"):
        build_home(path, path)
    odd = path.rename(tmp_path / "flat.urdf")
    with pytest.raises(OptionError, match=r"flat\.urdf: would be written over"):
        build_home(odd)
    assert list(tmp_path.iterdir()) == [odd] and odd.read_text() == GOOD


@pytest.mark.parametrize("name", ["", ".", ".."])
def test_a_folder_is_no_layout(name: str) -> None:
    with pytest.raises(HomeError, match="is not a regular file"):
        build_home(name)


def test_a_missing_layout_is_refused(tmp_path: Path) -> None:
    with pytest.raises(HomeError, match=r"nowhere\.toml"):
        load_layout(tmp_path / "nowhere.toml")


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(
    "spoil",
    [
        pipe,
        lambda path: os.truncate(path, 50 * 2**30),
        lambda path: path.write_text(f"name = {'[' * 100_000}"),
        lambda path: path.write_text(GOOD + 'door = "' + "x" * 10**6 + '"'),
        lambda path: path.write_text(GOOD.replace("width = 1.0", "width = 1" + "0" * 400)),
    ],
    ids=["pipe", "50 GB", "lists in lists", "long value", "large number"],
)
def test_a_layout_from_strangers_is_refused_in_few_words(spoil: Callable[[Path], object], tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    spoil(path)
    with pytest.raises(HomeError, match=re.escape(str(path))) as caught:
        load_layout(path)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("home", HOMES)
def test_furniture_stands_in_its_own_room(home: str) -> None:
    layout = load_layout(SCENES_DIR / f"{home}.toml")
    for piece in layout.furniture:
        assert (URDF_DIR / "furniture" / f"{piece.model}.urdf").is_file()
        x, y = piece.position[:2]
        assert any(x0 < x < x1 and y0 < y < y1 for x0, y0, x1, y1 in layout.rects[piece.room])
    assert {room_of(name) for name in things(home)} == set(layout.rects)


def test_preview_draws_the_plan_and_the_dolls_house(tmp_path: Path) -> None:
    picture = cv2.imread(str(preview(SCENES_DIR / "home_1.urdf", tmp_path / "home.png", size=(320, 160))))
    assert picture is not None and picture.shape == (160, 320, 3)
    for half in (picture[:, :160], picture[:, 160:]):
        assert 0.3 < (half < 240).any(axis=2).mean() < 0.95


def test_preview_refuses_what_it_cannot_read_or_write(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"home\.txt.*\.png"):
        preview(SCENES_DIR / "home_1.urdf", tmp_path / "home.txt")
    cut = tmp_path / "cut.urdf"
    cut.write_text((SCENES_DIR / "home_1.urdf").read_text()[:5000])
    with pytest.raises(HomeError, match=r"cut\.urdf: not XML"):
        preview(cut, tmp_path / "home.png")
    assert not list(tmp_path.glob("home.*"))


def test_preview_is_not_drawn_over_a_picture_of_the_home(tmp_path: Path) -> None:
    texture = tmp_path / "oak.png"
    texture.write_text("kept")
    with pytest.raises(OptionError, match=r"oak\.png: would be written over"):
        preview(replace(load_home("home_1"), files=(texture,)), texture)
    assert texture.read_text() == "kept"


def test_preview_of_a_missing_home_is_refused(tmp_path: Path) -> None:
    with pytest.raises(HomeError, match=r"none\.urdf"):
        preview(tmp_path / "none.urdf", tmp_path / "home.png")
