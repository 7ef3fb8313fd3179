"""Every sentence is English of the closed vocabulary, can be read back, and is true."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from chmarl_pb import catalog
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.tasks import language
from chmarl_pb.tasks.task import Task

TARGETS = list(catalog.RECEPTACLES)
TASK = Task("t", "home_1", "mug", "bed", "desk", 0)


def tasks_of(graspable: str, seeds: range) -> list[Task]:
    """Return tasks with one object and all targets in turn."""
    targets = [TARGETS[seed % len(TARGETS)] for seed in seeds]
    sources = ["bed" if target != "bed" else "sofa" for target in targets]
    return [
        Task(f"t-{seed}", "home_1", graspable, source, target, seed)
        for seed, source, target in zip(seeds, sources, targets, strict=True)
    ]


@pytest.mark.parametrize("graspable", catalog.GRASPABLES)
def test_instructions_read_back_and_are_well_formed(graspable: str) -> None:
    for task in tasks_of(graspable, range(96)):
        sentence = language.instruction(task)
        assert language.parse_instruction(sentence) == (task.graspable, task.target)
        assert sentence[0].isupper() and sentence[-1] in ".?!" and "{" not in sentence and "  " not in sentence
        words = language.words(sentence)
        for article, noun in pairwise(words):
            if article in ("a", "an"):
                assert (article == "an") == (noun[0] in "aeiou"), sentence


def test_an_instruction_depends_on_the_seed_alone() -> None:
    assert language.instruction(TASK) == language.instruction(replace(TASK, home="home_2", source="sofa"))
    assert len({language.instruction(replace(TASK, seed=seed)) for seed in range(200)}) > 20


def test_tokens_are_known_and_nothing_is_cut() -> None:
    sentences = {language.instruction(task) for name in catalog.GRASPABLES for task in tasks_of(name, range(64))}
    for sentence in sentences:
        tokens = language.tokenize(sentence, language.INSTRUCTION_LENGTH)
        count = np.count_nonzero(tokens)
        assert language.UNKNOWN not in tokens and tokens.max() < language.vocabulary_size(), sentence
        assert count == len(language.words(sentence)) and not tokens[count:].any()


def test_unknown_words_and_long_sentences() -> None:
    the, unknown, *rest = language.tokenize("the xylophone", 4).tolist()
    assert the > language.UNKNOWN and unknown == language.UNKNOWN and rest == [0, 0]
    assert len(language.tokenize("the " * 50, 8)) == 8 and not language.tokenize("", 8).any()


@pytest.mark.parametrize("text", ["", "Put the xylophone on the desk.", "Put the mug on the moon."])
def test_unreadable_instructions(text: str) -> None:
    with pytest.raises(ValueError):
        language.parse_instruction(text)


def test_longer_names_win() -> None:
    assert language.parse_instruction("Put the wine glass on the coffee table.") == ("wine_glass", "coffee_table")
    assert language.parse_instruction("put a hand towel on the towel shelf") == ("towel", "towel_rack")


def test_feedback_of_random_episodes_is_true(env: HouseholdEnv, tasks: list[Task]) -> None:
    """Told to have missed a pick or a place exactly when it was seen and would have worked."""
    told = 0
    for number, task in enumerate(tasks[:14]):
        rng = np.random.default_rng(number)
        env.reset(options={"task": task})
        while env.agents:
            previous, humanoid, goal = env.outcome, env.stage.humanoid, env.setting.goal
            action = int(rng.choice(10, p=[0.04] * 4 + [0.15, 0.01] + [0.17] * 4))
            name = env.action_names["humanoid"][action]
            verb = "place" if previous.held else "pick"
            could = humanoid.plan(verb, goal, previous.seen["humanoid"]) is not None
            observations, _, _, _, infos = env.step({"humanoid": action, "drone": int(rng.integers(9))})
            text = infos["humanoid"]["feedback"]
            assert infos["drone"]["feedback"] == ""
            assert bool(text) == (could and name != verb), (task.id, name, text)
            tokens = observations["humanoid"]["feedback"]
            assert language.UNKNOWN not in tokens
            assert np.count_nonzero(tokens) == len(language.words(text)), text
            told += bool(text)
    assert told > 20
