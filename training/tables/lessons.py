"""What one learns from the results, in a few sentences and one picture, both computed from the kept runs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from chmarl_pb.envs.tracks import HEADLINE_SPLITS
from chmarl_pb.evaluation import paper
from chmarl_pb.evaluation.as_text import interval_text, points
from chmarl_pb.evaluation.gain import best_blind
from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.files import replacing
from training.tables.cells import HEADLINE, METRICS, NOT_RUN, Records, built_in, cell, gained, runs_of, values
from training.tables.curves import STYLE
from training.tables.record import Record
from training.tables.row import Row
from training.tables.rows import TABLES

TEACHER = "search"  # of our rows from before there was a choice

_TITLES = {"scene-graph": "Graphs", "visual": "Pictures"}
_LINES = {"blind": "#d00000", "search": "#6b6b6b", "belief": "#000000"}
_OWN, _PAPERS = "#17a2b8", "#4c78a8"
_BAR = 0.17  # inches


@dataclass(frozen=True)
class Lesson:
    """A sentence with the scores of some rows.

    Attributes:
        sentence: with a place for each row's score.
        rows: (table, name of the row, split).
    """

    sentence: str
    rows: tuple[tuple[str, str, str], ...]


def _lesson(sentence: str, *names: str, table: str = "scene-graph", split: str = HEADLINE) -> Lesson:
    return Lesson(sentence, tuple((table, name, split) for name in names))


_LESSONS = (
    _lesson(
        "**Messages**: the board alone takes QMIX from {} to {}; the best policy that neither sees nor reads has more.",
        "QMIX", "QMIX + messages",
    ),
    _lesson(
        "**Words**: PPO for the humanoid alone has {}; told whether what it is asked for is in view, with a network of "
        "few numbers, bolder settings, five times the steps and the drone of *belief*, {}. So a reward of this kind "
        "can be learned from; what each of the five changes brings was not measured apart.",
        "PPO, humanoid only", "PPO, humanoid only, goal observed",
    ),
    _lesson(
        "**Memory** seems to bring nothing beside a board that never forgets, and to drive the drone as well costs: "
        "with the goal observed PPO has {}, Recurrent PPO, with half the epochs, {}, one PPO for both robots {}; "
        "beside the first two the drone follows *belief*.",
        "PPO, humanoid only, goal observed", "Recurrent PPO, humanoid only, goal observed",
        "PPO, both robots, goal observed",
    ),
    _lesson(
        "**From scratch**: QMIX as the paper has it, with messages, has {}; with an encoder that ties words to things, "
        "twice the episodes, more gradient steps and a nearer horizon {}, and PQN with this encoder {}, as much as "
        "imitation of *belief* in these homes, which has a quarter of the episodes and is 9 to 12 points ahead on the "
        "seen splits.",
        "QMIX + messages", "QMIX + messages, grounded", "PQN + messages",
    ),
    _lesson(
        "**Homes**: imitation of *belief* in the five homes of training has {}, then MAPPO there {}; with as many "
        "episodes in generated homes {}, where MAPPO adds nothing on validation tasks.",
        "Imitation of belief", "Imitation of belief, then MAPPO", "Imitation of belief, generated homes",
    ),
    Lesson(
        "**Reading and eyes**: this learner, which reads words that training never shows, has {}; {} where the rule "
        "that the built-in searches read by tells it X and Y, so reading is not what holds it; on pictures {} by "
        "our detector with words tied to what it finds, and {} by ResNet-18, which nothing can be tied to.",
        (
            ("scene-graph", "Imitation of belief, generated homes", HEADLINE),
            ("scene-graph", "Imitation of belief, generated homes, words parsed", HEADLINE),
            ("visual", "Imitation of belief, generated homes", HEADLINE),
            ("visual", "Imitation of belief, generated homes, ResNet-18", HEADLINE),
        ),
    ),
    Lesson(
        "**New homes**: clones of the planner with messages have {} on test-seen and {} on test-unseen; with the "
        "encoder that ties words to things {} and {}. The paper's have 45.35 and 13.72.",
        tuple(
            ("scene-graph", f"BC decentralized + messages{encoder}", split)
            for encoder in ("", ", grounded")
            for split in SPLITS[2:]
        ),
    ),
    _lesson(
        "**Without the board, with words to find out**: in the grounded track imitation of *belief* has {} on graphs "
        "of generated-test, {} after MAPPO, and {} if it is told what words name; QMIX from scratch, with the same "
        "encoder, has {}, and the best blind policy next to nothing ([the audit](benchmark.md#the-grounded-track)).",
        "Imitation of belief", "Imitation of belief, then MAPPO", "Imitation of belief, words parsed", "QMIX, grounded",
        table="grounded", split=HEADLINE_SPLITS["grounded"],
    ),
)  # fmt: skip


def lessons(records: Records, folder: Path) -> list[str]:
    """Return the Markdown of what one learns, and draw its picture into a folder."""
    lines = _headlines(records)
    for lesson in _LESSONS:
        scores = [_score(records, *row) for row in lesson.rows]
        if all(scores):
            lines.append(f"- {lesson.sentence.format(*scores)}")
    read = "if nothing else is said; ranges in brackets are 95 % intervals over tasks, one for each training."
    text = f"## What one learns from them\n\nPLW on {HEADLINE}, per cent, {read}"
    return [text, "\n".join(lines), *_draw(records, folder)]


def _score(records: Records, table: str, name: str, split: str) -> str:
    row = next(row for row in TABLES[table] if row.name == name)
    same = runs_of(row, records)
    return cell(values(same, "plw", split)) if same else ""


def _headlines(records: Records) -> list[str]:
    """Return, for each observation, the row that is best on val-unseen, as the headline is of unseen homes, too.

    Rows of which seeds are still to be run are no candidates where others are: the best of single runs is a lucky one.
    """
    lines = []
    for table, published in (("scene-graph", paper.SCENE_GRAPH), ("visual", paper.VISUAL)):
        run = [row for row in TABLES[table] if runs_of(row, records)]
        whole = [row for row in run if len(runs_of(row, records)) >= row.seeds]
        best = max(whole or run, key=lambda row: _valid(row, records), default=None)
        theirs = max(published.rows, key=lambda row: row.plw[-1])
        beside = f"paper's best {theirs.name}: PLW {theirs.plw[-1]:.2f}, success {theirs.success[-1]:.2f}"
        if best is None:
            lines.append(f"- {_TITLES[table]}, test-unseen: {NOT_RUN} ({beside}).")
            continue
        plw, success = (values(runs_of(best, records), metric, SPLITS[-1]) for metric in METRICS.values())
        search = built_in(TEACHER, "plw", HEADLINE)
        share = f", {fmean(plw) / search:.0%} of the PLW of {TEACHER}" if search else ""
        whose = f"{'' if best.published else 'ours, '}best on val-unseen of those with all seeds run"
        lines.append(
            f"- {_TITLES[table]}, test-unseen: **{best.name}** ({whose}): PLW **{cell(plw)}**"
            f"{_intervals(best, records, 'plw')}, success **{cell(success)}**"
            f"{_intervals(best, records, 'success_rate')}{share} ({beside}). "
            + _over_blind(runs_of(best, records), table, records)
        )
    return lines


def _over_blind(own_runs: Sequence[Record], table: str, records: Records) -> str:
    """Return the gain of runs over the best blind policy, and how many rows of learners have one."""
    best = best_blind(HEADLINE)
    if best is None:
        return ""
    level = best.plw.mean or 0.0
    rows = [same for row in TABLES[table] if (same := runs_of(row, records)) and gained(same)]
    ahead = [same for same in rows if fmean(values(same, "plw", HEADLINE)) > level]
    told = [gain for same in ahead if (gain := gained(same)) and gain.low is not None]
    surely = sum(gain.low > 0 for gain in told if gain.low is not None)
    intervals = "no interval of their gain is known, as their runs did not keep the PLW of each task"
    if told:
        intervals = f"an interval of the gain is known for {len(told)} of these, and lies above 0 for {surely}"
    own = gained(own_runs)
    blind = f"(*{best.name}*, {100 * level:.1f})"
    between = f" ({text})" if own and (text := interval_text(own)) else ""
    score = f"**{points(own.mean if own else None)}**{between} points"
    return (
        f"Gain over the best blind policy {blind}: {score}. {len(rows)} rows of learners are told no more than it; "
        f"{len(ahead)} of them score above it; {intervals}."
    )


def _intervals(row: Row, records: Records, metric: str) -> str:
    """Return the intervals over the tasks of test-unseen, one for each seed that has one, in brackets."""
    summaries = [record["evaluation"]["splits"][SPLITS[-1]]["summary"][metric] for record in runs_of(row, records)]
    known = [one for one in summaries if one.get("low") is not None]
    text = "; ".join(f"{100 * one['low']:.0f} to {100 * one['high']:.0f}" for one in known)
    return f" ({text})" if text else ""


def _valid(row: Row, records: Records) -> float:
    return fmean(values(runs_of(row, records), "plw", SPLITS[1]))


def _draw(records: Records, folder: Path) -> list[str]:
    """Draw every row's score beside those of policies that learn nothing; return the Markdown that shows it."""
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError:
        return []
    known = {table: [row for row in TABLES[table] if runs_of(row, records)] for table in _TITLES}
    if not any(known.values()):
        return []
    with matplotlib.rc_context(STYLE):
        height = 1.0 + _BAR * max(map(len, known.values()))
        figure = Figure(figsize=(12, height), layout="constrained")
        for axes, (table, rows) in zip(figure.subplots(1, len(known)), known.items(), strict=True):
            scores = {row.name: [100 * one for one in values(runs_of(row, records), "plw", HEADLINE)] for row in rows}
            names = sorted(scores, key=lambda name: fmean(scores[name]))
            published = {row.name for row in rows if row.published}
            colours = [_PAPERS if name in published else _OWN for name in names]
            axes.barh(names, [fmean(scores[name]) for name in names], color=colours, height=0.7)
            for place, name in enumerate(names):
                axes.plot([min(scores[name]), max(scores[name])], [place, place], color="black", linewidth=1)
            for policy, colour in _LINES.items():
                if (score := built_in(policy, "plw", HEADLINE)) is not None:
                    axes.axvline(100 * score, color=colour, linestyle="--", linewidth=1, label=policy)
            axes.set_title(f"{_TITLES[table]}: PLW on {HEADLINE} (%)")
            axes.tick_params(axis="y", labelsize=7)
            axes.grid(visible=False, axis="y")
        figure.axes[0].legend(loc="lower right", fontsize=7)
        path = folder / "results_overview.png"
        with replacing(path) as temporary:
            figure.savefig(temporary, format="png", metadata={"Software": None})
    text = (
        "Bars are means over seeds, black lines go from the lowest to the highest seed; dark blue: the paper's rows; "
        "dashed: policies that learn nothing."
    )
    return [f"![All rows]({path.name})", text]
