"""The catalogue holds the benchmark's classes, exactly."""

from collections.abc import Callable
from pathlib import Path

import pytest

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import AssetError

GRASPABLES = """apple banana board_game book bowl bread candle cereal_box chocolate_syrup clock coffee_pot cooking_pot
    cupcake cushion face_cream folder fork frying_pan glass hairbrush juice_box knife lime lotion magazine milk_carton
    mobile_phone mug notes peach plate remote_control shampoo slippers sports_ball teddy_bear toothbrush toothpaste
    towel toy_car washing_sponge water_bottle whipped_cream wine_bottle wine_glass""".split()
RECEPTACLES = """bathroom_counter bed bench bookshelf cabinet chair coffee_table desk dresser kitchen_counter
    kitchen_table nightstand sofa stove towel_rack tv_stand""".split()


def test_classes_are_those_of_the_benchmark() -> None:
    assert list(BENCHMARK.graspables) == GRASPABLES and len(GRASPABLES) == 45
    assert list(BENCHMARK.receptacles) == RECEPTACLES and len(RECEPTACLES) == 16
    assert catalog.ROOM_KINDS == ("kitchen", "bedroom", "bathroom", "livingroom")


def test_no_class_stands_twice() -> None:
    tables = (
        BENCHMARK.graspables,
        BENCHMARK.receptacles,
        BENCHMARK.scenery,
        BENCHMARK.rooms,
        BENCHMARK.robots,
    )
    assert len(BENCHMARK.classes) == sum(map(len, tables))
    assert not set(catalog.STRUCTURE) & set(BENCHMARK.classes)


@pytest.mark.parametrize("row", BENCHMARK.classes.values(), ids=lambda row: row.name)
def test_row_is_complete(row: catalog.ThingClass) -> None:
    assert row.states and set(row.states) <= set(BENCHMARK.states)
    assert row.synonyms and row.noun == row.name.replace("_", " ")
    assert len(set(row.synonyms)) == len(row.synonyms)


@pytest.mark.parametrize("table", [BENCHMARK.graspables, BENCHMARK.receptacles])
def test_a_word_names_one_class(table: dict[str, catalog.ThingClass]) -> None:
    words = [word for row in table.values() for word in row.synonyms]
    assert len(words) == len(set(words))


def test_ids_start_at_one_and_have_no_holes() -> None:
    for ids in (BENCHMARK.class_ids, BENCHMARK.state_ids, catalog.RELATION_IDS):
        assert sorted(ids.values()) == list(range(1, len(ids) + 1))


@pytest.mark.parametrize(
    ("thing", "class_name"),
    [
        ("kitchen/stove_1", "stove"),
        ("bedroom_2/tv_stand_12", "tv_stand"),
        ("mug_1", "mug"),
        ("humanoid", "humanoid"),
        ("bedroom_2", "bedroom"),
    ],
)
def test_class_of(thing: str, class_name: str) -> None:
    assert catalog.class_of(thing) == class_name


def test_room_of_and_room_kind() -> None:
    assert catalog.room_of("bedroom_2/bed_1") == "bedroom_2"
    assert catalog.room_kind("bedroom_2") == catalog.room_kind("bedroom") == "bedroom"


def test_urdf_of_every_graspable() -> None:
    assert all(catalog.graspable_urdf(name).is_file() for name in BENCHMARK.graspables)


@pytest.mark.parametrize("find", [catalog.graspable_urdf, catalog.furniture_urdf])
def test_unknown_model_names_the_known_ones(find: Callable[[str], Path]) -> None:
    with pytest.raises(AssetError, match=r"unicorn.*no such model; known in"):
        find("unicorn")
