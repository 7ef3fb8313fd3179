"""Draws the frames of an episode that is being played, for ``render()``."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.frames import panel
from chmarl_pb.frames.frame import VIEW_SIZE, Image, put_together, shrunk
from chmarl_pb.frames.motion_player import Replay
from chmarl_pb.frames.panel import Heading
from chmarl_pb.frames.plan_map import PlanMap
from chmarl_pb.frames.recording import Moment, Recording

_FINE = 1  # pixels drawn for each finished one, along a side; two take more than twice the time


@dataclass(frozen=True)
class Now:
    """How an episode stands.

    Attributes:
        recording: what is known of it.
        moment: the last step.
        step: its number, 0 at the start.
        most: number of the step that ends it at the latest, unless somebody else counts steps.
        over: whether it has ended.
    """

    recording: Recording
    moment: Moment
    step: int
    most: int
    over: bool

    @property
    def heading(self) -> Heading:
        """What the frame says of it."""
        if self.over:
            return Heading(panel.ending_words(self.recording.success, self.step), self.recording.success)
        limit = f" of at most {self.most}" if self.step <= self.most else ""
        return Heading(f"Step {self.step}{limit}" if self.step else "Start")


class FrameDrawer:
    """Draws the frames of one episode; the trails on the map lead through the steps that were drawn."""

    def __init__(self, first: Recording):
        """Draw the map of the home.

        Args:
            first: the episode.
        """
        self._map = PlanMap(first, panel.COLUMN_WIDTH, panel.PICTURE_HEIGHT)
        self._replay = Replay(first.home, first.team)
        self._step, self._frame = -1, np.empty(0, np.uint8)

    def draw(self, now: Now) -> NDArray[np.uint8]:
        """Return the frame (HEIGHT, WIDTH, 3) of a step; the same step again gives the same frame."""
        if now.step != self._step:
            self._step, self._frame = now.step, self._drawn(now)
        return self._frame.copy()

    def _drawn(self, now: Now) -> Image:
        recording, moment = now.recording, now.moment
        self._map.mark(recording)
        views = {
            robot: shrunk(self._replay.picture(robot, moment.rest, VIEW_SIZE * _FINE))
            for robot, _ in panel.shown(recording)
        }
        around = panel.draw_panel(recording, moment, moment, now.heading).pixels()
        return put_together(recording, around, views, self._map.draw(moment.rest))
