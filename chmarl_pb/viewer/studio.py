"""Draws the robots' views of all shots, on all processors."""

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.envs.parallel import AGENTS
from chmarl_pb.homes.home import load_home
from chmarl_pb.processes import in_processes
from chmarl_pb.viewer.film import Shot
from chmarl_pb.viewer.motion_player import Replay

Image = NDArray[np.uint8]

VIEW_SIZE = 400  # pixels of a finished view
_FINE, _COARSE = 2, 1  # pixels drawn for each finished one, along a side: at rest, and in motion where it must be quick
_MOST_WORKERS = 8
_FEW = 16  # shots that are not worth a second process


def draw_views(home: Path, shots: list[Shot]) -> Iterator[dict[str, Image]]:
    """Yield, for each shot, robot -> its view (VIEW_SIZE, VIEW_SIZE, 3).

    Args:
        home: URDF of the home.
        shots: what to draw.

    Raises:
        WorkerError: a process died.
    """
    jobs = [(home, shot) for shot in shots]
    workers = min(os.cpu_count() or 1, _MOST_WORKERS)
    if workers == 1 or len(jobs) <= _FEW:
        yield from map(_draw, jobs)
        return
    yield from in_processes(_draw, jobs, workers, ordered=True)


def _draw(job: tuple[Path, Shot]) -> dict[str, Image]:
    home, shot = job
    replay = _replay(home)
    size = VIEW_SIZE * (_FINE if shot.frames > 1 else _COARSE)
    return {robot: _shrink(replay.picture(robot, shot.scene, size)) for robot in AGENTS}


def _shrink(picture: Image) -> Image:
    return np.asarray(cv2.resize(picture, (VIEW_SIZE, VIEW_SIZE), interpolation=cv2.INTER_AREA), dtype=np.uint8)


@cache
def _replay(home: Path) -> Replay:
    """Return this process's drawer of a home."""
    return Replay(load_home(home))
