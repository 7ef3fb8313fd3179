"""Whether policies tell X from its lookalikes: ``python -m benchmarks.lookalikes POLICY ...``.

Plays validation tasks of the grounded track and looks at the first object of X's class that each policy takes: in how
many episodes there is one, in how many of these it is X, and in how many it would be by chance, among all objects of
that class. Who reads no colours is as often right as by chance. Test splits are refused.
"""

import argparse
import json
from contextlib import closing
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import chmarl_pb
from benchmarks.scores import SPLITS, thinned
from chmarl_pb.catalog import class_of
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.tracks import GROUNDED
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.files import write_atomically
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.limits import whole_number
from chmarl_pb.policies.policy import Policy
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.progress import progress_bar
from chmarl_pb.tasks.task import Task


class Taken(NamedTuple):
    """The first object of X's class that was taken: whether it was X, and how likely it would be by chance."""

    is_x: bool
    chance: float


def first_taken(env: HouseholdEnv, policy: Policy, task: Task) -> Taken | None:
    """Play a task and return what is taken first of X's class; None if nothing is."""
    held = list[str]()

    def note(core: HouseholdEnv) -> None:
        item, x = core.outcome.held, core.setting.goals[0].item
        if item and class_of(item) == class_of(x) and not held:
            held.append(item)

    chmarl_pb.rollout(env, policy, episode_seed(task, 0), task, note)
    x, things = env.setting.goals[0].item, [*env.outcome.supports, *env.outcome.state.held]
    alike = [thing for thing in things if class_of(thing) == class_of(x)]
    return Taken(held[0] == x, 1 / len(alike)) if held else None


def measured(name: str, observation: str, split: str, thin: int) -> dict[str, Any]:
    """Return what a policy takes on every so many tasks of a split."""
    source, tasks = find_policy(name), thinned(evaluated_tasks(split), thin)
    env = HouseholdEnv(observation=observation, **{"track": GROUNDED, **source.rules, "split": split})
    with closing(env), progress_bar() as bar:
        policy = source.make(env)
        row = bar.add_task(f"{name}, {split}", total=len(tasks))
        found = list[Taken | None]()
        for task in tasks:
            found.append(first_taken(env, policy, task))
            bar.advance(row)
    taken = [one for one in found if one is not None]
    shares = {"x": fmean(one.is_x for one in taken), "chance": fmean(one.chance for one in taken)} if taken else {}
    return {
        "policy": name,
        "observation": observation,
        "split": split,
        "tasks": len(tasks),
        "taken": len(taken),
        **shares,
    }


def main() -> int:
    """Play and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.lookalikes", description=__doc__)
    parser.add_argument("policies", nargs="+", metavar="POLICY", help="built-in, published weights, or a checkpoint")
    parser.add_argument("--observation", default="scene_graph", choices=("scene_graph", "visual"))
    parser.add_argument("--split", default=SPLITS[0], choices=SPLITS, help="(default: %(default)s)")
    parser.add_argument("--thin", type=int, default=5, metavar="N", help="play every Nth task only (default: 5)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="keep the figures in a file, too")
    return run_command(lambda: _print(parser.parse_args()))


def _print(chosen: argparse.Namespace) -> int:
    whole_number("--thin", chosen.thin, 1)
    if chosen.json and chosen.json.is_dir():
        raise OptionError(f"--json {chosen.json}: is a folder; name a file in it")
    rows = list[dict[str, Any]]()
    print(
        "| policy | tasks | takes one of X's class | X among these % | by chance % |", "|---|--:|--:|--:|--:|", sep="\n"
    )
    for name in chosen.policies:
        row = measured(name, chosen.observation, chosen.split, chosen.thin)
        rows.append(row)
        shares = [f"{100 * row[key]:.0f}" if key in row else "" for key in ("x", "chance")]
        print(f"| {name} | {row['tasks']} | {row['taken']} | {' | '.join(shares)} |", flush=True)
        if chosen.json:
            write_atomically(chosen.json, json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
