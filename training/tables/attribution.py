"""What each part of our own learner adds: rows of the tables, each with what it changes of one before."""

from dataclasses import dataclass
from statistics import fmean

from chmarl_pb.evaluation.paper import SPLITS
from training.tables.cells import METRICS, Records, both, runs_of, values
from training.tables.made_with import seeds
from training.tables.row import Row
from training.tables.rows import TABLES

NOTE = """## What each part adds

Rows of the tables below, from a clone of the planner to our learner. Cells are success / PLW, per cent, means over
seeds; the last columns are the points of PLW that a line has more than the one named before it. Differences of one
seed, and of less than five points on the 50 tasks of test-unseen, tell little. All hear the board and get feedback.
"""

AFTER = """MAPPO after imitation in generated homes was tried on validation tasks alone, where it added nothing
([findings](training_findings.md#our-own-row-imitation-of-a-search-then-mappo)).
"""


@dataclass(frozen=True)
class Line:
    """One line.

    Attributes:
        table: of the row.
        row: its name.
        change: what it changes of the line that it is compared with.
        before: number of that line, from 1; 0 for none.
    """

    table: str
    row: str
    change: str
    before: int


_MEMORY = "it is told where it has looked and what it did; half of the rollouts are played as in evaluation"

_PARTS = {
    "looks": "it is told where it has looked, and nothing else of these",
    "history": "it is told what it did, and nothing else",
    "greedy rollouts": "half of the rollouts are played as in evaluation, and nothing else",
}

LINES = (
    Line("scene-graph", "BC decentralized + messages", "clones of the planner, mean pool", 0),
    Line("scene-graph", "BC decentralized + messages, grounded", "the encoder that ties words to things", 1),
    Line("scene-graph", "Imitation of planner", "the planner asked in the learner's own states, as DAgger has it", 2),
    Line("scene-graph", "Imitation of search", "*search* as the teacher, who has to look for things, too", 3),
    Line("scene-graph", "Imitation of belief", "*belief* as the teacher", 4),
    Line("scene-graph", "Imitation of belief, then MAPPO", "then MAPPO, in the same five homes", 5),
    Line("scene-graph", "Imitation of belief, generated homes", "generated homes in place of the five; no MAPPO", 5),
    Line(
        "scene-graph", "Imitation of belief, generated homes, words parsed",
        "instructions read by the rule of the built-in searches, in place of a network that learns to read", 7,
    ),
    Line(
        "visual", "Imitation of belief, generated homes, ResNet-18",
        "pictures by ResNet-18, to which nothing ties words", 7,
    ),
    Line("visual", "Imitation of belief, generated homes", "our detector, and words tied to what it finds", 9),
    Line("scene-graph", "Imitation of belief, generated homes, memory", _MEMORY, 7),
    Line("scene-graph", "Imitation of belief, generated homes, words parsed, memory", _MEMORY, 8),
    Line("visual", "Imitation of belief, generated homes, memory", _MEMORY, 10),
    *(
        Line("scene-graph", f"Imitation of belief, generated homes, words parsed, {part}", change, 8)
        for part, change in _PARTS.items()
    ),
)  # fmt: skip


def attribution(records: Records) -> str:
    """Return the section as Markdown."""
    head = ("", "what changes", "seeds", *SPLITS, "more than", *(f"PLW more, {split}" for split in SPLITS[2:]))
    lines = [f"| {' | '.join(head)} |", "|--:|---|---|" + "--:|" * (len(SPLITS) + 3)]
    for number, line in enumerate(LINES, 1):
        row = _row(line)
        same = runs_of(row, records)
        cells = [both(same, split) for split in SPLITS]
        before = f"line {line.before}" if line.before else ""
        gained = [_more(records, line, LINES[line.before - 1], split) if line.before else "" for split in SPLITS[2:]]
        texts = (str(number), line.change, seeds(row, same), *cells, before, *gained)
        lines.append(f"| {' | '.join(texts)} |")
    return "\n\n".join([NOTE.strip(), "\n".join(lines), AFTER.strip()])


def _row(line: Line) -> Row:
    return next(row for row in TABLES[line.table] if row.name == line.row)


def _more(records: Records, line: Line, before: Line, split: str) -> str:
    """Return the points of PLW that one line has more than another, with a sign; "" if one of them has not been run."""
    ours, theirs = (values(runs_of(_row(one), records), METRICS["PLW"], split) for one in (line, before))
    return f"{100 * (fmean(ours) - fmean(theirs)):+.1f}" if ours and theirs else ""
