"""Eyes: policies that read scene graphs play on pictures by what is recognised in them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, COLOUR_IDS
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.aiming import cells_of
from chmarl_pb.policies.eyes import Seeing, Sight
from chmarl_pb.policies.seats import interface_of
from chmarl_pb.policies.sights import classes_in_view, colors_in_view, places_in_view
from chmarl_pb.policies.sources import find_policy

THINGS = [Sight("mug", 0.9, 0.1, 0.02), Sight("sofa", 0.5, 0.5, 0.3)]


class FixedEyes:
    """See the same in every picture."""

    fingerprint = "f" * 64

    def __init__(self, things: Sequence[Sight] = THINGS):
        self.things = things

    def __call__(self, image: np.ndarray) -> Sequence[Sight]:
        assert image.dtype == np.uint8 and image.ndim == 3
        return self.things


def blind_eyes() -> FixedEyes:
    return FixedEyes([])


class Keeping:
    """Stays, and keeps what it was given."""

    def reset(self, seed: int | None) -> None:
        self.given: dict[str, Any] = {}

    def act(self, observations: Any, infos: Any) -> Any:
        self.given = observations
        return {robot: len(info["action_mask"]) - 1 for robot, info in infos.items()}


def given(env: HouseholdEnv, **changes: np.ndarray) -> dict[str, np.ndarray]:
    """Return what the policy of the humanoid is given in the first step."""
    observations, infos = env.reset(options={"task": "val-unseen-000"})
    inner = Keeping()
    policy = Seeing(inner, FixedEyes(), interface_of(env))
    policy.reset(0)
    policy.act({"humanoid": {**observations["humanoid"], **changes}}, {"humanoid": infos["humanoid"]})
    return dict(inner.given["humanoid"])


def test_what_eyes_see_is_read_as_a_graph_of_the_robots_room() -> None:
    env = HouseholdEnv("visual", split="val-unseen")
    own = np.zeros_like(env.reset(seed=0)[0]["humanoid"]["self"])
    own[env.rooms.index("bedroom")] = 1
    seen = given(env, self=own)
    assert {"mug", "sofa"} <= classes_in_view(seen, {}, BENCHMARK)
    assert set(places_in_view(seen, {}, env.rooms, BENCHMARK)) == {("mug", "bedroom"), ("sofa", "bedroom")}
    assert cells_of(seen, BENCHMARK) == {}  # nothing points
    own[-1] = 1
    assert places_in_view(given(env, self=own), {}, env.rooms, BENCHMARK) == [("sofa", "bedroom")]
    between = np.zeros_like(own)
    between[len(env.rooms)] = 1
    assert places_in_view(given(env, self=between), {}, env.rooms, BENCHMARK) == []
    env.close()


def test_eyes_tell_where_to_point() -> None:
    env = HouseholdEnv("visual", split="val-unseen", pointing=True)
    assert cells_of(given(env), BENCHMARK) == {"mug": (0, 2), "sofa": (1, 1)}
    env.close()


def test_eyes_tell_colours_among_lookalikes() -> None:
    red = Sight("mug", 0.9, 0.1, 0.02, COLOUR_IDS["red"])
    for lookalikes, expected in ((True, {"mug": frozenset({red.colour})}), (False, {})):
        env = HouseholdEnv("visual", split="val-unseen", lookalikes=lookalikes)
        observations, infos = env.reset(options={"task": "val-unseen-000"})
        inner = Keeping()
        policy = Seeing(inner, FixedEyes([red, THINGS[1]]), interface_of(env))
        policy.reset(0)
        policy.act(observations, infos)
        assert colors_in_view(inner.given["humanoid"], BENCHMARK) == expected
        env.close()


def test_a_policy_with_eyes_is_told_nothing_and_says_whose_eyes_it_has() -> None:
    name = f"search@{__name__}:FixedEyes"
    played = {
        policy: chmarl_pb.evaluate(
            policy, "val-unseen", "visual", seeds=[0], workers=1, tasks=["val-unseen-000"], max_steps=6
        )
        for policy in (name, "search")
    }
    assert played[name].settings["policy"] == name and played[name].settings["policy_sha256"] == "f" * 64
    assert played[name].declared == "" and played["search"].declared == "is told the truth"


@pytest.mark.parametrize("policy", ["search", "belief", "reactive", "instruction-blind"])
def test_without_sight_nothing_is_found(policy: str) -> None:
    """The episode ends unsolved: nothing of the truth comes in by another way."""
    found = chmarl_pb.evaluate(
        f"{policy}@{__name__}:blind_eyes", "val-unseen", "visual", seeds=[0], workers=1, tasks=["val-unseen-000"],
        max_steps=12, feedback=False,
    )  # fmt: skip
    assert found.success_rate == 0.0


def test_wrong_names_are_told() -> None:
    with pytest.raises(OptionError, match=r"builtins:object: makes no eyes; .* have a text `fingerprint`"):
        find_policy("search@builtins:object")
    with pytest.raises(OptionError, match="unknown eyes 'owl'"):
        find_policy("search@owl")
    with pytest.raises(OptionError, match="'planner' takes no eyes; use one of: belief"):
        find_policy("planner@detector")
    env = HouseholdEnv("scene_graph", split="val-unseen")
    with pytest.raises(OptionError, match="eyes need pictures"):
        Seeing(Keeping(), FixedEyes(), interface_of(env))
    env.close()


def test_all_that_eyes_may_see_has_an_id() -> None:
    assert {name for name in (*BENCHMARK.graspables, *BENCHMARK.receptacles)} <= BENCHMARK.class_ids.keys()
    assert catalog.room_kind("") == "" and "" not in BENCHMARK.class_ids
