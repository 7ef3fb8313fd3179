"""The guide's steps run, in order, in an empty folder."""

import os
import re
import runpy
import signal
import subprocess
import sys
import venv
from collections.abc import Callable
from pathlib import Path

import pytest

from chmarl_pb.cli import main
from tools.guide_tables import BEGIN, END, tables

pytest.importorskip("torch")

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "guide.md").read_text(encoding="utf-8")
STEP = re.compile(r"(?:^(Below the line with )?`([^`\n]+)`:\n\n)?^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SLOW = ("chmarl-pb demo", "chmarl-pb homes build cabin.toml --watch")  # tested by themselves elsewhere, too


def follow(folder: Path, run: Callable[[str], None]) -> None:
    """Do what the guide says in a folder: write files, insert lines, run commands."""
    for below, label, language, text in STEP.findall(GUIDE):
        if below:
            insert(folder / "cabin.toml", label, text)
        elif label:
            (folder / label).write_text(text, encoding="utf-8")
        else:
            assert language == "bash"
            for command in text.splitlines():
                run(command)


def insert(file: Path, after: str, line: str) -> None:
    """Put a line behind the one that has some words."""
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    (place,) = (number for number, found in enumerate(lines) if after in found)
    file.write_text("".join([*lines[: place + 1], line, *lines[place + 1 :]]), encoding="utf-8")


def test_the_steps_run_in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(command: str) -> None:
        name, *words = command.split()
        if name == "python":
            (script,) = words
            runpy.run_path(script, run_name="__main__")
        elif not command.startswith(SLOW):
            assert main(words) == 0, command

    monkeypatch.chdir(tmp_path)
    follow(tmp_path, run)
    made = {"cabin.urdf", "cabin.png", "search.json", "my_things.toml", "lantern.png", "run"}
    assert {file.name for file in tmp_path.iterdir()} >= made


@pytest.mark.slow
def test_the_steps_run_from_an_installed_wheel(tmp_path: Path) -> None:
    programs, folder = installed(tmp_path), tmp_path / "empty"
    folder.mkdir()
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    env["PATH"] = f"{programs}{os.pathsep}{env['PATH']}"
    where = [str(programs / "python"), "-c", "import chmarl_pb; print(chmarl_pb.__file__)"]
    assert str(tmp_path) in subprocess.run(where, cwd=folder, env=env, capture_output=True, text=True).stdout

    def run(command: str) -> None:
        """Run a command; one that watches is interrupted when it has built the home once."""
        with subprocess.Popen(
            command.split(), cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        ) as process:
            watches = command.endswith("--watch")
            if watches and process.stdout is not None:
                assert "cabin.urdf cabin.png" in process.stdout.readline()
                process.send_signal(signal.SIGINT)
            shown, _ = process.communicate(timeout=1200)
        assert process.returncode == (128 + signal.SIGINT if watches else 0), f"{command}\n{shown}"

    follow(folder, run)
    assert (folder / "out" / "demo.mp4").is_file()


def installed(folder: Path) -> Path:
    """Install the wheel into a new environment, which sees the dependencies of this one; return its programs."""
    pip = [sys.executable, "-m", "pip", "--quiet"]
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", folder, ROOT], check=True)
    (wheel,) = folder.glob("chmarl_pb-*.whl")
    venv.create(folder / "venv")
    python = folder / "venv" / "bin" / "python"
    subprocess.run([*pip, "--python", python, "install", "--no-deps", wheel], check=True)
    (packages,) = (folder / "venv").glob("lib/python*/site-packages")
    others = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "dependencies.pth").write_text("\n".join(others) + "\n")
    return python.parent


def test_the_tables_are_those_of_the_code() -> None:
    written = GUIDE.split(BEGIN)[1].split(END)[0]
    assert written == f"\n{tables()}\n", "run python -m tools.guide_tables"


def test_the_pictures_of_the_guide_are_there() -> None:
    for name in re.findall(r"!\[\w+\]\(([^)]+)\)", GUIDE):
        assert (ROOT / "docs" / name).is_file()
