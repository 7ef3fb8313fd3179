"""The mended sentences: the same tasks, words and slots; the benchmark's own sentences stay as they are."""

import hashlib
from itertools import product

import numpy as np
import pytest

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.tasks import language
from chmarl_pb.tasks.language import feedback
from chmarl_pb.tasks.language.actions import VERBS
from chmarl_pb.tasks.language.instructions import phrase
from chmarl_pb.tasks.language.templates import DETOUR, INSTRUCTIONS, MENDED, MISSED_PICK, MISSED_PLACE, revised
from chmarl_pb.tasks.splits import LIMITED_SPLITS, SPLITS, load_tasks
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.tidy_task import TidyTask

SPOKEN = (INSTRUCTIONS, MISSED_PICK, MISSED_PLACE, DETOUR)
TASK = Task("t", "home_1", "slippers", "bed", "desk", 0)
X, Y = (BENCHMARK.classes[name].names[0] for name in ("slippers", "desk"))


def sentence(template: str) -> str:
    """Return a template of any kind, filled."""
    if template in (*INSTRUCTIONS.pool(True), *map(mended, INSTRUCTIONS.pool(True))):
        return phrase(template, X, Y, True, False)
    verb = VERBS["turn_left"][0]
    return feedback.phrase(template, X, Y, language.Advice("stay", True, "turn_left", True), verb, verb)


def mended(template: str) -> str:
    return revised(template, 2)


def test_the_benchmarks_sentences_stay() -> None:
    texts = [
        language.instruction(task) for split in SPLITS if split not in LIMITED_SPLITS for task in load_tasks(split)
    ]
    assert hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16] == "ff9afc7f57445624"
    assert all(revised(template, 1) == template for template in MENDED)


def test_each_stands_for_one_template() -> None:
    old = [template for kind in SPOKEN for template in kind.pool(True)]
    assert MENDED.keys() <= set(old) and set(old).isdisjoint(MENDED.values())
    assert len({*map(mended, old)}) == len(old) == len(set(old))


@pytest.mark.parametrize("template", MENDED.values())
def test_its_words_are_known(template: str) -> None:
    text = sentence(template)
    assert "{" not in text and set(language.words(text)) <= language.vocabulary().keys()


def test_training_shows_no_words_that_were_held_out() -> None:
    """So a task has seen or held-out wording whatever the revision."""
    for template in INSTRUCTIONS.train:
        assert language.wording_of(sentence(mended(template))) == "seen"
    for template in INSTRUCTIONS.held_out:
        assert language.wording_of(sentence(mended(template))) == language.wording_of(sentence(template))


def test_a_pronoun_has_something_to_refer_to() -> None:
    for template in (mended(one) for kind in SPOKEN for one in kind.pool(True)):
        before = template.split("{it}")[0].split("{they}")[0]
        assert before == template or "x}" in before, template


@pytest.mark.parametrize("split", ["train", "test-unseen"])
def test_instructions_ask_for_the_same(split: str) -> None:
    for task in load_tasks(split)[:500]:
        text = language.instruction(task, templates=2)
        assert language.parse_instruction(text) == (task.graspable, task.target)
        assert len(language.words(text)) <= language.INSTRUCTION_LENGTH
        assert language.wording_of(text) == language.wording_of_task(task)


def test_feedback_fits_its_tokens() -> None:
    longest = max(
        (name for kind in (BENCHMARK.graspables, BENCHMARK.receptacles) for row in kind.values() for name in row.names),
        key=lambda name: len(language.words(name.text)),
    )
    advice = language.Advice("goto_livingroom", False, "turn_right", True)
    turn, goto = VERBS["turn_right"][1], language.actions.ways_to_say("goto_livingroom", True)[-1]
    for template, held in product((mended(one) for kind in SPOKEN[1:] for one in kind.pool(True)), (True, False)):
        text = feedback.phrase(template, longest, longest, advice, *((goto, turn) if held else (turn, goto)))
        assert len(language.words(text)) <= language.FEEDBACK_LENGTH, text


def test_feedback_is_mended() -> None:
    advice = language.Advice("stay", True, "place", True)
    first, second = ({language.say(TASK, step, advice, templates=n) for step in range(200)} for n in (1, 2))
    assert any("put them" in text for text in first) and not any("them" in text for text in second)


def test_environments_speak_either() -> None:
    first = next(task for task in load_tasks("train") if "keep" in language.instruction(task))
    texts = {}
    for templates in (1, 2):
        env = HouseholdEnv(templates=templates)
        observations, _ = env.reset(seed=0, options={"task": first})
        texts[templates] = env.instruction
        tokens = language.tokenize(env.instruction, language.INSTRUCTION_LENGTH)
        assert np.array_equal(observations["drone"]["instruction"], tokens)
        env.close()
    assert texts[1].replace("keep", "put") == texts[2] != texts[1]


def test_tidying_speaks_either() -> None:
    wanted = [("mug", "desk"), ("book", "sofa")]
    moves = tuple(Task(f"t.{n}", "home_1", item, "bed", goal, n) for n, (item, goal) in enumerate(wanted))
    env = HouseholdEnv(task="tidy", templates=2)
    task = TidyTask("t", "home_1", moves, 0)
    assert env.instruction_of(task) == " ".join(language.instruction(move, templates=2) for move in moves)
    env.close()


def test_unknown_revisions_are_refused() -> None:
    with pytest.raises(OptionError, match="templates=3"):
        HouseholdEnv(templates=3)
