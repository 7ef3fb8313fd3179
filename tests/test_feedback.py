"""Every feedback sentence is true: what it says was done was done, and what it recommends works."""

import re
from collections.abc import Iterator
from itertools import product

import numpy as np
import pytest

from chmarl_pb import catalog
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks import language
from chmarl_pb.tasks.feedback import better_action, within_sight
from chmarl_pb.tasks.language import templates
from chmarl_pb.tasks.language.actions import ways_to_say
from chmarl_pb.tasks.language.feedback import templates_for
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.task import Task

GOTOS = tuple(f"goto_{room}" for room in catalog.ROOM_KINDS)
MOVES = (*GOTOS, "move_forward", "turn_left", "turn_right")
ACTIONS = (*GOTOS, "pick", "place", "move_forward", "turn_left", "turn_right", "stay")


def _either(ways: list[str]) -> str:
    return "|".join(map(re.escape, sorted(ways, key=len, reverse=True)))


def _names(table: dict[str, catalog.ThingClass]) -> list[str]:
    return [f"the {name}" for row in table.values() for name in row.synonyms]


def _phrases(actions: tuple[str, ...], form: str) -> dict[str, str]:
    return {getattr(verb, form): action for action in actions for verb in ways_to_say(action, held_out=True)}


DOING, BASE = _phrases(ACTIONS, "doing"), _phrases(ACTIONS, "base")
BETTER = {phrase: action for form in ("base", "past", "doing") for phrase, action in _phrases(MOVES, form).items()}
SLOTS = {
    "the_x": _either(_names(catalog.GRASPABLES)),
    "y": _either(_names(catalog.RECEPTACLES)),
    "goal": _either(_names(catalog.GRASPABLES) + _names(catalog.RECEPTACLES)),
    "it": "it|them",
    "was": "was|were",
    "done": _either([*DOING, *(f"trying to {phrase}" for phrase in BASE)]),
    **{form: _either(list(_phrases(MOVES, form))) for form in ("base", "past", "doing")},
}


def _pattern(template: str) -> re.Pattern[str]:
    parts = re.split(r"\{(\w+)\}", template)
    seen: set[str] = set()
    text = ""
    for literal, slot in zip(parts[::2], [*parts[1::2], ""], strict=True):
        text += re.escape(literal)
        if slot:
            text += f"(?:{SLOTS[slot]})" if slot in seen else f"(?P<{slot}>{SLOTS[slot]})"
            seen.add(slot)
    return re.compile(text, re.IGNORECASE)


PATTERNS = [
    (verb, _pattern(template))
    for verb, kind in (("pick", templates.MISSED_PICK), ("place", templates.MISSED_PLACE), ("", templates.DETOUR))
    for template in kind.pool(held_out=True)
]


def read(text: str) -> tuple[str, str, bool]:
    """Return what a sentence says: the better action, the action that was taken, and whether that could be done."""
    readings = set()
    for verb, pattern in PATTERNS:
        match = pattern.fullmatch(text)
        if match:
            slots = {slot: words.lower() for slot, words in match.groupdict().items()}
            better = verb or BETTER[slots.get("past") or slots.get("base") or slots["doing"]]
            tried = slots["done"].startswith("trying to ")
            done = BASE[slots["done"].removeprefix("trying to ")] if tried else DOING[slots["done"]]
            readings.add((better, done, not tried))
    assert len(readings) == 1, (text, readings)
    return readings.pop()


def test_there_are_forty_templates() -> None:
    sentences = [text for kind in templates.FEEDBACK for text in kind.pool(held_out=True)]
    assert len(set(sentences)) == len(sentences) >= 40


@pytest.mark.parametrize("split", ["train", "test-seen"])
def test_sentences_read_back_and_agree_with_their_nouns(split: str) -> None:
    rng = np.random.default_rng(0)
    graspables, receptacles = list(catalog.GRASPABLES), list(catalog.RECEPTACLES)
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
    held_out = [_pattern(text) for kind in templates.FEEDBACK for text in kind.held_out]
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
        return Outcome({"humanoid": seen, "drone": ("mug_1",)}, held, {}, "kitchen", 0.0, False)

    assert within_sight(goal, outcome(None, "mug_1")) == "pick"
    assert within_sight(goal, outcome("mug_1", "mug_1", "bedroom/desk_1")) == "place"
    assert within_sight(goal, outcome(None, "bedroom/desk_1")) is None
    assert within_sight(goal, outcome("mug_1", "mug_1")) is None


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
def test_unknown_styles_are_refused(value: object) -> None:
    with pytest.raises(OptionError, match="feedback"):
        Options(feedback=value)


@pytest.mark.parametrize(
    ("value", "style"), [(True, "paper"), (False, None), ("paper", "paper"), ("planner", "planner")]
)
def test_styles(value: bool | str, style: str | None) -> None:
    assert Options(feedback=value).feedback_style == style


def test_no_feedback_when_it_is_off(twin: HouseholdEnv, tasks: list[Task]) -> None:
    for text, *_ in played(twin, tasks[0], 0, 0.5):
        assert text == ""


# Against the world


@pytest.fixture(scope="module")
def planner_env() -> Iterator[HouseholdEnv]:
    env = HouseholdEnv(feedback="planner", max_steps=25)
    yield env
    env.close()


@pytest.fixture(scope="module")
def twin() -> Iterator[HouseholdEnv]:
    """An environment that is brought to the states in which something was said."""
    env = HouseholdEnv(feedback=False, max_steps=1000)
    yield env
    env.close()


def played(
    env: HouseholdEnv, task: Task, seed: int, detours: float, steps: int = 25
) -> Iterator[tuple[str, list[dict[str, int]], bool]]:
    """Play up to 25 steps of the planner with random detours; yield feedback, actions so far, success of the last.

    Args:
        env: where to play.
        task: what to play.
        seed: of the detours.
        detours: share of random steps; 1 is the random policy.
        steps: after which it ends.
    """
    rng = np.random.default_rng(seed)
    env.reset(options={"task": task})
    names = env.action_names["humanoid"]
    plan: list[str] = []
    taken: list[dict[str, int]] = []
    while env.agents and len(taken) < steps:
        astray = rng.random() < detours
        if not astray and not plan:
            plan = env.stage.oracle.plan(env.setting.goal)
        action = int(rng.integers(len(names))) if astray else names.index(plan.pop(0))
        plan = [] if astray else plan
        taken.append({"humanoid": action, "drone": int(rng.integers(9))})
        infos = env.step(taken[-1])[-1]
        assert infos["drone"]["feedback"] == ""
        yield infos["humanoid"]["feedback"], taken, infos["humanoid"]["action_success"]


def rewound(twin: HouseholdEnv, task: Task, actions: list[dict[str, int]]) -> HouseholdEnv:
    """Return the twin in the state before the last of the actions."""
    twin.reset(options={"task": task})
    for action in actions[:-1]:
        twin.step(action)
    return twin


def check_paper(twin: HouseholdEnv, task: Task, text: str, actions: list[dict[str, int]], succeeded: bool) -> None:
    """The recommended Pick or Place works in that state."""
    names = twin.action_names["humanoid"]
    better, done, could = read(text)
    assert (names[actions[-1]["humanoid"]], succeeded) == (done, could), text
    rewound(twin, task, actions)
    infos = twin.step({**actions[-1], "humanoid": names.index(better)})[-1]
    assert infos["humanoid"]["action_success"], (task, text)
    assert twin.world.held == task.item if better == "pick" else infos["humanoid"]["success"], (task, text)


def check_planner(twin: HouseholdEnv, task: Task, text: str, actions: list[dict[str, int]], succeeded: bool) -> None:
    """The recommended action shortens the optimal plan, and the one that was taken did not."""
    names = twin.action_names["humanoid"]
    better, done, could = read(text)
    assert (names[actions[-1]["humanoid"]], succeeded) == (done, could), text
    left = []
    for action in (actions[-1]["humanoid"], names.index(better)):
        rewound(twin, task, actions)
        before = len(twin.stage.oracle.plan(twin.setting.goal))
        twin.step({**actions[-1], "humanoid": action})
        left.append(len(twin.stage.oracle.plan(twin.setting.goal)) - before)
    assert left[0] >= 0 and left[1] == -1, (task, text, left)


def paper_feedback(env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float, steps: int) -> int:
    """Play a number of steps and check every sentence; return how many there were."""
    left, told, number = steps, 0, 0
    while left > 0:
        task = tasks[number % len(tasks)]
        for text, actions, succeeded in played(env, task, number, detours):
            left -= 1
            if text:
                told += 1
                check_paper(twin, task, text, list(actions), succeeded)
        number += 1
    return told


@pytest.mark.parametrize("detours", [1.0, 0.5])
def test_what_the_paper_style_recommends_works(
    env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float
) -> None:
    assert paper_feedback(env, twin, tasks, detours, 300) > 10


@pytest.mark.slow
@pytest.mark.parametrize("detours", [1.0, 0.5])
def test_what_the_paper_style_recommends_works_in_thousands_of_steps(
    env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float
) -> None:
    assert paper_feedback(env, twin, tasks, detours, 2000) > 80


def planner_feedback(env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], checks: int, detours: float) -> None:
    """Play episodes and check a number of their sentences; a step without one must have shortened the plan."""
    number = 0
    while checks > 0:
        task = tasks[number % len(tasks)]
        rng = np.random.default_rng(number)
        env.reset(options={"task": task})
        before = len(env.stage.oracle.plan(env.setting.goal))
        for text, actions, succeeded in played(env, task, number, detours):
            after = len(env.stage.oracle.plan(env.setting.goal))
            assert (after < before) == (text == ""), (task, text, before, after)
            before = after
            if text and rng.random() < 0.3:
                checks -= 1
                check_planner(twin, task, text, list(actions), succeeded)
        number += 1


@pytest.mark.parametrize("detours", [1.0, 0.3])
def test_what_the_planner_style_recommends_is_optimal(
    planner_env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float
) -> None:
    planner_feedback(planner_env, twin, tasks, 8, detours)


@pytest.mark.slow
def test_what_the_planner_style_recommends_is_optimal_in_thousands_of_steps(
    planner_env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task]
) -> None:
    planner_feedback(planner_env, twin, tasks, 100, 0.6)
