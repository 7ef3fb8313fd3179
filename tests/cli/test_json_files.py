"""The files of ``--json``: there before anything is shown, told from results, and never in place of something else."""

import argparse
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from chmarl_pb.cli import main, output
from chmarl_pb.cli.arguments import EXAMPLE
from chmarl_pb.cli.completion import parsers_in
from chmarl_pb.cli.program import COMMANDS, parser_of
from chmarl_pb.envs.tracks import PAPER, TRACKS
from chmarl_pb.errors import ResultError, WriteError
from chmarl_pb.evaluation.result import FORMAT, SUMMARY, load_result

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


# What an evaluation writes there is no result


@pytest.fixture
def summary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A summary, as ``evaluate --json`` writes it."""
    monkeypatch.chdir(tmp_path)
    assert main([*PLAY, "--quiet", "--json", "summary.json", "--out", "result.json"]) == 0
    return tmp_path / "summary.json"


def test_a_summary_calls_itself_one(summary: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found, result = (json.loads(path.read_text()) for path in (summary, summary.with_name("result.json")))
    assert (found["format"], result["format"]) == (SUMMARY, FORMAT)
    assert {**found, "format": FORMAT} == {name: value for name, value in result.items() if name != "episodes"}
    capsys.readouterr()
    assert main(["report", str(summary), "--out", "page.html"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "summary.json: is a summary without episodes" in line and "name one that `chmarl-pb evaluate --out`" in line


@pytest.mark.parametrize("wrong", ["as before", "baselines"])
def test_other_files_of_json_are_no_results(summary: Path, wrong: str) -> None:
    before = {**json.loads(summary.read_text()), "format": FORMAT}
    summary.write_text(json.dumps(before if wrong == "as before" else {"val-unseen": {"random": before}}))
    with pytest.raises(ResultError, match=r"name one that `chmarl-pb evaluate --out` has written") as raised:
        load_result(summary)
    assert "KeyError" not in str(raised.value)


def test_what_was_written_before_is_written_anew(summary: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for before in (summary.read_text(), summary.read_text().replace(SUMMARY, FORMAT), ""):
        summary.write_text(before)
        assert main([*PLAY, "--quiet", "--json", str(summary)]) == 0
        assert json.loads(summary.read_text())["format"] == SUMMARY
    for target, option, what in ((summary, "--out", "a result"), (summary.with_name("result.json"), "--json", "what")):
        before, _ = target.read_text(), capsys.readouterr()
        assert main([*PLAY, option, str(target)]) == 2
        assert f"{target} is there already and is not {what}" in capsys.readouterr().err
        assert target.read_text() == before


# Files of others


@pytest.mark.parametrize("parser", PARSERS, ids=lambda parser: parser.prog)
@pytest.mark.parametrize(
    "content", ["no JSON", "[]", "{}", '{"name": "mine"}', '[{"name": "mine"}]', '{"a": {"b": 1}}']
)
def test_files_of_others_are_not_written_over(
    parser: argparse.ArgumentParser,
    content: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "own.json"
    file.write_text(content)
    words = shlex.split(str(parser.epilog).removeprefix(EXAMPLE))[1:]
    assert main([*words, "--json", "own.json"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        f"chmarl-pb: own.json is there already and is not what {parser.prog} --json writes; "
        "name another file, or remove it"
    )
    assert file.read_text() == content and list(tmp_path.iterdir()) == [file]


def no_play(*arguments: Any, **options: Any) -> None:
    raise AssertionError("something is played")


@pytest.mark.parametrize("folder", ["out", "lengths"])
@pytest.mark.parametrize(
    "content",
    [b"[1, 2]", b"\xff\xfe", b"my notes", b'{"split": "val-unseen"}', None,
     b'{"split": "a", "max_steps": 1, "tasks": "", "homes": {}, "lengths": {"val-unseen-000": [1]}}'],
    ids=["list", "bytes", "notes", "object", "folder", "lengths"],
)  # fmt: skip
def test_no_target_of_the_baselines_is_of_others(
    content: bytes | None,
    folder: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("chmarl_pb.cli.baselines.evaluate", no_play)
    target = Path(folder) / ("val-unseen.json" if folder == "lengths" else "val-unseen-search.json")
    target.parent.mkdir()
    if content is None:
        target.mkdir()
    else:
        target.write_bytes(content)
    words = ["baselines", *ONE, "--policy", "random", "--policy", "search", "--out", "out", "--references", "lengths"]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"chmarl-pb: {target} is ")
    assert target.is_dir() if content is None else target.read_bytes() == content
    assert list(Path().rglob("*")) == [target.parent, target]


def test_references_are_written_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(TRACKS[PAPER], "max_steps", 2)
    words = ["baselines", *ONE, "--references", "lengths", "--quiet", "--policy"]
    Path("lengths").mkdir()
    Path("lengths/val-unseen.json").write_text("")
    assert main([*words, "random"]) == 0 and main([*words, "search"]) == 0
    lengths = json.loads(Path("lengths/val-unseen.json").read_text())["lengths"]
    assert set(lengths["val-unseen-000"]) == {"random", "search"}


@pytest.mark.parametrize(
    "words",
    [
        ("audit", *ONE, "--out", "au/a.json", "--json", "au/a/random.json"),
        ("audit", *ONE, "--out", "au/a.json", "--json", "au/a/new.json"),
        ("baselines", *ONE, "--out", "au/a", "--json", "au/../au/a/val-unseen-random.json"),
        ("baselines", *ONE, "--references", "au/a", "--json", "au/a/val-unseen.json"),
    ],
    ids=lambda words: f"{words[0]} {words[-1]}",
)
def test_the_file_does_not_lie_among_other_results(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("audit", "baselines"):
        monkeypatch.setattr(f"chmarl_pb.cli.{name}.{'audit' if name == 'audit' else 'evaluate'}", no_play)
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"chmarl-pb: --json {words[-1]}: lies in au/a, among other results; name a file elsewhere"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", COMMANDS_WITH_IT[1:], ids=lambda words: " ".join(words[:2]))
def test_every_command_writes_its_own_file_anew(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "data"))
    for _ in range(2):
        assert main([*words, "--json", "facts.json"]) == 0


@pytest.mark.parametrize(
    ("prog", "written"),
    [
        ("chmarl-pb episode replay", {"file": "episode.json", "same": True, "success": True, "steps": 4}),
        ("chmarl-pb dataset verify", {"chmarl/visual-train-v0": {"replayed": 3, "episodes": 3}}),
    ],
)
def test_so_do_those_that_need_more(prog: str, written: Any) -> None:
    (is_own,) = (parser.get_default("own_json")[0] for parser in PARSERS if parser.prog == prog)
    assert is_own(written) and not is_own(list(written))
