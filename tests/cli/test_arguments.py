"""Arguments are checked before work begins: one message, and nothing before it, no progress bar above all."""

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

import chmarl_pb
from chmarl_pb.cli import audit as audit_command
from chmarl_pb.cli import main
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.policy import Policy
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.progress import LateProgress


def refuses(env: chmarl_pb.HouseholdEnv) -> Policy:
    """A policy that was made for something else, as a checkpoint may be."""
    raise OptionError("a policy for pictures; use --observation visual")


TASK = ("--task", "val-unseen-000")
PLAY = ("evaluate", "--split", "val-unseen", *TASK, "--policy")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*PLAY, "random", "--workers", "0"), "workers=0 is not a whole number from 1 "),
        ((*PLAY, "random", "--seeds", "0"), "seeds=0 is not a whole number from 1 "),
        ((*PLAY, "random", "--draw", "5"), "--draw is the number of tasks for --home"),
        (("evaluate", "--policy", "random", "--home", "home_6", "--draw", "0"), "draw=0"),
        (("evaluate", "--policy", "random", "--home", "home_6", "--split", "val-unseen"), "--split is not played"),
        (("evaluate", "--policy", "random", "--home", "home_6", "--split", "test-unseen"), "--split is not played"),
        ((*PLAY, "random", "--label", "mine"), "label='mine' names a row of reports"),
        (("audit", "--split", "val-unseen", "--seeds", "-1"), "seeds=-1 is not a whole number from 1 "),
        ((*PLAY, "random", "--ray", "auto", "--workers", "3"), "--workers is for this machine alone"),
        ((*PLAY, "random", "--max-steps", "0"), "max_steps"),
        (("evaluate", "--policy", "random", "--split", "nowhere"), "nowhere"),
        (("evaluate", "--policy", "random", "--task", "nothing"), "nothing"),
        ((*PLAY, "guess"), "unknown policy 'guess'"),
        ((*PLAY, "best.pt"), "best.pt: no such file"),
        ((*PLAY, "best.onnx"), "best.onnx: no such file"),
        ((*PLAY, "out/best"), "out/best: no such file"),
        ((*PLAY, "./guess"), "./guess: no such file"),
        ((*PLAY, "no_such_module:make"), "no_such_module"),
        ((*PLAY, "tests.cli.test_arguments:refuses", "--seeds", "2"), "a policy for pictures"),
        ((*PLAY, "tests.cli.test_arguments:refuses", "--workers", "1"), "a policy for pictures"),
        (("baselines", "--workers", "0"), "workers=0"),
        (("baselines", "--seeds", "0"), "seeds=0"),
        (("baselines", "--split", "val-unseen", "--split", "nowhere"), "nowhere"),
        (("dataset", "generate", "--workers", "0"), "workers=0"),
        (("dataset", "generate", "--limit", "0"), "limit 0"),
        (("dataset", "generate", "--noise", "2"), "noise 2.0"),
        (("dataset", "generate", "--home", "home_6", "--split", "train"), "--split is not played where --home is"),
        (("dataset", "generate", "--split", "train", "--seed", "1"), "--seed is for --noise, and for tasks that"),
        (("dataset", "generate", "--split", "val-unseen", "--split", "nowhere"), "nowhere"),
        (("dataset", "verify", "--workers", "0"), "workers=0"),
        (("dataset", "verify", "--split", "nowhere"), "nowhere"),
        (("tasks", "build", "--out", "tasks", "--workers", "0"), "workers=0"),
        (("cache", "--fill", "home_1", "--workers", "0"), "workers=0"),
        (("cache", "--fill", "home_0"), "home_0"),
        (("cache", "--size", "64"), "--size is for --fill"),
        (("cache", "--workers", "1"), "--workers is for --fill"),
        (("bench", "--runs", "0"), "runs=0"),
        (("bench", "--only", "nothing"), "nothing"),
        (("demo", "--task", "nothing"), "nothing"),
        (("play", "--task", "val-unseen-000", "--home", "home_6"), "leave out --home"),
        (("watch", "random", "--port", "80"), "--port is for --live"),
        (("watch", "random", "--live", "--seed", "1"), "--seed has no effect with --live"),
        (("homes", "build", "."), ".: let the file's name end in .toml"),
        (("homes", "build", ""), ".: let the file's name end in .toml"),
        (("homes", "build", "cabin.toml"), "cabin.toml"),
        (
            ("homes", "generate", "--seed", "1", "--count", "0", "--out", "homes"),
            "count=0 is not a",
        ),
        (
            ("homes", "generate", "--seed", "1", "--count", "-2", "--out", "homes"),
            "count=-2 is not a",
        ),
        (("homes", "generate", "--seed", f"{10**15 - 1}", "--count", "2", "--out", "homes"), "count=2: seeds end at"),
        (("homes", "generate", "--seed", "-1", "--out", "homes"), "seed=-1"),
        (("episode", "save", *TASK, "--out", "episode.json", "--policy", "out/best.pt"), "out/best.pt: no such file"),
        (("episode", "save", *TASK, "--out", "episode.json", "--seed", "-1"), "-1"),
        (("episode", "save", "--task", "nothing", "--out", "episode.json"), "nothing"),
        (("episode", "show", "episode.json"), "episode.json"),
        (("report", "result.json"), "result.json"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_is_wrong_is_all_that_is_said(
    words: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "data"))
    assert main(words) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert said.out == "" and line.startswith("chmarl-pb: ") and message in line
    assert list(tmp_path.iterdir()) == []


def test_rules_that_contradict_each_other_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for pair in (("--feedback", "planner", "--no-feedback"), ("--messages", "--no-messages")):
        with pytest.raises(SystemExit):
            main(("evaluate", "--policy", "random", *pair))
        assert "not allowed with argument" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "ending"),
    [
        ((*PLAY, "random", "--out", "notes.txt"), ".json"),
        ((*PLAY, "random", "--json", "notes.txt"), ".json"),
        (("audit", "--out", "notes.txt"), ".json"),
        (("report", "notes.txt", "--out", "notes.txt"), ".html"),
        (("episode", "save", *TASK, "--out", "notes.txt"), ".json"),
        (("episode", "page", "notes.txt", "--out", "notes.txt"), ".html"),
        (("homes", "new", "notes.txt"), ".toml"),
        (("homes", "build", "cabin.toml", "--out", "notes.txt"), ".urdf"),
        (("homes", "check", "notes.txt", "--json", "notes.txt"), ".json"),
        (("homes", "check", "notes.txt", "--preview", "notes.txt"), ".png"),
        (("homes", "preview", "notes.txt", "--out", "notes.txt"), ".png"),
        (("things", "add", "notes.txt", "--class", "note", "--out", "notes.txt"), ".png"),
        (("doctor", "--record", "notes.txt"), ".json"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_files_of_other_kinds_are_not_written_over(
    words: tuple[str, ...],
    ending: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    notes = tmp_path / "notes.txt"
    notes.write_text("kept")
    with pytest.raises(SystemExit) as ended:
        main(words)
    said = capsys.readouterr().err.splitlines()[-1]
    assert ended.value.code == 2 and f"notes.txt: let the file's name end in {ending}" in said
    assert list(tmp_path.iterdir()) == [notes] and notes.read_text() == "kept"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("report", "own.html", "--out", "own.html"), "own.html: would be written over, but is read here"),
        (("report", "link.html", "--out", "own.html"), "own.html: would be written over"),
        (("episode", "page", "own.html", "--out", "./link.html"), "link.html: would be written over"),
        ((*PLAY, "own.json", "--out", "own.json"), "own.json: would be written over"),
        ((*PLAY, "random", "--catalog", "own.json", "--json", "own.json"), "own.json: would be written over"),
        ((*PLAY, "random", "--robots", "drone,own.json", "--json", "own.json"), "own.json: would be written over"),
        (("doctor", "--against", "own.json", "--record", "own.json"), "own.json: would be written over"),
        (("episode", "replay", "own.json", "--json", "own.json"), "own.json: would be written over"),
        ((*PLAY, "random", "--out", "new.json", "--json", "./new.json"), "--out and --json both write it"),
        ((*PLAY, "random", "--out", "own.json"), "own.json is there already and is not a result"),
        (("audit", "--split", "val-unseen", "--out", "own.json"), "own.json is there already and is not an audit"),
        (("episode", "save", *TASK, "--out", "own.json"), "own.json is there already and is not an episode"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_own_files_are_not_written_over(
    words: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("own.html", "own.json"):
        Path(name).write_text(f"[{name!r}]")
    Path("link.html").symlink_to("own.html")
    assert main(words) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert said.out == "" and message in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.html", "own.html", "own.json"]
    assert all(Path(name).read_text() == f"[{name!r}]" for name in ("own.html", "own.json"))


def test_a_bar_is_shown_with_the_first_progress() -> None:
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True)
    with LateProgress(console=console) as bar:
        row = bar.add_task("playing", total=2)
        assert shown.getvalue() == ""
        bar.update(row, completed=0)
        assert "playing" in shown.getvalue()


def test_a_callable_is_not_taken_for_a_file() -> None:
    assert find_policy("tests.cli.test_arguments:refuses").make.__name__ == refuses.__name__


@pytest.mark.parametrize(
    ("module", "words", "message"),
    [
        ("pretrain", ("--out", "."), "is a folder"),
        ("pretrain", ("--figures", "."), "is a folder"),
        ("pretrain", ("--workers", "0"), "--workers 0"),
        ("ours", ("--episodes", "0"), "--episodes 0"),
        ("ours", ("--imitation-episodes", "0"), "--imitation-episodes 0"),
        ("proofs", ("--out", "."), "is a folder"),
        ("table", ("--jobs", "0"), "--jobs 0"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_so_do_the_commands_of_training(
    module: str,
    words: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    command = pytest.importorskip(f"training.{module}")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        command.main(list(words))
    said = capsys.readouterr()
    assert ended.value.code == 2 and said.out == "" and message in said.err.splitlines()[-1] and "━" not in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("", "paper-test-unseen.json"),
        ("--track grounded", "grounded-generated-test.json"),
        ("--split val-unseen --seeds 1 --observation visual", "paper-val-unseen-observation=visual-seeds=1.json"),
        (
            "--track grounded --no-pointing --feedback planner",
            "grounded-generated-test-feedback=planner-pointing=False.json",
        ),
    ],
)
def test_audits_of_other_rules_have_files_of_their_own(
    words: str, name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[Path] = []

    def played(*_: Any, out: Path, **__: Any) -> None:
        asked.append(out)
        raise OptionError("enough")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(audit_command, "audit", played)
    assert main(["audit", *words.split()]) == 2
    assert asked == [Path("out/audit") / name]
