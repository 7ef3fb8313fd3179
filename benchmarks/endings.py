"""How the episodes end that a learner fails: ``python -m benchmarks.endings WEIGHTS``.

Plays its weights on validation tasks by the rules that they were trained by, and looks at the last steps of the robot
that grasps where the task was not solved: whether it only turns on the spot, repeats the same few actions or does
something else, and what the expert that it has imitated would have done there. On no test split.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from typing import Any

import chmarl_pb
from benchmarks.scores import Scores, parser_of, run, thinned
from benchmarks.teacher_parts import Helper
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.policies.policy import first_grasper
from chmarl_pb.progress import progress_bar
from chmarl_pb.robots.pointing import verb_of

LAST = 12  # steps of a failed episode that are looked at: a whole turn on the spot
TURNS = frozenset(("turn_left", "turn_right"))
_PACE = "move_forward"


def ending(done: Sequence[str]) -> str:
    """Return how the last actions of an episode are to be called."""
    last = list(done[-LAST:])
    if TURNS.issuperset(last):
        return "turns on the spot"
    if any(last[period:] == last[:-period] for period in range(1, LAST // 3 + 1)):
        return "repeats itself"
    return "other"


def wish(proposed: Sequence[str], done: Sequence[str]) -> str:
    """Return what an expert would have done in the last steps of an episode, beside what was done."""
    unmet = [want for want, own in zip(proposed[-LAST:], done[-LAST:], strict=True) if verb_of(want) != verb_of(own)]
    if any(verb_of(want) in ("pick", "place") for want in unmet):
        return "Pick or Place"
    if _PACE in unmet:
        return "a pace forward"
    if any(want.startswith("goto") for want in unmet):
        return "Goto"
    return "to turn" if unmet else "the same"


def endings(env: Any, helped: Any, split: str, thin: int, label: str) -> Counter[tuple[str, str, str]]:
    """Return how often failed episodes end with X held or not, in which way, and with which wish of the expert's."""
    name, found = first_grasper(env.unwrapped.action_names), Counter[tuple[str, str, str]]()
    actions, tasks = env.unwrapped.action_names[name], thinned(evaluated_tasks(split), thin)
    with progress_bar() as bar:
        for task in bar.count(tasks, len(tasks), label):
            episode = chmarl_pb.rollout(env, helped, episode_seed(task, 0), task)
            if episode.success:
                found["solved", "", ""] += 1
                continue
            own, proposed = ([actions[row[name][side]] for row in helped.taken] for side in (0, 1))
            held = "held" if env.unwrapped.outcome.held else "not held"
            found[held, ending(own), wish(proposed, own)] += 1
    return found


def main() -> int:
    """Play and print."""
    parser = parser_of("benchmarks.endings", __doc__, workers=1)
    parser.add_argument("--expert", default="belief", help="what it has imitated")
    return run(parser, _play)


def _play(chosen: argparse.Namespace) -> None:
    scores = Scores("", chosen)
    for split in scores.splits:
        rules = {"split": split, "observation": chosen.observation, **scores.rules}
        with closing(chmarl_pb.parallel_env(**rules)) as env:
            helped = Helper(chosen.weights, chosen.expert, ())(env)
            found = endings(env, helped, split, chosen.thin, split)
        total = found.total()
        rows = [
            {"X": held, "in its last steps": how, "the expert would": want, "episodes": count, "of": total}
            for (held, how, want), count in found.most_common()
        ]
        scores.count(split, rows)


if __name__ == "__main__":
    raise SystemExit(main())
