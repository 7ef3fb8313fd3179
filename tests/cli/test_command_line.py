"""The command line as a whole: options are explained and documented, examples parse, ``--quiet``, ``--json -``."""

import argparse
import io
import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from chmarl_pb.cli import main
from chmarl_pb.cli.arguments import EXAMPLE
from chmarl_pb.cli.completion import SHELLS, parsers_in
from chmarl_pb.cli.program import COMMANDS, parser_of
from chmarl_pb.progress import LateProgress, silence
from chmarl_pb.tasks.splits import load_tasks

DOCS = Path(__file__).parents[2] / "docs"
PARSER = parser_of(COMMANDS)
LEAVES = [parser for parser in parsers_in(PARSER) if "--quiet" in parser._option_string_actions]
TASK = "val-unseen-000"


@pytest.mark.parametrize("parser", LEAVES, ids=lambda parser: parser.prog)
def test_help_explains_every_argument_and_shows_an_example(parser: argparse.ArgumentParser) -> None:
    assert all(action.help for action in parser._actions)
    assert parser.epilog and parser.epilog.startswith(f"{EXAMPLE}{parser.prog} ".rstrip())
    words = shlex.split(parser.epilog.removeprefix(EXAMPLE))
    assert callable(PARSER.parse_args(words[1:]).run)


def test_every_command_is_tested() -> None:
    assert {parser.prog.split()[1] for parser in LEAVES} == set(COMMANDS)


def test_the_reference_is_what_the_parsers_have() -> None:
    """So every option stands in the docs; ``python -m tools.command_line`` writes the page."""
    pytest.importorskip("tyro")
    from tools.command_line import PAGE, reference

    assert PAGE.read_text(encoding="utf-8") == reference()


@pytest.mark.parametrize(
    ("command", "words"), [("train", ["qmix", "--help"]), ("train", ["dagger-mappo", "--help"]), ("sb3", ["--help"])]
)
def test_options_of_learners_stand_in_the_docs(command: str, words: list[str]) -> None:
    pytest.importorskip("tyro")
    from tools.command_line import learner_options

    text = (DOCS / "command_line.md").read_text(encoding="utf-8")
    options = learner_options(command, words)
    assert {"--seed", "--quiet", "--observation"} <= options
    assert all(f"`{option}`" in text for option in options)


# Results as JSON, and nothing else

EVALUATE = ("evaluate", "--policy", "random", "--split", "val-unseen", "--task", TASK, "--workers", "1", "--seeds", "1")


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ((*EVALUATE, "--out", "result.json"), "summary"),
        (("audit", "--split", "val-unseen", "--task", TASK, "--seeds", "1", "--workers", "1"), "rows"),
        (("homes", "list"), "name"),
        (("homes", "check", "home_6"), "playable"),
        (("things", "list"), "synonyms"),
        (("bench", "--only", "planner", "--runs", "1", "--warm-up", "1"), "figures"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, tuple) else "",
)
def test_json_is_all_that_is_printed(
    words: tuple[str, ...],
    key: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*words, "--json", "-"]) == 0
    said = capsys.readouterr()
    found: Any = json.loads(said.out)
    assert key in (found[0] if isinstance(found, list) else found) and said.err == ""
    assert main([*words, "--json", "facts.json"]) == 0
    said = capsys.readouterr()
    assert said.out and "{" not in said.out.splitlines()[0]
    again = json.loads(Path("facts.json").read_text())
    if "run" not in found and "figures" not in found:  # these hold times
        assert again == found


def test_a_replay_tells_in_json_whether_it_is_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, task = tmp_path / "episode.json", min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)
    assert main(["episode", "save", "--task", task.id, "--out", str(path)]) == 0
    capsys.readouterr()
    assert main(["episode", "replay", str(path), "--json", "-"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts == {"file": str(path), "same": True, "success": True, "steps": task.optimal_steps}


def test_bad_targets_of_json_are_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["homes", "list", "--json", str(tmp_path)])
    assert "is a folder" in capsys.readouterr().err


# Quiet


def test_quiet_leaves_results_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*EVALUATE]) == 0
    loud = capsys.readouterr()
    assert main([*EVALUATE, "--quiet"]) == 0
    said = capsys.readouterr()
    assert "episodes" in said.out and said.out == loud.out
    assert said.err == "" and loud.err != ""


def test_quiet_leaves_notes_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, words in (("a", []), ("b", ["--quiet"])):
        assert main(["homes", "new", str(tmp_path / f"{name}.toml"), *words]) == 0
    assert [line.startswith("next: ") for line in capsys.readouterr().out.splitlines()] == [False, True, False]


def test_no_bar_is_shown_within_silence() -> None:
    shown = io.StringIO()
    with silence():
        bar = LateProgress(console=Console(file=shown, force_terminal=True))
    with bar:
        list(bar.track(range(3)))
        bar.update(bar.add_task("playing", total=2), completed=1)
    assert shown.getvalue() == ""


# Completion


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_knows_commands_and_options(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("shtab")
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(word in script for word in (*COMMANDS, "live", "feedback", "grounded"))
