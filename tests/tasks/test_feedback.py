"""Feedback sentences: their templates, their English, and when something is said."""

from itertools import product
from typing import Any

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.envs.options import Options
from chmarl_pb.errors import OptionError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks import language
from chmarl_pb.tasks.advisers import Detour, MissedChance
from chmarl_pb.tasks.feedback import better_action, within_sight
from chmarl_pb.tasks.language import templates
from chmarl_pb.tasks.language.feedback import templates_for
from chmarl_pb.tasks.order import plan_all
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import Grip, Objects, Support, WorldState
from tests.helpers.feedback_reader import ACTIONS, MOVES, pattern_of, read


def test_there_are_forty_templates() -> None:
    sentences = [text for kind in templates.FEEDBACK for text in kind.pool(held_out=True)]
    assert len(set(sentences)) == len(sentences) >= 40


@pytest.mark.parametrize("split", ["train", "test-seen"])
def test_sentences_read_back_and_agree_with_their_nouns(split: str) -> None:
    rng = np.random.default_rng(0)
    graspables, receptacles = list(catalog.BENCHMARK.graspables), list(catalog.BENCHMARK.receptacles)
    said = set()
    for number, (done, succeeded, better, holding) in enumerate(
        [*product(ACTIONS, (True, False), ("pick", "place", *MOVES), (True, False))] * 3
    ):
        source, target = rng.permutation(receptacles)[:2].tolist()
        task = Task(f"{split}-{number:04d}", "home_1", str(rng.choice(graspables)), source, target, number)
        text = language.say(task, number % 50, language.Advice(done, succeeded, better, holding))
        assert read(text) == (better, done, succeeded)
        assert text[0].isupper() and text[-1] in ".?" and "{" not in text
        spoken = language.words(text)
        assert task.graspable in ("slippers", "notes") or ("them" not in spoken and "were in view" not in text), text
        assert len(spoken) <= language.FEEDBACK_LENGTH
        assert language.UNKNOWN not in language.tokenize(text, language.FEEDBACK_LENGTH), text
        said.add(text)
    assert len(said) > 900


def test_training_never_hears_a_held_out_sentence() -> None:
    held_out = [pattern_of(text) for kind in templates.FEEDBACK for text in kind.held_out]
    heard = {"train": 0, "val-seen": 0}
    for split, seed, better in product(heard, range(200), ("pick", "place", "turn_left")):
        text = language.say(
            Task(f"{split}-1", "home_1", "mug", "bed", "desk", seed), 3, language.Advice("stay", True, better, False)
        )
        heard[split] += any(pattern.fullmatch(text) for pattern in held_out)
    assert heard["train"] == 0 and heard["val-seen"] > 100


def test_words_depend_on_seed_and_step_alone() -> None:
    advice = language.Advice("stay", True, "pick", False)
    task = Task("train-1", "home_1", "mug", "bed", "desk", 5)
    assert language.say(task, 3, advice) == language.say(Task("a", "home_2", "mug", "sofa", "desk", 5), 3, advice)
    assert len({language.say(task, step, advice) for step in range(50)}) > 20


def test_each_kind_of_advice_has_its_sentences() -> None:
    kinds = [templates_for(language.Advice("stay", True, better, False)) for better in ("pick", "place", "turn_left")]
    assert tuple(kinds) == templates.FEEDBACK


def test_within_sight() -> None:
    goal = Goal("mug_1", ("kitchen/desk_1", "bedroom/desk_1"))

    def outcome(held: str | None, *seen: str) -> Outcome:
        grips = {} if held is None else {"humanoid": Grip(held, 0.0)}
        supports = {} if held else {"mug_1": Support("kitchen/stove_1", 1.0)}
        state = WorldState(Objects(supports=supports), grips)
        return Outcome(state, {"humanoid": seen, "drone": ("mug_1",)}, "kitchen", 0.0, False)

    assert within_sight(goal, outcome(None, "mug_1"), "humanoid") == "pick"
    assert within_sight(goal, outcome("mug_1", "mug_1", "bedroom/desk_1"), "humanoid") == "place"
    assert within_sight(goal, outcome(None, "bedroom/desk_1"), "humanoid") is None
    assert within_sight(goal, outcome("mug_1", "mug_1"), "humanoid") is None
    assert within_sight(goal, outcome("mug_1", "mug_1"), "drone") is None, "another robot holds it"


def test_better_action() -> None:
    plan = ["turn_left", "pick", "place"]
    assert better_action(plan, "turn_left", plan[1:]) is None
    assert better_action(plan, "goto_kitchen", ["pick", "place"]) is None  # another way, as short
    assert better_action(plan, "stay", plan) == "turn_left"
    assert better_action(plan, "move_forward", ["turn_left", *plan]) == "turn_left"
    assert (
        better_action(None, "stay", plan) is better_action(plan, "stay", None) is better_action([], "stay", []) is None
    )


@pytest.mark.parametrize("value", ["oracle", "", 2, None])
def test_unknown_styles_are_refused(value: Any) -> None:
    with pytest.raises(OptionError, match="feedback"):
        Options(feedback=value)


@pytest.mark.parametrize(
    ("value", "critic"), [(True, MissedChance), (False, None), ("paper", MissedChance), ("planner", Detour)]
)
def test_styles(value: bool | str, critic: type | None) -> None:
    adviser = Options(feedback=value).adviser
    assert getattr(adviser, "critic", None) is critic


def test_the_planner_knows_what_others_with_arms_have_done() -> None:
    env = chmarl_pb.parallel_env(
        split="val-unseen", feedback="planner", robots=("humanoid", "humanoid", "drone"), max_steps=60
    )
    env.reset(options={"task": "val-unseen-003"})
    oracle, said = env.simulation.oracles["humanoid_0"], []
    stay = {name: names.index("stay") for name, names in env.action_names.items()}
    while env.agents:
        plan = plan_all(oracle, env.setting.goals).actions
        actions = stay | {"humanoid_0": env.action_names["humanoid_0"].index(plan[0])}
        held = bool(env.world.state.grips)
        _, _, _, _, infos = env.step(actions)
        if held:
            said.append(infos["humanoid_1"]["feedback"])
    assert said and not any(said), "there is nothing left to do for who stands by"
    env.close()
