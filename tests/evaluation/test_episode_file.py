import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from chmarl_pb.cli import main
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.episode_file import EpisodeFile, load_episode, record_episode, replay_episode, save_episode
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.viewer.record import record_file

TASK = load_tasks("test-unseen")[0]


def recorded(steps: int) -> EpisodeFile:
    env = HouseholdEnv(home=TASK.home, max_steps=steps, messages=False)
    file = record_episode(env, make_policy("random", env), "random", 5, TASK)
    env.close()
    return file


@pytest.fixture(scope="module")
def episode() -> EpisodeFile:
    return recorded(20)


@pytest.fixture(scope="module")
def brief() -> EpisodeFile:
    """An episode whose motions are soon driven."""
    return recorded(5)


def test_an_episode_survives_its_file(tmp_path: Path, episode: EpisodeFile) -> None:
    path = tmp_path / "deep" / "episode.json"
    save_episode(episode, path)
    assert load_episode(path) == episode
    assert path.stat().st_size < 8000
    assert [entry.name for entry in path.parent.iterdir()] == ["episode.json"]
    assert (len(episode.states), episode.options["max_steps"], episode.options["messages"]) == (21, 20, False)


def test_replay_is_the_same(episode: EpisodeFile) -> None:
    assert replay_episode(episode) is None


def test_other_robots_and_tasks_are_kept(tmp_path: Path) -> None:
    """Files of the benchmark's own say nothing of robots and tasks, as those from before there was a choice."""
    path, robots = tmp_path / "episode.json", ("humanoid", "humanoid", "drone")
    env = HouseholdEnv(home=TASK.home, robots=robots, task="tidy", max_steps=30)
    env.reset(seed=1)
    save_episode(record_episode(env, make_policy("planner", env), "planner", 0, env.task), path)
    env.close()
    file = load_episode(path)
    assert (file.options["robots"], file.options["task"]) == (robots, "tidy") and file.success
    assert {len(numbers) for numbers in file.actions} == {3} and len(file.task.moves) > 1
    assert replay_episode(file) is None
    with pytest.raises(ResultError, match="several objects"):
        record_file(file)


def test_the_benchmarks_robots_are_not_named(episode: EpisodeFile) -> None:
    assert not {"robots", "task"} & set(episode.options)


def test_files_that_an_episode_names_may_have_moved_with_it(
    tmp_path: Path, small_home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "before").mkdir()
    (tmp_path / "before" / "own.urdf").write_bytes(small_home.read_bytes())
    monkeypatch.chdir(tmp_path / "before")
    env = HouseholdEnv(home="own.urdf", max_steps=3)
    task = replace(TASK, home="own.urdf", graspable="mug", source="desk", target="sofa")
    save_episode(record_episode(env, make_policy("random", env), "random", 5, task), "episode.json")
    env.close()
    (tmp_path / "before").rename(tmp_path / "after")
    monkeypatch.chdir(tmp_path)
    assert replay_episode(load_episode(Path("after") / "episode.json")) is None


def test_replay_after_other_episodes_is_the_same(env: HouseholdEnv) -> None:
    """The planner's episode in a long-used environment equals its replay in a fresh one."""
    policy = make_policy("planner", env)
    for task in load_tasks("test-unseen")[:3]:
        file = record_episode(env, policy, "planner", 0, task)
    assert file.success and replay_episode(file) is None


def test_an_episode_can_be_shown(brief: EpisodeFile) -> None:
    """The demo plays the actions with driven motions; they end in the same way, also where the episode was cut."""
    recording = record_file(brief)
    assert (recording.steps, recording.success, recording.policy) == (5, brief.success, "random")
    assert [moment.reward for moment in recording.moments[1:]] == list(brief.rewards)


@pytest.mark.parametrize(
    ("part", "change", "words"),
    [
        ("states", lambda states: ["0" * 64, *states[1:]], "at the start"),
        ("states", lambda states: [*states[:3], "0" * 64, *states[4:]], "after step 3 "),
        ("rewards", lambda rewards: [*rewards[:-1], 7.0], "reward of step 20 "),
        ("success", lambda success: not success, "does not end in the same way"),
        ("home_sha256", lambda value: "0" * 64, "home_7 is not the one"),
    ],
)
def test_replay_says_what_differs_first(
    tmp_path: Path, episode: EpisodeFile, part: str, change: Callable[[Any], object], words: str
) -> None:
    path = tmp_path / "episode.json"
    save_episode(episode, path)
    data = json.loads(path.read_text())
    path.write_text(json.dumps({**data, part: change(data[part])}))
    difference = replay_episode(load_episode(path))
    assert difference is not None and words in difference


@pytest.mark.parametrize(
    "change",
    [
        lambda data: {**data, "format": "other"},
        lambda data: {**data, "actions": data["actions"][:-1]},
        lambda data: {**data, "actions": [[1]] * len(data["actions"])},
        lambda data: {**data, "options": {}},
        lambda data: {**data, "seed": -1},
        lambda data: {**data, "seed": "0"},
        lambda data: {**data, "more": 1},
        lambda data: {**data, "task": {"id": "x"}},
        lambda data: [],
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, episode: EpisodeFile, change: Callable[[Any], object]) -> None:
    path = tmp_path / "episode.json"
    save_episode(episode, path)
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(ResultError, match=r"episode\.json"):
        load_episode(path)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe", None])
def test_files_that_are_none_are_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "episode.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ResultError, match=r"episode\.json"):
        load_episode(path)


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "episode.json"
    assert main(["episode", "save", "--policy", "search", "--task", TASK.id, "--out", str(path)]) == 0
    assert main(["episode", "replay", str(path)]) == 0
    assert "are the same" in capsys.readouterr().out
    file = load_episode(path)
    states = json.dumps(list(file.states)).replace(file.states[1], "0" * 64)
    path.write_text(path.read_text().replace(json.dumps(list(file.states)), states))
    assert main(["episode", "replay", str(path)]) == 1
    assert "after step 1 " in capsys.readouterr().err
    assert main(["episode", "replay", str(tmp_path / "none.json")]) == 2
    assert main(["episode", "save", "--task", TASK.id, "--seed", "-1", "--out", str(tmp_path / "other.json")]) == 2
    assert not (tmp_path / "other.json").exists()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"home_sha256": "0" * 64}, "not the one"),
        ({"success": "other"}, "another way"),
        ({"actions": "cut"}, "another"),
    ],
    ids=["home", "ending", "length"],
)
def test_what_a_file_does_not_say_is_not_shown(brief: EpisodeFile, change: dict[str, Any], words: str) -> None:
    if change == {"actions": "cut"}:
        change = {"actions": brief.actions[:-1], "rewards": brief.rewards[:-1], "states": brief.states[:-1]}
    elif change == {"success": "other"}:
        change = {"success": not brief.success}
    with pytest.raises(ResultError, match=words):
        record_file(replace(brief, **change))


@pytest.mark.parametrize("policy", ["random", "search"])
def test_the_command_saves_what_an_evaluation_plays(tmp_path: Path, policy: str) -> None:
    report = evaluate(policy, "test-unseen", seeds=[2], tasks=[TASK], workers=1)
    given = ["--policy", policy, "--task", TASK.id, "--seed", "2", "--out", str(tmp_path / "episode.json")]
    assert main(["episode", "save", *given]) == 0
    assert load_episode(tmp_path / "episode.json").actions == tuple(map(tuple, report.episodes[0].actions))


def test_sentences_of_the_grounded_track_are_said_again() -> None:
    env = HouseholdEnv(split="val-unseen", track="grounded", max_steps=2)
    try:
        file = record_episode(env, make_policy("random", env), "random", 0, "val-unseen-000")
    finally:
        env.close()
    assert file.options["templates"] == 2 and replay_episode(file) is None
