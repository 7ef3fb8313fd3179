"""The commands at the beginning of docs/training.md work one after the other anywhere, and its tables are true."""

import json
import re
import shlex
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest

from chmarl_pb.cli import program
from chmarl_pb.policies.weights import ENCODER, published

train = pytest.importorskip("chmarl_pb.cli.train")

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "training.md").read_text(encoding="utf-8")
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


def rows_of(name: str) -> list[list[str]]:
    """Return the cells of a table of the page, without its head."""
    table = TEXT.split(f"<!-- {name} -->")[1].split(f"<!-- end of {name} -->")[0].strip()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def runs_of(row: str, table: str) -> list[dict[str, Any]]:
    """Return the kept runs of a row."""
    slug = re.sub("[^a-z0-9]+", "-", row.lower()).strip("-")
    files = sorted((ROOT / "results" / table).glob(f"{slug}-seed?.json"))
    return [json.loads(file.read_text(encoding="utf-8")) for file in files]


def test_learners_to_take_score_what_is_said() -> None:
    before = ""
    for name, _, minutes, score in rows_of("learners"):
        alike = name == "the same on pictures"
        runs = runs_of(before if alike else name, "visual" if alike else "scene-graph")
        before = name
        took = [round(run["seconds"]["train"] / 60) for run in runs]
        assert len(runs) == 3 and minutes == f"{min(took)} to {max(took)}", name
        summaries = [run["evaluation"]["splits"]["test-unseen"]["summary"] for run in runs]
        means = [100 * fmean(one[metric]["mean"] for one in summaries) for metric in ("success_rate", "plw")]
        assert score == " / ".join(f"{mean:.1f}" for mean in means), name


def test_learners_to_take_are_trained_by_what_is_said() -> None:
    """The arguments, with the encoder in the place of its letter, are among those of the row."""
    encoder = "--graph-pool grounded --word-vectors --grounding-coef 1 --numbers-past"
    before, wanted = "", ""
    for name, said, *_ in rows_of("learners"):
        alike = name == "the same on pictures"
        own = " ".join(re.findall("`(--[^`]*)`", said)) + (f" {encoder}" if "`G`" in said else "")
        wanted = f"{wanted} {own}" if said.startswith(("the same", "and ")) else own
        command = runs_of(before if alike else name, "visual" if alike else "scene-graph")[-1]["commands"]["train"]
        before = name
        assert set(wanted.split()) <= set(command.split()), name
        left = command.split(" ", 3)[3].split(" --observation ")[0]
        assert set(left.split()) <= {*wanted.split(), "--preset", "goal"}, name


def test_defaults_are_those_of_the_command() -> None:
    for names, episodes, envs, pool, eyes, rate, _ in rows_of("defaults"):
        for name in re.findall("`([^`]*)`", names):
            teacher = ["--expert", "belief"] if name == "imitation" else []
            config = train.parse(["--algo", name, "--observation", "visual", *teacher]).config
            assert (config.graph_pool, config.image_encoder, f"{config.learning_rate:g}") == (pool, eyes, rate)
            budget = f"{config.epochs} epochs" if name == "bc" else f"{config.episodes:,}"
            assert episodes.endswith(budget) and envs == str(getattr(config, "envs", ""))
