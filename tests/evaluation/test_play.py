"""Playing jobs: seeds, independence of episodes, and errors before anything is started."""

import pytest

from chmarl_pb.envs.options import Options
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.play import Player, Setup, episode_seed, play
from chmarl_pb.executors import Local
from chmarl_pb.tasks.splits import load_tasks

TASKS = load_tasks("val-unseen")[:3]
SETUP = Setup("random", Options(split="val-unseen", max_steps=6))


def test_seeds_of_episodes_differ_by_task_and_by_seed() -> None:
    tasks = load_tasks("val-unseen")
    seeds = {episode_seed(task, seed) for task in tasks for seed in range(3)}
    assert len(seeds) == 3 * len(tasks), "two episodes share their random numbers"
    assert episode_seed(tasks[0], 1) == 1628218424, "published results were played by this one"


def test_an_episode_does_not_depend_on_those_before_it() -> None:
    player = Player(SETUP)
    try:
        first = player.play((TASKS[0], 0))
        player.play((TASKS[1], 0))
        assert player.play((TASKS[0], 0)) == first
    finally:
        player.close()


def test_nothing_to_play() -> None:
    assert list(play(SETUP, [], Local(4))) == []


def test_an_unknown_policy_is_refused_at_once() -> None:
    with pytest.raises(OptionError, match="no_such"):
        play(Setup("no_such_policy", SETUP.options), [(TASKS[0], 0)], Local(1))
