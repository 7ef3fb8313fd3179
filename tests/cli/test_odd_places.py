"""Commands where output is closed or cannot show all text, and with files and numbers that nobody means."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb.cli.program import main
from chmarl_pb.evaluation.golden import ROLLOUTS

TASK = "test-unseen-000"


def run(command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a shell of its own, which may close streams."""
    script = f"exec {sys.executable} -m chmarl_pb.cli {command}"
    environment = os.environ | variables
    return subprocess.run(["sh", "-c", script], capture_output=True, text=True, env=environment, check=False)


@pytest.mark.parametrize("streams", [">&-", "2>&-", ">&- 2>&- <&-"])
def test_closed_streams_do_no_harm(streams: str, tmp_path: Path) -> None:
    done = run(f"evaluate --policy blind --task {TASK} --out {tmp_path / 'blind.json'} {streams}")
    assert done.returncode == 0 and "Traceback" not in done.stderr
    assert json.loads((tmp_path / "blind.json").read_text())["episodes"]
    assert [file.name for file in tmp_path.iterdir()] == ["blind.json"]


def test_errors_are_not_printed_among_results() -> None:
    done = run("report nothing.json 2>&-")
    assert done.returncode == 2 and not done.stdout


def test_text_that_cannot_be_encoded_is_escaped() -> None:
    done = run("dataset stats", PYTHONIOENCODING="ascii")
    assert done.returncode == 0 and "\\u2588" in done.stdout


def test_a_place_of_the_cache_that_is_no_folder_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        monkeypatch.setenv("CHMARL_CACHE", str(place))
        assert main(["cache", "--clear"]) == 2
        assert f"{tmp_path / 'file'} is no folder" in capsys.readouterr().err


def test_what_could_not_be_cleared_is_not_said_to_be_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path))
    home, unlink = chmarl_pb.generate_home(3), Path.unlink

    def refuse(path: Path, missing_ok: bool = False) -> None:
        if "meshes" not in path.parts:
            raise OSError(30, "Read-only file system", str(path))
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", refuse)
    assert main(["cache", "--clear"]) == 2
    told = capsys.readouterr()
    assert f"{tmp_path / 'homes'}: removed 0 generated homes" in told.out and home.is_file()
    assert f"{home.parent}/generated-3." in told.err and "cannot be removed (Read-only file system)" in told.err
    assert "(and 2 more)" in told.err


def test_a_page_that_cannot_be_written_leaves_no_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    result = tmp_path / "blind.json"
    assert main(["evaluate", "--policy", "blind", "--task", TASK, "--out", str(result), "--quiet"]) == 0

    def refuse(path: Path, text: str) -> None:
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("chmarl_pb.evaluation.report.write_atomically", refuse)
    assert main(["report", str(result), "--out", str(tmp_path / "page.html")]) == 2
    assert [file.name for file in tmp_path.iterdir()] == ["blind.json"]
    capsys.readouterr()
    assert main(["report", str(result), "--out", "/dev/null"]) == 2
    assert not Path("/dev/null_episodes").exists() and capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 100_000, "nested too deeply"),
        ('{"versions": {}, "machine": {}, "digests": []}', "its digests is no object"),
        ('{"versions": {}, "machine": {}, "digests": {"x": 1}}', "no texts"),
        ('{"versions": {}, "machine": {}, "digests": {}, "machine": {}}', "'machine' twice"),
    ],
)
def test_what_are_no_digests_is_refused_before_anything_is_played(
    text: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ROLLOUTS:
        monkeypatch.setitem(ROLLOUTS, name, lambda: pytest.fail("played"))
    file = tmp_path / "digests.json"
    file.write_text(text)
    assert main(["doctor", "--against", str(file)]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [("--seeds", "10001"), ("--workers", "99999999999"), ("--label", "a\udcff")])
def test_numbers_and_labels_that_nobody_means_are_refused(
    wrong: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "--policy", "blind", "--task", TASK, *wrong]) == 2
    assert f"{wrong[0][2:]}=" in capsys.readouterr().err


def test_an_episode_of_actions_that_there_are_not_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "episode.json"
    assert main(["episode", "save", "--policy", "blind", "--task", TASK, "--out", str(file)]) == 0
    content = json.loads(file.read_text())
    content["actions"][0][0] = 10**30
    file.write_text(json.dumps(content))
    for verb in (["replay", str(file)], ["show", str(file), "--out", str(tmp_path / "shown")]):
        assert main(["episode", *verb]) == 2
        assert f"{file}: " in capsys.readouterr().err
