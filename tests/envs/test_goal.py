"""The option ``goal``: what the instruction asks for as class ids, and whether it is in view, for each robot."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.cli import main
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.result import load_result
from chmarl_pb.evaluation.tables import title_of
from chmarl_pb.policies.policy import Actions, Infos, Observations
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.language import parse_instruction
from tests.helpers.env_ids import EACH_ID

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")
TASKS = ["val-unseen-000", "val-unseen-001", "val-unseen-002"]


def steps_of(env: HouseholdEnv, task: str) -> list[tuple[Observations, Infos]]:
    """Return all observations and infos of an episode that the search policy plays."""
    policy = make_policy("search", env)
    policy.reset(0)
    seen, infos = env.reset(seed=0, options={"task": task})
    steps = [(seen, infos)]
    while env.agents:
        seen, _, _, _, infos = env.step(policy.act(seen, infos))
        steps.append((seen, infos))
    return steps


@pytest.fixture(scope="module")
def episodes() -> dict[str, list[list[tuple[Observations, Infos]]]]:
    """The same episodes in graphs and in pictures."""
    played = {}
    for observation in ("scene_graph", "visual"):
        env = chmarl_pb.parallel_env(observation, split="val-unseen", image_size=32, goal=True)
        played[observation] = [steps_of(env, task) for task in TASKS]
        env.close()
    return played


def test_goal_is_what_the_words_and_the_view_tell(episodes: Any) -> None:
    bits = set()
    for seen, infos in (step for episode in episodes["scene_graph"] for step in episode):
        for robot in TEAM:
            wanted = [catalog.BENCHMARK.class_ids[name] for name in parse_instruction(infos[robot]["instruction"])]
            in_view = [number in seen[robot]["node_class"] for number in wanted]
            assert seen[robot]["goal"].tolist() == [*wanted, *in_view] and seen[robot]["goal"].dtype == np.int16
            bits.add((robot, *in_view))
    assert {bits[0] for bits in bits} == set(TEAM) and len(bits) >= 6  # both robots saw X or Y, and did not


def test_bits_follow_the_same_rule_in_pictures(episodes: Any) -> None:
    goals = [
        [seen[robot]["goal"].tolist() for episode in played for seen, _ in episode for robot in TEAM]
        for played in episodes.values()
    ]
    assert goals[0] == goals[1] != []


def test_nothing_else_changes() -> None:
    plain, given = (chmarl_pb.parallel_env(split="val-unseen", goal=goal) for goal in (False, True))
    for one, (other, infos) in zip(steps_of(plain, TASKS[0]), steps_of(given, TASKS[0]), strict=True):
        assert all("goal" not in part for part in one[0].values())
        without = {robot: {key: part[key] for key in part if key != "goal"} for robot, part in other.items()}
        assert digest(*one) == digest(without, infos)
    plain.close()
    given.close()


@pytest.mark.parametrize("env_id", EACH_ID)
def test_every_id_takes_it(make: Callable[..., Any], env_id: str) -> None:
    env = make(env_id, goal=True, image_size=32)
    check_env(env.unwrapped, skip_render_check=True)
    keys = [key for key in env.observation_space if key.endswith("goal")]
    assert keys == (["goal"] if "Humanoid" in env_id else ["drone_goal", "humanoid_goal"])


def test_pettingzoo_takes_it() -> None:
    parallel, aec = chmarl_pb.parallel_env(goal=True), chmarl_pb.env(goal=True)
    parallel_api_test(parallel, num_cycles=30)
    api_test(aec, num_cycles=30)
    parallel.close()
    aec.close()


def test_vectors_share_it() -> None:
    env = chmarl_pb.vector_env(2, "CHMARL/SceneGraphHumanoid-v0", workers=2, split="val-unseen", goal=True)
    seen, infos = env.reset(seed=0)
    for goal, text in zip(seen["goal"], infos["instruction"], strict=True):
        assert goal[:2].tolist() == [catalog.BENCHMARK.class_ids[name] for name in parse_instruction(text)]
    env.close()


def test_other_values_are_refused() -> None:
    with pytest.raises(OptionError, match="goal='yes'"):
        chmarl_pb.parallel_env(goal="yes")


class Seeing:
    """Picks and places what the goal says is in view; cannot do without it."""

    centralized = True

    def __init__(self, env: HouseholdEnv):
        self.names = env.action_names

    def reset(self, seed: int | None) -> None:
        pass

    def act(self, observations: Observations, infos: Infos) -> Actions:
        seen = observations["humanoid"]
        chosen = ("place" if seen["self"][-1] else "pick") if seen["goal"][2:].any() else "turn_left"
        return {"humanoid": self.names["humanoid"].index(chosen), "drone": self.names["drone"].index("stay")}


def test_evaluation_gives_and_records_it(tmp_path: Path) -> None:
    given: dict[str, Any] = {"split": "val-unseen", "seeds": (0,), "workers": 1, "tasks": TASKS[:2], "max_steps": 4}
    report = evaluate(Seeing, goal=True, **given)
    assert report.settings["options"]["goal"] is True and "goal observed" in title_of(report)
    with pytest.raises(KeyError):
        evaluate(Seeing, **given)
    plain = evaluate("random", **given)
    assert set(plain.settings["options"]) == {"messages", "feedback", "max_steps", "image_size"}  # as it has been
    assert "goal" not in title_of(plain)


def test_command_gives_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    given = ["--policy", "test_goal:Seeing", "--goal"]
    out = tmp_path / "result.json"
    split = ["--split", "val-unseen", "--task", TASKS[0], "--seeds", "1", "--workers", "1", "--max-steps", "4"]
    assert main(["evaluate", *given, *split, "--out", str(out)]) == 0
    assert "goal observed" in capsys.readouterr().out and load_result(out).settings["options"]["goal"] is True
    assert main(["episode", "save", *given, "--task", TASKS[0], "--out", str(tmp_path / "episode.json")]) == 0
    assert main(["episode", "replay", str(tmp_path / "episode.json")]) == 0
