"""Shortcut policies where Pick and Place point, and nobody tells whether they would work."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.policies.carrying import Carrier
from chmarl_pb.policies.groping import Groper
from chmarl_pb.policies.narrow_views import BlindView, SeeingView
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.spots import Spot, spot_of, spots_of, tours
from chmarl_pb.tasks.splits import load_tasks
from tools.build_spots import Shown, build, gather, main, spots, tour

ROOMS = ("kitchen", "bedroom", "bathroom", "livingroom")


def seen(
    holding: bool, cells: dict[str, tuple[int, int]], supports: dict[str, str],
    colors: dict[str, frozenset[int]] | None = None,
) -> SeeingView:  # fmt: skip
    return SeeingView(((), ()), False, "kitchen", holding, frozenset(cells), cells, supports, colors or {})


def test_who_carries_tries_each_pair_once() -> None:
    carrier = Carrier(ROOMS, BENCHMARK)
    carrier.reset(np.random.default_rng(0))
    cells = {"mug": (1, 1), "desk": (0, 1), "bed": (2, 2)}
    chosen = [
        carrier.choose(seen(False, cells, {"mug": "desk"})), carrier.choose(seen(True, cells, {})),
        carrier.choose(seen(False, cells, {"mug": "bed"})), carrier.choose(seen(True, cells, {})),
    ]  # fmt: skip
    assert chosen[:3] == ["pick_1_1", "place_2_2", "pick_1_1"]
    assert chosen[3].startswith("turn_")  # it has been on the desk and on the bed


def test_who_carries_prefers_what_has_lookalikes() -> None:
    carrier = Carrier(ROOMS, BENCHMARK)
    carrier.reset(np.random.default_rng(0))
    colors = {"mug": frozenset({3, 5}), "book": frozenset({3})}
    assert carrier.choose(seen(False, {"book": (0, 0), "mug": (1, 1)}, {}, colors)) == "pick_1_1"


def test_what_is_in_vain_is_not_tried_again_from_there() -> None:
    carrier = Carrier(ROOMS, BENCHMARK)
    carrier.reset(np.random.default_rng(0))
    view = seen(False, {"mug": (1, 1), "book": (0, 0)}, {})
    assert [carrier.choose(view) for _ in range(3)][:2] == ["pick_1_1", "pick_0_0"]
    assert carrier.choose(seen(False, {"mug": (1, 1)}, {})) == "pick_1_1"  # it has turned since


def test_who_gropes_goes_on_after_what_it_has_put_down() -> None:
    groper = Groper(ROOMS)
    groper.reset(np.random.default_rng(0))

    def view(holding: bool) -> BlindView:
        return BlindView(((), ()), False, None, holding)

    picks = [action for _ in range(12) if (action := groper.choose(view(False))).startswith("pick")]
    assert len(picks) >= 3
    first = [groper.choose(view(True)) for _ in range(3)]
    assert first[0].startswith("goto_") and any(action.startswith("place") for action in first)
    known = BlindView((("bedroom",), ()), False, None, False)
    groper.reset(np.random.default_rng(0))
    assert groper.choose(known) == "goto_bedroom"


def test_homes_without_known_rooms_are_stayed_in() -> None:
    groper = Groper(("attic",))
    groper.reset(np.random.default_rng(0))
    assert groper.choose(BlindView(((), ()), False, None, False)) == "stay"


def test_ways_to_spots() -> None:
    spot = Spot("kitchen", -2, (0, 1))
    assert spot_of(str(spot)) == spot
    assert spot.actions("pick") == ["goto_kitchen", "turn_right", "turn_right", "pick_0_1"]
    assert spot.way("kitchen", -1) == ["turn_right"] and spot.way("kitchen", 3) == spot.way("bedroom", 0)


def test_the_file_has_spots_and_tours() -> None:
    assert {spot.room for spot in spots_of("pick")} == {spot.room for spot in spots_of("place")} == set(ROOMS)
    assert set(tours()) <= set(BENCHMARK.receptacles) and len(tours()) == 16
    assert all(5 <= len(line) <= 80 for line in tours().values())


def views() -> Shown:
    """X of two tasks is taken in the middle of the first room, in one of them; a bed after a turn in the second."""
    item, other = np.zeros((2, 2, 4, 12, 3, 3), bool)
    receptacle = np.full((2, 4, 12, 3, 3), -1, np.int8)
    bed = list(BENCHMARK.receptacles).index("bed")
    item[0, 0, 5, 1, 1], item[1, 2, 5, 0, 0], receptacle[:, 1, 6, 2, 2] = True, True, bed
    return Shown(item, other, receptacle, np.array([bed, bed], np.int8))


def test_spots_are_found_by_what_they_add() -> None:
    found = spots(views().item)
    assert {(spot.room, spot.turned, spot.cell) for spot in found} == {
        ("kitchen", 0, (1, 1)), ("bathroom", 0, (0, 0))
    }  # fmt: skip
    line = list(tour(views(), int(views().target[0]), 12))
    assert line[:5] == ["goto_kitchen", "pick_1_1", "goto_bedroom", "turn_left", "place_2_2"]
    assert list(build(views())["tours"]) == ["bed"]  # type: ignore[call-overload]


def test_spots_are_measured_in_a_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tasks = [task for task in load_tasks("train") if task.home == "home_3"][:2]
    measured = gather(tasks)
    assert measured.item.any() and measured.on_target.any() and not (measured.item & measured.other).any()
    monkeypatch.setattr("tools.build_spots.stream_tasks", lambda count, draw: tasks)
    assert main(["--out", str(tmp_path / "spots.json")]) == 0


@pytest.mark.parametrize("name", ["blind", "instruction-blind", "open-loop", "partner-blind"])
@pytest.mark.parametrize("options", [{}, {"messages": True}], ids=["own words", "board"])
def test_the_grounded_track_is_played(name: str, options: dict[str, Any]) -> None:
    grounded = HouseholdEnv(split="val-unseen", track="grounded", max_steps=12, **options)
    policy, task = make_policy(name, grounded), load_tasks("val-unseen")[0]
    played = [rollout(grounded, policy, seed=0, task=task).actions for _ in range(2)]
    assert played[0] == played[1]
    grounded.close()
