"""The storyboard: which scenes the video shows, in which order and for how long."""

from collections.abc import Iterator
from dataclasses import dataclass

from chmarl_pb.demo.record import Moment, Recording
from chmarl_pb.sensing.replay import Scene, between

FRAME_RATE = 30  # frames a second, as the snapshots come
DRIVE_SPEED, ARM_SPEED = 2.0, 1.5  # how much faster than life motions are shown
_OPENING, _PAUSE, _ENDING = 45, 18, 75  # frames that the scene rests

_MOVED = 1e-4  # metres or quaternion units by which a base moves if it moves at all


@dataclass(frozen=True)
class Shot:
    """One picture of the video.

    Attributes:
        step: index of the moment that it belongs to.
        done: whether the step is over, so that its result is known.
        scene: what is drawn.
        frames: number of frames that it stays.
    """

    step: int
    done: bool
    scene: Scene
    frames: int = 1


def storyboard(recording: Recording) -> list[Shot]:
    """Return the shots of a recording: every step's motion, then a pause on its result."""
    last = recording.steps
    shots = []
    for step, moment in enumerate(recording.moments):
        shots += [Shot(step, False, scene) for scene in _sample(moment)]
        pause = _OPENING if step == 0 else _ENDING if step == last else _PAUSE
        shots.append(Shot(step, True, moment.rest, pause))
    return shots


def _sample(moment: Moment) -> Iterator[Scene]:
    """Yield a step's motion at the speeds of the film."""
    motion, time = moment.motion, 0.0
    while time < len(motion) - 1:
        index, share = int(time), time % 1
        first, second = motion[index], motion[index + 1]
        yield between(first, second, share) if share > 0 else first
        time += DRIVE_SPEED if _drives(first, second) else ARM_SPEED


def _drives(first: Scene, second: Scene) -> bool:
    """Return whether the base of a robot moves between two scenes."""
    return any(
        abs(now - then) > _MOVED
        for robot in first.robots
        for old, new in zip(first.robots[robot], second.robots[robot], strict=True)
        for then, now in zip(old, new, strict=True)
    )
