"""PyBullet as it comes: with its greeting, from one of two distributions, with and without NumPy."""

import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest

from chmarl_pb.evaluation.provenance import versions
from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.rendering import camera
from chmarl_pb.rendering.plan_view import draw_plan
from chmarl_pb.rendering.preview import preview
from chmarl_pb.robots.file import find_model
from chmarl_pb.world import Client, bullet, loaded_home
from tests.test_layers import imported

ROOT = Path(__file__).parents[2]
START = "import chmarl_pb; chmarl_pb.parallel_env().close()"


def test_it_does_not_greet() -> None:
    done = subprocess.run([sys.executable, "-c", START], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("closed", ["2>&-", ">&-", "<&- >&- 2>&-"])
def test_it_starts_where_there_is_no_console(closed: str) -> None:
    assert subprocess.run(["sh", "-c", f'"$0" -c "{START}" {closed}', sys.executable], timeout=120).returncode == 0


def test_it_needs_no_numpy_of_its_own() -> None:
    code = f"import pybullet; pybullet.isNumpyEnabled = lambda: 0; {START}"
    subprocess.run([sys.executable, "-c", code], check=True, stderr=subprocess.DEVNULL)


def test_threads_that_silence_one_descriptor_give_it_back(tmp_path: Path) -> None:
    entered, second_leaves = Event(), Event()

    def silence() -> None:
        with bullet.quiet(file.fileno()):
            entered.set()
            second_leaves.wait(60)

    with (tmp_path / "out").open("wb", buffering=0) as file:
        second = Thread(target=silence)
        with bullet.quiet(file.fileno()):
            second.start()
            entered.wait(0.5)  # it has to wait for this thread
        second_leaves.set()
        second.join()
        os.write(file.fileno(), b"seen")
    assert (tmp_path / "out").read_bytes() == b"seen"


def test_silence_survives_a_closed_stream(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with (tmp_path / "out").open("w") as stream:
        pass
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", None)
    with bullet.quiet(2), bullet.quiet(1):
        pass


@pytest.mark.parametrize("name", ["pybullet", "pybullet-arm64"])
def test_results_name_the_distribution(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Whichever it is: results and stored pictures say so."""

    def version(asked: str) -> str:
        if asked != name:
            raise PackageNotFoundError(asked)
        return "3.2.99"

    monkeypatch.setattr(bullet, "version", version)
    recorded = {package: number for package, number in versions().items() if package.startswith("pybullet")}
    assert recorded == {name: "3.2.99"}
    assert bullet.distribution() == (name, "3.2.99")


def test_results_say_that_nothing_is_known_of_a_pybullet_without_metadata(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(asked: str) -> str:
        raise PackageNotFoundError(asked)

    monkeypatch.setattr(bullet, "version", version)
    assert versions()["pybullet"] == "unknown"


def test_pictures_are_the_same_without_numpy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A PyBullet that was built without NumPy gives tuples."""
    home, draw = load_home("home_1"), bullet.pybullet.getCameraImage
    view = camera.view_matrix(find_model("drone").eye(space_of(home), 0))
    client = Client()
    with loaded_home(client.number, home):
        pass

    def pictures() -> list[np.ndarray]:
        seen = camera.render(client.number, camera.camera_of(find_model("drone")), view, 24)
        house = preview(home.path, tmp_path / "house.png", size=(80, 40))
        parts = seen.colour, seen.depth, seen.segmentation, draw_plan(home, 40, 40).rgb
        return [*parts, np.frombuffer(house.read_bytes(), np.uint8)]

    def as_tuples(*args: Any, **options: Any) -> tuple[Any, ...]:
        width, height, *parts = draw(*args, **options)
        return width, height, *(tuple(np.ravel(part).tolist()) for part in parts)

    arrays = pictures()
    monkeypatch.setattr(bullet.pybullet, "getCameraImage", as_tuples)
    for expected, found in zip(arrays, pictures(), strict=True):
        assert expected.dtype == found.dtype
        np.testing.assert_array_equal(expected, found)


VECTORS = """
import numpy as np
import chmarl_pb

if __name__ == "__main__":
    envs = chmarl_pb.vector_env(2, workers=2, split="val-unseen")
    envs.reset(seed=0)
    envs.close()
"""
TASKS = ("--task", "val-unseen-000", "--task", "val-unseen-001")


@pytest.mark.parametrize(
    "words",
    [
        ("-m", "chmarl_pb.cli", "homes", "check", "home_1"),
        ("-m", "chmarl_pb.cli", "evaluate", "--policy", "random", "--split", "val-unseen", "--seeds", "1", *TASKS),
        ("vectors.py",),
        ("-m", "tools.assets.sheet", "--help"),
    ],
    ids=lambda words: " ".join(words[:4]),
)
def test_nor_does_any_process_of_a_command(words: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "vectors.py").write_text(VECTORS)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, *words], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "build time" not in done.stdout + done.stderr


def test_nothing_else_imports_it() -> None:
    """Whoever imported it before would let it greet; inside the package, the test of layers sees to that."""
    files = [
        path for folder in ("training", "examples", "benchmarks", "tools") for path in (ROOT / folder).rglob("*.py")
    ]
    assert len(files) > 40
    for path in files:
        names = [name.partition(".")[0] for name in imported(path.read_text(encoding="utf-8"))]
        assert "pybullet" not in names, path
