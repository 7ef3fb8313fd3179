"""Catalogue files: own classes stand after the benchmark's, and broken files are refused with one clear line."""

import pickle
from pathlib import Path

import pytest

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import AssetError
from chmarl_pb.homes.catalog_file import load_catalog
from chmarl_pb.homes.imports import Wish, add_thing
from tests.helpers.own_things import BOX, CATALOG, CRATE, POST, shape, urdf, write_things


def test_own_classes_stand_after_the_benchmark_s(tmp_path: Path) -> None:
    known = load_catalog(write_things(tmp_path))
    count = len(BENCHMARK.rows)
    assert known.rows[:count] == BENCHMARK.rows and known.states[: len(BENCHMARK.states)] == BENCHMARK.states
    assert {**known.class_ids, **BENCHMARK.class_ids} == known.class_ids
    assert [row.name for row in known.rows[count:]] == ["striped_crate", "post", "workbench", "easel"]
    assert known.class_ids["easel"] == count + 4 and known.states[-1] == "sealed"
    assert list(known.graspables)[:45] == list(BENCHMARK.graspables) and "workbench" in known.receptacles
    assert [(name.text, name.held_out) for name in known.classes["striped_crate"].names] == [
        ("striped crate", False), ("wooden crate", False), ("slatted crate", True),
    ]  # fmt: skip


def test_catalogue_is_a_value(tmp_path: Path) -> None:
    known = load_catalog(write_things(tmp_path / "one"))
    again = pickle.loads(pickle.dumps(known))
    assert again == known and hash(again) == hash(known) and again.rows == known.rows
    assert load_catalog(write_things(tmp_path / "two")) == known
    assert known != BENCHMARK and BENCHMARK == pickle.loads(pickle.dumps(BENCHMARK))


def test_content_follows_the_files(tmp_path: Path) -> None:
    path = write_things(tmp_path)
    before = load_catalog(path).content
    (tmp_path / "post.urdf").write_text(POST.replace("0.4", "0.5"))
    assert load_catalog(path).content != before


def test_object_stands_under_its_collision_box_however_its_file_places_it(tmp_path: Path) -> None:
    files = dict(load_catalog(write_things(tmp_path)).classes["striped_crate"].model)
    text = files["striped_crate.urdf"].decode()
    assert '<box size="0.12000 0.10000 0.08000"/>' in text and '<origin xyz="0 0 0.04000"/>' in text
    corners = [list(map(float, line.split()[1:])) for name, file in files.items() if name.endswith(".obj")
               for line in file.decode().splitlines() if line.startswith("v ")]  # fmt: skip
    assert min(x for x, _, _ in corners) == pytest.approx(-0.0605) and min(z for _, _, z in corners) == pytest.approx(
        -0.0005
    )


ROW = '[[graspable]]\nclass = "thing"\nurdf = "crate.urdf"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "0 rows"),
        ("[[graspable]\n", "not TOML"),
        ("[[grasable]]\n", "'grasable' is not known; did you mean 'graspable'"),
        ("graspable = 3\n", "not a list of tables"),
        ('[[graspable]]\nurdf = "crate.urdf"\n', r"\[\[graspable\]\] 1: class = 'None'"),
        (ROW + 'nmaes = ["x"]\n', r"1 \('thing'\): 'nmaes' is no key of such a row; did you mean 'names'"),
        (ROW + ROW, r"2 \('thing'\): class 'thing' stands twice"),
        (ROW.replace("thing", "mug"), "class 'mug' is one of the benchmark's"),
        (ROW.replace("thing", "wall"), "part of every home"),
        (ROW.replace("thing", "Thing 1"), "lower-case letters"),
        (ROW.replace("thing", "thing_2"), "letters at both ends"),
        (ROW.replace("crate.urdf", "crat.urdf"), "no such file beside the catalogue file; did you mean 'crate.urdf'"),
        (ROW.replace("crate.urdf", "../crate.urdf"), "leaves the thing's folder"),
        (ROW.replace('urdf = "crate.urdf"\n', ""), "urdf is missing"),
        pytest.param(ROW.replace("crate.urdf", "x" * 9000), "urdf", id="long"),
        (ROW + 'names = ["coffee mug"]\n', "'coffee mug' names a mug"),
        (ROW + 'names = ["a Big thing"]\n', "names .*without an article"),
        (ROW + 'names = "crate"\n', "not a list of at most"),
        (ROW + 'names = ["crate", "crate"]\n', "names one twice"),
        (ROW + 'states = ["held"]\n', "'held' is what the world says"),
        (ROW + 'places = ["dsk", "sofa"]\n', "'dsk' is no receptacle; did you mean 'desk'"),
        (ROW + 'places = ["desk"]\n', "at least two"),
        (ROW + "places = []\n", "at least two"),
        (ROW + 'models = ["crate.urdf"]\n', "no key of such a row"),
        ('[[receptacle]]\nclass = "shelf"\nmodels = ["nothing.urdf"]\n', "no such file"),
        pytest.param("[[graspable]]\n" * 300, "300 rows", id="many"),
    ],
)
def test_broken_catalogue_is_refused_by_row(text: str, words: str, tmp_path: Path) -> None:
    path = write_things(tmp_path, text)
    with pytest.raises(AssetError, match=words) as raised:
        load_catalog(path)
    assert str(raised.value).startswith(str(path)) and "\n" not in str(raised.value) and len(str(raised.value)) < 600


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (CRATE.replace("0.12 0.1 0.08", "0.52 0.1 0.08"), "too big to grasp"),
        (CRATE.replace("0.12 0.1 0.08", "0.004 0.1 0.08"), "too small to grasp"),
        (CRATE.replace('mass value="0.4"', 'mass value="7"'), "weighs 7 kg"),
        (urdf([shape(BOX)], [shape(BOX)], None), "no mass"),
        (urdf([shape(BOX)], []), "no <collision>"),
        (CRATE.replace("</link>", f'</link><link name="b"><visual>{shape(BOX)}</visual></link>'), "no parent"),
        (
            CRATE.replace(
                "</link>",
                f'</link>\n<link name="b"><visual>{shape(BOX)}</visual></link>\n<joint name="j" type="fixed">'
                '<parent link="base"/><child link="b"/></joint>',
            ),
            "2 links have geometry",
        ),
        (CRATE.replace(BOX, '<mesh filename="gone.obj"/>'), "does not exist"),
        ("<robot", "not XML"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><robot name="r"/>', "refused"),
    ],
)
def test_broken_object_is_refused_by_row(text: str, words: str, tmp_path: Path) -> None:
    path = write_things(tmp_path, ROW)
    (tmp_path / "crate.urdf").write_text(text)
    with pytest.raises(AssetError, match=words) as raised:
        load_catalog(path)
    assert f"{path}: [[graspable]] 1 ('thing'): urdf" in str(raised.value)


def test_other_collisions_count_as_the_box_around_all(tmp_path: Path) -> None:
    two = urdf([shape(BOX)], [shape(BOX), shape('<sphere radius="0.05"/>', "0.1 0 0")])
    path = write_things(tmp_path, ROW)
    (tmp_path / "crate.urdf").write_text(two)
    text = dict(load_catalog(path).classes["thing"].model)["thing.urdf"].decode()
    assert text.count("<collision>") == 1 and '<box size="0.21' in text


def test_missing_file_says_what_makes_one(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="does not exist; `chmarl-pb things add`"):
        load_catalog(tmp_path / "none.toml")


def test_sample_is_good_as_written(tmp_path: Path) -> None:
    assert CATALOG.count("class =") == 4 and load_catalog(write_things(tmp_path)).content


def own_classes(path: Path) -> list[str]:
    return [row.name for row in load_catalog(path).rows[len(BENCHMARK.rows) :]]


def test_ids_stay_where_rows_have_an_order(tmp_path: Path) -> None:
    path = write_things(tmp_path)
    for order, name in enumerate(("easel", "workbench", "striped_crate", "post"), start=1):
        path.write_text(path.read_text().replace(f'class = "{name}"\n', f'class = "{name}"\norder = {order}\n'))
    assert own_classes(path) == ["easel", "workbench", "striped_crate", "post"]
    path.write_text(path.read_text().replace("order = 4", "order = 3"))
    with pytest.raises(AssetError, match="order = 3 stands twice; give every row its own, the next is 4"):
        load_catalog(path)
    path.write_text(path.read_text().replace("order = 3\n", "", 1))
    with pytest.raises(AssetError, match="order is missing; as other rows have one, give each a whole"):
        load_catalog(path)


def test_what_is_imported_shifts_no_ids(tmp_path: Path) -> None:
    (tmp_path / "crate.urdf").write_text(CRATE)
    path = tmp_path / "my_things.toml"
    for name, kind in (("stand", "receptacle"), ("toolbox", "graspable"), ("shelf_unit", "receptacle")):
        add_thing(tmp_path / "crate.urdf", Wish(name, kind), path)  # type: ignore[arg-type]
    assert own_classes(path) == ["stand", "toolbox", "shelf_unit"]
    path.write_text(path.read_text().replace("order = 2\n", "").replace("order = 1\n", "").replace("order = 3\n", ""))
    add_thing(tmp_path / "crate.urdf", Wish("jewel_box"), path)
    assert own_classes(path) == ["toolbox", "jewel_box", "stand", "shelf_unit"], "no order where other rows have none"
