"""Full disks, real ones: a small tmpfs in a mount namespace of its own, which goes with the process that sees it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from chmarl_pb.errors import WriteError
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.viewer.video import write_video
from tests.helpers.disk import full_disk

ROOT = Path(__file__).parents[2]
MOUNT = 'mount -t tmpfs -o size=64k tmpfs "$0" && exec "$@"'


def on_small_disk(folder: str, script: str, *arguments: object) -> "subprocess.CompletedProcess[str]":
    """Run a Python script where a folder is a disk of 64 kB."""
    command = ["unshare", "--map-root-user", "--mount", "sh", "-c", MOUNT, folder]
    try:
        subprocess.run([*command, "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no file system can be mounted here: {error}")
    return subprocess.run(
        [*command, sys.executable, "-c", script, folder, *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, timeout=600,
    )  # fmt: skip


FILL = """
import sys
from pathlib import Path

def fill(folder):
    with open(Path(folder) / "filler", "wb", buffering=0) as file:
        try:
            while file.write(bytes(4096)):
                pass
        except OSError:
            pass

sys.path.insert(0, "tests")
"""

STORE = (
    FILL
    + """
from tests.helpers.stored_views import POSES, VIEW, opened, picture
folder = Path(sys.argv[1])
file = opened(folder / "views")
for pose in range(2):
    assert file.put(pose, VIEW, picture(pose)) is not None
fill(folder)
for again in (file, opened(folder / "views")):
    assert [again.get(pose, VIEW) is not None for pose in range(POSES)] == [True] * 2 + [False] * (POSES - 2)
    assert len(again.gaps()) == POSES - 2 and again.put(5, VIEW, picture(5)) is None
"""
)


def test_view_store_on_a_full_tmpfs(tmp_path: Path) -> None:
    done = on_small_disk(str(tmp_path), STORE)
    assert done.returncode == 0, done.stderr
    assert "pictures of homes are kept in memory only" in done.stderr


SHARED = """
import sys
from pathlib import Path
from chmarl_pb.envs.vector.memory import shared_file
with shared_file(200_000) as file:
    assert Path(file.name).parent != Path(sys.argv[1]) and Path(file.name).stat().st_size == 200_000
import tempfile
tempfile.tempdir = sys.argv[1]
with shared_file(20_000) as file:
    assert Path(file.name).parent == Path(sys.argv[1])
shared_file(200_000)
"""


def test_shared_memory_that_finds_no_room_is_an_error() -> None:
    if not Path("/dev/shm").is_dir():
        pytest.skip("there is no /dev/shm")
    done = on_small_disk("/dev/shm", SHARED)
    assert "WorkerError: no room for 0.2 MB that processes share (/dev/shm: No space left on device" in done.stderr


COMMANDS = (
    FILL
    + """
import contextlib, io, json
from chmarl_pb.cli import main
folder, found = Path(sys.argv[1]), {}
fill(folder)
for command in json.loads(sys.argv[2]):
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        code = main(command)
    left = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    found[" ".join(command[:2])] = code, errors.getvalue(), left
print(json.dumps(found))
"""
)

TASK = "test-unseen-000"


def test_every_command_names_the_file_that_a_full_disk_does_not_take(tmp_path: Path) -> None:
    disk, kept = tmp_path / "disk", tmp_path / "result.json"
    disk.mkdir()
    evaluate("random", tasks=[TASK], seeds=(0,), workers=1, max_steps=3, out=kept)
    commands = {
        "r.json.partial": ["evaluate", "--policy", "random", "--task", TASK, "--workers", "1", "--out", "r.json"],
        "b/test-unseen-random.json.partial": ["baselines", "--split", "test-unseen", "--workers", "1", "--out", "b"],
        "p_episodes/": ["report", str(kept), "--out", "p.html"],
        "e.json": ["episode", "save", "--task", TASK, "--out", "e.json"],
        "h.png": ["homes", "preview", "home_1", "--out", "h.png"],
        "meshes/": ["homes", "build", "scenes/home_1.toml", "--out", "h.urdf"],
        "s.json": ["dataset", "stats", "--json", "s.json"],
    }
    placed = [[*rest, str(disk / last)] for *rest, last in commands.values()]
    done = on_small_disk(str(disk), COMMANDS, json.dumps(placed))
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert len(found) == len(placed)
    for name, command in commands.items():
        code, known, left = found[" ".join([*command, ""][:2])]
        assert code == 2 and left == ["filler"], (command, known, left)
        message = [line for line in known.splitlines() if line.startswith("chmarl-pb: ")]
        assert len(message) == 1 and f"chmarl-pb: {disk / name}" in message[0], known
        assert "cannot be written (No space left on device)" in message[0] and "Traceback" not in known


@pytest.mark.parametrize("size", [2_000, 60_000])  # at the beginning, and at the end, where ffmpeg finishes the file
def test_half_a_video_is_not_left(tmp_path: Path, size: int) -> None:
    rng = np.random.default_rng(0)
    frames = [(rng.integers(0, 256, (64, 64, 3), dtype=np.uint8), 1) for _ in range(30)]
    write_video(tmp_path / "whole.mp4", frames, (64, 64))
    assert (tmp_path / "whole.mp4").stat().st_size > 60_000
    with full_disk(size), pytest.raises(WriteError, match=r"demo\.mp4: cannot be written"):
        write_video(tmp_path / "demo.mp4", frames, (64, 64))
    assert [path.name for path in tmp_path.iterdir()] == ["whole.mp4"]
