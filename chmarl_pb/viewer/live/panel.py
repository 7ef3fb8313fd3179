"""The panel of the page: what is said, and what can be pressed."""

from collections.abc import Callable, Coroutine, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np
import viser
from numpy.typing import NDArray

from chmarl_pb.envs.tracks import TRACKS
from chmarl_pb.frames import wording
from chmarl_pb.frames.recording import Recording
from chmarl_pb.robots.pointing import VERBS, verb_of
from chmarl_pb.viewer.live import texts
from chmarl_pb.viewer.live.choice import CHANNELS, homes_on_offer, tasks_on_offer
from chmarl_pb.viewer.live.game import PERSON

Image = NDArray[np.uint8]

SPEEDS = {"as in life": 1, "2 times": 2, "4 times": 4, "8 times": 8, "at once": 0}
DRAWN = "another, drawn"
STEP, BACK, HINT = "Step", "Step back", "Hint"

#: Key -> the actions that it stands for; a robot has at most one of them.
KEYS: dict[str, tuple[str, ...]] = {
    "I": ("move_forward",), "J": ("turn_left", "move_left"), "L": ("turn_right", "move_right"),
    "K": ("move_backward",), "U": ("stay",), "P": ("pick",), "O": ("place",),
}  # fmt: skip
_ROOM_KEYS = "123456789"
_FRAME, _GREY = 2, 200  # pixels around each picture, and their brightness


class Orders(Protocol):
    """What the panel asks for; called from any thread."""

    def act(self, robot: str, action: str, symbol: int) -> None:
        """Let a robot do something: at once, or in the next step."""

    def step(self) -> None:
        """Play a step."""

    def back(self) -> None:
        """Take a step back."""

    def hint(self) -> None:
        """Tell the planner's next move."""

    def hand_over(self, robot: str, driver: str) -> None:
        """Let a policy or a person drive a robot."""

    def run(self) -> None:
        """Play on as long as that is ticked."""

    def look_at(self, number: int) -> None:
        """Show a moment."""

    def redraw(self) -> None:
        """Show the same again, as what is to be shown has changed."""

    def begin(self, **chosen: Any) -> None:
        """Begin another episode."""

    def save(self, client: viser.ClientHandle) -> None:
        """Send the episode file."""

    def save_page(self, client: viser.ClientHandle) -> None:
        """Send the replay page."""

    def load(self, content: bytes) -> None:
        """Show an episode file."""


class Panel:
    """The panel of one recording.

    Attributes:
        at_once: the box that says whether a press of an action plays the step.
        cones: the box that shows the view cones.
        labels: the box that shows what is seen.
    """

    def __init__(
        self, server: viser.ViserServer, recording: Recording, orders: Orders, actions: Mapping[str, Sequence[str]],
        symbols: int, policies: Sequence[str], track: str, messages: Any,
    ):  # fmt: skip
        """Build it; what was there goes.

        Args:
            server: whose panel it is.
            recording: what is shown.
            orders: takes what is pressed.
            actions: robot -> names of its actions; empty if an episode file is shown.
            symbols: number of symbols that robots choose from; 0 without own words.
            policies: names of those that robots can be handed to.
            track: the rules.
            messages: the option by which the robots hear each other.
        """
        self._gui: Any = server.gui  # its types forbid to set values
        self._orders, self._actions = orders, actions
        self._recording, self._symbols, self._policies = recording, symbols, (PERSON, *policies)
        server.gui.reset()
        server.gui.set_panel_label("chmarl-pb play")
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._status = self._gui.add_markdown("")
        self._message = self._gui.add_markdown("", visible=False)
        self._views = self._gui.add_image(np.zeros((1, 2, 3), np.uint8), label="What the robots see", format="png")
        if actions:
            self._add_play()
        self._reports: dict[str, Any] = {}
        self._drivers: dict[str, Any] = {}
        tabs = self._gui.add_tab_group()
        for robot in recording.models:
            with tabs.add_tab(wording.robot_words(robot)):
                self._add_robot(robot)
        with tabs.add_tab("Seen"):
            self._graphs = {robot: self._gui.add_markdown("") for robot in recording.models}
        with tabs.add_tab("Show"):
            self._add_show()
        with tabs.add_tab("Episode"):
            self._add_episode(track, messages)
        self._number: Any = self._gui.add_slider("Moment", 0, 1, 1, 0)
        self._number.on_update(_by_person(lambda event: orders.look_at(int(event.target.value))))
        self._board = self._gui.add_markdown("")
        self._thing = self._gui.add_markdown("*Click a thing in the home.*")
        if actions:
            self._add_keys()

    @property
    def speed(self) -> int:
        """How much faster than life motions are shown; 0: not at all."""
        return SPEEDS[self._speed.value]

    @property
    def is_running(self) -> bool:
        """Whether the game is to play on by itself."""
        return bool(self._actions) and self._running.value

    def start_running(self) -> None:
        """Tick that the game plays on."""
        self._running.value = True

    def stop_running(self) -> None:
        """Let the game play on no longer."""
        if self._actions:
            self._running.value = False

    def show_driver(self, robot: str, driver: str) -> None:
        """Show who drives a robot."""
        self._drivers[robot].value = driver

    def say(self, message: str) -> None:
        """Show a message, or none."""
        self._message.content, self._message.visible = message, bool(message)

    def show(
        self, recording: Recording, number: int, over: bool, pictures: Mapping[str, Image],
        pixels: dict[str, dict[str, int]], chosen: Mapping[str, str],
    ) -> None:  # fmt: skip
        """Show a moment.

        Args:
            recording: the episode.
            number: of the moment.
            over: whether the episode ends there.
            pictures: robot -> what it sees.
            pixels: robot -> thing -> its pixels.
            chosen: robot -> the action that waits for the next step.
        """
        self._status.content = texts.status(recording, number, over)
        self._views.image = _beside(list(pictures.values()))
        self._number.max = max(1, recording.steps)
        self._number.value = number
        self._board.content = texts.board(recording, number)
        for robot, report in self._reports.items():
            waiting = f"Next: {wording.short_action_words(chosen[robot])}\n\n" if robot in chosen else ""
            report.content = waiting + texts.robot_report(recording, number, robot)
        for robot, graph in self._graphs.items():
            graph.content = texts.scene_graph(recording, number, robot, pixels[robot])

    def show_thing(self, report: str) -> None:
        """Show what is known of a thing that was clicked."""
        self._thing.content = report

    def _add_play(self) -> None:
        orders = {STEP: self._orders.step, BACK: self._orders.back, HINT: self._orders.hint}
        buttons = self._gui.add_button_group("Play", tuple(orders))
        buttons.on_click(_in_order(lambda event: orders[event.target.value]()))

    def _add_robot(self, robot: str) -> None:
        if self._actions:
            self._add_driving(robot, self._actions[robot])
        self._reports[robot] = self._gui.add_markdown("")

    def _add_driving(self, robot: str, actions: Sequence[str]) -> None:
        driver = self._drivers[robot] = self._gui.add_dropdown("Driver", self._policies, hint="A person, or a policy")
        driver.on_update(_by_person(lambda event: self._orders.hand_over(robot, event.target.value)))
        symbol = self._gui.add_dropdown("Says", [str(n) for n in range(self._symbols)]) if self._symbols else None
        for title, row in rows_of(actions):
            named = {texts.button_words(action): action for action in row}
            buttons = self._gui.add_button_group(title, tuple(named))
            buttons.on_click(_in_order(partial(self._press, robot, named, symbol)))

    def _press(self, robot: str, named: Mapping[str, str], symbol: Any, event: Any) -> None:
        self._orders.act(robot, named[event.target.value], int(symbol.value) if symbol else 0)

    def _add_show(self) -> None:
        if self._actions:
            self._add_pace()
        self._speed = self._gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="4 times")
        self.cones = self._gui.add_checkbox("View cones", True)
        self.labels = self._gui.add_checkbox("What is seen", False, hint="Pixels that the rule of visibility counts")
        for box in (self.cones, self.labels):
            box.on_update(_by_person(lambda _: self._orders.redraw()))

    def _add_pace(self) -> None:
        self._running = self._gui.add_checkbox("Play on", False, hint="Step after step: policies act, others stay")
        self._running.on_update(_by_person(lambda _: self._orders.run()))
        self.at_once = self._gui.add_checkbox(
            "Act at once", True, hint="A press plays the step; if not, it waits for Step, so that robots act together"
        )

    def _add_episode(self, track: str, messages: Any) -> None:
        task, gui = self._recording.task, self._gui
        home = gui.add_dropdown("Home", homes_on_offer(task.home), initial_value=task.home)
        listed = gui.add_dropdown("Task", [DRAWN, *tasks_on_offer(task.home)])
        named = gui.add_text("or its id", "", hint="Any task, e.g. train-0001 or generated-test-0007")
        home.on_update(_by_person(lambda event: _offer(listed, event.target.value)))
        rules = gui.add_dropdown("Track", tuple(TRACKS), initial_value=track)
        known = next((name for name, option in CHANNELS.items() if option == messages), next(iter(CHANNELS)))
        self._channel = gui.add_dropdown("Messages", tuple(CHANNELS), initial_value=known)
        gui.add_button("Begin").on_click(
            lambda _: self._orders.begin(
                home=home.value, task=named.value.strip() or (None if listed.value == DRAWN else listed.value),
                track=rules.value, messages=CHANNELS[self._channel.value],
            )
        )  # fmt: skip
        if self._actions:
            gui.add_button("Save").on_click(lambda event: self._orders.save(event.client))
        gui.add_upload_button("Load", mime_type="application/json").on_upload(
            lambda event: self._orders.load(event.target.value.content)
        )
        gui.add_button("Save as a page", hint="A 3D replay that opens from a file").on_click(
            lambda event: self._orders.save_page(event.client)
        )

    def _add_keys(self) -> None:
        """Let keys drive one robot at a time; viser lists them when Ctrl-K is pressed."""
        robots = list(self._actions)
        driven = self._gui.add_dropdown(
            "Keys drive", robots, hint="I J K L move, U stay, P pick, O place, 1 to 9 rooms"
        )
        rooms = {key: (f"goto_{room}",) for key, room in zip(_ROOM_KEYS, self._recording.rooms, strict=False)}

        def press(actions: tuple[str, ...]) -> None:
            own = [action for action in actions if action in self._actions[driven.value]]
            if own:
                self._orders.act(driven.value, own[0], 0)

        for key, actions in (KEYS | rooms).items():
            words = " or ".join(wording.short_action_words(action) for action in actions)
            self._add_key(words, key, partial(press, actions))
        for words, key, order in (
            (STEP, "N", self._orders.step), (BACK, "B", self._orders.back), (HINT, "H", self._orders.hint)
        ):  # fmt: skip
            self._add_key(words, key, order)

    def _add_key(self, words: str, key: Any, order: Callable[[], None]) -> None:
        self._gui.add_command(words, hotkey=key).on_trigger(lambda _: order())


def rows_of(actions: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield titles and the actions of the buttons beside each other."""
    rooms = [action for action in actions if action.startswith("goto_")]
    arm = [action for action in actions if verb_of(action) in VERBS]
    yield "Go to", rooms
    for verb in VERBS:
        if row := [action for action in arm if verb_of(action) == verb]:
            yield verb.capitalize(), row
    yield "Move", [action for action in actions if action not in rooms and action not in arm]


def _by_person(work: Callable[[Any], object]) -> Callable[[Any], None]:
    """Return a callback for what people change; viser also calls it for what is set from here."""

    def called(event: Any) -> None:
        if event.client is not None:
            work(event)

    return called


def _in_order(work: Callable[[Any], object]) -> Callable[[Any], Coroutine[Any, Any, None]]:
    """Return a callback that viser calls before it reads the next press of a button of the same group."""

    async def called(event: Any) -> None:
        work(event)

    return called


def _offer(listed: Any, home: str) -> None:
    listed.options = [DRAWN, *tasks_on_offer(home)]
    listed.value = DRAWN


def _beside(pictures: Sequence[Image]) -> Image:
    """Return pictures beside each other in grey frames, each pixel as 2 x 2."""
    larger = [picture.repeat(2, axis=0).repeat(2, axis=1) for picture in pictures]
    frame = ((_FRAME, _FRAME), (_FRAME, _FRAME), (0, 0))
    return np.hstack([np.pad(picture, frame, constant_values=_GREY) for picture in larger])
