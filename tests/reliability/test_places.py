"""Folders that take no file, and many processes with no machine code yet."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLAY = """
import chmarl_pb
env = chmarl_pb.parallel_env("visual", home="home_7", image_size=32)
env.reset(seed=3)
for number in range(3):
    seen, rewards, *_ = env.step(dict.fromkeys(env.agents, number))
print(sum(int(part["image"].astype(int).sum()) for part in seen.values()), rewards)
"""
MOUNTS = """
for place in "$1" "$2" "$3"; do
  mount --bind "$place" "$place" && mount -o remount,bind,ro "$place" || exit 9
done
shift 3; exec "$@"
"""


def installed(folder: Path) -> Path:
    """Return a folder with the package as in a wheel, without machine code."""
    shutil.copytree(ROOT / "chmarl_pb", folder / "chmarl_pb", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("urdf", "scenes"):
        shutil.copytree(ROOT / name, folder / name)
    return folder


def environment(package: Path, home: Path) -> dict[str, str]:
    """Return variables for a user with a home of his own."""
    left = {name: value for name, value in os.environ.items() if not name.startswith(("CHMARL", "XDG", "NUMBA"))}
    return {**left, "PYTHONPATH": str(package), "HOME": str(home), "PYTHONDONTWRITEBYTECODE": "1"}


@pytest.mark.slow
def test_read_only_home_cache_and_site_packages(tmp_path: Path) -> None:
    """Really mounted read-only, in a mount namespace of its own: root, too, can write nothing there."""
    places = installed(tmp_path / "site"), tmp_path / "home", tmp_path / "home" / ".cache"
    places[2].mkdir(parents=True)
    play = [sys.executable, "-c", PLAY]
    usual = subprocess.run(play, cwd=ROOT, capture_output=True, text=True, check=True)
    wrap = ["unshare", "--map-root-user", "--mount", "sh", "-c", MOUNTS, "sh", *map(str, places)]
    if subprocess.run([*wrap, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here")
    found = subprocess.run(
        [*wrap, *play], env=environment(*places[:2]), cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert found.returncode == 0 and found.stdout == usual.stdout, found.stderr
    assert "Traceback" not in found.stderr and not [path for path in places[1].rglob("*") if path.is_file()]


@pytest.mark.slow
def test_eight_processes_with_a_cold_compile_cache(tmp_path: Path) -> None:
    package, home = installed(tmp_path / "site"), tmp_path / "home"
    home.mkdir()
    started = [
        subprocess.Popen(
            [sys.executable, "-c", PLAY], env=environment(package, home), cwd=tmp_path, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )
        for _ in range(8)
    ]  # fmt: skip
    ends = [process.communicate(timeout=1500) for process in started]
    assert [process.returncode for process in started] == [0] * 8, ends
    assert len({out for out, _ in ends}) == 1 and not [said for _, said in ends if "Traceback" in said]
    assert not list(tmp_path.rglob("*.tmp"))
