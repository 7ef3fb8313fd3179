"""Layout files: lines of mistakes, the schema for editors, the starter, and building while the file is edited."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import tomllib
from hypothesis import given, settings
from hypothesis import strategies as st

from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.cli import main
from chmarl_pb.errors import HomeError
from chmarl_pb.homes.layout import SCHEMA, STARTER, STYLES, load_layout
from chmarl_pb.homes.toml_lines import Place, lines_of

SCHEMA_ROWS = json.loads(SCHEMA.read_text())
LAYOUTS = [*STYLES.values(), *sorted(SCENES_DIR.glob("home_*.toml"))]


def places(value: Any, place: Place = ()) -> Iterator[Place]:
    """Yield the place of every value of a parsed file."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*place, key)
        yield from places(inner, (*place, key))


@pytest.mark.parametrize("path", LAYOUTS, ids=lambda path: path.stem)
def test_every_value_of_a_layout_has_its_line(path: Path) -> None:
    text = path.read_text()
    lines, rows = lines_of(text), text.splitlines()
    for place in places(tomllib.loads(text)):
        if isinstance(place[-1], str):
            assert re.search(rf"\b{place[-1]}\b", rows[lines[place] - 1]), place


KEYS = st.sampled_from(["a", "b", "c-d", "e_1"])
PLAIN = st.sampled_from(
    ["1", "-2.5", "true", '"x"', "'y]'", '"""\nz\n"""', '"\\"}"', "1979-05-27 07:32:00", "[ 1, 2 ]", "{}"]
)
ROWS = st.recursive(
    PLAIN,
    lambda inner: st.lists(inner, max_size=3).map(
        lambda rows: "[ # ] first\n" + "".join(f"  {row},\n" for row in rows) + "]"
    ),
    max_leaves=6,
)


@settings(max_examples=60)
@given(st.dictionaries(KEYS, ROWS, max_size=3), st.lists(st.dictionaries(KEYS, ROWS, max_size=3), max_size=3))
def test_lines_are_those_of_any_toml(top: dict[str, str], tables: list[dict[str, str]]) -> None:
    text = "".join(f"{key} = {value} # = [\n" for key, value in top.items())
    for table in tables:
        text += "\n[[table]]\n" + "".join(f'"{key}" = {value}\n' for key, value in table.items())
    lines, rows = lines_of(text), text.splitlines()
    for place in places(tomllib.loads(text)):
        if isinstance(place[-1], str) and place != ("table",):
            assert re.match(rf'\s*"?{place[-1]}"? =', rows[lines[place] - 1]), (place, text)
        elif len(place) == 2 and place[0] == "table":
            assert rows[lines[place] - 1] == "[[table]]"


def test_all_mistakes_are_told_at_once_each_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "home.toml"
    text = STARTER.read_text()
    spoilt = [
        ('model = "stove_gas"', 'model = "stove_coal"'),
        ("at = 5.0", "at = 50.0"),
        ("width = 1.25", "width = 0.5"),
    ]
    for old, new in spoilt:
        text = text.replace(old, new, 1)
    path.write_text(text)
    with pytest.raises(HomeError) as caught:
        load_layout(path)
    told = str(caught.value).splitlines()
    assert len(told) == len(spoilt)
    for _, new in spoilt:
        line = next(number for number, row in enumerate(text.splitlines(), start=1) if new in row)
        assert any(row.startswith(f"{path}:{line}: ") for row in told), (new, told)


def test_mistakes_of_the_head_are_told_with_those_of_rooms(tmp_path: Path) -> None:
    path = tmp_path / "home.toml"
    path.write_text('name = "A"\npalette = { oak = "x" }\nwall_height = "d"\n[[room]]\nname = "kitchen"\n')
    with pytest.raises(HomeError) as caught:
        load_layout(path)
    assert {row.removeprefix(f"{path}:")[0] for row in str(caught.value).splitlines()} == set("1234")


@pytest.mark.parametrize("path", LAYOUTS, ids=lambda path: path.stem)
def test_layouts_follow_the_schema(path: Path) -> None:
    jsonschema.validate(tomllib.loads(path.read_text()), SCHEMA_ROWS)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('name = "my_home"', 'name = "My home"'),
        ('name = "my_home"', 'name = "my_home"\nheight = 3'),
        ('name = "bedroom"', 'name = "attic"'),
        ("width = 1.25", "width = 0.5"),
        ("rect = [0.0, 0.0,", "rect = [0.0, 0.1,"),
        ("rect = [0.0, 0.0,", "rect = [0.0,"),
        ('floor = "oak", ', ""),
        ('against = "north"', 'against = "up"'),
        ("position = [3.5, 3.3]", "position = [3.5, 3.3], at = 1, against = 'north'"),
        ("z = 1.6", "z = -1"),
        ('room = "kitchen", ', ""),
    ],
)
def test_what_the_schema_refuses_is_refused(old: str, new: str, tmp_path: Path) -> None:
    text = STARTER.read_text()
    assert old in text
    spoilt = text.replace(old, new, 1)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(spoilt), SCHEMA_ROWS)
    (tmp_path / "home.toml").write_text(spoilt)
    with pytest.raises(HomeError):
        load_layout(tmp_path / "home.toml")


def test_the_starter_is_built_and_good(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    layout = tmp_path / "cabin.toml"
    assert main(["homes", "new", str(layout)]) == 0
    assert main(["homes", "new", str(layout)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert (tmp_path / "layout.schema.json").is_file()
    assert main(["homes", "build", str(layout)]) == 0
    assert main(["homes", "check", str(tmp_path / "cabin.urdf")]) == 0


def test_a_schema_of_others_is_left_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    schema = tmp_path / "layout.schema.json"
    schema.write_text("{}")
    assert main(["homes", "new", str(tmp_path / "cabin.toml")]) == 0
    assert schema.read_text() == "{}" and f"{schema} is there already and differs" in capsys.readouterr().out
    schema.unlink()
    for name in ("a.toml", "b.toml"):
        assert main(["homes", "new", str(tmp_path / name)]) == 0
    assert schema.is_file() and "differs" not in capsys.readouterr().out


BY_HAND = """<?xml version='1.0' encoding='utf-8'?>
<robot name="cabin">
  <link name="home">
    <inertial>
      <mass value="0" />
    </inertial>
  </link>
</robot>
"""


@pytest.mark.parametrize("text", ["<robot name='mine'/>", BY_HAND, "\x00\xff"])
def test_a_home_by_hand_is_not_built_over(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    layout, home = tmp_path / "cabin.toml", tmp_path / "cabin.urdf"
    layout.write_text(STARTER.read_text())
    home.write_text(text)
    assert main(["homes", "build", str(layout)]) == 2
    said = capsys.readouterr().err
    assert f"{home} is there already and was not built from a layout; name another file by --out" in said
    assert home.read_text() == text and sorted(tmp_path.iterdir()) == [layout, home]
    assert main(["homes", "build", str(layout), "--out", str(home)]) == 0
    layout.write_text(layout.read_text().replace("stove_gas", "stove_electric"))
    assert main(["homes", "build", str(layout)]) == 0, "it has been built by now"
    home.write_bytes(home.read_bytes().replace(b"\n", b"\r\n"))
    assert main(["homes", "build", str(layout)]) == 0, "as a checkout on Windows has it"
    home.write_text(home.read_text().replace("</robot>", "  <!-- mine -->\n</robot>"))
    assert main(["homes", "build", str(layout)]) == 2


@pytest.mark.parametrize("home", sorted(SCENES_DIR.glob("*.urdf")), ids=lambda path: str(path.stem))
def test_homes_of_all_versions_are_known_as_built(home: Path, tmp_path: Path) -> None:
    (tmp_path / "cabin.toml").write_text(STARTER.read_text())
    shutil.copy(home, tmp_path / "cabin.urdf")
    assert main(["homes", "build", str(tmp_path / "cabin.toml")]) == 0


def test_a_mesh_by_hand_is_not_built_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    layout = tmp_path / "cabin.toml"
    layout.write_text(STARTER.read_text())
    assert main(["homes", "build", str(layout)]) == 0
    mesh = sorted((tmp_path / "meshes").iterdir())[0]
    content = mesh.read_bytes()
    mesh.write_text("older")
    assert main(["homes", "build", str(layout)]) == 0 and mesh.read_bytes() == content, "the home beside it names it"
    (tmp_path / "cabin.urdf").unlink()
    mesh.write_text("mine")
    for words in ([], ["--out", str(tmp_path / "other.urdf")]):
        assert main(["homes", "build", str(layout), *words]) == 2
        assert f"{mesh} is there already, differs" in capsys.readouterr().err
    assert mesh.read_text() == "mine" and not list(tmp_path.glob("*.urdf"))


def test_a_watched_layout_is_built_when_it_is_saved(tmp_path: Path) -> None:
    layout, home = tmp_path / "cabin.toml", tmp_path / "cabin.urdf"
    text = STARTER.read_text()
    layout.write_text(text.replace("stove_gas", "stove_coal"))
    command = [sys.executable, "-m", "chmarl_pb.cli", "homes", "build", str(layout), "--watch"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as watching:
        try:
            assert watching.stderr is not None and watching.stdout is not None
            assert "unknown model 'stove_coal'" in watching.stderr.readline()
            assert not home.exists()
            layout.write_text(text)
            assert str(home) in watching.stdout.readline()
            assert home.with_suffix(".png").is_file()
            home.with_suffix(".png").write_text("mine")
            layout.write_text(f"{text}\n")
            assert f"{home.with_suffix('.png')} is there already" in watching.stderr.readline()
            assert home.with_suffix(".png").read_text() == "mine"
        finally:
            watching.kill()
