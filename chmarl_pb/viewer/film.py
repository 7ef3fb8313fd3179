"""The storyboard: which scenes the video shows, in which order and for how long."""

from dataclasses import dataclass
from math import ceil

from chmarl_pb.frames.motion_player import Scene
from chmarl_pb.frames.recording import Recording

FRAME_RATE = 30  # frames a second, as the snapshots come
SLOWEST = 2  # how much faster than life motions are shown at least
LONGEST = 720  # frames of a film: motions of longer episodes are shown faster
_FEWEST = 4  # frames of motion in a step, however long the episode is
_OPENING, _PAUSE, _ENDING = 45, 18, 75  # frames that the scene rests


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


def speed(recording: Recording) -> int:
    """Return how much faster than life the motions of a recording are shown."""
    steps = max(recording.steps, 1)
    room = max(LONGEST - _OPENING - (steps - 1) * _PAUSE - _ENDING, steps * _FEWEST)
    return max(SLOWEST, ceil(sum(len(moment.motion) for moment in recording.moments) / room))


def storyboard(recording: Recording) -> list[Shot]:
    """Return the shots of a recording: every step's motion, then a pause on its result."""
    last, every = recording.steps, speed(recording)
    shots = []
    for step, moment in enumerate(recording.moments):
        shots += [Shot(step, False, scene) for scene in moment.motion[::every]]
        pause = _OPENING if step == 0 else _ENDING if step == last else _PAUSE
        shots.append(Shot(step, True, moment.rest, pause))
    return shots
