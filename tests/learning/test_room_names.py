"""Weights are played only where Gotos and messages name the rooms that they named in training."""

from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb.homes.assemble import build_home
from chmarl_pb.homes.layout import STARTER
from chmarl_pb.learning.benchmark_env import benchmark, untold
from chmarl_pb.learning.config import HOME, ROOMS
from chmarl_pb.learning.policies.checks import check_names
from chmarl_pb.learning.storage.checkpoint import CheckpointError
from chmarl_pb.policies.sources import find_policy

RENAMED = "kitchen,kitchen_2,bedroom,livingroom"


@pytest.fixture(scope="module")
def two_kitchens(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with as many rooms as the benchmark's, one of which is of another kind."""
    layout = tmp_path_factory.mktemp("home") / "two_kitchens.toml"
    layout.write_text(STARTER.read_text(encoding="utf-8").replace('"bathroom"', '"kitchen_2"'), encoding="utf-8")
    return build_home(layout)


def test_weights_of_the_benchmark_are_refused_where_other_rooms_have_their_numbers(two_kitchens: Path) -> None:
    env = chmarl_pb.parallel_env(home=str(two_kitchens))
    assert ",".join(env.rooms) == RENAMED
    for weights in ("ours-graphs", "qmix-graphs"):
        with pytest.raises(CheckpointError, match=rf"name the rooms kitchen,bedroom,.*, not {RENAMED}"):
            find_policy(weights).make(env)
    env.close()


def test_what_was_trained_there_is_played_there_alone(two_kitchens: Path) -> None:
    setting = benchmark("scene_graph", home=str(two_kitchens))[1]
    assert setting[ROOMS] == RENAMED
    there, elsewhere = chmarl_pb.parallel_env(home=str(two_kitchens)), chmarl_pb.parallel_env(split="val-unseen")
    check_names(there, setting, Path("best.pt"))
    with pytest.raises(CheckpointError, match=f"name the rooms {RENAMED}, not kitchen,bedroom"):
        check_names(elsewhere, setting, Path("best.pt"))
    older = {name: value for name, value in setting.items() if name != ROOMS}
    assert older[HOME]
    check_names(there, older, Path("best.pt"))
    assert untold(older, setting)[ROOMS] == RENAMED and ROOMS not in untold(benchmark("scene_graph")[1], setting)
    assert ROOMS not in benchmark("scene_graph")[1]
    for env in (there, elsewhere):
        env.close()
