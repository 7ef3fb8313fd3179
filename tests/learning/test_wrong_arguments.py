"""Wrong arguments of ``train``, and files that do not fit: refused in a sentence, before anything is done."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from torch import nn

import chmarl_pb
from chmarl_pb.errors import OptionError
from chmarl_pb.files import write_atomically
from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.algorithms.mappo import MappoConfig
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.storage.checkpoint import CheckpointError, fill, load, save
from tests.helpers.small_runs import SMALL
from tests.helpers.uneven_env import UnevenEnv

TINY = replace(SMALL, episodes=4)
IMITATION = DAggerConfig(episodes=2, envs=2, batch_size=2, features=8, hidden=8)


class Mixer(nn.Module):
    """A mixer that is derived from nothing of ours."""

    def __init__(self, agents: int, state_size: int, units: int):
        super().__init__()


class Unpaid(UnevenEnv):
    """An environment that forgets the rewards."""

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        """Leave the rewards out."""
        observations, _, *rest = super().step(actions)
        return observations, {}, *rest


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((None, "qmix", TINY), "env_fn=None: give what makes an environment"),
        ((UnevenEnv(), "qmix", TINY), "give what makes an environment"),
        ((partial(gymnasium.make, "CartPole-v1"), "qmix", TINY), "has to make a ParallelEnv"),
        ((UnevenEnv, "qmix", {"episodes": 4}), "qmix takes settings of the class Config"),
        ((UnevenEnv, "mappo", TINY), "mappo takes settings of the class MappoConfig"),
        ((UnevenEnv, "qmix", replace(TINY, mixer=f"{__name__}:Mixer")), "derive what it makes from .*mixers.Mixer"),
        ((Unpaid, "qmix", TINY), "returns no reward of 'long', which has acted"),
    ],
)
def test_arguments_of_another_kind_are_refused(arguments: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        train(*arguments)


@pytest.mark.parametrize(
    ("expert", "words"),
    [(None, "needs an expert"), (3, "expert=3: give what makes"), (lambda env: None, "expert makes None: make a pol")],
)
def test_experts_of_another_kind_are_refused(expert: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        train(UnevenEnv, "imitation", IMITATION, expert=expert)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("encoder", 3, "encoder=3: must be a text"),
        ("graph_pool", None, "graph_pool=None: must be a text"),
        ("layer_norm", "yes", "layer_norm='yes': must be True or False"),
        ("hidden", True, "hidden=True: must be a number"),
    ],
)
def test_settings_of_another_kind_are_refused(name: str, value: Any, words: str) -> None:
    with pytest.raises(ValueError, match=f"^{words}"):
        replace(TINY, **{name: value})


def test_a_folder_may_be_a_text(tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", TINY, folder=str(tmp_path / "run"))
    assert (tmp_path / "run" / LAST).is_file() and (tmp_path / "run" / BEST).is_file()


@pytest.mark.parametrize("setting", [{"x": Path("a")}, {"x": [np.zeros(3)]}, {Path("a"): 1}, "abc"])
def test_a_setting_that_no_checkpoint_keeps_is_refused_at_the_start(setting: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^setting"):
        train(UnevenEnv, "vdn", TINY, folder=tmp_path / "run", setting=setting)
    assert not (tmp_path / "run").exists()


def test_what_would_not_be_read_again_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=re.escape("agents['a'][1]: a checkpoint keeps no PosixPath")):
        save(tmp_path / "a.pt", "value", {"agents": {"a": [1, tmp_path]}})
    assert not list(tmp_path.iterdir())


def test_best_weights_of_another_run_are_not_written_over(tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", TINY, tmp_path)
    before = (tmp_path / BEST).read_bytes()
    (tmp_path / LAST).unlink()
    with pytest.raises(CheckpointError, match=r"best.pt: the best weights of a run that cannot go on"):
        train(UnevenEnv, "iql", TINY, tmp_path)
    assert (tmp_path / BEST).read_bytes() == before


def test_a_refused_training_leaves_no_folder(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="mixer"):
        train(UnevenEnv, "qmix", replace(TINY, mixer="nonsense"), tmp_path / "new" / "run")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("figures", "words"),
    [
        ({"score": 1.0, "note": "hi"}, "'note': 'hi' among its figures"),
        ({"score": 1.0, "x": np.zeros(3)}, "'x': array.* among its figures"),
        ({"score": np.inf}, "has the score inf"),
        ({"scores": 1.0}, "with one of the name 'score'"),
    ],
)
def test_a_validation_is_checked_before_its_weights_are_kept(figures: Any, words: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=words):
        train(UnevenEnv, "vdn", TINY, tmp_path, validate=lambda collector, agents: figures)
    assert not (tmp_path / BEST).exists()
    score = torch.tensor(2.0, dtype=torch.bfloat16, requires_grad=True)
    assert train(UnevenEnv, "vdn", TINY, tmp_path, validate=lambda *_: {"score": score}).best_score == 2


def test_weights_that_are_no_numbers_are_neither_played_nor_begun_with(tmp_path: Path) -> None:
    env_fn = partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=2)
    config = MappoConfig(episodes=2, envs=2, batch_size=2, horizon=2, features=8, hidden=8, buffer_size=2)
    train(env_fn, "mappo", config, tmp_path / "whole")
    content = load(tmp_path / "whole" / BEST)
    next(iter(content["agents"].values())).fill_(torch.nan)
    bad = tmp_path / "bad.pt"
    save(bad, content.pop("kind"), content)
    with pytest.raises(CheckpointError, match=r"bad.pt: its weights .* are not all finite numbers"):
        train(env_fn, "mappo", replace(config, start=str(bad)), tmp_path / "begun")
    env = env_fn()
    with pytest.raises(CheckpointError, match=r"bad.pt: its weights .* are not all finite numbers"):
        ValuePolicies(bad)(env.unwrapped)
    env.close()


class Masked(nn.Module):
    """A network with what attention has: infinite numbers that are no weights."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(2, 2)
        self.register_buffer("mask", torch.full((2, 2), -torch.inf).triu(1))


def test_only_weights_have_to_be_numbers(tmp_path: Path) -> None:
    save(tmp_path / "a.pt", "value", {"state": Masked().state_dict(), "kinds": {1, 2}, "device": torch.device("cpu")})
    content = load(tmp_path / "a.pt")
    fill(Masked(), content["state"], tmp_path / "a.pt")
    assert content["kinds"] == {1, 2} and content["device"] == torch.device("cpu")


@pytest.mark.parametrize("rules", [{"nope": 6}, {"max_steps": "six"}])
def test_rules_of_another_version_are_refused_by_the_name_of_the_file(rules: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "later.pt"
    save(path, "value", {"setting": {"rules": rules}})
    with pytest.raises(CheckpointError, match=f"^{path}: does not hold what this version looks for"):
        ValuePolicies(path)


def test_a_run_folder_is_no_policy(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match=r"is a folder; name the file of the weights in it, e.g. .*best.pt"):
        chmarl_pb.evaluate(str(tmp_path), "val-unseen", workers=1)


def test_a_folder_below_a_file_is_refused_by_the_name_of_the_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for name in ("file", "link"):
        with pytest.raises(OSError, match=f"{tmp_path / name} is no folder"):
            write_atomically(tmp_path / name / "run", "text")
