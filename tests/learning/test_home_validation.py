"""Weights that are trained in a home of one's own are chosen on tasks that are drawn for it."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from pettingzoo.utils import BaseParallelWrapper

import chmarl_pb
from chmarl_pb.cli.program import main
from chmarl_pb.envs.tracks import GROUNDED
from chmarl_pb.learning import Config, train
from chmarl_pb.learning.runs.validation import SEEDS_FROM, by_home, by_tasks, home_tasks
from chmarl_pb.learning.sb3.validation import make_validation, validation_tasks
from chmarl_pb.robots.registry import TEAM
from tests.helpers.small_homes import home_text


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A home of one room."""
    path = tmp_path_factory.mktemp("home") / "home.urdf"
    path.write_text(home_text())
    return str(path)


def test_tasks_of_a_home_are_apart_from_those_of_training(home: str) -> None:
    tasks = home_tasks(home, 3, TEAM, None)
    assert tasks == home_tasks(home, 3, TEAM, None) and len({task.id for task in tasks}) == 3
    assert all(task.seed >= SEEDS_FROM and task.home == home and task.optimal_steps > 0 for task in tasks)
    env = chmarl_pb.parallel_env(home=home)
    for seed in range(3):
        env.reset(seed=seed)
        assert env.task.seed < SEEDS_FROM
    assert chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), task=tasks[0]).steps == tasks[0].optimal_steps
    env.close()


def test_a_training_in_a_home_validates_there(tmp_path: Path, home: str) -> None:
    config = Config(
        episodes=2, envs=1, horizon=3, batch_size=1, learning_starts=1, features=8, hidden=8, validation_interval=1
    )
    env_fn = partial(chmarl_pb.parallel_env, home=home, max_steps=3)
    train(env_fn, "vdn", config, tmp_path, by_home(home, 2))
    assert (tmp_path / "best.pt").is_file()


def test_sb3_validates_in_its_home(home: str) -> None:
    tasks = validation_tasks(2, home)
    assert tasks == home_tasks(home, 4, TEAM, None)
    alike = validation_tasks(14, "home_7", track=GROUNDED)  # the last of which is another one among lookalikes
    assert alike == home_tasks("home_7", 14, TEAM, None, lookalikes=True) != home_tasks("home_7", 14, TEAM, None)
    env = make_validation("CHMARL/SceneGraph-v0", tasks, 2, {"max_steps": 3, "home": home})
    _, info = env.reset(seed=0)
    assert info["humanoid"]["task_id"] == tasks[0].id and env.step(env.action_space.sample())[1] == 0
    env.close()


def test_an_episode_in_a_home_is_saved_and_replayed(
    tmp_path: Path, home: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "episode.json"
    assert main(["episode", "save", "--home", home, "--out", str(file)]) == 0
    assert "success after" in capsys.readouterr().out
    assert json.loads(file.read_text())["task"]["home"] == home
    assert main(["episode", "replay", str(file)]) == 0
    assert main(["episode", "save", "--out", str(file)]) != 0
    assert "give either --task" in capsys.readouterr().err


class Lone(BaseParallelWrapper):  # type: ignore[misc]
    """The humanoid alone; its drone stays."""

    def __init__(self, env: Any):
        super().__init__(env)
        self.possible_agents = ["humanoid"]

    @property
    def agents(self) -> list[str]:
        return [name for name in self.env.agents if name == "humanoid"]

    @agents.setter
    def agents(self, value: list[str]) -> None: ...

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, ...]:
        return tuple({"humanoid": part["humanoid"]} for part in self.env.reset(seed=seed, options=options))

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        stay = self.env.unwrapped.action_names["drone"].index("stay")
        return tuple({"humanoid": part["humanoid"]} for part in self.env.step({**actions, "drone": stay}))


def test_a_view_with_fewer_agents_than_the_home_is_validated_by_tasks() -> None:
    config = Config(episodes=2, envs=2, horizon=28, batch_size=2, learning_starts=2, features=8, hidden=8)
    validate = by_tasks(("val-unseen",), most=1)
    assert train(lambda: Lone(chmarl_pb.parallel_env()), "iql", config, validate=validate).best_score >= 0
