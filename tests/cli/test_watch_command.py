"""``chmarl-pb watch`` plays what an evaluation would, and shows it in the way that is asked for."""

from pathlib import Path
from typing import Any

import pytest

import chmarl_pb
from chmarl_pb.cli import main, watch
from chmarl_pb.evaluation.episode_file import EpisodeFile, load_episode
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.viewer.live.choice import Choice

TASK = "val-unseen-000"


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What would be shown, and how."""
    calls: list[Any] = []

    def note(*given: Any, **named: Any) -> int:
        calls.append((*given, named))
        return 0

    for name in ("show_episode", "write_page", "serve"):
        monkeypatch.setattr(watch, name, note)
    return calls


def test_the_episode_is_that_of_an_evaluation(shown: list[Any], tmp_path: Path) -> None:
    assert main(["watch", "random", "--task", TASK, "--seed", "1", "--out", str(tmp_path)]) == 0
    ((file, folder, _),) = shown
    report = chmarl_pb.evaluate("random", "val-unseen", tasks=[TASK], seeds=[1], workers=1)
    assert isinstance(file, EpisodeFile) and folder == tmp_path and file.policy == "random"
    assert file.actions == report.episodes[0].actions


def test_a_page_in_place_of_the_film(shown: list[Any], tmp_path: Path) -> None:
    pytest.importorskip("viser")
    assert main(["watch", "planner", "--task", TASK, "--page", "--out", str(tmp_path)]) == 0
    ((file, path, _),) = shown
    assert file.success and path == tmp_path / "watch.html"


def test_live_hands_all_robots_over(shown: list[Any]) -> None:
    pytest.importorskip("viser")
    words = ["watch", "search", "--task", TASK, "--live", "--goal", "--observation", "visual", "--track", "grounded"]
    assert main(words) == 0
    ((choice, policies, options, driver, _),) = shown
    assert isinstance(choice, Choice) and (choice.task, choice.track, choice.observation) == (
        TASK,
        "grounded",
        "visual",
    )
    assert choice.rules == {"goal": True} and policies == ["search"] and driver == "search" and options.port


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nobody",), "unknown policy 'nobody'"),
        (("random", "--task", "nothing"), "nothing"),
        (("random", "--task", TASK, "--home", "home_1"), "leave out --home"),
    ],
)
def test_bad_input_is_one_line(
    words: tuple[str, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["watch", *words, "--out", str(tmp_path)]) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert said.out == "" and message in line


def test_show_makes_the_page_without_a_film(tmp_path: Path) -> None:
    task = min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)
    episode = tmp_path / "episode.json"
    assert main(["episode", "save", "--task", task.id, "--out", str(episode)]) == 0
    assert main(["episode", "show", str(episode), "--page", "--out", str(tmp_path / "out")]) == 0
    (page,) = (tmp_path / "out").iterdir()
    steps = len(load_episode(episode).actions)
    assert page.name == "demo.html" and page.read_text(encoding="utf-8").count("data:image/jpeg") == 2 * (steps + 1)
