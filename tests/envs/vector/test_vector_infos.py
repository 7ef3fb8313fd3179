"""The infos of a vector: only what has changed travels, and Gymnasium's format is made of it."""

import pickle
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import VectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st

from chmarl_pb.envs.vector.infos import ChangeFinder, InfoTable, nest
from tests.helpers.toy_vectors import same

#: Each key has values of one kind, as the infos of an environment have.
INFOS = st.fixed_dictionaries(
    {"flag": st.booleans()},
    optional={
        "number": st.integers(-5, 5), "share": st.floats(-2, 2), "text": st.text(max_size=2),
        "things": st.tuples(st.sampled_from("ab"), st.sampled_from("ab")),
        "row": st.lists(st.integers(0, 2), max_size=2),
        "array": st.integers(0, 2).map(lambda value: np.full(2, value, np.int16)),
        "final_obs": st.integers(0, 2).map(lambda value: np.full(2, value, np.int16)),
        "robot": st.fixed_dictionaries(
            {}, optional={"name": st.text(max_size=1), "arm": st.fixed_dictionaries({}, optional={"on": st.booleans()})}
        ),
    },
)  # fmt: skip


@settings(max_examples=60)
@given(st.lists(st.tuples(INFOS, INFOS), min_size=1, max_size=6))
def test_changes_give_the_infos(steps: list[tuple[dict[str, Any], ...]]) -> None:
    table, finders = InfoTable(2), [ChangeFinder(), ChangeFinder()]
    flats: list[dict[tuple[str, ...], Any]] = [{}, {}]
    gymnasium_env = VectorEnv()
    gymnasium_env.num_envs = 2
    for infos in steps:
        changes = [pickle.loads(pickle.dumps(finder.change(info))) for finder, info in zip(finders, infos, strict=True)]
        table.update(changes)
        wanted: dict[str, Any] = {}
        for number, info in enumerate(infos):
            gymnasium_env._add_info(wanted, info, number)
            flats[number].update(changes[number][0])
            for path in changes[number][1]:
                del flats[number][path]
            assert same(nest(flats[number]), info)
        assert same(table.infos(), wanted)


def test_columns_widen() -> None:
    table = InfoTable(2)
    for value, wanted in ((1, [1, 0]), (0.5, [0.5, 0]), (2, [2, 0]), ("text", ["text", 0])):
        table.update([({("key",): value}, []), ({}, [])])
        assert list(table.infos()["key"]) == wanted


def test_unchanged_infos_do_not_travel() -> None:
    finder = ChangeFinder()
    info: dict[str, Any] = {"robot": {"mask": np.ones(2), "seen": ("a", "b")}, "text": "go"}
    assert len(finder.change(info)[0]) == 3
    info["robot"]["mask"][0] = 5  # changed in place
    assert finder.change(info) == ({("robot", "mask"): pytest.approx(np.array([5, 1]))}, [])
    assert finder.change(info) == ({}, [])
    new, gone = finder.change({})
    assert (new, sorted(gone)) == ({}, [("robot", "mask"), ("robot", "seen"), ("text",)])
