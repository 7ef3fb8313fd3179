"""All that is wrong with a home is listed in one pass, with link, place, measure and way out; odd things warn."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from chmarl_pb.cli import main
from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.check import check_home
from tests.helpers.small_homes import HOMES, SMALL_HOME, Boxes, home_text

Write = Callable[..., Path]
FLOOR = ((4, 4, 0.1), (0, 0, -0.05))
WALL = ((0.1, 4, 2.5), (2.05, 0, 1.25))
CHAIR = (0.45, 0.45, 0.45)


def broken() -> str:
    """Return a home with a mistake of every kind."""
    boxes = {
        **SMALL_HOME,
        "washroom/floor_1": ((2, 2, 0.1), (5, 0, -0.05)),
        "Kitchen/stove1": ((0.4, 0.4, 0.4), (1.0, 0.5, 0.2)),
        "livingroom/nightstand_1": ((0.4, 0.4, 0.1), (-1.5, -0.5, 0.05)),
        "livingroom/couch_1": ((1.8, 0.8, 0.45), (0.5, -1.3, 0.225)),
        "pantry/shelf_1": ((0.3, 0.3, 0.3), (-1.5, 0.5, 0.15)),
    }
    text = home_text(boxes, '<link name="livingroom/tv_1"><visual><geometry><mesh filename="gone.obj"/></geometry>'
                     '</visual></link>\n<joint name="j" type="fixed"><parent link="world"/>'
                     '<child link="livingroom/tv_1"/></joint>\n')  # fmt: skip
    return text.replace('name="to_livingroom/desk_1" type="fixed"', 'name="to_livingroom/desk_1" type="revolute"')


def test_all_problems_are_found_in_one_pass(write_home: Write) -> None:
    report = check_home(write_home(broken()))
    found = {(problem.severity, problem.link) for problem in report.problems}
    assert found >= {
        ("error", "livingroom/desk_1"),  # moves
        ("error", "livingroom/tv_1"),  # its mesh is missing
        ("error", "Kitchen/stove1"),  # its name
        ("error", "pantry/shelf_1"),  # its room has no floor
        ("error", "washroom/floor_1"),  # cannot be reached
        ("error", "livingroom/nightstand_1"),  # too low
        ("warning", "washroom/floor_1"),  # no known kind
        ("warning", "livingroom/couch_1"),  # no known class
    }
    for problem in report.problems:
        assert problem.file == str(report.path) and problem.measured and problem.fix
        assert problem.position is not None and len(problem.position) == 3


def test_joints_that_go_round_are_told_as_that_alone(write_home: Write) -> None:
    text = home_text(SMALL_HOME, '<joint name="round" type="fixed"><parent link="livingroom/floor_1"/>'
                     '<child link="world"/></joint>\n')  # fmt: skip
    told = [str(problem) for problem in check_home(write_home(text)).problems]
    assert "its own ancestor" in told[0] and not any("no parent" in line for line in told)


@pytest.mark.parametrize("name", ["Shapes/mug.OBJ", "Shapes\\Mug.obj"])
def test_a_mesh_whose_name_is_nearly_right(write_home: Write, name: str) -> None:
    path = write_home(home_text(SMALL_HOME, f'<link name="livingroom/tv_1"><visual><geometry><mesh filename="{name}"/>'
                      '</geometry></visual></link>\n<joint name="j" type="fixed"><parent link="world"/>'
                      '<child link="livingroom/tv_1"/></joint>\n'))  # fmt: skip
    (path.parent / "Shapes").mkdir()
    (path.parent / "Shapes" / "Mug.obj").touch()
    assert any("write 'Shapes/Mug.obj'" in str(problem) for problem in check_home(path).errors)


def test_an_environment_tells_the_first_and_how_many_there_are(write_home: Write) -> None:
    with pytest.raises(HomeError, match=r"^[^\n]*revolute[^\n]*\(and \d+ more[^\n]*homes check[^\n]*\)$"):
        load_home(write_home(broken()))


@pytest.mark.parametrize("home", HOMES)
def test_benchmark_homes_have_nothing_odd(home: str) -> None:
    assert check_home(home).problems == ()


ODD: dict[str, tuple[Boxes, str]] = {
    "another name of a class": ({"livingroom/couch_1": (CHAIR, (-1.5, 0, 0.225))}, "'couch'.*'sofa'"),
    "a class misspelt": ({"livingroom/nigthstand_1": (CHAIR, (-1.5, 0, 0.225))}, "'nigthstand'.*'nightstand'"),
    "another name of a room": ({"washroom_2/floor_1": ((2, 4, 0.1), (3, 0, -0.05))}, "'washroom_2'.*'bathroom'"),
    "a thing in another room": (
        {"bedroom/floor_1": ((4, 4, 0.1), (4, 0, -0.05)), "bedroom/chair_1": (CHAIR, (-1.5, 0, 0.225))},
        "says 'bedroom'.*in 'livingroom'",
    ),
    "a thing outside": ({"livingroom/stool_1": (CHAIR, (-3.5, 0, 0.225))}, "outside"),
    "a thing in another": ({"livingroom/stool_1": (CHAIR, (0.5, 1.4, 0.225))}, r"0\.\d\d m deep inside '.*desk_1'"),
    "half in a wall": (
        {"livingroom/wall_1": WALL, "livingroom/chair_1": (CHAIR, (1.9, 0, 0.225))}, "0.10 m deep in the wall",
    ),
    "nothing below": ({"livingroom/stool_1": (CHAIR, (-1.5, 0, 1.225))}, "nothing carries it.*1.00 m"),
}  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_what_is_odd_is_warned_of(write_home: Write, name: str) -> None:
    boxes, words = ODD[name]
    report = check_home(write_home(home_text({**SMALL_HOME, **boxes})))
    assert not report.errors
    assert any(re.search(words, str(problem)) for problem in report.warnings), report.problems


@pytest.mark.parametrize(
    "boxes",
    [
        {"livingroom/wall_1": WALL, "livingroom/chair_1": (CHAIR, (1.775, 0, 0.225))},  # touches the wall
        {"livingroom/wall_1": WALL, "livingroom/picture_1": ((0.04, 0.5, 0.5), (1.98, 0, 1.5))},
        {"livingroom/table_lamp_1": ((0.2, 0.2, 0.4), (0, 1.6, 0.95))},  # stands on the desk
        {"livingroom/rug_1": ((1.5, 1.5, 0.01), (0, 1.3, 0.005))},  # under the desk
        {"bedroom/floor_1": ((4, 4, 0.1), (4, 0, -0.05)), "bedroom/chair_1": (CHAIR, (4, 0, 0.225))},
    ],
    ids=["at a wall", "picture", "lamp", "rug", "two rooms"],
)
def test_what_is_usual_is_not(write_home: Write, boxes: Boxes) -> None:
    assert check_home(write_home(home_text({**SMALL_HOME, **boxes}))).problems == ()


def test_looks_are_compared_with_what_is_solid(write_home: Write) -> None:
    text = home_text()
    desk = text[text.index('<link name="livingroom/desk_1"') : text.index('<joint name="to_livingroom/desk_1"')]
    unseen = re.sub("<visual>.*?</visual>", "", desk)
    moved = desk.replace('xyz="0 1.6 0.375"', 'xyz="0 -0.2 0.375"', 1)
    for other, words in ((unseen, "no <visual>"), (moved, "beside what is solid")):
        (problem,) = check_home(write_home(text.replace(desk, other))).problems
        assert problem.severity == "warning" and words in problem.measured and problem.link == "livingroom/desk_1"


@pytest.mark.parametrize("size", ["120 60 75", "0.0012 0.0006 0.00075"])
def test_looks_in_millimetres_are_noticed(write_home: Write, size: str) -> None:
    """What cannot be seen is no target; tasks to it would be missing without a word."""
    text = home_text()
    desk = text[text.index('<link name="livingroom/desk_1"') : text.index('<joint name="to_livingroom/desk_1"')]
    assert desk.count('size="1.2 0.6 0.75"') == 2
    told = check_home(write_home(text.replace(desk, desk.replace("1.2 0.6 0.75", size, 1)))).problems
    assert any("the right scale" in problem.fix for problem in told)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('size="1.2 0.6 0.75"', 'size="120 60 75"', "measures 120 x 60 x 75 m.* unit is the metre"),
        ("<link name=", '<xacro:bed xmlns:xacro="http://ros.org/wiki/xacro"/><link name=', "run xacro"),
        ('<origin xyz="0 1.6 0.375"', '<origin rpy="0 0 90" xyz="0 1.6 0.375"', "angles are in radians"),
    ],
    ids=["centimetres", "xacro", "degrees"],
)
def test_units_and_macros_are_told_as_what_they_are(write_home: Write, old: str, new: str, words: str) -> None:
    text = home_text()
    assert old in text
    errors = [str(problem) for problem in check_home(write_home(text.replace(old, new))).errors]
    assert any(re.search(words, error) for error in errors), errors


def test_floors_of_two_rooms_touch(write_home: Write) -> None:
    boxes = {**SMALL_HOME, "bedroom/floor_1": ((4, 4, 0.1), (3, 0, -0.05))}
    with pytest.raises(HomeError, match=r"livingroom/floor_1.* it reaches 1\.00 m into the floor of 'bedroom'"):
        load_home(write_home(home_text(boxes)))
    load_home(write_home(home_text({**boxes, "bedroom/floor_1": ((4, 4, 0.1), (3.9, 0, -0.05))})))  # under a wall


def test_a_layout_is_no_home(tmp_path: Path) -> None:
    (tmp_path / "cabin.toml").touch()
    with pytest.raises(HomeError, match=r"is a layout, no home yet; build it: chmarl-pb homes build"):
        load_home(tmp_path / "cabin.toml")


def test_report_as_text_json_and_picture(write_home: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad, picture = write_home(home_text()), write_home(broken(), "bad.urdf"), tmp_path / "marks.png"
    assert main(["homes", "check", str(good)]) == 0
    said = capsys.readouterr()
    assert not said.err and "livingroom  16.0 m2" in said.out and "livingroom/desk_1  0.72 m2 free" in said.out
    assert main(["homes", "check", str(bad), "--preview", str(picture), "--json", "-"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert not report["playable"] and len(report["problems"]) >= 8
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["homes", "check", str(good), "--json", str(tmp_path / "report.json")]) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["playable"] and report["rooms"] == [{"name": "livingroom", "area": 16.0}]
    assert {row["name"] for row in report["receptacles"]} == {"livingroom/desk_1", "livingroom/sofa_1"}
