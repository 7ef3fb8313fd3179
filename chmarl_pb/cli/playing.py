"""What commands share that let a policy play one task."""

import argparse
from typing import Any

from chmarl_pb.cli.arguments import (
    GOAL,
    add_catalog,
    add_home,
    add_lookalikes,
    add_observation,
    add_robots,
    add_track,
    given_of,
)
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import OF_TRACK
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.episode_file import EpisodeFile, record_episode
from chmarl_pb.evaluation.optimum import optimal_steps
from chmarl_pb.evaluation.play import Player, Setup, seeds_to_play
from chmarl_pb.evaluation.rules import rules_with
from chmarl_pb.limits import whole_number
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.tasks.splits import find_task
from chmarl_pb.tasks.task import Task


def add_playing(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which task is played, and by which rules."""
    parser.add_argument("--task", metavar="ID", help="task to play, e.g. test-unseen-007")
    add_home(parser, "a task is drawn for it")
    add_catalog(parser)
    add_observation(parser)
    parser.add_argument("--goal", action="store_true", help=GOAL)
    add_lookalikes(parser)
    add_robots(parser)
    add_track(parser, OF_TRACK, "that of the checkpoint, else paper")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="as in evaluate (default: 0)")


def observation_of(options: argparse.Namespace) -> str:
    """Return what the policy observes."""
    return options.observation or find_policy(options.policy).observation or "scene_graph"


def rules_for(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of the environment: those that the policy was trained by, and those that are given."""
    given = {"track": options.track, "lookalikes": options.lookalikes}
    return rules_with(find_policy(options.policy).rules, given | given_of(options))


def task_of(options: argparse.Namespace) -> Task:
    """Return the task that is named, or one that is drawn for the home that is named.

    Raises:
        TaskError: there is no such task, or none can be drawn.
    """
    if options.task is not None:
        return find_task(options.task)
    rules = {name: value for name, value in rules_for(options).items() if name in ("lookalikes", "track")}
    (task,) = draw_tasks(options.home, 1, catalog=options.catalog, robots=options.robots, **rules)
    return task


def played(options: argparse.Namespace, task: Task) -> tuple[EpisodeFile, int]:
    """Let the policy play a task as an evaluation with the seed does; return the episode and L*.

    Raises:
        OptionError: the policy or an option is unknown.
    """
    source, seed = find_policy(options.policy), whole_number("seed", options.seed)
    player = Player(Setup(options.policy, Options(observation_of(options), home=task.home, **rules_for(options))))
    try:
        start, own = seeds_to_play(player.env, task, seed)
        file = record_episode(player.env, player.policy, source.name, start, task, policy_seed=own)
        return file, optimal_steps(player.env, task)
    finally:
        player.close()
