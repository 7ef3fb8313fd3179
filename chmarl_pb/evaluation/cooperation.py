"""What a score is worth: cooperation accounting, and what the built-in policies score on the same tasks.

The references are fixed: for each task the lengths that the built-in policies reach, among them the belief search with
the drone, without hearing it, and by the humanoid alone. `chmarl-pb baselines --references` measures them.
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

from chmarl_pb.evaluation.json_file import check_own
from chmarl_pb.evaluation.metrics import Played, path_weighted
from chmarl_pb.evaluation.provenance import home_hashes, tasks_hash
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.files import write_atomically
from chmarl_pb.tasks.language import WORDINGS, wording_of_task
from chmarl_pb.tasks.tidy_task import AnyTask

FOLDER = Path(__file__).parent / "references"
ALONE, SILENT, PAIR = "belief-alone", "belief-silent", "belief"
VARIANTS = (ALONE, SILENT, PAIR)


class Score(NamedTuple):
    """What a policy scores, 0 to 1."""

    success_rate: float
    plw: float


Lengths = dict[str, list[int | None]]  # variant -> joint steps for each seed, None for a failure


@dataclass(frozen=True)
class Reference:
    """What the built-in policies reach on the tasks of a split.

    Attributes:
        max_steps: joint steps after which its episodes were cut.
        lengths: task -> its lengths.
    """

    max_steps: int
    lengths: dict[AnyTask, Lengths]


@dataclass(frozen=True)
class Cooperation:
    """What a policy gets of the possible gain from cooperation.

    Attributes:
        tasks: number of tasks.
        plw_alone: PLW of the humanoid that searches alone: no gain.
        plw_silent: PLW of the search pair whose messages nobody hears.
        plw_pair: PLW of the search pair.
        plw: of the policy.
        share: (PLW - PLW alone) / (1 - PLW alone), where 1 is the PLW of the planner, which knows everything.
        share_pair: the same of the search pair.
        steps_saved: joint steps fewer than the lone humanoid takes, mean over tasks; a failure counts
            ``max_steps``.
        steps_possible: the same of the planner.
        faster: share of the tasks on which the policy takes fewer steps than the lone humanoid.
    """

    tasks: int
    plw_alone: float
    plw_silent: float
    plw_pair: float
    plw: float
    share: float | None
    share_pair: float | None
    steps_saved: float
    steps_possible: float
    faster: float


def cooperation(episodes: Sequence[Played], split: str, max_steps: int) -> Cooperation | None:
    """Return what a policy gets of the gain from cooperation, or None if there is nothing to compare with.

    Args:
        episodes: of the policy, all seeds.
        split: that they belong to.
        max_steps: joint steps after which they were cut; the reference lengths are cut there, too.
    """
    reference = read_reference(split)
    own = _lengths(episodes)
    if reference is None or reference.max_steps < max_steps or not own or not own.keys() <= reference.lengths.keys():
        return None
    known = {task: {name: _cut(reference.lengths[task][name], max_steps) for name in VARIANTS} for task in own}
    plw = {name: fmean(_score(task, known[task][name]) for task in own) for name in VARIANTS}
    plw_own = fmean(_score(task, own[task]) for task in own)
    saved = [_steps(known[task][ALONE], max_steps) - _steps(own[task], max_steps) for task in own]
    possible = [_steps(known[task][ALONE], max_steps) - min(task.optimal_steps, max_steps) for task in own]
    return Cooperation(
        len(own), plw[ALONE], plw[SILENT], plw[PAIR], plw_own,
        gain_share(plw_own, plw[ALONE]), gain_share(plw[PAIR], plw[ALONE]),
        fmean(saved), fmean(possible), fmean(steps > 0 for steps in saved),
    )  # fmt: skip


def reference_scores(split: str, max_steps: int, tasks: Iterable[AnyTask] | None = None) -> dict[str, Score]:
    """Return built-in policy -> what it scores; empty if there is no reference.

    Args:
        split: the split.
        max_steps: joint steps after which an episode is cut.
        tasks: of the split; all that are evaluated if None.
    """
    reference = read_reference(split)
    chosen = list(reference.lengths if tasks is None and reference else tasks or ())
    if (
        reference is None
        or reference.max_steps < max_steps
        or not reference.lengths.keys() >= set(chosen)
        or not chosen
    ):
        return {}
    scores = {}
    for name in reference.lengths[chosen[0]]:
        cut = {task: _cut(reference.lengths[task][name], max_steps) for task in chosen}
        solved = fmean(fmean(steps is not None for steps in lengths) for lengths in cut.values())
        scores[name] = Score(solved, fmean(_score(task, lengths) for task, lengths in cut.items()))
    return scores


def reference_scores_by_wording(split: str, max_steps: int) -> dict[str, dict[str, Score]]:
    """Return wording of the instructions, "seen" or "held-out" -> what ``reference_scores`` says of those tasks."""
    tasks = {name: [task for task in evaluated_tasks(split) if wording_of_task(task) == name] for name in WORDINGS}
    return {name: reference_scores(split, max_steps, same) for name, same in tasks.items()}


def gain_share(plw: float, alone: float) -> float | None:
    """Return which share of the way from the lone humanoid to the planner a PLW goes; None if there is no way."""
    return (plw - alone) / (1 - alone) if alone < 1 else None


def path_weighted_lengths(reference: Reference, policy: str, max_steps: int) -> dict[AnyTask, float]:
    """Return task -> PLW of a built-in policy, 0 to 1.

    Args:
        reference: what the built-in policies reach.
        policy: one of them, which has played all tasks.
        max_steps: joint steps after which an episode is cut.
    """
    return {task: _score(task, _cut(lengths[policy], max_steps)) for task, lengths in reference.lengths.items()}


@cache
def read_reference(split: str, folder: Path | None = None) -> Reference | None:
    """Return the reference lengths of a split, or None if they are missing or of other tasks or homes.

    Args:
        split: the split.
        folder: of the file; None: those that come with the package.
    """
    path = (folder or FOLDER) / f"{split}.json"
    if not path.is_file():
        return None
    data = json.loads(path.read_text(encoding="utf-8"))
    tasks = evaluated_tasks(split)
    if data["tasks"] != tasks_hash(tasks) or data["homes"] != home_hashes(tasks):
        return None
    return Reference(data["max_steps"], {task: data["lengths"][task.id] for task in tasks})


def check_reference(path: Path) -> None:
    """Refuse to write reference lengths over a file that holds something else.

    Raises:
        OptionError: so it is.
    """
    check_own(path, _is_reference, "a file of reference lengths")


def _is_reference(found: Any) -> bool:
    if not isinstance(found, dict) or not found.keys() >= {"split", "max_steps", "tasks", "homes", "lengths"}:
        return False
    return isinstance(found["lengths"], dict) and all(
        isinstance(of_task, dict) for of_task in found["lengths"].values()
    )


def write_reference(path: Path, split: str, max_steps: int, episodes: Mapping[str, Sequence[Played]]) -> None:
    """Write a split's reference file; what other policies did on the same tasks stays in it, see ``reference_json``.

    Raises:
        OptionError: something else is there.
        WriteError: it cannot be written.
    """
    check_reference(path)
    before = path.read_text(encoding="utf-8") if path.is_file() else ""
    write_atomically(path, reference_json(split, max_steps, episodes, before))


def reference_json(split: str, max_steps: int, episodes: Mapping[str, Sequence[Played]], before: str = "") -> str:
    """Return the text of a split's reference file.

    Args:
        split: the split.
        max_steps: joint steps after which the episodes were cut.
        episodes: built-in policy -> its episodes on all tasks of the split.
        before: text that the file has; what other policies did on the same tasks stays in it.
    """
    tasks = evaluated_tasks(split)
    head = {"split": split, "max_steps": max_steps, "tasks": tasks_hash(tasks), "homes": home_hashes(tasks)}
    others = _lengths_in(before, head)
    lengths = {name: _lengths(of_policy) for name, of_policy in episodes.items()}
    of_task = {
        task.id: {**others.get(task.id, {}), **{name: lengths[name][task] for name in lengths}} for task in tasks
    }
    rows = [f"{json.dumps(task)}: {json.dumps(row)}" for task, row in of_task.items()]
    joined = ",\n  ".join(rows)
    return f'{json.dumps(head, indent=1)[:-2]},\n "lengths": {{\n  {joined}\n }}\n}}\n'


def _lengths_in(text: str, head: dict[str, Any]) -> dict[str, Any]:
    """Return task id -> policy -> lengths of a reference file's text, nothing if it begins otherwise."""
    try:
        kept = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return dict(kept["lengths"]) if _is_reference(kept) and head.items() <= kept.items() else {}


def _lengths(episodes: Sequence[Played]) -> dict[AnyTask, list[int | None]]:
    """Return task -> joint steps for each seed, None for a failure."""
    lengths: dict[AnyTask, list[int | None]] = defaultdict(list)
    for episode in sorted(episodes, key=lambda episode: episode.seed):
        lengths[episode.task].append(episode.steps if episode.success else None)
    return dict(lengths)


def _cut(lengths: Sequence[int | None], max_steps: int) -> list[int | None]:
    """Return the lengths that episodes cut at ``max_steps`` would have had."""
    return [None if steps is None or steps > max_steps else steps for steps in lengths]


def _score(task: AnyTask, lengths: Sequence[int | None]) -> float:
    return fmean(path_weighted(steps is not None, steps or 0, task.optimal_steps) for steps in lengths)


def _steps(lengths: Sequence[int | None], max_steps: int) -> float:
    return fmean(max_steps if steps is None else steps for steps in lengths)
