"""A home is read from its URDF alone; what is unsafe, broken or unplayable is refused with a message that helps."""

import itertools
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chmarl_pb.cli import main
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import HomeError
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.check import check_home
from chmarl_pb.navigation.free_space import space_of
from tests.helpers.small_homes import SMALL_HOME, Boxes, box, home_text

Write = Callable[..., Path]
GOOD = home_text()
DESK = box("livingroom/desk_1", *SMALL_HOME["livingroom/desk_1"])
FLOOR = box("livingroom/floor_1", *SMALL_HOME["livingroom/floor_1"])


def collision(geometry: str, origin: str = '<origin xyz="0 1 1"/>') -> str:
    """Return a link ``livingroom/box_1`` with one collision, joined to the world."""
    return (
        f'<link name="livingroom/box_1"><collision>{origin}<geometry>{geometry}</geometry></collision></link>\n'
        '<joint name="to_box" type="fixed"><parent link="world"/><child link="livingroom/box_1"/></joint>\n'
    )


def refused(path: Path, *words: str) -> None:
    """Expect a HomeError that names the file and holds all words."""
    with pytest.raises(HomeError) as caught:
        space_of(load_home(path)).lattice  # noqa: B018
    message = str(caught.value)
    assert path.name in message
    for word in words:
        assert re.search(word, message), f"{word!r} is not in {message!r}"


def test_a_home_in_millimetres_is_refused(write_home: Write) -> None:
    def larger(size: re.Match[str]) -> str:
        return f'size="{" ".join(str(1000 * float(word)) for word in size[1].split())}"'

    sizes = re.sub(r'size="([^"]*)"', larger, GOOD)
    assert sizes != GOOD
    refused(write_home(sizes), "metre")


def test_small_home_is_read(write_home: Write) -> None:
    home = load_home(write_home(GOOD))
    assert home.goto_rooms == ("livingroom",) and list(home.receptacles) == ["livingroom/desk_1", "livingroom/sofa_1"]
    assert home.rooms["livingroom"].area == pytest.approx(16)
    assert check_home(home.path).problems == ()


def test_check_lets_pybullet_load_the_home(write_home: Write, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["homes", "check", str(write_home(GOOD))]) == 0
    nameless = re.sub(r"<robot name=\"[^\"]*\"", "<robot", GOOD)
    assert nameless != GOOD
    path = write_home(nameless)
    assert main(["homes", "check", str(path)]) != 0
    assert f"{path}: PyBullet cannot load this URDF" in capsys.readouterr().err


def test_unchanged_file_is_read_once_and_a_changed_one_anew(write_home: Write) -> None:
    path = write_home(GOOD)
    assert load_home(path) is load_home(path)
    before = load_home(path)
    path.write_text(GOOD.replace("desk_1", "bench_1"))
    assert load_home(path) is not before and "livingroom/bench_1" in load_home(path).receptacles


def test_a_changed_mesh_is_noticed(tmp_path: Path, write_home: Write) -> None:
    path = write_home(home_text(extra=collision('<mesh filename="shape.obj"/>')))
    heights, contents = [], set()
    for height in (0.8, 0.4, 0.8):
        trimesh.creation.box((0.4, 0.4, height)).export(tmp_path / "shape.obj")
        home = load_home(path)
        (solid,) = next(thing for thing in home.things if thing.class_name == "box").solids
        heights.append(float(solid.top - solid.bottom))
        contents.add(home.content)
    assert heights == pytest.approx([0.8, 0.4, 0.8]) and len(contents) == 2 and home_hash(str(path)) in contents
    (tmp_path / "shape.obj").unlink()
    with pytest.raises(HomeError, match=r"shape\.obj"):
        load_home(path)


def test_tasks_are_drawn_anew_for_a_changed_home(write_home: Write) -> None:
    path = write_home(home_text())
    first, content = draw_tasks(str(path), 3), home_hash(str(path))
    assert draw_tasks(str(path), 3) is first
    path.write_text(home_text().replace("desk_1", "bench_1"))
    other = draw_tasks(str(path), 3)
    assert home_hash(str(path)) != content
    assert "desk" not in {name for task in other for name in (task.source, task.target)} and first != other


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["not XML", "fix"]),
        ("not xml at all", ["not XML"]),
        (GOOD[:-20], ["not XML"]),
        (GOOD.replace("<?xml", "\x00<?xml"), ["not XML"]),
        ("<sdf/>", ["<sdf>", "<robot>"]),
        (GOOD.replace('name="home">', f'name="home"><!-- {"x" * 1100} -->', 1), ["line 2", "1000"]),
    ],
    ids=["empty", "prose", "cut off", "null byte", "wrong root", "overlong line"],
)
def test_not_a_urdf(write_home: Write, text: str, words: list[str]) -> None:
    refused(write_home(text), *words)


@pytest.mark.parametrize(
    "declaration",
    [
        '<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        '<!DOCTYPE robot [<!ENTITY secret SYSTEM "file:///etc/hostname">]>',
        '<!DOCTYPE robot SYSTEM "http://localhost/evil.dtd">',
        "<!DOCTYPE robot>",
    ],
    ids=["entity bomb", "external entity", "external DTD", "plain DTD"],
)
def test_document_types_are_refused(write_home: Write, declaration: str) -> None:
    text = GOOD.replace('<robot name="home">', f'{declaration}\n<robot name="home">')
    refused(write_home(text), "document types", "DOCTYPE")


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ('<link name="livingroom/desk_1"/>', ["livingroom/desk_1", "2 times", "its own name"]),
        ("<link/>", ["own name"]),
        (
            '<joint name="j" type="fixed"><parent link="nowhere"/><child link="livingroom/desk_1"/></joint>',
            ["'j'", "'nowhere'", "does not exist"],
        ),
        ('<joint name="j" type="fixed"><parent link="world"/></joint>', ["'j'", "does not exist"]),
        (
            '<link name="livingroom/door_1"/><joint name="hinge" type="revolute"><parent link="world"/>'
            '<child link="livingroom/door_1"/></joint>',
            ["'hinge'", "'revolute'", "fixed"],
        ),
        ('<link name="livingroom/door_1"/><joint name="hinge"/>', ["'hinge'", "fixed"]),
        (
            '<joint name="j" type="fixed"><parent link="world"/><child link="livingroom/desk_1"/></joint>',
            ["livingroom/desk_1", "second parent"],
        ),
        ('<link name="island"/>', ["island", "no parent"]),
        (
            '<link name="a"/><link name="b"/>'
            '<joint name="ab" type="fixed"><parent link="a"/><child link="b"/></joint>'
            '<joint name="ba" type="fixed"><parent link="b"/><child link="a"/></joint>',
            ["'a'|'b'", "ancestor|tree"],
        ),
        (
            '<joint name="self" type="fixed"><parent link="world"/><child link="world"/></joint>',
            ["parent|ancestor"],
        ),
        (
            '<link name="livingroom/door_1"/><joint type="fixed"><parent link="world"/>'
            '<child link="livingroom/door_1"/></joint>',
            ["livingroom/door_1", "no name"],
        ),
        (
            '<link name="a"/><link name="b"/><joint name="hinge" type="fixed"><parent link="world"/><child link="a"/>'
            '</joint><joint name="hinge" type="fixed"><parent link="world"/><child link="b"/></joint>',
            ["'hinge'", "twice", "'a'", "'b'", "its own name"],
        ),
    ],
    ids=["duplicate link", "nameless link", "missing parent", "no child", "moving joint", "typeless joint",
         "second parent", "island", "cycle", "own parent", "nameless joint", "duplicate joint"],
)  # fmt: skip
def test_links_and_joints(write_home: Write, extra: str, words: list[str]) -> None:
    refused(write_home(home_text(extra=extra)), *words)


@pytest.mark.parametrize(
    ("geometry", "words"),
    [
        ('<box size="nan 1 1"/>', ["finite|number"]),
        ('<box size="inf 1 1"/>', ["finite|number"]),
        ('<box size="0 1 1"/>', ["above 0"]),
        ('<box size="1 -1 1"/>', ["above 0"]),
        ('<box size="1 1"/>', []),
        ('<box size="a b c"/>', []),
        ("<box/>", []),
        ('<cylinder radius="0.1"/>', []),
        ('<cylinder radius="0" length="1"/>', ["above 0"]),
        ('<sphere radius="nan"/>', ["finite|number"]),
        ("", []),
        ('<capsule radius="1" length="1"/>', []),
    ],
)
def test_bad_geometry(write_home: Write, geometry: str, words: list[str]) -> None:
    refused(write_home(home_text(extra=collision(geometry))), "livingroom/box_1", *words)


@pytest.mark.parametrize("origin", ["nan 0 0", "inf 0 0", "0 0", "a b c"])
def test_bad_pose(write_home: Write, origin: str) -> None:
    extra = collision('<box size="1 1 1"/>', f'<origin xyz="{origin}"/>')
    refused(write_home(home_text(extra=extra)), "livingroom/box_1")


@pytest.mark.parametrize("origin", ["nan 0 0", "0 inf 0", "0 0", "x y z"])
def test_bad_joint_pose(write_home: Write, origin: str) -> None:
    extra = collision('<box size="1 1 1"/>').replace("</joint>", f'<origin xyz="{origin}"/></joint>')
    refused(write_home(home_text(extra=extra)), "livingroom/box_1|to_box")


@pytest.mark.parametrize(
    ("boxes", "words"),
    [
        ({"livingroom/floor_1": ((30, 30, 0.1), (0, 0, -0.05))}, ["900 m2", "400 m2"]),
        ({"livingroom/floor_1": ((70, 1, 0.1), (0, 0, -0.05))}, ["70 m", "60 m"]),
        ({**SMALL_HOME, "livingroom/desk_2": ((11, 11, 0.8), (0, 0, 0.4))}, ["livingroom/desk_2", "100 m2"]),
        ({**SMALL_HOME, "livingroom/lamp_1": ((1, 1, 1), (2000, 0, 0.5))}, ["livingroom/lamp_1", "1,000 m"]),
        ({f"livingroom/wall_{n}": ((1, 1, 1), (0, 0, 1)) for n in range(601)}, ["601 <visual>|601 <collision>"]),
    ],
    ids=["area", "width", "tops", "far away", "collisions"],
)
def test_homes_have_limits(write_home: Write, boxes: Boxes, words: list[str]) -> None:
    path = write_home(home_text(boxes))
    with pytest.raises(HomeError) as caught:
        space_of(load_home(path)).surfaces  # noqa: B018
    for word in words:
        assert re.search(word, str(caught.value))


@pytest.mark.parametrize("rgba", ["1 0 0", "nan 0 0 1", "255 0 0 1", "-1 0 0 1"])
def test_bad_colour(write_home: Write, rgba: str) -> None:
    refused(write_home(home_text(extra=f'<material name="m"><color rgba="{rgba}"/></material>')), "'m'", "rgba")


@pytest.mark.parametrize("size", ["nan 1 1", "1 1", "a b c"])
def test_bad_visual_size(write_home: Write, size: str) -> None:
    extra = collision('<box size="0.1 0.1 0.1"/>').replace(
        "</link>", f'<visual><geometry><box size="{size}"/></geometry></visual></link>'
    )
    refused(write_home(home_text(extra=extra)), "livingroom/box_1")


@pytest.mark.parametrize(
    "name",
    ["../outside.obj", "meshes/../../outside.obj", "/etc/hosts.obj", "file:///etc/hosts.obj", "package://a/b.obj",
     "http://localhost/a.obj"],
)  # fmt: skip
@pytest.mark.parametrize("role", ["collision", "visual"])
def test_mesh_outside_the_folder(tmp_path: Path, name: str, role: str) -> None:
    folder = tmp_path / "home"
    folder.mkdir()
    trimesh.creation.box().export(tmp_path / "outside.obj")
    path = folder / "small.urdf"
    extra = collision(f'<mesh filename="{name}"/>').replace("collision>", f"{role}>")
    path.write_text(home_text(extra=extra))
    refused(path, "livingroom/box_1", "outside|hosts|b.obj|a.obj", "leaves the home's folder")


def test_link_to_a_mesh_outside_the_folder(tmp_path: Path) -> None:
    folder = tmp_path / "home"
    folder.mkdir()
    trimesh.creation.box().export(tmp_path / "outside.obj")
    (folder / "inside.obj").symlink_to(tmp_path / "outside.obj")
    path = folder / "small.urdf"
    path.write_text(home_text(extra=collision('<mesh filename="inside.obj"/>')))
    refused(path, "livingroom/box_1", "leaves the home's folder")


def test_texture_outside_the_folder(write_home: Write) -> None:
    extra = '<material name="m"><texture filename="../secret.png"/></material>'
    refused(write_home(home_text(extra=extra)), "secret.png", "leaves the home's folder")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("missing.obj", None, ["missing.obj", "does not exist"]),
        ("shape.blend", b"x", ["shape.blend", "unknown kind"]),
        ("shape.obj", b"not a mesh", ["shape.obj"]),
        ("shape.obj", b"", ["shape.obj"]),
        ("shape.stl", b"solid nothing\nendsolid", ["shape.stl"]),
        ("shape.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", ["volume"]),
        ("shape.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n", ["finite|volume"]),
    ],
    ids=["missing", "unknown kind", "prose", "empty", "no faces", "flat", "NaN"],
)
def test_bad_mesh(tmp_path: Path, write_home: Write, name: str, content: bytes | None, words: list[str]) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    refused(write_home(home_text(extra=collision(f'<mesh filename="{name}"/>'))), "livingroom/box_1", *words)


@pytest.mark.parametrize("scale", ["nan 1 1", "0 1 1", "1 1", "x"])
def test_bad_mesh_scale(tmp_path: Path, write_home: Write, scale: str) -> None:
    trimesh.creation.box().export(tmp_path / "shape.obj")
    extra = collision(f'<mesh filename="shape.obj" scale="{scale}"/>')
    refused(write_home(home_text(extra=extra)), "livingroom/box_1")


def test_mesh_beside_the_home_counts_as_its_hull(tmp_path: Path, write_home: Write) -> None:
    trimesh.creation.box((0.4, 0.4, 0.8)).export(tmp_path / "shape.obj")
    home = load_home(write_home(home_text(extra=collision('<mesh filename="shape.obj"/>'))))
    (solid,) = next(thing for thing in home.things if thing.class_name == "box").solids
    assert (solid.bottom, solid.top) == pytest.approx((0.6, 1.4))
    np.testing.assert_allclose(solid.high - solid.low, (0.4, 0.4), atol=1e-6)


@pytest.mark.parametrize(
    ("boxes", "words"),
    [
        ({"livingroom/desk_1": SMALL_HOME["livingroom/desk_1"]}, ["no floor", "floor_1"]),
        ({"livingroom/floor_1": ((4, 4, 0.1), (0, 0, 0.5))}, ["livingroom/floor_1", "z = 0"]),
        ({"livingroom/floor_1": ((4, 4, 0.1), (0, 0, -1))}, ["livingroom/floor_1", "z = 0"]),
        ({**SMALL_HOME, "Desk": ((1, 1, 1), (1, 0, 0.5))}, ["'Desk'", "<room>/<class>_<number>"]),
        ({**SMALL_HOME, "livingroom/desk": ((1, 1, 1), (1, 0, 0.5))}, ["'livingroom/desk'", "<number>"]),
        ({**SMALL_HOME, "attic/desk_1": ((1, 1, 1), (1, 0, 0.5))}, ["attic/desk_1", "attic/floor_1"]),
        (
            {**SMALL_HOME, "kitchen/floor_1": ((3, 3, 0.1), (10, 0, -0.05))},
            ["'livingroom'|'kitchen'", "cannot be reached"],
        ),
        ({"livingroom/floor_1": ((0.1, 0.1, 0.1), (0.6, 0.6, -0.05))}, ["livingroom", "cannot be reached"]),
        (
            {**SMALL_HOME, "livingroom/wall_1": ((4, 4, 2.6), (0, 0, 1.3))},
            ["livingroom", "cannot be reached"],
        ),
    ],
    ids=["no floor", "floor too high", "floor too low", "free name", "no number", "room without floor",
         "unreachable room", "floor between the lattice points", "no free floor"],
)  # fmt: skip
def test_rooms(write_home: Write, boxes: Boxes, words: list[str]) -> None:
    refused(write_home(home_text(boxes)), *words)


def test_floor_without_collision(write_home: Write) -> None:
    visual = re.sub("<collision>.*?</collision>", "", FLOOR)
    refused(write_home(GOOD.replace(FLOOR, visual)), "livingroom/floor_1", "collision")


@pytest.mark.parametrize("name", ["home_99", "/no/such/file.urdf", "", ".", "home_1.urdf/.."])
def test_unknown_home(name: str) -> None:
    with pytest.raises(HomeError, match=r"no such home.*home_1"):
        load_home(name)


def test_environment_refuses_a_bad_home(write_home: Write) -> None:
    with pytest.raises(HomeError, match=r"bad\.urdf"):
        HouseholdEnv(home=write_home("<robot/>", "bad.urdf"))


def test_environment_refuses_a_home_with_too_many_things_or_no_room_to_go_to(write_home: Write) -> None:
    crowd = {f"livingroom/ornament_{n}": ((0.1, 0.1, 0.1), (1.5, -1.5 + 0.04 * n, 0.05)) for n in range(70)}
    with pytest.raises(HomeError, match=r"crowd.*72 things.*64"):
        HouseholdEnv(home=write_home(home_text({**SMALL_HOME, **crowd}), "crowd.urdf"))
    with pytest.raises(HomeError, match=r"hall.*no room is one of"):
        HouseholdEnv(home=write_home(GOOD.replace("livingroom/", "hallway/"), "hall.urdf"))


@pytest.mark.parametrize("kept", [["livingroom/floor_1"], ["livingroom/floor_1", "livingroom/desk_1"]])
def test_home_with_too_few_receptacles_has_no_tasks(write_home: Write, kept: list[str]) -> None:
    path = write_home(home_text({name: SMALL_HOME[name] for name in kept}))
    assert any("at least two classes" in problem.measured for problem in check_home(path).errors)
    with pytest.raises(HomeError, match="at least two classes"):
        HouseholdEnv(home=path)


def test_receptacle_that_is_only_drawn_is_reported_and_never_a_target(write_home: Write) -> None:
    drawn = re.sub("<collision>.*?</collision>", "", DESK.replace("desk_1", "desk_2"))
    path = write_home(home_text(extra=drawn))
    assert list(load_home(path).receptacles) == ["livingroom/desk_1", "livingroom/sofa_1"]
    assert [problem.link for problem in check_home(path).errors] == ["livingroom/desk_2"]


@pytest.mark.parametrize("number", range(1, 8))
def test_benchmark_home_has_no_problems(number: int) -> None:
    report = check_home(f"home_{number}")
    assert report.problems == () and all(top.reached for top in report.tops.values())
    home = report.home
    assert home is not None
    assert len({thing.class_name for thing in home.receptacles.values()}) >= 12
    assert home.goto_rooms == ("kitchen", "bedroom", "bathroom", "livingroom")


def test_homes_of_training_hold_all_receptacle_classes() -> None:
    homes = [load_home(f"home_{number}") for number in range(1, 6)]
    assert len({thing.class_name for home in homes for thing in home.receptacles.values()}) == 16


def test_files_that_a_mesh_names_stay_in_the_folder(tmp_path: Path) -> None:
    (tmp_path / "cube.mtl").write_text("newmtl m\nmap_Kd ../../secret.png\n")
    (tmp_path / "cube.obj").write_text(
        "mtllib cube.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"
    )
    home = tmp_path / "home.urdf"
    home.write_text(
        '<robot name="h"><link name="home"/>\n<link name="kitchen/stove_1"><visual><geometry>\n'
        '<mesh filename="cube.obj"/></geometry></visual></link>\n<joint name="j" type="fixed">\n'
        '<parent link="home"/><child link="kitchen/stove_1"/></joint></robot>'
    )
    with pytest.raises(HomeError, match=r"kitchen/stove_1.*secret\.png"):
        load_home(home)


def test_a_very_long_chain_of_links_is_read(tmp_path: Path) -> None:
    names = ["home", *(f"frame_{number}" for number in range(1500))]
    joints = itertools.pairwise(names)
    home = tmp_path / "home.urdf"
    lines = [f'<link name="{name}"/>' for name in names]
    lines += [
        f'<joint name="to_{child}" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'
        for parent, child in joints
    ]
    home.write_text("\n".join(['<robot name="h">', *lines, "</robot>"]))
    with pytest.raises(HomeError, match="no floor"):
        load_home(home)
