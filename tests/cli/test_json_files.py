"""The files of ``--json``: there before anything is shown."""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import pytest

from chmarl_pb.cli import main, output
from chmarl_pb.cli.completion import parsers_in
from chmarl_pb.cli.program import COMMANDS, parser_of
from chmarl_pb.errors import WriteError

ONE = ("--split", "val-unseen", "--seeds", "1", "--workers", "1")
PLAY = ("evaluate", "--policy", "random", *ONE, "--task", "val-unseen-000")
COMMANDS_WITH_IT = [
    (*PLAY, "--quiet"),
    ("baselines", "--policy", "random", *ONE, "--quiet"),
    ("audit", *ONE, "--task", "val-unseen-000", "--quiet"),
    ("homes", "list"),
    ("homes", "check", "home_6"),
    ("things", "list"),
    ("dataset", "stats"),
    ("bench", "--only", "planner", "--runs", "1", "--warm-up", "1", "--quiet"),
]
PARSERS = [parser for parser in parsers_in(parser_of(COMMANDS)) if "--json" in parser._option_string_actions]


@contextmanager
def unread() -> Iterator[None]:
    """Let the standard output be a pipe that nobody reads."""
    read, write = os.pipe()
    os.close(read)
    with open(write, "w", encoding="utf-8") as pipe, redirect_stdout(pipe):
        yield


@pytest.mark.parametrize("words", COMMANDS_WITH_IT, ids=lambda words: " ".join(words[:2]))
def test_the_file_is_there_though_nobody_reads_what_is_shown(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "data"))
    with unread():
        assert main([*words, "--json", "facts.json"]) == 141
    assert json.loads(Path("facts.json").read_text()) and capsys.readouterr().err == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_the_file_is_there_though_the_output_is_full(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "chmarl_pb.cli", *PLAY, "--quiet", "--json", str(tmp_path / "facts.json")]
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
    assert ended.returncode == 2 and ended.stderr == (
        "chmarl-pb: the output cannot be written: No space left on device\n"
    )
    assert json.loads((tmp_path / "facts.json").read_text())["summary"]


def test_bars_that_nobody_reads_end_no_work(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "chmarl_pb.cli", *PLAY, "--json", str(tmp_path / "facts.json")]
    ended = subprocess.run(command, stderr=write, stdout=subprocess.PIPE, text=True, timeout=300)
    os.close(write)
    assert ended.returncode == 0 and ended.stdout and (tmp_path / "facts.json").exists()


def test_what_cannot_be_written_is_shown_yet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    options = argparse.Namespace(json=str(tmp_path / "file" / "facts.json"))
    with pytest.raises(WriteError, match=r"facts\.json"):
        output.tell(options, lambda: 1, lambda: print("shown"))
    assert capsys.readouterr().out == "shown\n"
