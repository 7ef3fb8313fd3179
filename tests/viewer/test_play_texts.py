"""What the page says of a moment."""

from collections.abc import Iterator
from typing import Any

import pytest

from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task
from chmarl_pb.viewer.live import choice, texts
from chmarl_pb.viewer.live.choice import Choice, homes_on_offer, tasks_on_offer
from chmarl_pb.viewer.live.game import Game

SHORT = min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)


@pytest.fixture(scope="module")
def game() -> Iterator[Game]:
    game = Choice(SHORT.id).begin()
    while not game.over:
        for robot, action in game.hint().items():
            game.choose(robot, action)
        game.step()
    yield game
    game.close()


def test_status_tells_instruction_potential_and_ending(game: Game) -> None:
    recording = game.recording
    assert recording.instruction in texts.status(recording, 0, False)
    assert "reward" not in texts.status(recording, 0, False)
    last = texts.status(recording, recording.steps, True)
    assert f"Solved in {SHORT.optimal_steps} steps" in last and "potential 10 of 10" in last and "reward +" in last


def test_board_marks_the_rooms(game: Game) -> None:
    assert "●" in texts.board(game.recording, game.recording.steps)
    assert all(room in texts.board(game.recording, 0) for room in ("kitchen", "living room"))


def test_robot_has_its_scene_graph_with_pixels(game: Game) -> None:
    recording, last = game.recording, game.recording.steps
    seen = recording.moments[last].visible["humanoid"]
    table = texts.scene_graph(recording, last, "humanoid", dict.fromkeys(seen, 7))
    assert table.count("| 7 |") == len(seen)
    assert f"on {recording.moments[last].carriers[recording.item]}" in table
    assert "sees nothing" in texts.scene_graph(recording, last, "humanoid", {})
    assert "Did: place" in texts.robot_report(recording, last, "humanoid")


def test_labels_say_what_is_too_small_to_count(game: Game) -> None:
    labels = texts.seen_labels({"humanoid": {"kitchen/stove_1": 3}, "drone": {"kitchen/stove_1": 40}})
    assert labels == {"kitchen/stove_1": "kitchen/stove_1: humanoid 3 px, below 4; drone 40 px"}


def test_thing_report_tells_class_state_and_place(game: Game) -> None:
    recording, last = game.recording, game.recording.steps
    item, target = texts.thing_report(recording, last, recording.item), recording.targets[0]
    assert f"class: {SHORT.graspable}" in item and "state: " in item and "stands on: " in item and "seen by: " in item
    assert "held by: humanoid" in texts.thing_report(recording, last - 1, recording.item)
    assert f"room: {target.partition('/')[0]}" in texts.thing_report(recording, 0, target)
    assert "class: drone" in texts.thing_report(recording, 0, "drone")


def test_buttons_are_short() -> None:
    words = [texts.button_words(action) for action in ("goto_livingroom", "turn_left", "pick", "place_0_2")]
    assert words == ["living room", "turn left", "pick", "place ↗"]


def test_page_offers_homes_and_their_tasks() -> None:
    assert homes_on_offer("home_7") == homes_on_offer("home_1")
    assert homes_on_offer("mine.urdf")[0] == "mine.urdf"
    assert SHORT.id in tasks_on_offer("home_7") and tasks_on_offer("mine.urdf") == []


def test_a_task_is_drawn_by_the_rules_that_it_is_played_by(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []

    def drawn(home: str, *_: Any, **rules: Any) -> tuple[Task, ...]:
        asked.append((home, rules))
        return (SHORT,)

    monkeypatch.setattr(choice, "draw_tasks", drawn)
    Choice(home=SHORT.home, rules={"lookalikes": True}).begin().close()
    given = {"catalog": None, "robots": ("humanoid", "drone")}
    assert asked == [(SHORT.home, {"lookalikes": True, "track": "paper", **given})]
