"""Every sentence is English of the closed vocabulary, can be read back, and is true."""

from dataclasses import replace
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, Name
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.tasks import language
from chmarl_pb.tasks.language.choice import may_use_held_out
from chmarl_pb.tasks.language.instructions import phrase
from chmarl_pb.tasks.language.names import names_of
from chmarl_pb.tasks.language.templates import INSTRUCTIONS
from chmarl_pb.tasks.language.tokens import FILE
from chmarl_pb.tasks.splits import BENCHMARK_SPLITS, SPLIT_SIZES, TRAINING_SPLITS, load_tasks
from chmarl_pb.tasks.task import Task

TARGETS = list(BENCHMARK.receptacles)
TASK = Task("t", "home_1", "mug", "bed", "desk", 0)


def tasks_of(graspable: str, seeds: range) -> list[Task]:
    """Return tasks with one object and all targets in turn."""
    targets = [TARGETS[seed % len(TARGETS)] for seed in seeds]
    sources = ["bed" if target != "bed" else "sofa" for target in targets]
    return [
        Task(f"t-{seed}", "home_1", graspable, source, target, seed)
        for seed, source, target in zip(seeds, sources, targets, strict=True)
    ]


@pytest.mark.parametrize("graspable", BENCHMARK.graspables)
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
    sentences = {language.instruction(task) for name in BENCHMARK.graspables for task in tasks_of(name, range(64))}
    for sentence in sentences:
        tokens = language.tokenize(sentence, language.INSTRUCTION_LENGTH)
        count = np.count_nonzero(tokens)
        assert language.UNKNOWN not in tokens and tokens.max() < language.vocabulary_size(), sentence
        assert count == len(language.words(sentence)) and not tokens[count:].any()


def test_unknown_words_and_long_sentences() -> None:
    the, unknown, *rest = language.tokenize("the xylophone", 4).tolist()
    assert the > language.UNKNOWN and unknown == language.UNKNOWN and rest == [0, 0]
    assert len(language.tokenize("the " * 50, 8)) == 8 and not language.tokenize("", 8).any()


@pytest.mark.parametrize("text", ["", "Put the xylophone on the desk.", "Put the mug on the moon.", None, 5, []])
def test_unreadable_instructions(text: Any) -> None:
    with pytest.raises(OptionError):
        language.parse_instruction(text)


def test_longer_names_win() -> None:
    assert language.parse_instruction("Put the wine glass on the coffee table.") == ("wine_glass", "coffee_table")
    assert language.parse_instruction("put a hand towel on the towel shelf") == ("towel", "towel_rack")


@pytest.mark.parametrize("text", ["Put the mug or the plate on the desk.", "Move the mug from the bed to the desk."])
def test_ambiguous_instructions(text: str) -> None:
    with pytest.raises(ValueError, match="must name one known"):
        language.parse_instruction(text)


# Templates and names

TEMPLATES = INSTRUCTIONS.pool(held_out=True)
ARTICLES = [*product((True, False), repeat=2)]
NAMED = [(row.name, name) for row in BENCHMARK.graspables.values() for name in row.names]
PLACES = [(row.name, name) for row in BENCHMARK.receptacles.values() for name in row.names]


def check_sentence(template: str, x: tuple[str, Name], y: tuple[str, Name]) -> None:
    """A sentence reads back and fits its token array, whatever its articles."""
    for articles in ARTICLES:
        text = phrase(template, x[1], y[1], *articles)
        assert language.parse_instruction(text) == (x[0], y[0]), text
        assert len(language.words(text)) <= language.INSTRUCTION_LENGTH, text


def test_there_are_forty_templates() -> None:
    assert len(set(TEMPLATES)) == len(TEMPLATES) >= 40
    assert INSTRUCTIONS.train and INSTRUCTIONS.held_out


@pytest.mark.parametrize("template", TEMPLATES)
def test_every_template_with_every_name(template: str) -> None:
    for x in NAMED:
        check_sentence(template, x, ("desk", BENCHMARK.receptacles["desk"].names[0]))
    for y in PLACES:
        check_sentence(template, ("mug", BENCHMARK.graspables["mug"].names[0]), y)


def test_every_object_with_every_place() -> None:
    for x, y in product(NAMED, PLACES):
        check_sentence(TEMPLATES[0], x, y)
        assert phrase(TEMPLATES[0], x[1], y[1], True, True).lower() == f"put the {x[1].text} on the {y[1].text}."


@pytest.mark.parametrize(
    "row", [*BENCHMARK.graspables.values(), *BENCHMARK.receptacles.values()], ids=lambda row: row.name
)
def test_every_class_has_synonyms_shown_and_held_out(row: catalog.ThingClass) -> None:
    assert len(names_of(row.name, held_out=False)) >= 2
    assert len(names_of(row.name, held_out=True)) > len(names_of(row.name, held_out=False))


@pytest.mark.parametrize("room", catalog.ROOM_KINDS)
def test_every_room_has_synonyms(room: str) -> None:
    assert len(names_of(room, held_out=False)) >= 2


@pytest.mark.parametrize(
    ("template", "graspable", "name", "expected"),
    [
        ("Put {x} on {y}.", "apple", 0, "Put an apple on a TV stand."),
        ("Put {x} on {y}.", "slippers", 1, "Put some house shoes on a TV stand."),
        ("Put {x} on {y}.", "bread", 0, "Put some bread on a TV stand."),
        ("Put {x} on {y}.", "bread", 1, "Put a loaf of bread on a TV stand."),
        ("{the_x} {is} here; {they} need{s} me, so take {it}.", "notes", 0,
         "The notes are here; they need me, so take them."),
        ("{the_x} {is} here; {they} need{s} me, so take {it}.", "mug", 0, "The mug is here; it needs me, so take it."),
        ("There {is} {a_x}.", "notes", 0, "There are some notes."),
        ("There {is} {a_x}.", "wine_bottle", 1, "There is a bottle of wine."),
    ],
)  # fmt: skip
def test_grammar(template: str, graspable: str, name: int, expected: str) -> None:
    x, y = BENCHMARK.graspables[graspable].names[name], BENCHMARK.receptacles["tv_stand"].names[0]
    assert phrase(template, x, y, False, False) == expected


# Held-out paraphrases


def shown(task: Task) -> set[str]:
    """Return the instructions that training could give for a task."""
    xs, ys = (names_of(name, held_out=False) for name in (task.graspable, task.target))
    return {phrase(text, x, y, *bits) for text, x, y, bits in product(INSTRUCTIONS.train, xs, ys, ARTICLES)}


@pytest.mark.parametrize("split", SPLIT_SIZES)
def test_held_out_words_are_for_validation_and_test(split: str) -> None:
    tasks = load_tasks(split)[:300]
    unseen = [language.instruction(task) not in shown(task) for task in tasks]
    assert not any(unseen) if split in TRAINING_SPLITS else np.mean(unseen) >= 0.5


@pytest.mark.parametrize(
    ("task_id", "expected"),
    [
        ("train-0001", False),
        ("train-limited-0001", False),
        ("home_7-123", False),
        ("mine", False),
        ("val-unseen-007", True),
        ("test-seen-1", True),
    ],
)
def test_the_id_of_a_task_tells_its_words(task_id: str, expected: bool) -> None:
    assert may_use_held_out(replace(TASK, id=task_id)) == expected


def test_seen_words_are_those_that_training_shows() -> None:
    """Of the words in validation and test, the held-out ones are those in no instruction of the 5,500 for training."""
    shown, asked = (
        {word for split in splits for task in load_tasks(split) for word in language.words(language.instruction(task))}
        for splits in (["train"], [split for split in SPLIT_SIZES if split not in TRAINING_SPLITS])
    )
    assert asked - shown == asked & language.held_out_words()


def test_six_of_ten_instructions_of_validation_and_test_have_held_out_words() -> None:
    asked = [task for split in BENCHMARK_SPLITS if split != "train" for task in load_tasks(split)]
    assert 0.55 < np.mean([language.wording_of_task(task) == "held-out" for task in asked]) < 0.65
    assert {language.wording_of_task(task) for task in load_tasks("train")} == {"seen"}


@pytest.mark.parametrize(
    ("text", "wording"),
    [
        ("", "seen"), ("Put the mug on the desk.", "seen"), ("Place the smartphone on a bed!", "held-out"),
        ("Transfer the mug onto the desk.", "held-out"), ("Put the table fork on the desk.", "seen"),
        ("Put the red mug on the desk in the lounge.", "seen"),
        ("Put the mug on the desk in the restroom.", "held-out"),
    ],
)  # fmt: skip
def test_wording(text: str, wording: str) -> None:
    assert language.wording_of(text) == wording


# Vocabulary and corpus


def test_vocabulary_file_holds_exactly_the_words_of_the_language() -> None:
    assert FILE.read_text(encoding="ascii").splitlines() == language.all_words()
    assert language.vocabulary_size() == len(language.all_words()) + 2
    assert min(language.vocabulary().values()) == max(language.PADDING, language.UNKNOWN) + 1


def test_corpus_statistics() -> None:
    counts = language.corpus_statistics(["Put the mug on the desk.", "", "Put it down!"])
    assert counts == language.CorpusStatistics(2, 7, 4.5, {3: 1, 6: 1})
    assert language.corpus_statistics([]).mean_length == 0


def test_the_corpus_is_as_rich_as_the_paper_s(env: HouseholdEnv, tasks: list[Task]) -> None:
    """CH-MARL, section 3: 183 unique words and 14.04 words in a sentence."""
    corpus = [language.instruction(task) for split in BENCHMARK_SPLITS for task in load_tasks(split)]
    rng = np.random.default_rng(0)
    for task in tasks[:6]:
        env.reset(options={"task": task})
        while env.agents:
            infos = env.step({"humanoid": int(rng.integers(10)), "drone": 8})[-1]
            corpus.append(infos["humanoid"]["feedback"])
    counts = language.corpus_statistics(corpus)
    assert counts.distinct_words >= 183
    assert 13 <= counts.mean_length <= 15
