"""Draws the robots' views of all shots, on all processors."""

import os
import pickle
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import cache, partial

from chmarl_pb.compiled import is_stored
from chmarl_pb.frames.frame import VIEW_SIZE, Image, shrunk
from chmarl_pb.frames.motion_player import Replay
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.processes import in_processes, meanwhile
from chmarl_pb.rendering import visible_pixels
from chmarl_pb.rendering.movables import Team
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.viewer.film import Shot

_FINE, _COARSE = 2, 1  # pixels drawn for each finished one, along a side: at rest, and in motion where it must be quick
_MOST_WORKERS = 8
_FEW = 16  # shots that are not worth a second process


@contextmanager
def compiling() -> Iterator[None]:
    """Let another process compile what tells what robots see, if that was never done, while this one compiles the rest.

    This one draws the empty home first, which takes as long to compile; what either has compiled, both use.
    """
    with nullcontext() if is_stored(visible_pixels.visible) or os.cpu_count() == 1 else meanwhile(see_once):
        yield


def see_once() -> None:
    """Find out whether a robot sees an object, and make the graph of it, but draw no picture."""
    task = load_tasks("test-unseen")[0]
    simulation = Simulation(task.home)
    try:
        setting, item = simulation.begin(task), simulation.renderer.names[0]
        simulation.renderer.could_see(next(iter(simulation.robots)), setting.goal.item)
        simulation.graphs.graph(simulation.world.state, (item,), setting.states)
    finally:
        simulation.close()


def draw_views(home: Home, team: Team, shots: list[Shot]) -> Iterator[dict[str, Image]]:
    """Yield, for each shot, robot -> its view (VIEW_SIZE, VIEW_SIZE, 3).

    Args:
        home: where it was played.
        team: the robots.
        shots: what to draw.

    Raises:
        WorkerError: a process died.
    """
    # Bytes, so that a process knows the scene of the last shot again.
    draw = partial(_draw, pickle.dumps((home.path, home.catalog, team)))
    workers = min(os.cpu_count() or 1, _MOST_WORKERS)
    if workers == 1 or len(shots) <= _FEW:
        yield from map(draw, shots)
        return
    yield from in_processes(draw, shots, workers, ordered=True)


def _draw(scene: bytes, shot: Shot) -> dict[str, Image]:
    replay = _replay(scene)
    size = VIEW_SIZE * (_FINE if shot.frames > 1 else _COARSE)
    return {robot: shrunk(replay.picture(robot, shot.scene, size)) for robot in shot.scene.robots}


@cache
def _replay(scene: bytes) -> Replay:
    """Return this process's drawer of a home and its robots."""
    path, known, team = pickle.loads(scene)
    return Replay(load_home(path, known), team)
