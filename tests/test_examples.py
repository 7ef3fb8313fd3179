"""The examples run."""

import importlib.util
import json
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium
import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.evaluation.result import Report
from chmarl_pb.learning import Config, train
from chmarl_pb.learning.runs.run import BEST
from chmarl_pb.policies.policy import Factory, Policy

torch = pytest.importorskip("torch")

torch.set_num_threads(1)
EXAMPLES = Path(__file__).parents[1] / "examples"


def example(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_custom_learner(capsys: pytest.CaptureFixture[str]) -> None:
    example("custom_learner").main(["--episodes", "2", "--split", "val-unseen"])
    assert "episode 1: return" in capsys.readouterr().out


def test_asynchronous(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--steps", "200", "--envs", "3", "--batch-size", "2", "--workers", "1", "--split", "val-unseen"]
    example("asynchronous").main(words)
    assert "episodes; the last" in capsys.readouterr().out


def test_sb3_quickstart(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3")
    evaluate = chmarl_pb.evaluate

    def two(policy: str | Factory | Policy, split: str, **options: Any) -> Report:
        return evaluate(policy, split, tasks=chmarl_pb.load_tasks(split)[:2], **options)

    monkeypatch.setattr(chmarl_pb, "evaluate", two)
    example("sb3_quickstart").main(steps=1024, seed=3)
    shown = capsys.readouterr().out
    assert "val-seen: " in shown and "% of 2 tasks, PLW " in shown.split("val-unseen: ")[1]


def test_torchrl_rollout(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("torchrl")
    example("torchrl_rollout").main(["--steps", "3", "--split", "val-unseen"])
    assert "drone: 3 steps, return" in capsys.readouterr().out


@pytest.mark.parametrize("more", [[], ["--shared"]], ids=str)
def test_rllib_ppo(more: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("ray.rllib")
    example("rllib_ppo").main(["--iterations", "1", "--batch", "56", *more])
    assert "iteration 0: mean return" in capsys.readouterr().out


@pytest.mark.parametrize("algorithm", ["mappo", "qmix"])
def test_benchmarl_task(
    algorithm: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("benchmarl")
    module = example("benchmarl_task")
    monkeypatch.setitem(sys.modules, "benchmarl_task", module)  # BenchMARL pickles the task
    module.main(["--algorithm", algorithm, "--frames", "120", "--split", "val-unseen", "--out", str(tmp_path)])
    assert f"{algorithm}: 120 frames, mean return" in capsys.readouterr().out


def test_epymarl_env() -> None:
    """What EPyMARL asks of an environment: as many lists as robots, spaces to match, and its own limit of time."""
    example("epymarl_env")
    env: Any = gymnasium.make("Household-v0", max_episode_steps=28, split="val-unseen", keys=("messages", "self"))
    team, spaces = env.unwrapped, env.observation_space
    vectors, _ = env.reset(seed=3)
    assert [one.n for one in env.action_space] == [10, 9] and team.n_agents == len(vectors) == 2
    for step in range(28):
        assert all(space.contains(vector) for space, vector in zip(spaces, vectors, strict=True))
        vectors, rewards, ended, cut, info = env.step(np.array([9, 8]))
        assert len(rewards) == 2 and (ended, cut) == (False, step == 27) and info == {"success": 0.0}
    other, _ = env.reset(seed=3)
    assert np.array_equal(other[0], env.reset(seed=3)[0][0])
    env.close()


def test_cleanrl_ppo(capsys: pytest.CaptureFixture[str]) -> None:
    example("cleanrl_ppo").main(["--steps", "256", "--envs", "2", "--split", "val-unseen"])
    assert "episodes: mean return" in capsys.readouterr().out


def test_noisy_channel(capsys: pytest.CaptureFixture[str]) -> None:
    example("noisy_channel").main(tasks=2)
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) == 4 and "NoisyChannel(flip=0.3)" in shown[2] and shown[0].startswith("True")


def test_depth_sensor(capsys: pytest.CaptureFixture[str]) -> None:
    example("depth_sensor").main()
    assert capsys.readouterr().out.count(" m\n") == 4


def test_text_policy(capsys: pytest.CaptureFixture[str]) -> None:
    example("text_policy").main()
    shown = capsys.readouterr().out
    assert "You are the humanoid, in the " in shown and "\n> " in shown and "after" in shown


def test_tidy_task(capsys: pytest.CaptureFixture[str]) -> None:
    example("tidy_task").main()
    assert "success after" in capsys.readouterr().out


def test_my_policy(capsys: pytest.CaptureFixture[str]) -> None:
    example("my_policy").main(tasks=2)
    assert "MyPolicy" in capsys.readouterr().out


def test_watch_checkpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = Config(episodes=1, envs=1, horizon=4, learning_starts=9, buffer_size=1, features=8, hidden=8)
    train(
        lambda: chmarl_pb.parallel_env(split="val-unseen", max_steps=4),
        "iql",
        config,
        tmp_path,
        lambda *_: {"score": 0},
    )
    example("watch_checkpoint").main([str(tmp_path / BEST), "--out", str(tmp_path / "episode.gif")])
    assert "after" in capsys.readouterr().out
    assert (tmp_path / "episode.gif").stat().st_size > 1000


def test_new_mixer(capsys: pytest.CaptureFixture[str]) -> None:
    example("new_mixer").main(episodes=200)
    assert "return of the greedy actions: " in capsys.readouterr().out


def test_scout_robot(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    example("scout_robot").main(out=tmp_path / "scout.png")
    assert "goto_kitchen     sees kitchen/" in capsys.readouterr().out and (tmp_path / "scout.png").is_file()


def test_three_humanoids_two_drones(capsys: pytest.CaptureFixture[str]) -> None:
    example("three_humanoids_two_drones").main()
    shown = capsys.readouterr().out
    assert "humanoid_1        humanoid_2        drone_0" in shown and "success after" in shown


def test_hint_adviser(capsys: pytest.CaptureFixture[str]) -> None:
    example("hint_adviser").main()
    said = capsys.readouterr().out.splitlines()
    assert said[0].endswith("The best plan has 6 steps, you have taken 1.") and said[-1].startswith("place")


def test_own_objects(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("own_objects").main(str(tmp_path / "own"))
    assert "success after" in capsys.readouterr().out and (tmp_path / "own" / "duck.png").is_file()


def test_own_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("own_robot").main(str(tmp_path / "own"), tasks=1)
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == "rover, planner: 1 of 1 tasks" and shown[2] == "humanoid + drone + rover, planner: 1 of 1 tasks"


def test_own_home(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example("own_home").main(str(tmp_path / "own"), tasks=1)
    shown = capsys.readouterr().out
    assert "good: it can be played" in shown and "livingroom/coffee_table_1" in shown and "of 1 tasks" in shown
    assert (tmp_path / "own" / "cabin.png").is_file()


@pytest.fixture
def chat() -> Iterator[tuple[str, list[str]]]:
    """Serve a language model that always wants to turn; yield its address and what it reads."""
    read: list[str] = []

    class Answer(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            asked = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            read.append(asked["messages"][1]["content"])
            words = "I choose turn_left." if "turn_left" in read[-1] else "Let us sing."
            self.send_response(200)
            self.end_headers()
            self.wfile.write(json.dumps({"choices": [{"message": {"content": words}}]}).encode())

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Answer)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", read
    server.shutdown()
    server.server_close()


def test_language_model(
    chat: tuple[str, list[str]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("LM_URL", "LM_MODEL"):
        monkeypatch.setenv(name, "")  # the example sets them
    url, read = chat
    example("language_model").main(url, max_steps=3)
    shown = capsys.readouterr().out.splitlines()
    assert shown[1:4] == ["turn_left         stay            "] * 3 and shown[4] == "failure after 3 steps"
    assert read[0].startswith("Task: ") and read[-2].endswith("Your last actions: turn_left, turn_left.")


def test_play_together(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser")
    monkeypatch.setattr("sys.path", [*sys.path])  # the example adds its folder
    example("play_together").rehearse()
    shown = capsys.readouterr().out.splitlines()
    assert "drone goto_bedroom" in shown[1] and shown[-1] == "success"
