"""Published weights in the hundred homes of generated-test, by the rules of the paper's track."""

from collections.abc import Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.evaluation.as_text import points
from chmarl_pb.evaluation.cooperation import Reference, path_weighted_lengths, read_reference
from chmarl_pb.evaluation.intervals import interval
from chmarl_pb.evaluation.metrics import by_home
from chmarl_pb.tasks.tidy_task import AnyTask
from training.tables.published import read_published

SPLIT, FOLDER = "generated-test", "generated-test"  # a folder of the results' folder: NAME.json
#: Policies that do not learn, from those that see nothing or do not read to the teacher of our learner.
SHOWN = ("blind", "instruction-blind", "search", "belief")
BLIND = "blind"

NOTE = """## In a hundred homes

The headline's test-unseen has 50 tasks in one home. Here the weights that come with the package, one training each,
play the 2,000 tasks of generated-test in 100 homes that nothing was trained or chosen in, by the rules of the paper's
track; intervals are over homes (95 %). Weights called *ours* learned in other generated homes, but
`ours-pictures-mappo`, like all others, in the five of training. `qmix-pictures` sees by a detector, the rows *QMIX* of
the tables by ResNet-18. *Gain*: points of PLW more than *blind* on the same tasks. A line is made by (pictures: with
`--observation visual`; PPO's file ends in `.zip`)

```
python -m training.score results/weights/NAME.pt --messages --feedback --splits generated-test --out out/in-100/NAME
cp out/in-100/NAME/scores.json results/generated-test/NAME.json
```
"""


def hundred_homes(results: Path) -> list[str]:
    """Return the section as Markdown, nothing where no such result, or none of the built-in policies, is kept.

    Args:
        results: folder of the kept files.

    Raises:
        ResultError: a file is damaged, or of other weights than the published ones of its name.
    """
    played, reference = read_published(results / FOLDER, _fault), read_reference(SPLIT, results)
    if not played or reference is None:
        return []
    blind = path_weighted_lengths(reference, BLIND, MAX_STEPS)
    lines = ["| | success % | PLW % | gain |", "|---|--:|--:|--:|"]
    for name, one in sorted(played.items(), key=lambda item: -item[1]["splits"][SPLIT]["summary"]["plw"]["mean"]):
        found, more = one["splits"][SPLIT], one["options"].get("goal")  # who is told more gains nothing by seeing
        shares = [_with_interval(found["summary"][metric]) for metric in ("success_rate", "plw")]
        gained = "" if more else _gain({task: found["plw_of_tasks"][task.id] for task in blind}, blind)
        lines.append(f"| {name}{', told the goal' if more else ''} | {' | '.join(shares)} | {gained} |")
    lines += [_built_in(name, reference, blind) for name in SHOWN]
    return [NOTE.strip(), "\n".join(lines)]


def _fault(evaluation: Mapping[str, Any]) -> str:
    options = evaluation["options"]
    if not (options["messages"] and options["feedback"]):
        return "it was not played by the rules of the paper's track"
    return "" if SPLIT in evaluation["splits"] else f"it is not of {SPLIT}"


def _built_in(name: str, reference: Reference, blind: Mapping[AnyTask, float]) -> str:
    """Return the line of a built-in policy."""
    own = path_weighted_lengths(reference, name, MAX_STEPS)
    solved = {
        task: fmean(steps is not None and steps <= MAX_STEPS for steps in reference.lengths[task][name]) for task in own
    }
    shares = [
        _with_interval({"mean": fmean(of.values()), **dict(zip(("low", "high"), interval(by_home(of)), strict=True))})
        for of in (solved, own)
    ]
    gained = "" if name == BLIND else _gain(own, blind)
    return f"| *{name}* | {' | '.join(shares)} | {gained} |"


def _with_interval(figure: Mapping[str, float]) -> str:
    return f"{100 * figure['mean']:.1f} [{100 * figure['low']:.1f} to {100 * figure['high']:.1f}]"


def _gain(own: Mapping[AnyTask, float], blind: Mapping[AnyTask, float]) -> str:
    """Return the points of PLW that a policy has more than the blind one, with the interval over homes."""
    ahead = {task: 100 * (own[task] - blind[task]) for task in own}
    low, high = interval(by_home(ahead))
    return f"{points(fmean(ahead.values()))} [{low:+.1f} to {high:+.1f}]"
