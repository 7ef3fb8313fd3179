"""What this project set out to reach, beside what it reaches, and what is known of why it falls short where it does."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from chmarl_pb.envs.tracks import HEADLINE_SPLITS
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.json_file import read_object
from training.tables.cells import HEADLINE, NOT_RUN, Records, built_in, runs_of, values
from training.tables.rows import TABLES
from training.tables.without_feedback import Scores, played_without

NOTE = """## Goals, and what stops what misses them

What this project set out to reach. Success / PLW, per cent, means over seeds, on test-unseen (grounded track:
generated-test); a goal is met if both are reached. Goals of speed: [performance.md](performance.md#learning).
"""

_TEACHER = (
    "in part its teacher, which has {belief}; it lacks {lag} of that, mostly by tasks that it fails "
    "([measured](training_findings.md#why-it-stops-short))"
)
_FIVE = "the five homes that it learned in, where it has {gap} points of PLW more (test-seen); then as the next line"
_EYES = (
    "objects that the detector misses, on `ours-pictures` 7 points of PLW in home 6, and what imitators on graphs "
    "lack, too ([measured](training_findings.md#what-pictures-lose)); its teacher has {belief}"
)
_SILENT = (
    "in part its teacher, which has {belief}; it lacks {lag} of that, with and without feedback, by tasks that it "
    "fails ([measured](training_findings.md#why-it-stops-short))"
)
_SILENT_READING = (
    "in part its teacher, which has {belief}; it lacks {lag} of that, and 0 to 2 points less with feedback "
    "([below](#without-feedback-at-test))"
)
_SILENT_PICTURES = (
    "in part objects that the detector misses, which feedback points out "
    "([measured](training_findings.md#what-feedback-gives-on-pictures) on `ours-pictures`)"
)
_POINTING = (
    "names that training never shows, which it misreads, and what its humanoid does otherwise than its teacher "
    "([measured](training_findings.md#what-misread-words-cost))"
)
_POINTING_PICTURES = (
    "in part objects that the detector misses: with the same eyes the search that it imitates has hardly more PLW, and "
    "weights that learned words have 13 points of success more where they are told the truth "
    "([measured](training_findings.md#what-pictures-cost))"
)

_SEEN, _GAP = "test-seen", "{gap}"
#: Success and PLW on the headline's split, per cent; points of PLW more on test-seen; how many trainings.
Reached = tuple[tuple[float, ...], str, str]


@dataclass(frozen=True)
class Goal:
    """One line.

    Attributes:
        what: the learner and its setting.
        wanted: success and PLW, per cent.
        stops: why it is missed, as far as that is known; ``{belief}`` stands for the scores of the belief search,
            ``{lag}`` for what it has more, ``{gap}`` for the points of PLW that its own has more on test-seen.
        table: of the row.
        row: its name, as the table's rows of one name differ by observation alone; "" if it is played without feedback.
        observation: of the row.
        weights: name of the published weights that are played without feedback.
    """

    what: str
    wanted: tuple[float, float]
    stops: str = ""
    table: str = "scene-graph"
    row: str = ""
    observation: str = "scene_graph"
    weights: str = ""


_OURS = "Imitation of belief, generated homes"
_PARSED, _IMITATION_PARSED = f"{_OURS}, words parsed", "Imitation of belief, words parsed"

GOALS = (
    Goal("PPO, humanoid only, goal observed", (75, 38), row="PPO, humanoid only, goal observed"),
    Goal("Recurrent PPO, humanoid only, goal observed", (85, 45), row="Recurrent PPO, humanoid only, goal observed"),
    Goal("PPO, one network for both robots, goal observed", (65, 30), row="PPO, both robots, goal observed"),
    Goal("ours, graphs", (97, 65), _TEACHER, row=f"{_PARSED}, greedy rollouts"),
    Goal("the same, all rollouts drawn", (97, 65), _TEACHER, row=_PARSED),
    Goal("the same, words learned", (97, 65), _TEACHER, row=_OURS),
    Goal("the same, with memory", (97, 65), _TEACHER, row=f"{_OURS}, memory"),
    Goal("ours, pictures", (92, 55), _FIVE, "visual", "Imitation of belief, then MAPPO", "visual"),
    Goal("imitation on pictures in generated homes, words parsed", (92, 55), _EYES, "visual", _PARSED, "visual"),
    Goal("the same, words learned", (92, 55), _EYES, "visual", _OURS, "visual"),
    Goal("ours, graphs, no feedback at test", (95, 62), _SILENT, weights="ours-graphs-greedy"),
    Goal("the same, all rollouts drawn", (95, 62), _SILENT, weights="ours-graphs-parsed"),
    Goal("the same, words learned", (95, 62), _SILENT_READING, weights="ours-graphs"),
    Goal("words parsed, with memory", (95, 62), _SILENT, weights="ours-graphs-memory"),
    Goal("ours, pictures, no feedback at test", (88, 50), _FIVE, weights="ours-pictures-mappo"),
    Goal(
        "imitation on pictures in generated homes, words parsed, no feedback at test", (88, 50), _SILENT_PICTURES,
        weights="ours-pictures-parsed",
    ),
    Goal("the same, words learned", (88, 50), _SILENT_PICTURES, weights="ours-pictures"),
    Goal("ours, grounded track, graphs", (75, 40), row=_IMITATION_PARSED, table="grounded"),
    Goal("words learned, then MAPPO", (75, 40), _POINTING, "grounded", "Imitation of belief, then MAPPO"),
    Goal(
        "ours, grounded track, pictures", (55, 25), _POINTING_PICTURES, "grounded", _IMITATION_PARSED, "visual",
    ),
    Goal(
        "words learned, then MAPPO", (55, 25), _POINTING_PICTURES, "grounded", "Imitation of belief, then MAPPO",
        "visual",
    ),
)  # fmt: skip


def goals(records: Records, results: Path) -> str:
    """Return the section as Markdown.

    Args:
        records: the kept runs.
        results: folder of the kept files.
    """
    silent = played_without(results)
    belief = [100 * (built_in("belief", metric, HEADLINE) or 0) for metric in ("success_rate", "plw")]
    lines = ["| | goal | reached | of | met | what stops it |", "|---|--:|--:|---|---|---|"]
    for goal in GOALS:
        reached, gap, of = _without(silent.get(goal.weights)) if goal.weights else _of_row(goal, records)
        met = bool(reached) and all(have >= want for have, want in zip(reached, goal.wanted, strict=True))
        cells = [goal.what, _pair(goal.wanted, 0), _pair(reached, 1), of, "yes" if met else "no" if reached else ""]
        lag = _pair([have - more for have, more in zip(belief, reached, strict=False)], 1)
        stops = "" if met else goal.stops.format(belief=_pair(belief, 1), lag=lag, gap=gap)
        lines.append(f"| {' | '.join([*cells, stops])} |")
    return "\n\n".join([NOTE.strip(), "\n".join(lines), _detector(results)])


def _of_row(goal: Goal, records: Records) -> Reached:
    """Return what a row reaches, in the mean of its trainings."""
    row = next(row for row in TABLES[goal.table] if (row.name, row.observation) == (goal.row, goal.observation))
    same, split = runs_of(row, records), HEADLINE_SPLITS.get(goal.table, HEADLINE_SPLITS["paper"])
    if not same:
        return (), "", NOT_RUN
    scores = tuple(100 * fmean(values(same, metric, split)) for metric in ("success_rate", "plw"))
    gap = f"{100 * fmean(values(same, 'plw', _SEEN)) - scores[1]:.0f}" if _GAP in goal.stops else ""
    return scores, gap, f"{len(same)} training{'s' * (len(same) > 1)}"


def _without(scores: Scores | None) -> Reached:
    """Return what published weights reach that were played without feedback."""
    if scores is None:
        return (), "", NOT_RUN
    split = scores[HEADLINE_SPLITS["paper"]]
    gap = f"{100 * (scores[_SEEN]['plw'] - split['plw']):.0f}"
    return tuple(100 * split[metric] for metric in ("success_rate", "plw")), gap, "1 training"


def _pair(scores: Sequence[float], digits: int) -> str:
    return " / ".join(f"{score:.{digits}f}" for score in scores)


def _detector(results: Path) -> str:
    """Return what became of the goal for the detector."""
    path = results / "detector.json"
    if not path.is_file():
        return ""
    try:
        measured = read_object(path)
        found = {home: float(measured[home]["mean_average_precision"]) for home in ("home_6", "generated_val")}
    except (KeyError, TypeError, ValueError) as error:
        raise ResultError(f"{path}: not the figures of a detector: {error!r}; measure it again") from error
    return (
        f"The detector's goal is a mean average precision of 0.65 in homes that it never saw: {found['home_6']:.2f} in "
        f"home 6, {found['generated_val']:.2f} in homes of generated-val, the two robots among its "
        "classes. Its time for a picture: [training_encoders.md](training_encoders.md#the-detector)."
    )
