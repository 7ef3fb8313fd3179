"""The commands at the beginning of docs/training.md work one after the other on a clean machine."""

import re
import shlex
from pathlib import Path

import pytest

from chmarl_pb.cli import program
from chmarl_pb.policies.weights import ENCODER, published

train = pytest.importorskip("chmarl_pb.cli.train")

TEXT = (Path(__file__).parents[2] / "docs" / "training.md").read_text(encoding="utf-8")
LINES = re.findall(r"```\n(.*?)```", TEXT, re.DOTALL)[0].splitlines()
COMMANDS = [shlex.split(line, comments=True) for line in LINES]
TRAININGS = [words[3:] for words in COMMANDS if words[:3] == ["python", "-m", "training.train"]]
EVALUATED = next(words for words in COMMANDS if words[:2] == ["chmarl-pb", "evaluate"])


def place(*beginning: str) -> int:
    return next(number for number, words in enumerate(COMMANDS) if words[: len(beginning)] == list(beginning))


def test_every_training_is_understood() -> None:
    assert len(TRAININGS) >= 3
    for words in TRAININGS:
        train.parse(words)
    for words in COMMANDS:
        if words[0] == "chmarl-pb":
            program.parser_of(words[1:]).parse_args(words[1:])


def test_what_a_command_needs_is_made_before_it() -> None:
    for words in TRAININGS:
        command = train.parse(words)
        here = COMMANDS.index(["python", "-m", "training.train", *words])
        if command.setting.observation == "visual" and command.config.image_encoder != "cnn":
            assert published(command.config.image_encoder, ENCODER) is not None  # comes with the package
        if command.algo == "bc":
            assert place("chmarl-pb", "dataset", "generate") < here


def test_the_checkpoint_that_is_evaluated_is_of_a_training_before() -> None:
    folders = [str(Path("out/train") / train.run_name(train.parse(words))) for words in TRAININGS]
    assert str(Path(EVALUATED[EVALUATED.index("--policy") + 1]).parent) in folders
