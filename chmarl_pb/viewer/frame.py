"""The frames of the video: what each shot shows."""

from collections.abc import Iterable, Iterator

from chmarl_pb.frames import panel
from chmarl_pb.frames.frame import Image, put_together
from chmarl_pb.frames.panel import Heading
from chmarl_pb.frames.plan_map import PlanMap
from chmarl_pb.frames.recording import Recording
from chmarl_pb.viewer.film import Shot, speed


def compose(recording: Recording, shots: list[Shot], views: Iterable[dict[str, Image]]) -> Iterator[Image]:
    """Yield the frame (HEIGHT, WIDTH, 3) of each shot.

    Args:
        recording: the episode.
        shots: of the video, in order.
        views: robot -> its finished view, for each shot.
    """
    plan_map = PlanMap(recording, panel.COLUMN_WIDTH, panel.PICTURE_HEIGHT)
    around, around_of = None, None
    for shot, pictures in zip(shots, views, strict=False):
        if (shot.step, shot.done) != around_of:
            around, around_of = _around(recording, shot), (shot.step, shot.done)
        assert around is not None
        yield put_together(recording, around, pictures, plan_map.draw(shot.scene))


def _around(recording: Recording, shot: Shot) -> Image:
    now, last = recording.moments[shot.step], recording.steps
    known = now if shot.done else recording.moments[shot.step - 1]
    finished = shot.done and shot.step == last
    words = f"Step {shot.step} of {last}" if shot.step else "Start"
    if finished:
        words = panel.ending_words(recording.success, last)
    heading = Heading(words, recording.success if finished else None, f"shown at {speed(recording)}x speed")
    return panel.draw_panel(recording, now, known, heading).pixels()
