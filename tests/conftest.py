"""What several tests share: benchmark homes with their simulations, environments and small homes made on the spot."""

import os
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium
import hypothesis
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.rendering import view_file
from chmarl_pb.rendering.home_views import HomeViews
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import BENCHMARK_SPLITS, load_tasks
from chmarl_pb.tasks.task import Task
from tests.helpers.small_homes import HOMES, home_text
from tests.helpers.warm_processes import start_warm


def pytest_configure(config: pytest.Config) -> None:
    """Give each run a view store of its own, which its workers and subprocesses inherit, and let Ctrl-C reach them."""
    hypothesis.settings.register_profile("patient", deadline=None)  # no test asks how long something takes
    hypothesis.settings.load_profile("patient")
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it
    if hasattr(config, "workerinput") or config.getoption("dist", "no") == "no":  # else it only hands out tests
        with suppress(ImportError):
            # Triton, which PyTorch loads with its first optimizer, and Numba each bring an LLVM; loaded after much of
            # Numba's work, Triton has ended the process.
            import_module("torch._dynamo")
    os.environ["SDL_VIDEODRIVER"] = "dummy"  # checkers of environments open windows
    if not hasattr(config, "workerinput"):
        folder = tempfile.mkdtemp(prefix="chmarl-views-")
        os.environ["CHMARL_CACHE"] = folder
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))


@pytest.fixture(scope="session", autouse=True)
def warm_processes() -> Iterator[pytest.MonkeyPatch]:
    """Processes that the package starts are there at once."""
    with pytest.MonkeyPatch.context() as patch:
        start_warm(patch)
        yield patch


@pytest.fixture(scope="module")
def spawned(warm_processes: pytest.MonkeyPatch) -> Iterator[None]:
    """Processes are spawned, as they are outside of tests."""
    warm_processes.undo()
    yield
    start_warm(warm_processes)


@pytest.fixture(scope="session")
def simulation_of() -> Iterator[Callable[[str], Simulation]]:
    """The simulation of a benchmark home by its name, loaded at its first use and kept for all tests."""
    simulations: dict[str, Simulation] = {}

    def simulation(home: str) -> Simulation:
        if home not in simulations:
            simulations[home] = Simulation(home)
        return simulations[home]

    yield simulation
    for kept in simulations.values():
        kept.close()


@pytest.fixture(params=HOMES)
def simulation(request: pytest.FixtureRequest, simulation_of: Callable[[str], Simulation]) -> Simulation:
    """Every benchmark home in turn."""
    return simulation_of(request.param)


@pytest.fixture(scope="session")
def tasks() -> list[Task]:
    """Tasks of the paper's splits, the homes in turn: the first seven play in seven homes."""
    rows: dict[str, list[Task]] = {home: [] for home in HOMES}
    for split in BENCHMARK_SPLITS:
        for task in load_tasks(split):
            rows[task.home].append(task)
    return [task for row in zip(*rows.values(), strict=False) for task in row]


@pytest.fixture(scope="session")
def env() -> Iterator[HouseholdEnv]:
    """A scene-graph environment; it can play tasks of all seven homes."""
    env = HouseholdEnv()
    yield env
    env.close()


@pytest.fixture(scope="session")
def visual_env() -> Iterator[HouseholdEnv]:
    """An environment with small pictures."""
    env = HouseholdEnv("visual", image_size=32)
    yield env
    env.close()


@pytest.fixture
def write_home(tmp_path: Path) -> Callable[[str], Path]:
    """A function that writes a URDF into a folder of its own and returns its path."""

    def write(text: str, name: str = "small.urdf") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def small_home(write_home: Callable[[str], Path]) -> Path:
    """A home of one room."""
    return write_home(home_text())


@pytest.fixture
def make() -> Iterator[Callable[..., Any]]:
    """``gym.make`` that closes what it made."""
    made = []

    def make(env_id: str, **options: Any) -> Any:
        made.append(gymnasium.make(env_id, **options))
        return made[-1]

    yield make
    for env in made:
        env.close()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store's folder of its own for one test."""
    monkeypatch.setenv("CHMARL_CACHE", str(tmp_path / "cache"))
    view_file.warn_of.cache_clear()
    view_file.warn.cache_clear()
    return tmp_path / "cache" / "views"


@pytest.fixture
def home(write_home: Callable[[str], Path]) -> Home:
    """A home of one room, read."""
    return load_home(write_home(home_text()))


@pytest.fixture
def draws(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by the size of each picture that is drawn."""
    drawn: list[int] = []
    draw = HomeViews.draw

    def noted(*arguments: Any) -> object:
        drawn.append(arguments[3])
        return draw(*arguments)

    monkeypatch.setattr(HomeViews, "draw", noted)
    return drawn
