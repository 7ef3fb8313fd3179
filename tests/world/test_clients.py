"""PyBullet's clients are given back: by close, when what uses them is dropped, after errors, and at the exit."""

import gc
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pybullet
import pytest

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.envs.vector.engine import Engine
from chmarl_pb.errors import ChmarlError, HomeError
from chmarl_pb.homes.home import load_home
from chmarl_pb.rendering import home_views as home_views_module
from chmarl_pb.rendering import movables as movables_module
from chmarl_pb.rendering.fast import FastRenderer
from chmarl_pb.rendering.home_views import HomeViews
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.world import Client, World
from chmarl_pb.world import physics as physics_module
from tests.helpers.small_homes import SMALL_HOME, box, home_text

MAKERS: dict[str, Callable[[], Any]] = {
    "parallel": chmarl_pb.parallel_env,
    "aec": chmarl_pb.env,
    "joint": lambda: gymnasium.make("CHMARL/SceneGraph-v0"),
    "humanoid": lambda: gymnasium.make("CHMARL/SceneGraphHumanoid-v0"),
    "vector": lambda: chmarl_pb.vector_env(2, workers=0),
    "sb3": lambda: chmarl_pb.sb3_vec_env(2, workers=0),
    "simulation": lambda: Simulation("home_1"),
}


def connected() -> set[int]:
    """The ids of all clients of this process: new homes may drop those of other tests' homes from caches."""
    return {number for number in range(1024) if pybullet.getConnectionInfo(number)["isConnected"]}


@pytest.fixture(autouse=True, scope="module")
def few_to_collect() -> Iterator[None]:
    """What other tests have left is not looked through again for each test here."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.fixture(autouse=True)
def no_collector() -> Iterator[None]:
    """What is dropped goes at once, not when the garbage collector happens to come by."""
    renderer = Simulation("home_1").renderer
    assert isinstance(renderer, FastRenderer)
    movables_module.movables(renderer._team, BENCHMARK)  # has a client for the whole process
    del renderer
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.parametrize("kind", MAKERS)
def test_dropped_environments_keep_no_clients(kind: str) -> None:
    if kind == "sb3":
        pytest.importorskip("stable_baselines3")
    before = connected()
    for seed in range(10 if kind == "parallel" else 3):
        env = MAKERS[kind]()
        if kind not in ("simulation", "sb3") and seed < 3:
            env.reset(seed=seed)
        assert connected() - before
        del env
        assert not connected() - before, "what other tests have left may go meanwhile"


def test_environments_in_reference_cycles_go_with_the_garbage(monkeypatch: pytest.MonkeyPatch) -> None:
    before = connected()
    env = chmarl_pb.parallel_env()
    env.__dict__["me"] = env
    del env
    assert connected() > before
    connect = pybullet.connect
    full: list[None] = []

    def connect_once_full(mode: int) -> int:
        full.append(None)
        return -1 if len(full) == 1 else int(connect(mode))

    monkeypatch.setattr("pybullet.connect", connect_once_full)
    client = Client()
    client.close()
    assert connected() <= before


def test_too_many_clients_is_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pybullet.connect", lambda mode: -1)
    with pytest.raises(ChmarlError, match="no free client; close some environments"):
        chmarl_pb.parallel_env()


def test_a_world_outlives_its_environment() -> None:
    before = connected()
    env = chmarl_pb.parallel_env()
    env.reset(seed=0)
    world = env.world
    del env
    assert world.client in connected()
    world.close()
    world.close()
    assert connected() <= before


@pytest.mark.parametrize("where", ["home", "object", "robot", "renderer"])
def test_environments_that_cannot_be_made_keep_no_clients(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: Any, **options: Any) -> Any:
        raise KeyboardInterrupt

    place = {
        "home": (physics_module, "loaded_home"),
        "object": (physics_module, "loaded_graspables"),
        "robot": (RobotModel, "load"),
        "renderer": (sys.modules["chmarl_pb.rendering.fast"], "home_views"),
    }[where]
    monkeypatch.setattr(*place, fail)
    before = connected()
    with pytest.raises(KeyboardInterrupt) as caught:
        chmarl_pb.parallel_env()
    assert connected() <= before, "although the traceback still refers to all that was made"
    assert caught.tb is not None


def test_failed_resets_keep_no_clients(write_home: Callable[..., Path], small_home: Path) -> None:
    kitchen = {name.replace("livingroom", "kitchen"): place for name, place in SMALL_HOME.items()}
    other = write_home(home_text(kitchen), "other.urdf")
    env = chmarl_pb.parallel_env(home=small_home)
    env.reset(seed=0)
    number, before = env.world.client, connected()
    with pytest.raises(HomeError, match="differ") as caught:
        env._simulations.enter(str(other))
    assert connected() <= before
    with pytest.raises(ChmarlError):
        env.reset(options={"task": "no-such-task"})
    assert connected() <= before
    env.reset(seed=1)
    env.close()
    assert number not in connected()
    assert caught.tb is not None


def test_views_of_homes_keep_no_clients(write_home: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """A home with a cylinder is drawn by TinyRenderer, in a client that lives as long as the views do."""
    cylinder = box("livingroom/lamp_1", (0.1, 0.1, 0.1), (1.5, 0, 0.05))
    cylinder = cylinder.replace('<box size="0.1 0.1 0.1"/>', '<cylinder radius="0.05" length="0.1"/>')
    home = load_home(write_home(home_text(extra=cylinder)))
    monkeypatch.setenv("CHMARL_CACHE", "off")
    before = connected()
    views = HomeViews(home)
    views.look(find_model("drone"), 0, 16)
    assert len(connected() - before) == 1
    del views
    assert connected() <= before
    monkeypatch.setattr(home_views_module, "content_hash", lambda home: "another")
    views = HomeViews(home)
    with pytest.raises(HomeError, match="has changed") as caught:
        views.look(find_model("drone"), 0, 16)
    assert connected() <= before
    assert caught.tb is not None


def test_worlds_are_garbage_without_the_collector() -> None:
    worlds = [World(load_home("home_1")) for _ in range(2)]
    client = worlds[0].client
    worlds.clear()
    assert client not in connected()


ENDINGS = {
    "in use": "",
    "closed": "env.close()",
    "in a cycle": "env.me = env; del env",
    "after an error": "raise SystemExit(0)",
}


@pytest.mark.parametrize("ending", ENDINGS.values(), ids=ENDINGS)
def test_the_interpreter_exits_silently(ending: str) -> None:
    code = f"import chmarl_pb\nenv = chmarl_pb.parallel_env()\n{ending}"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


def test_workers_of_a_dropped_vector_end() -> None:
    env = chmarl_pb.vector_env(2, workers=2)
    assert isinstance(env._engine, Engine)
    (worker,) = env._engine._processes
    env.reset(seed=0)
    del env
    worker.join(10)
    assert not worker.is_alive()
