"""Shortcut policies in settings without messages or feedback, and those that obey words or have no partner."""

from typing import Any

import numpy as np
import pytest

from chmarl_pb.catalog import COLOUR_IDS, ROOM_KINDS
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.policies.policy import Infos, Observations
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.tasks.language import Advice, read_detour, say, tokenize
from chmarl_pb.tasks.language.tokens import FEEDBACK_LENGTH
from chmarl_pb.tasks.splits import load_tasks
from tests.policies.test_shortcuts import Beside

TASKS = load_tasks("val-unseen")[:3]

HUMANOID_ACTIONS = (
    *(f"goto_{room}" for room in ROOM_KINDS), "pick", "place", "move_forward", "turn_left", "turn_right", "stay"
)  # fmt: skip

#: Policy, options of the environment, keys of observations that it may read.
CASES = [
    ("blind", {"feedback": False}, {"messages", "self"}),
    ("blind", {"feedback": False, "messages": False}, {"self"}),
    ("instruction-blind", {"feedback": False}, {"messages", "self", "node_class"}),
    ("instruction-blind", {"messages": False}, {"feedback", "self", "node_class"}),
    ("instruction-blind", {"messages": False, "feedback": False}, {"self", "node_class"}),
    ("feedback-only", {}, {"feedback", "self"}),
    ("feedback-only", {"feedback": "planner"}, {"feedback", "self"}),
    ("partner-blind", {}, {"self", "instruction", "node_class", "node_state", "edges"}),
]


@pytest.mark.parametrize(("name", "options", "keys"), CASES)
def test_a_policy_reads_nothing_but_what_its_row_says(name: str, options: dict[str, Any], keys: set[str]) -> None:
    def narrowed(observations: Observations, infos: Infos) -> tuple[Any, Any]:
        kept = {
            robot: {key: value if key in keys else np.roll(value, 1) for key, value in seen.items()}
            for robot, seen in observations.items()
        }
        return kept, {robot: {} for robot in infos}

    with_options = HouseholdEnv(split="val-unseen", **options)
    for task in TASKS[:2]:
        policy = Beside(make_policy(name, with_options), make_policy(name, with_options), narrowed)
        rollout(with_options, policy, seed=3, task=task)
        assert all(first == second for first, second in policy.chosen)
    with_options.close()


def test_the_words_of_the_planner_are_enough() -> None:
    advised = HouseholdEnv(split="val-unseen", feedback="planner")
    policy = make_policy("feedback-only", advised)
    episodes = [rollout(advised, policy, seed=0, task=task) for task in TASKS]
    assert all(episode.success for episode in episodes)
    assert all(episode.steps <= 2 * episode.task.optimal_steps + 2 for episode in episodes)
    advised.close()


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.id)
@pytest.mark.parametrize("better", sorted(set(HUMANOID_ACTIONS) - {"pick", "place"}))
def test_feedback_is_read_back(task: Any, better: str) -> None:
    for step, done in enumerate(HUMANOID_ACTIONS * 3):
        if done != better:
            text = say(task, step, Advice(done, step % 2 == 0, better, step % 3 == 0))
            assert read_detour(tokenize(text, FEEDBACK_LENGTH), HUMANOID_ACTIONS) == better, text


def test_feedback_that_names_no_way_is_none() -> None:
    for better in ("pick", "place"):
        for step in range(30):
            text = say(TASKS[0], step, Advice("turn_left", True, better, better == "place"))
            assert read_detour(tokenize(text, FEEDBACK_LENGTH), HUMANOID_ACTIONS) is None, text
    assert read_detour(np.zeros(FEEDBACK_LENGTH, np.int16), HUMANOID_ACTIONS) is None


def test_who_has_no_partner_lets_it_stay() -> None:
    with_drone = HouseholdEnv(split="val-unseen")
    episode = rollout(with_drone, make_policy("partner-blind", with_drone), seed=0, task=TASKS[0])
    stay = with_drone.action_names["drone"].index("stay")
    assert {chosen["drone"] for chosen in episode.actions} == {stay}
    with_drone.close()


def test_who_tells_no_colours_apart_takes_any_lookalike_for_x() -> None:
    """It is told no colour by graphs nor by the names of infos; where nothing looks alike, it is the search itself."""

    def recoloured(observations: Observations, infos: Infos) -> tuple[Any, Any]:
        seen = {robot: {**own, "node_color": np.roll(own["node_color"], 1)} for robot, own in observations.items()}
        return seen, infos

    grounded = HouseholdEnv(track="grounded", split="val-unseen")
    differs = 0
    for task in TASKS:
        policy = Beside(make_policy("colour-blind", grounded), make_policy("colour-blind", grounded), recoloured)
        episode = rollout(grounded, policy, seed=3, task=task)
        assert all(first == second for first, second in policy.chosen)
        differs += episode.actions != rollout(grounded, make_policy("belief", grounded), seed=3, task=task).actions
    assert differs
    pictures = HouseholdEnv(observation="visual", lookalikes=True, split="val-unseen")
    observations, infos = pictures.reset(seed=0, options={"task": TASKS[0]})
    for name, expected in (("colour-blind", {True}), ("belief", {True, False})):
        one, picks = make_policy(name, pictures), set()
        for colour in COLOUR_IDS.values():
            one.reset(0)
            lookalike = {"visible": (f"{TASKS[0].graspable}_{colour}",)}
            chosen = one.act(observations, {robot: info | lookalike for robot, info in infos.items()})["humanoid"]
            picks.add(pictures.action_names["humanoid"][chosen] == "pick")
        assert picks == expected
    for env in (grounded, pictures):
        env.close()
