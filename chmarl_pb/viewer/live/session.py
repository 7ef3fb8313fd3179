"""A session: one game or one loaded episode, seen and driven from any number of browser tabs."""

import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import partial, wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import viser

from chmarl_pb.errors import ChmarlError
from chmarl_pb.evaluation.episode_file import load_episode, save_episode
from chmarl_pb.evaluation.rules import rules_with
from chmarl_pb.frames.motion_player import Replay
from chmarl_pb.frames.recording import Moment, Recording
from chmarl_pb.viewer.film import FRAME_RATE
from chmarl_pb.viewer.live import texts
from chmarl_pb.viewer.live.choice import Choice
from chmarl_pb.viewer.live.game import Game
from chmarl_pb.viewer.live.house import House
from chmarl_pb.viewer.live.panel import Panel
from chmarl_pb.viewer.live.replay_page import replay_page
from chmarl_pb.viewer.live.worker import Worker
from chmarl_pb.viewer.record import record_file

Method = TypeVar("Method", bound=Callable[..., None])

IMAGE_SIZE = 128  # pixels of the robots' pictures, as environments give them by default


def _in_worker(method: Method) -> Method:
    """Let a method of a session work in its worker's thread, whichever calls it."""

    @wraps(method)
    def asked(self: "Session", *args: Any, **options: Any) -> None:
        self._do(partial(method, self, *args, **options))

    return cast(Method, asked)


class Session:
    """What the page shows; it alone touches the game and the pictures, in its worker's thread.

    Its public methods may be called from any thread; see :class:`chmarl_pb.viewer.live.panel.Orders`.
    """

    def __init__(self, server: viser.ViserServer, choice: Choice, policies: tuple[str, ...], driver: str | None = None):
        """Begin.

        Args:
            server: of the page.
            choice: what the first episode is begun with.
            policies: names of those that robots can be handed to.
            driver: the one that plays on with all robots; None: people drive.

        Raises:
            ChmarlError: the episode cannot be begun, or the policy cannot play in it.
        """
        self._server, self._choice, self._policies = server, choice, policies
        self._game: Game | None = _begun(choice, driver)
        self._closing = False
        self._open(self._game.recording)
        self._worker = Worker(self._failed)
        if driver is not None:
            self._do(partial(self._watch, driver))

    @property
    def task(self) -> str:
        """The id of the task that is played."""
        return self._recording.task.id

    @_in_worker
    def act(self, robot: str, action: str, symbol: int) -> None:
        """Let a robot do something: at once, or in the next step."""
        if self._game:
            self._game.choose(robot, action, symbol)
            if self._panel.at_once.value:
                self._step()
            self._refresh()

    def step(self) -> None:
        """Play a step."""
        self._do(self._step)

    @_in_worker
    def back(self) -> None:
        """Take a step back."""
        if self._game:
            self._game.back()
            self._show_end()

    @_in_worker
    def hint(self) -> None:
        """Tell the planner's next move."""
        if self._game:
            words = ", ".join(f"{robot} **{action}**" for robot, action in self._game.hint().items())
            self._panel.say(f"The planner's next move: {words}")

    @_in_worker
    def hand_over(self, robot: str, driver: str) -> None:
        """Let a policy or a person drive a robot."""
        if self._game:
            try:
                self._game.hand_over(robot, driver)
            finally:
                self._panel.show_driver(robot, self._game.drivers[robot])
            self._refresh()

    def run(self) -> None:
        """Play on as long as that is ticked."""
        self._do(self._go_on)

    @_in_worker
    def look_at(self, number: int) -> None:
        """Show a moment."""
        self._number = min(number, self._recording.steps)
        self._refresh()

    def redraw(self) -> None:
        """Show the same again, as what is to be shown has changed."""
        self._do(self._refresh)

    @_in_worker
    def begin(self, **chosen: Any) -> None:
        """Begin another episode."""
        self._panel.say("Laying out the task …")
        again = chosen["task"] is None and chosen["home"] == self._choice.home
        before = {"track": self._choice.track, **self._choice.rules}
        rules = rules_with(before, {"track": chosen.pop("track")})
        choice = replace(
            self._choice, **chosen, track=rules.pop("track"), rules=rules,
            draw=self._choice.draw + 1 if again else 0,
        )  # fmt: skip
        game = choice.begin()
        self._leave()
        self._game, self._choice = game, choice
        self._open(game.recording)

    @_in_worker
    def save(self, client: viser.ClientHandle) -> None:
        """Send the episode file to a page."""
        if self._game:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "episode.json"
                save_episode(self._game.file(), path)
                client.send_file_download(f"{self.task}.json", path.read_bytes(), save_immediately=True)

    @_in_worker
    def save_page(self, client: viser.ClientHandle) -> None:
        """Send the replay page of the episode to a page."""
        self._panel.say("Writing the replay page …")
        page = replay_page(self._recording)
        client.send_file_download(f"{self.task}.html", page.encode(), save_immediately=True)
        self._panel.say("")

    @_in_worker
    def load(self, content: bytes) -> None:
        """Show an episode file."""
        self._panel.say("Playing the episode again …")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "uploaded"
            path.write_bytes(content)
            recording = record_file(load_episode(path))
        self._leave()
        self._open(recording)

    def close(self) -> None:
        """Let the work in hand end, and disconnect from physics."""
        self._closing = True
        self._worker.stop()
        self._leave()

    def _do(self, work: Any) -> None:
        def alone() -> None:
            if not self._closing:
                self._panel.say("")
                work()

        self._worker.do(alone)

    def _failed(self, error: Exception) -> None:
        if not isinstance(error, ChmarlError):
            traceback.print_exception(error, file=sys.stderr)
        self._panel.say(f"⚠ {error}")
        self._panel.stop_running()

    def _leave(self) -> None:
        if self._game:
            self._game.close()
        self._game = None

    def _open(self, recording: Recording) -> None:
        """Build the page for an episode."""
        game = self._game
        self._loaded, self._number, self._thing = recording, recording.steps if game else 0, ""
        self._replay = Replay(recording.home, recording.team)
        self._house = House(self._server, recording, partial(self._click, self._replay))
        self._panel = Panel(
            self._server, recording, self, game.env.action_names if game else {}, game.env.symbols if game else 0,
            self._policies, self._choice.track, self._choice.messages,
        )  # fmt: skip
        self._refresh()

    @property
    def _recording(self) -> Recording:
        return self._game.recording if self._game else self._loaded

    def _click(self, replay: Replay, name: str) -> None:
        def work() -> None:
            if replay is self._replay:  # else it was on what an episode before has shown
                self._thing = name
                self._refresh()

        self._do(work)

    def _watch(self, driver: str) -> None:
        """Show that a policy drives all robots, and play on."""
        for robot in self._game.drivers if self._game else ():
            self._panel.show_driver(robot, driver)
        self._refresh()
        self._panel.start_running()
        self.run()

    def _step(self) -> None:
        if self._game:
            self._animate(self._game.step())
            self._show_end()

    def _go_on(self) -> None:
        """Play a step, and come back for the next one after what others have asked for."""
        if self._panel.is_running and self._game:
            if self._game.over:
                self._panel.stop_running()
            else:
                self._step()
                self.run()

    def _animate(self, moment: Moment) -> None:
        speed = self._panel.speed
        for scene in moment.motion[::speed] if speed else ():
            if self._closing or self._worker.awaited:
                break
            began = time.monotonic()
            self._house.show(scene)
            time.sleep(max(0.0, 1 / FRAME_RATE - (time.monotonic() - began)))

    def _show_end(self) -> None:
        self._number = self._recording.steps
        self._refresh()

    def _refresh(self) -> None:
        """Bring page and scene to the moment that is looked at."""
        recording, number = self._recording, self._number
        scene = recording.moments[number].rest
        pictures = {name: self._replay.picture(name, scene, IMAGE_SIZE) for name in recording.models}
        pixels = {name: self._replay.pixels(name, scene) for name in recording.models}
        over = number == recording.steps and (self._game.over if self._game else True)
        self._house.show(scene)
        self._house.show_pictures(pictures)
        self._house.show_cones(self._panel.cones.value)
        self._house.label(texts.seen_labels(pixels) if self._panel.labels.value else {}, scene)
        self._panel.show(recording, number, over, pictures, pixels, self._game.chosen if self._game else {})
        if self._thing:
            self._panel.show_thing(texts.thing_report(recording, number, self._thing))


def _begun(choice: Choice, driver: str | None) -> Game:
    """Return a new game, with its robots handed to a policy."""
    game = choice.begin()
    try:
        if driver is not None:
            for robot in game.drivers:
                game.hand_over(robot, driver)
    except BaseException:
        game.close()
        raise
    return game
