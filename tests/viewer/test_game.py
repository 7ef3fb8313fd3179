"""A game of people and policies: driving, handing over, stepping back, hints, and its episode file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.episode_file import load_episode, replay_episode, save_episode
from chmarl_pb.evaluation.play import Player, Setup
from chmarl_pb.frames.motion_player import Replay
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task
from chmarl_pb.viewer.live.game import PERSON, Game
from chmarl_pb.viewer.record import record_file

SHORT = min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)


def game_of(task: Task = SHORT, **options: Any) -> Game:
    return Game(HouseholdEnv(home=task.home, **{"execution": "instant", **options}), task)


@pytest.fixture
def game() -> Iterator[Game]:
    game = game_of()
    yield game
    game.close()


def solve(game: Game) -> None:
    """Do as the planner says, by hand."""
    while not game.over:
        for robot, action in game.hint().items():
            game.choose(robot, action)
        game.step()


def test_person_solves_the_task_by_the_hints(game: Game) -> None:
    solve(game)
    assert game.recording.success
    assert game.recording.steps == SHORT.optimal_steps
    assert game.recording.policy == PERSON
    assert [moment.potential for moment in game.recording.moments][-1] == 10


def test_robots_without_a_choice_stay(game: Game) -> None:
    game.choose("humanoid", "turn_left")
    assert game.chosen == {"humanoid": "turn_left"}
    assert game.step().actions == {"humanoid": "turn_left", "drone": "stay"}
    assert game.chosen == {}


def test_steps_back_lead_to_the_same_state_and_the_same_rest(game: Game) -> None:
    solve(game)
    before = game.recording.moments
    game.back(2)
    assert not game.over
    assert len(game.recording.moments) == len(before) - 2
    assert not game.recording.success
    solve(game)
    assert [moment.actions for moment in game.recording.moments] == [moment.actions for moment in before]
    game.back(100)
    assert game.recording.steps == 0


def test_a_policy_in_all_seats_plays_as_in_an_evaluation(game: Game) -> None:
    for robot in game.drivers:
        game.hand_over(robot, "search")
    while not game.over:
        game.step()
    player = Player(Setup("search", Options(home=SHORT.home)))
    played = player.play((SHORT, 0))
    player.close()
    assert game.file().actions == played.actions
    assert game.recording.success == played.success


def test_a_policy_goes_on_after_a_step_back_as_it_did_before(game: Game) -> None:
    for robot in game.drivers:
        game.hand_over(robot, "random")
    for _ in range(4):
        game.step()
    before = [moment.actions for moment in game.recording.moments]
    game.back(2)
    game.step()
    game.step()
    assert [moment.actions for moment in game.recording.moments] == before


def test_a_policy_that_takes_over_has_seen_what_came_before() -> None:
    whole, later = game_of(), game_of()
    for game in (whole, later):
        if game is whole:
            game.hand_over("drone", "random")
        first = game.step().actions["drone"]
        if game is later:
            assert first == "stay"
            game.hand_over("drone", "random")
    assert whole.step().actions["drone"] == later.step().actions["drone"]
    whole.close()
    later.close()


def test_a_person_and_a_policy_play_together(game: Game) -> None:
    game.hand_over("drone", "search")
    game.choose("humanoid", "turn_right")
    moment = game.step()
    assert moment.actions["humanoid"] == "turn_right"
    assert game.recording.policy == "person+search"
    with pytest.raises(OptionError, match="drives drone"):
        game.choose("drone", "stay")
    game.hand_over("drone", PERSON)
    game.choose("drone", "move_left")


@pytest.mark.parametrize("whole", [True, False])
def test_file_replays_and_is_shown(game: Game, whole: bool, tmp_path: Path) -> None:
    if whole:
        solve(game)
    else:
        game.choose("humanoid", "goto_bedroom")
        game.step()
    save_episode(game.file(), tmp_path / "episode.json")
    file = load_episode(tmp_path / "episode.json")
    assert replay_episode(file) is None
    shown = record_file(file)
    assert shown.success == whole
    assert [moment.actions for moment in shown.moments] == [moment.actions for moment in game.recording.moments]


def test_own_words_are_said_and_saved(tmp_path: Path) -> None:
    game = game_of(messages="symbols")
    game.choose("drone", "stay", 5)
    assert game.step().said == {"humanoid": 0, "drone": 5}
    game.hand_over("humanoid", "search")
    game.step()
    game.back()
    file = game.file()
    game.close()
    assert file.said == ((0, 5),)
    assert replay_episode(file) is None


def test_nothing_is_saved_before_the_first_step(game: Game) -> None:
    with pytest.raises(OptionError, match="play a step"):
        game.file()


def test_unknown_actions_and_policies_are_named(game: Game) -> None:
    with pytest.raises(OptionError, match="no action 'fly'"):
        game.choose("humanoid", "fly")
    with pytest.raises(OptionError, match="unknown policy"):
        game.hand_over("humanoid", "nobody")
    assert game.drivers["humanoid"] == PERSON


def test_after_the_end_nothing_moves(game: Game) -> None:
    solve(game)
    for attempt in (game.step, game.hint):
        with pytest.raises(OptionError, match="over"):
            attempt()


def test_counted_pixels_say_what_is_visible(game: Game) -> None:
    """What the picture that decides shows is what the environment calls visible."""
    replay = Replay(game.recording.home, game.recording.team)
    game.choose("humanoid", "goto_kitchen")
    game.choose("drone", "goto_kitchen")
    game.step()
    for moment in game.recording.moments:
        for robot, seen in moment.visible.items():
            pixels = replay.pixels(robot, moment.rest)
            assert {name for name, count in pixels.items() if count >= 4} == set(seen)


def test_grounded_track_is_played_by_pointing() -> None:
    game = game_of(track="grounded")
    solve(game)
    assert game.recording.success and game.recording.steps <= 28
    assert any(moment.actions.get("humanoid", "").startswith("pick_") for moment in game.recording.moments)
    game.back()
    game.step()
    file = game.file()
    game.close()
    assert replay_episode(file) is None
