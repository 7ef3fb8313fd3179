"""Commands whose folder takes no file: the disk is full, or is mounted read-only. One line names the file."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
REASONS = {"full": "No space left on device", "read-only": "Read-only file system"}
MOUNTS = {
    "full": 'mount -t tmpfs -o size=64k tmpfs "$0" && (head -c 1M /dev/zero > "$0/filler" 2> /dev/null; exec "$@")',
    "read-only": 'mount -t tmpfs -o size=64k,ro tmpfs "$0" && exec "$@"',
}
TASK = ("--task", "test-unseen-000")
#: What is written -> the command without it.
COMMANDS: dict[str, tuple[str, ...]] = {
    "r.json": ("evaluate", "--policy", "random", *TASK, "--workers", "1", "--out"),
    "a.json": ("audit", "--split", "val-unseen", "--seeds", "1", "--workers", "1", "--out"),
    "data": ("dataset", "generate", "--split", "test-unseen", "--limit", "2", "--workers", "1", "--out"),
    "run": ("train", "--algo", "vdn", "--episodes", "8", "--out"),
    "taught": ("train", "--algo", "imitation", "--episodes", "8", "--out"),
    "model": ("sb3", "--algo", "ppo", "--steps", "64", "--out"),
    "e.json": ("episode", "save", *TASK, "--out"),
    "h.png": ("homes", "preview", "home_1", "--out"),
    "home.urdf": ("homes", "build", "scenes/home_1.toml", "--out"),
    "digests.json": ("doctor", "--record"),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", COMMANDS)
@pytest.mark.parametrize("disk", MOUNTS)
def test_a_command_whose_folder_takes_no_file_names_it_in_one_line(disk: str, what: str, tmp_path: Path) -> None:
    wrap = ["unshare", "--map-root-user", "--mount", "sh", "-c", MOUNTS[disk], str(tmp_path)]
    if subprocess.run([*wrap, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here")
    command = [sys.executable, "-m", "chmarl_pb.cli", *COMMANDS[what], str(tmp_path / what)]
    done = subprocess.run([*wrap, *command], cwd=ROOT, capture_output=True, text=True, timeout=600, check=False)
    lines = [line for line in done.stderr.splitlines() if REASONS[disk] in line]
    assert done.returncode == 2 and len(lines) == 1 and "Traceback" not in done.stderr, done.stderr
    assert str(tmp_path) in lines[0]
