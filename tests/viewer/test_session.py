"""A session without a browser: what the page asks for is done, one thing after the other."""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from chmarl_pb.errors import ChmarlError
from chmarl_pb.evaluation.episode_file import save_episode
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.viewer.live.choice import Choice

pytest.importorskip("viser", reason="the extra 'viewer' is not installed")
gates = pytest.importorskip("chmarl_pb.viewer.live.gate")
panels = pytest.importorskip("chmarl_pb.viewer.live.panel")
sessions = pytest.importorskip("chmarl_pb.viewer.live.session")
replays = pytest.importorskip("chmarl_pb.viewer.live.replay_page")

SHORT, OTHER = sorted(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)[:2]


@pytest.fixture
def session() -> Iterator[Any]:
    server = gates.guarded_server(gates.Gate(), "127.0.0.1", 0)
    session = sessions.Session(server, Choice(SHORT.id), ("planner", "search"))
    session._panel._speed.value = "at once"
    yield session
    session.close()
    gates.stop(server)


def settle(session: Any) -> None:
    """Wait until all is done that has been asked for so far."""
    done = threading.Event()
    session._worker.do(done.set)
    assert done.wait(timeout=300)


def status(session: Any) -> str:
    settle(session)
    return str(session._panel._status.content)


def message(session: Any) -> str:
    settle(session)
    return str(session._panel._message.content)


def test_a_policy_is_watched_from_the_start() -> None:
    server = gates.guarded_server(gates.Gate(), "127.0.0.1", 0)
    session = sessions.Session(server, Choice(SHORT.id), ("planner",), "planner")
    try:
        for _ in range(SHORT.optimal_steps + 3):
            settle(session)  # every step asks for the next
        assert f"Solved in {SHORT.optimal_steps} steps" in status(session)
        assert set(session._game.drivers.values()) == {"planner"}
    finally:
        session.close()
        gates.stop(server)


def test_policies_play_on_to_the_end_and_the_file_is_shown_again(session: Any, tmp_path: Path) -> None:
    for robot in ("humanoid", "drone"):
        session.hand_over(robot, "planner")
    settle(session)
    session._panel._running.value = True
    session.run()
    for _ in range(SHORT.optimal_steps + 2):
        settle(session)  # every step asks for the next
    assert not session._panel.is_running
    assert f"Solved in {SHORT.optimal_steps} steps" in status(session)
    session.step()
    assert "the episode is over" in message(session)
    session.back()
    assert f"step {SHORT.optimal_steps - 1} " in status(session)
    save_episode(session._game.file(), tmp_path / "episode.json")
    session.load((tmp_path / "episode.json").read_bytes())
    assert "step 0 " in status(session)
    session.look_at(1)
    assert "step 1 " in status(session)
    session.act("drone", "stay", 0)  # nobody drives what is loaded
    assert "step 1 " in status(session) and session._game is None
    session.begin(home=OTHER.home, task=OTHER.id, track="paper", messages=False)
    assert "step 0 " in status(session)
    assert session.task == OTHER.id


def test_faults_are_told_and_change_nothing(session: Any, capfd: pytest.CaptureFixture[str]) -> None:
    session.begin(home="home_7", task="nonsense", track="paper", messages=True)
    assert "unknown task 'nonsense'" in message(session)
    session.load(b"{}")
    assert "not a whole episode file" in message(session)
    session.hand_over("drone", "nobody")
    assert "unknown policy 'nobody'" in message(session)
    assert session._panel._drivers["drone"].value == "person"
    session.act("humanoid", "turn_left", 0)
    assert message(session) == "" and "step 1 " in status(session)
    assert capfd.readouterr().err == ""


def test_things_that_are_clicked_and_seen_are_told(session: Any) -> None:
    target = session._recording.targets[0]
    session._click(session._replay, target)
    settle(session)
    assert target in session._panel._thing.content
    session._panel.labels.value = True
    session.redraw()
    settle(session)
    seen = session._recording.moments[0].visible
    assert set().union(*seen.values()) <= session._house._labels.keys()


def test_replay_page_stands_alone(session: Any) -> None:
    settle(session)
    page = replays.replay_page(session._recording)
    assert "__VISER_EMBED_DATA__" in page
    assert 'src="http' not in page and '<link rel="stylesheet" href="http' not in page


def test_buttons_hold_every_action_once() -> None:
    actions = ("goto_kitchen", "pick_0_0", "pick_0_1", "place_0_0", "move_forward", "turn_left", "stay")
    rows = dict(panels.rows_of(actions))
    assert list(rows) == ["Go to", "Pick", "Place", "Move"]
    assert sorted(action for row in rows.values() for action in row) == sorted(actions)


def test_a_click_on_what_is_no_longer_shown_does_nothing(session: Any) -> None:
    click, before = session._click, session._replay
    session.begin(home="home_2", task=None, track="paper", messages=True)
    click(before, "livingroom/cabinet_1")  # a thing of the home before
    session.step()
    assert "⚠" not in message(session)
    assert not session._thing


def test_the_page_shows_and_keeps_the_channel_in_force() -> None:
    server = gates.guarded_server(gates.Gate(), "127.0.0.1", 0)
    session = sessions.Session(server, Choice(SHORT.id, messages=False, max_steps=9), ())
    try:
        assert session._panel._channel.value == "none"
        assert "Nothing has been said" in session._panel._board.content
        session.begin(home=SHORT.home, task=OTHER.id, track="paper", messages="symbols")
        settle(session)
        assert session._panel._channel.value == "own words"
        assert session._game.env.options.messages == "symbols"
    finally:
        session.close()
        gates.stop(server)


def test_rules_of_a_training_end_with_its_track() -> None:
    server = gates.guarded_server(gates.Gate(), "127.0.0.1", 0)
    rules = {"pointing": True, "lookalikes": True, "templates": 2, "feedback": False, "goal": True}
    session = sessions.Session(server, Choice(SHORT.id, track="grounded", rules=rules), ())
    try:
        session.begin(home=SHORT.home, task=OTHER.id, track="paper", messages=True)
        settle(session)
        options = session._game.env.options
        assert (options.pointing, options.lookalikes, options.templates, options.feedback) == (False, False, 1, True)
        assert options.goal, "what no track decides stays"
    finally:
        session.close()
        gates.stop(server)


def test_a_policy_that_cannot_play_is_refused_at_once() -> None:
    server = gates.guarded_server(gates.Gate(), "127.0.0.1", 0)
    try:
        with pytest.raises(ChmarlError, match=r"ours-pictures|observation"):
            sessions.Session(server, Choice(SHORT.id), ("planner",), "ours-pictures")
    finally:
        gates.stop(server)
