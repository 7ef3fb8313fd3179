"""The page of results: our tables beside the paper's, from the kept files of the runs."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from chmarl_pb.envs.tracks import GROUNDED, HEADLINE_SPLITS, MAX_STEPS
from chmarl_pb.evaluation.as_text import points
from chmarl_pb.evaluation.audit_file import published_audit
from chmarl_pb.evaluation.cooperation import reference_scores_by_wording
from chmarl_pb.evaluation.gain import best_blind, gain
from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.files import Lock, write_atomically
from chmarl_pb.policies.registry import BUILT_IN, SEARCHES, SHORTCUTS
from chmarl_pb.tasks.language import WORDINGS
from chmarl_pb.tasks.splits import SPLIT_SIZES as TASKS
from training.tables import limited
from training.tables.attribution import attribution
from training.tables.cells import HEADLINE, METRICS, Records, built_in, cell, gained, runs_of, shown_name, values
from training.tables.curves import draw_curves
from training.tables.goals import goals
from training.tables.hundred_homes import hundred_homes
from training.tables.lessons import lessons
from training.tables.made_with import budget, encoder_of, made_with, seeds
from training.tables.record import Record
from training.tables.row import LIMITED, Row
from training.tables.rows import TABLES
from training.tables.runs import read_records
from training.tables.without_feedback import without_feedback

TITLES = {"scene-graph": "Scene graphs", "visual": "Pictures", "feedback": "Messages and language feedback apart"}
TITLES |= {GROUNDED: "The grounded track"}
GROUNDED_SPLIT = HEADLINE_SPLITS[GROUNDED]
#: Built-in policies below the learners -> what they do.
DESCRIBED = {**SHORTCUTS, **SEARCHES}
_GROUNDED_POLICIES = {
    "blind": "sees nothing, reads nothing", "open-loop": "reads, and plays a tour of cells",
    "instruction-blind": SHORTCUTS["instruction-blind"], "reactive": SHORTCUTS["reactive"],
    "partner-blind": "*belief* without its partner", "colour-blind": "*belief*, to which lookalikes are all X",
    **SEARCHES,
}  # fmt: skip

TITLE = """# Results of the learners

Written by `python -m training.table --show` from the files in `results/`; do not edit. How the runs are made:
[training_tables.md](training_tables.md). What is measured: [benchmark.md](benchmark.md#metrics).
"""

READING = f"""## How to read the tables

All numbers are per cent.

- *Paper*: Sharma et al. 2022, in VirtualHome; the homes, tasks and pictures there are others, so the columns
  tell which way things go and not which program is better.
- *Ours*: mean ± sample standard deviation over training seeds, whose number is in the column *seeds* ("1 of 3": two
  are still to be run); every task of a split is played once, greedily, for at most {MAX_STEPS} steps (policies that
  draw their actions play it three times).
- The weights of a run are those with the best PLW on 50 tasks each of val-seen and val-unseen, so ours on these two
  splits are a little too good (trainings in generated homes choose on tasks of generated-val); nothing was chosen on
  a test split, but for the {MAX_STEPS} steps of an episode, which keep the random policy below 3 % of test-unseen.
- The headline number is PLW on test-unseen. Its {TASKS[SPLITS[-1]]} tasks are a small sample: ± is the spread of
  trainings on the same tasks, and the intervals of the headlines (95 %, bootstrap over tasks, one for each seed) tell
  how far other tasks might lie. Budgets differ, see [the runs](#the-runs).
- Rows in *italics* are not in the paper: our own learner, and baselines of Stable-Baselines3, whose one network
  drives both robots, or the humanoid beside a drone that follows *search* or *belief* (column *made with*).
- At the end stand built-in policies that learn nothing ([benchmark.md](benchmark.md#what-the-score-measures)):
  {", ".join(SHORTCUTS)} do without most of what a robot is given, *search* looks for X and Y by rule. Their scores are
  the same with graphs and with pictures: *reactive*, *instruction-blind*, *search* and *belief* are told the true
  classes in view there, too, as their rows say; what searches score on what a detector sees:
  [benchmark.md](benchmark.md#searches-that-see-pictures).
- *Made with*: what encodes the observations (*detector*: a network trained on the simulator's segmentation; *numbers
  alone*: messages, own state and whether X and Y are in view), what drives a drone that does not learn, who was the
  teacher, the length of the training, its minutes by the clock, mostly beside another training (on shared machines,
  whose other load made some runs many times slower than others of the same row: compare no minutes), and whether
  there was feedback at test.
- *Grounded* in a row's name is its encoder, which ties words to things, and not the grounded track. *(ours)*: the
  paper has no such row; X is the object that is asked for, Y the kind of furniture that it belongs on, and PLW is
  success weighted by the fewest steps over the steps taken.
- The teachers of our own rows, *search* and *belief*, are told the true classes in view while they teach on pictures;
  *planner* knows the whole world.

**What the score measures**: mostly obedience to the message board. The environment fills it with the truth, also where
robots get pictures; Pick and Place take no argument and drive by themselves; X's class stands in the scene but
once; and feedback comes exactly when X or Y was in view and within reach. So a score is to be read as its *gain over
the best blind policy*: PLW minus that of the best policy of the [shortcut audit](benchmark.md#shortcut-audit) that sees
nothing, on the same split. What does not gain shows no seeing. The column *gain* is that of {HEADLINE}, in points; who
is told more than the blind ones, the goal or the true classes in view, has none. Of one training on these tasks its
interval reaches 5 to 8 points to either side ([the published weights](benchmark.md#shortcut-audit)).
"""

#: Where an episode ends -> the potentials that say so.
ENDS = {"X in nobody's view": {0}, "X in view": {1, 2}, "X held": {4, 5, 6}, "X on Y": {10}}

ENDS_NOTE = """Where the episodes of test-unseen end, per cent: a learner that does not find X ends on the left, one
that sees it and does not pick it next to that, one that does not find Y, or does not place, further right. *Picks*: in
how many of the steps with X in view, *places*: in how many with X held and Y in view; of the trainings that were scored
when this was kept.
"""

WORDING_NOTE = """PLW of tasks whose instruction training can show, and of those with words held out of it
([language.md](language.md#held-out-paraphrases)); of runs that were scored when this was kept.
"""

GROUNDED_NOTE = f"""Other rules ([environments.md](environments.md#tracks)): Pick and Place point at a cell, lookalikes
stand about, the robots have words of their own, nobody corrects them, and homes are generated. All of {GROUNDED_SPLIT}
is played; the weights are those with the best PLW on every tenth task of generated-val. Nothing here has a counterpart
in the paper. At the end stand policies that learn nothing, one seed of
[the audit](benchmark.md#the-grounded-track). *Picks*: in how many of the steps with X in view, *places*: in how many
with X held and Y in view. Trainings of MAPPO after imitation all begin with the weights of one imitator, so ± is theirs
alone. What learners from scratch come to: [findings](training_findings.md#from-scratch).
"""

ISOLATION = """The paper's rows without messages still get feedback, and feedback names rooms and objects, too. Here
are all four combinations for QMIX; the paper lacks the one with neither. Below stands our strongest learner, trained
and played with feedback and without; weights that were trained with it also [play without](#without-feedback-at-test).
"""


def write_page(results: Path, page: Path) -> None:
    """Write the page and, beside it, the pictures of learning curves that there are runs for.

    Args:
        results: folder of the kept files.
        page: file to write.

    Raises:
        ResultError: a kept file is damaged.
    """
    with Lock(page, wait=True):  # tables that are worked through side by side write it in turns, from all results
        _write_page(results, page)


def _write_page(results: Path, page: Path) -> None:
    records = read_records(results, TABLES)
    parts = [TITLE, *lessons(records, page.parent), goals(records, results), READING, attribution(records)]
    parts += [*without_feedback(results), *hundred_homes(results)]
    for table, rows in TABLES.items():
        if table == LIMITED:
            parts += [f"## {limited.TITLE}", limited.NOTE, f"```\n{_command(table)}\n```", limited.table(rows, records)]
            continue
        if table == GROUNDED:
            command = f"```\n{_command(table)}\n```"
            parts += [f"## {TITLES[table]}", GROUNDED_NOTE, command, _grounded(rows, records)]
            parts += draw_curves(table, rows, records, page.parent)
            continue
        parts += [f"## {TITLES[table]}", *([ISOLATION] if table == "feedback" else []), f"```\n{_command(table)}\n```"]
        parts += [_table(title, rows, records, table) for title in METRICS]
        parts += _by_wording(rows, records) if table != "feedback" else []
        parts += _ends(rows, records) if table != "feedback" else []
        parts += draw_curves(table, rows, records, page.parent)
    write_atomically(page, "\n\n".join(part.strip() for part in [*parts, *_runs(records)]) + "\n")


def _command(table: str) -> str:
    return f"python -m training.table --table {table}"


def _table(title: str, rows: Sequence[Row], records: Records, table: str) -> str:
    """Return one metric of a table as Markdown."""
    metric = METRICS[title]
    lines = [f"| {title} % | seeds | made with |" + "".join(f" {split}: paper | ours |" for split in SPLITS)]
    lines.append("|---|---|---|" + "--:|--:|" * len(SPLITS))
    if gains := metric == "plw" and best_blind(HEADLINE) is not None:
        lines = [lines[0] + " gain |", lines[1] + "--:|"]
    name = _setting if table == "feedback" else shown_name
    for row in rows:
        same = runs_of(row, records)
        cells = (
            f" {_paper(row, metric, number)} | {cell(values(same, metric, split))} |"
            for number, split in enumerate(SPLITS)
        )
        lines.append(f"| {name(row)} | {seeds(row, same)} | {made_with(row, same)} |{''.join(cells)}")
        ahead = gained(same)
        lines[-1] += f" {points(ahead.mean if ahead else None)} |" * gains
    for policy, does in DESCRIBED.items():
        scores = [built_in(policy, metric, split) for split in SPLITS]
        if all(score is not None for score in scores):
            told = ", told the true classes" * (table == "visual" and BUILT_IN[policy].reads_graphs)
            ours = "".join(f" | {100 * (score or 0):.1f} |" for score in scores)
            lines.append(f"| *{policy}* | | {does}{told} |{ours}")
            lines[-1] += f" {points(None if told else gain([scores[-1] or 0], HEADLINE))} |" * gains
    return "\n".join(lines)


def _grounded(rows: Sequence[Row], records: Records) -> str:
    """Return the table of the grounded track as Markdown."""
    lines = ["| | observes | seeds | made with | success % | PLW % | picks % | places % |"]
    lines.append("|---|---|---|---|" + "--:|" * 4)
    for row in rows:
        same, seen = runs_of(row, records), "graphs" if row.observation == "scene_graph" else "pictures"
        scores = [cell(values(same, metric, GROUNDED_SPLIT)) for metric in ("success_rate", "plw")]
        cells = [*scores, *_recognition([record["evaluation"]["splits"][GROUNDED_SPLIT] for record in same])]
        made = made_with(row, same)
        lines.append(f"| {row.name} | {seen} | {seeds(row, same)} | {made} | {' | '.join(cells)} |")
    audit = published_audit(GROUNDED_SPLIT, GROUNDED)
    for line in audit.lines if audit else ():
        if does := _GROUNDED_POLICIES.get(line.name):
            scores = [f"{100 * (figure.mean or 0):.1f}" for figure in (line.success_rate, line.plw)]
            lines.append(f"| *{line.name}* | graphs | | {does} | {' | '.join(scores)} | | |")
    return "\n".join(lines)


def _recognition(played: Sequence[dict[str, Any]]) -> list[str]:
    """Return in how many steps a row's trainings pick and place where they could; "" where none of them tells it."""
    shares = [split.get("recognition", {}) for split in played]
    return [cell([one[name] for one in shares if name in one]) for name in ("pick_share", "place_share")]


def _by_wording(rows: Sequence[Row], records: Records) -> list[str]:
    """Return a table of PLW for seen and for held-out wording apart, of the rows whose runs tell it."""
    lines = [f"| PLW %, seen, held-out | {' | '.join(SPLITS)} |", "|---|" + "--:|" * len(SPLITS)]
    for row in rows:
        known = [
            record for record in runs_of(row, records) if "per_wording" in record["evaluation"]["splits"][SPLITS[-1]]
        ]
        cells = (", ".join(cell(_apart(known, split, name)) for name in WORDINGS) for split in SPLITS)
        lines += [f"| {shown_name(row)}{_some(row, known, records)} | {' | '.join(cells)} |"] if known else []
    scores = {split: reference_scores_by_wording(split, MAX_STEPS) for split in SPLITS}
    for policy in DESCRIBED:
        if all(policy in same for of_split in scores.values() for same in of_split.values()):
            cells = (", ".join(f"{100 * same[policy].plw:.1f}" for same in scores[split].values()) for split in SPLITS)
            lines.append(f"| *{policy}* | {' | '.join(cells)} |")
    return [WORDING_NOTE, "\n".join(lines)] if len(lines) > 2 else []


def _some(row: Row, known: Sequence[Record], records: Records) -> str:
    """Return how many of a row's trainings a cell is of, if it is not of all."""
    count = len(runs_of(row, records))
    return f", {len(known)} of {count} trainings" if len(known) < count else ""


def _apart(same: Sequence[Record], split: str, wording: str) -> list[float]:
    """Return the PLW of each run on tasks of one wording, 0 to 1."""
    return [record["evaluation"]["splits"][split]["per_wording"][wording]["plw"]["mean"] for record in same]


def _ends(rows: Sequence[Row], records: Records) -> list[str]:
    """Return a table of where the episodes of test-unseen end, over all seeds of each row."""
    lines = [f"| row | {' | '.join(ENDS)} | picks % | places % |", "|---|" + "--:|" * (len(ENDS) + 2)]
    for row in rows:
        played = [record["evaluation"]["splits"][SPLITS[-1]] for record in runs_of(row, records)]
        counts = Counter[float]()
        for split in played:
            counts.update({float(phi): n for phi, n in split.get("ends", {}).items()})
        if counts:
            shares = [f"{100 * sum(counts[phi] for phi in phis) / counts.total():.0f}" for phis in ENDS.values()]
            lines.append(f"| {shown_name(row)} | {' | '.join([*shares, *_recognition(played)])} |")
    return [ENDS_NOTE, "\n".join(lines)] if len(lines) > 2 else []


def _setting(row: Row) -> str:
    return row.setting + ("" if row.published else " (not in the paper)")


def _paper(row: Row, metric: str, number: int) -> str:
    if row.published is None:
        return ""
    return f"{(row.published.plw if metric == 'plw' else row.published.success)[number]:.2f}"


def _runs(records: Records) -> list[str]:
    """Return what the runs were made with."""
    lines = ["| row | seed | encoder | budget | best after | train, score | source |", "|---|---|---|---|---|---|---|"]
    lines += [_run_line(record) for same in records.values() for record in same]
    if len(lines) == 2:
        return []
    spent = [[sum(record["seconds"].values()) / 3600 for record in same] for same in records.values() if same]
    text = (
        f"{sum(map(sum, spent)):.0f} hours by the clock in all, mostly two runs side by side on shared machines of two "
        "cores, which others slowed down, some runs many times; had each run taken as long as the fastest of its row, "
        f"{sum(len(hours) * min(hours) for hours in spent):.0f}. One line for each run. *Budget*: of ours, imitation + "
        "MAPPO; *best after*: where its best weights are from; *train, score*: minutes; *source*: sha256 of the code "
        "of `chmarl_pb` and, in later runs, of `training`, that the run was scored with; seeds of a row may come from "
        "different versions (`python -m tools.sources HASH` names the commit). The commands, all settings and all "
        "hashes are in `results/TABLE/ROW-seedK.json`, in later runs also those of every version of `training` that "
        "trained it (`trained_by`). A command of an older version may mean something else today: `python -m "
        "training.table --rows ROW` trains a row as it is now. `python -m training.table --show --csv FILE` writes the "
        "scores of each seed on each split."
    )
    return ["## The runs", text, "\n".join(lines)]


def _best_after(record: Record) -> int | None:
    """Return the episodes, epochs or steps after which a run had the weights that it kept, if it was validated."""
    checkpoint, points = record["checkpoint"], record["curve"]["validation"]
    told: int | None = checkpoint.get("episodes") or (checkpoint.get("validation") or {}).get("epoch")
    last = max(reversed(points), key=lambda point: point[1], default=(None,))[0]  # of equals, as SB3's runs keep it
    return told or last


def _run_line(record: Record) -> str:
    checkpoint, best = record["checkpoint"], _best_after(record)
    minutes = ", ".join(f"{seconds / 60:.0f}" for seconds in record["seconds"].values())
    cells = (
        f"{record['table']}/{record['row']}", record["seed"], encoder_of(record),
        budget(record), f"{best:,}" if best else "", minutes,
        " ".join(sha[:8] for sha in (record["evaluation"]["source_sha256"], checkpoint.get("learners_sha256", ""))),
    )  # fmt: skip
    return f"| {' | '.join(map(str, cells))} |"
