"""The policies that do without eyes, words, feedback or a memory: they use nothing else, and play what is published."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chmarl_pb import catalog
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.evaluation.cooperation import read_reference, reference_scores
from chmarl_pb.evaluation.play import episode_seed, policy_seed
from chmarl_pb.policies.open_loop import tours
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.policies.registry import SHORTCUTS, make_policy
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task
from tools.build_tours import Views, best_tour, build

TASKS = [*load_tasks("val-seen")[:2], load_tasks("val-unseen")[1]]

#: Policy -> keys of observations that it may read; all others are taken away, and all infos.
ALLOWED = {
    "blind": {"messages", "feedback", "self"},
    "instruction-blind": {"messages", "feedback", "self", "node_class"},
    "open-loop": {"instruction"},
    "reactive": {"messages", "feedback", "self", "node_class", "instruction"},
}


class Beside:
    """Drives by a policy, and asks a second one that gets changed observations and infos for its actions."""

    def __init__(self, policy: Policy, second: Policy, change: Callable[[Observations, Infos], tuple[Any, Any]]):
        self.policy, self.second, self.change = policy, second, change
        self.chosen: list[tuple[Actions, Actions]] = []

    def reset(self, seed: int | None) -> None:
        self.policy.reset(seed)
        self.second.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        chosen = self.policy.act(observations, infos), self.second.act(*self.change(observations, infos))
        self.chosen.append(chosen)
        return chosen[0]


def narrowed(name: str, observations: Observations, infos: Infos) -> tuple[Any, Any]:
    """Take away what a policy must not read; feedback says something else."""
    kept = {robot: {key: of[key] for key in ALLOWED[name]} for robot, of in observations.items()}
    for of in kept.values():
        if "feedback" in of:
            of["feedback"] = np.where(of["feedback"].any(), 7, 0) * np.ones_like(of["feedback"])
    return kept, {robot: {} for robot in infos}


@pytest.mark.parametrize("name", SHORTCUTS)
@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.id)
def test_a_policy_reads_nothing_but_what_its_row_says(env: HouseholdEnv, name: str, task: Task) -> None:
    policy = Beside(make_policy(name, env), make_policy(name, env), lambda seen, heard: narrowed(name, seen, heard))
    rollout(env, policy, seed=3, task=task)
    assert all(first == second for first, second in policy.chosen)


@pytest.mark.parametrize("name", ["blind", "instruction-blind", "reactive"])
def test_each_robot_has_its_own_view_only(env: HouseholdEnv, name: str) -> None:
    def other_drone(seen: Observations, heard: Infos) -> tuple[Any, Any]:
        drone = {**seen["drone"], "node_class": np.arange(96) % 60, "self": -seen["drone"]["self"]}
        return {**seen, "drone": drone}, heard

    policy = Beside(make_policy(name, env), make_policy(name, env), other_drone)
    rollout(env, policy, seed=3, task=TASKS[0])
    assert all(first["humanoid"] == second["humanoid"] for first, second in policy.chosen)


@pytest.mark.parametrize("name", SHORTCUTS)
def test_a_seed_fixes_all_actions_with_graphs_and_with_pictures(
    env: HouseholdEnv, visual_env: HouseholdEnv, name: str
) -> None:
    played = [rollout(one, make_policy(name, one), seed=4, task=TASKS[0]).actions for one in (env, env, visual_env)]
    assert played[0] == played[1] == played[2]
    other = rollout(env, make_policy(name, env), seed=5, task=TASKS[0]).actions
    assert (played[0] == other) == find_policy(name).deterministic


@pytest.mark.parametrize("name", SHORTCUTS)
def test_published_lengths_are_those_that_are_played(env: HouseholdEnv, name: str) -> None:
    reference, policy = read_reference("test-unseen"), make_policy(name, env)
    assert reference is not None
    for task in load_tasks("test-unseen")[:4]:
        own = policy_seed(env.instruction_of(task), 0)
        episode = rollout(env, policy, episode_seed(task, 0), task, policy_seed=own)
        assert reference.lengths[task][name][0] == (len(episode) if episode.success else None)


def test_published_scores_show_that_eyes_and_words_are_hardly_needed() -> None:
    scores = reference_scores("test-unseen", 28)
    assert scores["blind"][0] > 0.8 and scores["blind"][1] > 0.38
    assert scores["instruction-blind"][1] > 0.37 and scores["open-loop"][0] > 0.3
    assert reference_scores("test-unseen", 29) == {}  # cut later than the references
    few = reference_scores("test-unseen", 28, load_tasks("test-unseen")[:3])
    assert few.keys() == scores.keys() and few != scores
    assert reference_scores("test-unseen", 28, load_tasks("val-seen")[:3]) == {}


# --- the tours of the open loop ------------------------------------------------------------------


def views_of_two_rooms() -> Views:
    """X is in view from room a after a turn to the left, Y from room b; from where X is picked, nothing is."""
    item, target = np.zeros((2, 3, 4, 12), dtype=bool)
    item[:, 0, 1] = target[:, 1, 0] = True
    return Views(("a", "b"), item, target)


def test_the_best_tour_is_found() -> None:
    tour = best_tour(views_of_two_rooms(), beam=4, steps=8)
    assert tour.actions[:5] == ("goto_a", "turn_left", "pick", "goto_b", "place")
    assert (tour.score == 1).all()  # five steps are no more than a typical L*


def test_a_tour_is_built_for_each_class_that_stands_in_the_homes() -> None:
    tasks = [task for task in load_tasks("train") if task.home == "home_3"][:2]
    built = build(tasks, beam=1)
    assert built.keys() <= tours().keys() and len(built) >= 12
    known = {"pick", "place", "turn_left", "turn_right", *(f"goto_{room}" for room in catalog.ROOM_KINDS)}
    assert all(set(line.split()) <= known and len(line.split()) <= 28 for line in built.values())


def test_a_home_with_fewer_rooms_plays_what_is_left_of_a_tour(small_home: Path) -> None:
    with_one_room = HouseholdEnv(home=small_home)
    for name in SHORTCUTS:
        episode = rollout(with_one_room, make_policy(name, with_one_room), seed=0)
        assert set(episode.actions[0]) == set(TEAM)
    with_one_room.close()
