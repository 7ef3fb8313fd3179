"""Aiming: where the observation says that things are, and what pointing there takes."""

from collections.abc import Iterator

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK, class_of
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.aiming import SURE, Nodes, aims_at, cells_of, nodes_of, turned
from chmarl_pb.policies.belief.hand import Hand
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.seats import seated
from chmarl_pb.policies.sights import OTHER
from chmarl_pb.robots.pointing import named
from chmarl_pb.tasks.splits import load_tasks

TASKS = load_tasks("val-unseen")[::7]
KINDS = (("pick", BENCHMARK.graspables), ("place", BENCHMARK.receptacles))


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(track="grounded", split="val-unseen")
    yield env
    env.close()


def looks(env: HouseholdEnv, count: int) -> Iterator[dict[str, np.ndarray]]:
    """Yield what the humanoid observes in some rooms, after some turns."""
    names, rng = env.action_names, np.random.default_rng(0)
    for task in TASKS[:count]:
        observations, _ = env.reset(options={"task": task})
        for room in env.rooms:
            for action in (f"goto_{room}", *["turn_left"] * int(rng.integers(4))):
                observations, *_ = env.step({"humanoid": names["humanoid"].index(action), "drone": 8})
            yield observations["humanoid"]


def nodes(*rows: tuple[str, float, float, float]) -> Nodes:
    return Nodes(tuple(name for name, *_ in rows), np.array([views for _, *views in rows]).reshape(-1, 3))


def test_cells_name_what_has_most_pixels_there(env: HouseholdEnv) -> None:
    right: dict[str, list[bool]] = {verb: [] for verb, _ in KINDS}
    for seen in looks(env, 8):
        cells, pointer = cells_of(seen, BENCHMARK), env.simulation.pointer
        assert pointer is not None
        for verb, kinds in KINDS:
            shown = pointer.shown("humanoid", verb)
            right[verb] += [
                class_of(shown.get(named(verb, cell), "")) == name.removeprefix(OTHER)
                for name, cell in cells.items()
                if name.removeprefix(OTHER) in kinds
            ]
    assert min(map(len, right.values())) > 20
    assert np.mean(right["pick"]) > 0.8 and np.mean(right["place"]) > 0.7


def test_a_small_thing_beside_a_large_one_is_aimed_at_where_it_stands_out() -> None:
    both = nodes(("bed", 0.3, 0.5, 0.16), ("nightstand", 0.6, 0.5, 0.04))
    assert aims_at(both, ["nightstand"])[0].cell[1] == 2 and aims_at(both, ["bed"])[0].cell[1] == 0
    hidden = nodes(("plate", 0.5, 0.5, 0.05), ("fork", 0.5, 0.5, 0.001))
    assert aims_at(hidden, ["fork"])[0].part < SURE and aims_at(hidden, ["mug"]) == []


def test_a_turn_is_foreseen(env: HouseholdEnv) -> None:
    names = env.action_names["humanoid"]
    for seen in looks(env, 2):
        before = nodes_of(seen, BENCHMARK.graspables, BENCHMARK)
        foreseen = turned(before, 1)
        observations, *_ = env.step({"humanoid": names.index("turn_left"), "drone": 8})
        after = nodes_of(observations["humanoid"], BENCHMARK.graspables, BENCHMARK)
        for name, view in zip(foreseen.names, foreseen.views, strict=True):
            away = np.abs(view[:2] - 0.5).max() < 0.4 and view[2] > 0.001
            if away and name in after.names and after.names.count(name) == foreseen.names.count(name) == 1:
                assert np.abs(after.views[after.names.index(name), :2] - view[:2]).max() < 0.06


def test_a_hand_does_not_try_the_same_in_vain_twice(env: HouseholdEnv) -> None:
    wanted = BENCHMARK.graspables
    for seen in looks(env, 1):
        hand, tried = Hand(BENCHMARK), []
        for _ in range(12):  # as if nothing happened
            action = hand.choose(seen, wanted, wanted, wanted)
            if action is None:
                break
            hand.note(action)
            tried.append(action)
        picks = [action for action in tried if action.startswith("pick")]
        assert len(picks) == len(set(picks)) and len(tried) - len(picks) <= 4


def test_the_belief_search_solves_most_tasks_of_the_track(env: HouseholdEnv) -> None:
    policy = seated(lambda core: make_policy("belief", core), env)
    solved = [chmarl_pb.rollout(env, policy, 0, task).success for task in TASKS]
    assert np.mean(solved) >= 0.6
