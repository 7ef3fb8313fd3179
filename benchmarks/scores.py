"""What policies that are made of one file of weights score on validation tasks: a table, printed and kept."""

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.as_text import percent
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.provenance import source_hash
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.files import file_hash, write_atomically
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.limits import whole_number
from chmarl_pb.progress import progress_bar
from chmarl_pb.tasks.task import Task

SPLITS = ("generated-val", "val-seen", "val-unseen")  # on a test split nothing is tried
_THIN = "play every Nth task only, from N/2 on, so that none of generated-val has chosen weights if N is 5 or 10"


def parser_of(module: str, text: str | None, **fixed: object) -> argparse.ArgumentParser:
    """Return a parser with the options that all such benchmarks have.

    Args:
        module: that is run.
        text: what it does.
        fixed: values of "observation" and "workers" that cannot be chosen.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=text)
    parser.add_argument("weights", type=Path)
    parser.set_defaults(**fixed)
    if "observation" not in fixed:
        parser.add_argument("--observation", default="scene_graph", choices=("scene_graph", "visual"))
    parser.add_argument("--split", action="append", choices=SPLITS, help=f"(default: {SPLITS[0]})")
    parser.add_argument("--thin", type=int, default=5, metavar="N", help=f"{_THIN} (default: 5)")
    parser.add_argument("--no-feedback", action="store_true", help="give no language feedback")
    if "workers" not in fixed:
        parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="keep the scores in a file, too")
    return parser


def run(parser: argparse.ArgumentParser, work: Callable[[argparse.Namespace], None]) -> int:
    """Do a benchmark's work; bad weights, files or numbers end it with one sentence and exit code 2."""
    chosen = parser.parse_args()

    def whole() -> int:
        for name in ("thin", "workers"):
            whole_number(f"--{name}", getattr(chosen, name), 1)
        if chosen.json and chosen.json.is_dir():
            raise OptionError(f"--json {chosen.json}: is a folder; name a file in it")
        work(chosen)
        return 0

    return run_command(whole)


class Scores:
    """Plays policies by the rules that their weights were trained by, and prints and keeps a row for each."""

    def __init__(self, first: str, chosen: argparse.Namespace):
        """Begin a table, whose head is printed with its first row.

        Args:
            first: head of its first column.
            chosen: the options.
        """
        rules = ValuePolicies(chosen.weights).rules
        self.rules: dict[str, Any] = rules if "track" in rules else {"messages": True, "feedback": True, **rules}
        if chosen.no_feedback:
            self.rules["feedback"] = False
        self.splits: Sequence[str] = chosen.split or SPLITS[:1]
        self._chosen, self._rows, self._counted = chosen, list[dict[str, Any]](), dict[str, list[dict[str, Any]]]()
        head = ("split", "tasks", "success %", "PLW %", "picks %", "places %")
        self._head = f"| {first} | {' | '.join(head)} |\n|---|---|{'--:|' * 5}"

    def play(self, name: str, policies: Any, split: str) -> None:
        """Play the tasks of a split, and add a row.

        Args:
            name: of the row.
            policies: as ``evaluate`` takes them.
            split: whose tasks are played.
        """
        chosen, tasks = self._chosen, thinned(evaluated_tasks(split), self._chosen.thin)
        with progress_bar() as bar:
            report = evaluate(
                policies, split, chosen.observation, seeds=[0], workers=chosen.workers, tasks=tasks,
                progress=bar.counter(f"{name}, {split}"), **self.rules,
            )  # fmt: skip
        summary, shares = report.summary, report.recognition.figures()
        cells = [percent(summary.success_rate), percent(summary.plw)]
        cells += [f"{100 * shares[key]:.0f}" if key in shares else "" for key in ("pick_share", "place_share")]
        lines = [] if self._rows else [self._head]
        print(*lines, f"| {name} | {split} | {len(tasks)} | {' | '.join(cells)} |", sep="\n", flush=True)
        means = {"success_rate": summary.success_rate.mean, "plw": summary.plw.mean}
        self._rows.append({"row": name, "split": split, "tasks": len(tasks), **means, **shares})
        self._keep()

    def count(self, name: str, rows: list[dict[str, Any]]) -> None:
        """Print a second table, of what was counted while policies played, and keep it.

        Args:
            name: of the table in the file.
            rows: head -> cell of each, all with the same heads; shares are numbers from 0 to 1.
        """
        heads = list(rows[0]) if rows else []
        print("", f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}", sep="\n")
        for row in rows:
            cells = [f"{100 * cell:.1f} %" if isinstance(cell, float) else str(cell) for cell in row.values()]
            print(f"| {' | '.join(cells)} |", flush=True)
        self._counted[name] = rows
        self._keep()

    def _keep(self) -> None:
        chosen, path = self._chosen, self._chosen.json
        if path is None:
            return
        content = {
            "weights": chosen.weights.stem, "weights_sha256": file_hash(chosen.weights),
            "observation": chosen.observation, "rules": self.rules, "source_sha256": source_hash(),
            "rows": self._rows, **self._counted,
        }  # fmt: skip
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, json.dumps(content, indent=1) + "\n")


def thinned(tasks: Sequence[Task], every: int) -> list[Task]:
    """Return every so many tasks, from the middle of the first ones on, and one at least."""
    return list(tasks[min(every // 2, len(tasks) - 1) :: every])
