"""Evaluations in environments that somebody has changed: played, recorded, and kept apart from the benchmark's."""

from functools import partial
from pathlib import Path
from typing import Any

import pytest
from pettingzoo.utils import BaseParallelWrapper

import chmarl_pb
from chmarl_pb.cli import main
from chmarl_pb.envs.parallel import HouseholdEnv, Results
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.replays import replays
from chmarl_pb.evaluation.result import load_result
from chmarl_pb.evaluation.tables import title_of
from chmarl_pb.policies.policy import Actions, Infos, Observations
from chmarl_pb.tasks.splits import load_tasks

TASKS = load_tasks("test-unseen")[:2]
GIVEN: dict[str, Any] = {"tasks": TASKS, "seeds": (0,), "workers": 1}


class Slow(BaseParallelWrapper):  # type: ignore[misc]
    """Carries out every action twice."""

    def step(self, actions: Actions) -> Results:
        results: Results = self.env.step(actions)
        if self.env.agents:
            results = self.env.step(actions)
        return results


def slow(**options: Any) -> Slow:
    return Slow(chmarl_pb.parallel_env(**{**options, "max_steps": 20}))


def test_it_is_played_and_recorded(tmp_path: Path) -> None:
    report = evaluate("random", env_fn=slow, out=tmp_path / "result.json", **GIVEN)
    settings = report.settings
    assert settings["env"]["name"].endswith("test_changed_env:slow") and len(settings["env"]["sha256"]) == 64
    assert [name.rpartition(":")[2] for name in settings["env"]["wrappers"]] == ["Slow"]
    assert settings["options"]["max_steps"] == 20  # what it really had
    assert {episode.steps for episode in report.episodes} == {20}
    assert report.cooperation is None and "test_changed_env:slow" in title_of(report)
    assert load_result(tmp_path / "result.json").episodes == report.episodes
    assert "changed environment" in replays([report], tmp_path)


def test_nothing_is_recorded_of_the_benchmark_itself() -> None:
    report = evaluate("random", max_steps=3, **GIVEN)
    assert "env" not in report.settings
    wrapped = evaluate("random", max_steps=3, env_fn=chmarl_pb.parallel_env, **GIVEN)
    assert wrapped.settings["env"]["wrappers"] == [] and wrapped.episodes == report.episodes


@pytest.mark.parametrize("env_fn", ["nowhere:env", "no_colon", lambda **options: object()])
def test_other_environments_are_refused(env_fn: Any) -> None:
    with pytest.raises(OptionError, match=r"environment|ParallelEnv"):
        evaluate("random", env_fn=env_fn, **GIVEN)


def test_homes_are_the_tasks_affair() -> None:
    with pytest.raises(OptionError, match="tasks name their homes"):
        evaluate("random", home="home_1", **GIVEN)


def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    out = tmp_path / "result.json"
    given = ["--policy", "random", "--env", "test_changed_env:slow", "--task", TASKS[0].id, "--seeds", "1"]
    assert main(["evaluate", *given, "--workers", "2", "--out", str(out)]) == 0
    assert "test_changed_env:slow" in capsys.readouterr().out.replace("\n", "")
    assert load_result(out).settings["env"]["name"] == "test_changed_env:slow"


class Staying:
    """A policy that is given as an object."""

    def reset(self, seed: int | None) -> None:
        pass

    def act(self, observations: Observations, infos: Infos) -> Actions:
        return {"humanoid": 9, "drone": 8}


def test_a_policy_may_be_an_object() -> None:
    report = evaluate(Staying(), max_steps=3, **GIVEN)
    assert report.settings["policy"].endswith("test_changed_env:Staying")
    assert {episode.actions for episode in report.episodes} == {((9, 8),) * 3}


def test_workers_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    alone, two = (
        evaluate("random", "test-unseen", env_fn="test_changed_env:slow", **{**GIVEN, "workers": workers})
        for workers in (1, 2)
    )
    assert alone.episodes == two.episodes and alone.settings == two.settings


def test_options_of_all_kinds_are_passed_on() -> None:
    options: list[dict[str, Any]] = []

    def env_fn(**given: Any) -> HouseholdEnv:
        options.append(given)
        return chmarl_pb.parallel_env(**given)

    evaluate("random", env_fn=partial(env_fn), goal=True, max_steps=2, **GIVEN)
    assert all(given["goal"] is True and given["max_steps"] == 2 for given in options)
