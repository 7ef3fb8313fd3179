"""Several objects of a class in a home, in colours that are clearly different."""

from dataclasses import replace

import pytest

from chmarl_pb.catalog import BENCHMARK, COLOURS, Name, ThingClass
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.lookalikes import OF_A_CLASS, among_lookalikes, colours_of
from chmarl_pb.homes.object_looks import RGB
from chmarl_pb.tasks.language.tokens import words


@pytest.mark.parametrize("row", BENCHMARK.graspables.values(), ids=lambda row: row.name)
def test_every_class_has_colours_that_no_name_of_it_holds(row: ThingClass) -> None:
    colours = colours_of(row)
    assert len(set(colours)) == OF_A_CLASS and set(colours) <= set(COLOURS)
    assert list(colours) == sorted(colours, key=COLOURS.index)
    assert not set(colours) & {word for name in row.synonyms for word in words(name)}


def test_a_class_whose_names_hold_most_colours_has_two_all_the_same() -> None:
    names = tuple(Name(f"{colour} ball") for colour in ("red", "blue", "yellow", "white", "green"))
    assert len(colours_of(replace(BENCHMARK.graspables["apple"], name="ball", names=names))) >= 2


def test_colours_have_values() -> None:
    assert set(COLOURS) <= set(RGB)


def test_ids_stay_and_objects_are_named_by_their_colours() -> None:
    home = load_home("home_1")
    among = among_lookalikes(home)
    assert among is among_lookalikes(home) and among.catalog != home.catalog and among.content == home.content
    assert among.catalog.class_ids == home.catalog.class_ids and among.catalog.state_ids == home.catalog.state_ids
    names = [name for name, _ in among.catalog.classes["mug"].objects]
    assert names == [f"mug_{COLOURS.index(colour) + 1}" for colour in colours_of(among.catalog.classes["mug"])]
    assert [name for name, _ in home.catalog.classes["mug"].objects] == ["mug_1"]
