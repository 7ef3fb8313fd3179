"""One training run of a row: its folders, its two steps (train, score), and the small file that is kept of it."""

import json
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chmarl_pb import learning
from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.json_file import read_object
from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.evaluation.provenance import source_hash
from chmarl_pb.files import Lock, sealed, unsealed_or_plain, write_atomically
from chmarl_pb.learning.runs.logger import METRICS, read_rows
from training.score import SCORES
from training.tables.record import Record, check_record, check_scores
from training.tables.row import Row

FORMAT = "chmarl-pb table run 1"
STATE = "state.json"
STEPS = ("train", "score")


@dataclass(frozen=True)
class Run:
    """A row with a seed.

    Attributes:
        row: what is trained.
        seed: of the training.
        out: folder for models and logs.
        results: folder for the files that are kept.
        data: folder of the data sets for cloning.
        extra: more options of the training command, for tries.
    """

    row: Row
    seed: int
    out: Path
    results: Path
    data: Path
    extra: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name that is unique over all tables."""
        return f"{self.row.table}/{self.row.slug}-seed{self.seed}"

    @property
    def folder(self) -> Path:
        """Of the model, the logs and all evaluated episodes."""
        return self.out / self.name

    @property
    def result(self) -> Path:
        """The small file that is kept."""
        return self.results / f"{self.name}.json"

    @property
    def checkpoint(self) -> Path:
        """The weights that were best on the validation tasks."""
        return self.folder / self.row.checkpoint

    def command(self, step: str) -> list[str]:
        """Return the command of a step, to be run by Python's ``-m``."""
        row = self.row
        options = ["--observation", row.observation]
        if step == "score":  # a checkpoint knows its track
            options += row.rules if row.track == PAPER else ()
            options += ("--robots", row.robots) if row.robots else ()
            options += ("--splits", *row.splits) if row.splits != SPLITS else ()
            return ["training.score", str(self.checkpoint), *options, "--out", str(self.folder)]
        options += row.rules
        data = ["--data", str(self.data)] if row.clones else []
        seed = ["--seed", str(self.seed), "--out", str(self.folder)]
        return [row.module, *row.options, *options, *data, *self.extra, *seed]

    def told(self, step: str) -> str:
        """Return the command of a step as results keep it."""
        return " ".join(["python -m", *self.command(step)])

    def made_by(self) -> str:
        """Return the command that trained what is kept as its result.

        Raises:
            ResultError: it is damaged.
        """
        return str(read_record(self.result, self.results).get("commands", {}).get("train"))

    def next_step(self) -> str | None:
        """Return the first step that is not finished."""
        if self.result.is_file():
            return None
        return "score" if self.state()["trained"] == self.command("train") else "train"

    def state(self) -> dict[str, Any]:
        """Return how far the run is.

        It has the seconds of each step, the sha256 of all versions of ``training`` that took part in the training, and
        the command of a finished training.

        Raises:
            ResultError: the file that tells it is damaged.
        """
        path = self.folder / STATE
        if not path.is_file():
            return {"seconds": dict.fromkeys(STEPS, 0.0), "code": [], "trained": None}
        try:
            state = unsealed_or_plain(path.read_text(encoding="utf-8"))
            seconds = {step: float(state["seconds"][step]) for step in STEPS}
            return {"seconds": seconds, "code": list(state.get("code", [])), "trained": state["trained"]}
        except (KeyError, TypeError, ValueError) as error:
            raise ResultError(f"{path}: damaged ({error!r}); remove it, and the run goes on") from error

    def begin(self, step: str) -> None:
        """Write down the version of the code, if a training begins with it or goes on with it."""
        state, code = self.state(), source_hash(learning)
        if step == "train" and code not in state["code"]:
            state["code"].append(code)
            write_atomically(self.folder / STATE, sealed(state))

    def spend(self, step: str, seconds: float) -> None:
        """Add to the time of a step."""
        state = self.state()
        state["seconds"][step] = round(state["seconds"][step] + seconds, 3)
        write_atomically(self.folder / STATE, sealed(state))

    def finish(self, step: str) -> None:
        """Write down that a step has ended well; after the last, write the result.

        Raises:
            ResultError: the step has left no file that it should have.
        """
        wanted = self.checkpoint if step == "train" else self.folder / SCORES
        if not wanted.is_file():
            raise ResultError(f"{wanted}: the step {step!r} has ended without writing it")
        if step == "train":
            (self.folder / SCORES).unlink(missing_ok=True)
            write_atomically(self.folder / STATE, sealed(self.state() | {"trained": self.command("train")}))
        else:
            write_atomically(self.result, _lines(self.record()))

    def record(self) -> Record:
        """Return what is kept of the run.

        Raises:
            ResultError: its scores are damaged.
        """
        row, scores = self.row, self.folder / SCORES
        try:
            kept = unsealed_or_plain(scores.read_text(encoding="utf-8"))
            check_scores(kept, row.splits)
        except (KeyError, TypeError, ValueError) as error:
            raise ResultError(f"{scores}: not the scores of all splits: {error!r}; remove it") from error
        return {
            "format": FORMAT, "table": row.table, "row": row.slug, "name": row.name, "seed": self.seed,
            "observation": row.observation, "messages": row.messages, "feedback": row.feedback,
            "commands": {step: self.told(step) for step in STEPS},
            "seconds": self.state()["seconds"], "trained_by": self.state()["code"],
            **kept,
            "curve": curve(self.folder / METRICS),
        }  # fmt: skip

    def lock(self) -> Lock:
        """Return a lock that this process and those that inherit it hold.

        Raises:
            BusyError: another process works on this run, perhaps one left over from a killed command.
        """
        return Lock(self.folder / STATE)


def curve(metrics: Path) -> dict[str, Any]:
    """Return a run's learning curves: unit of x, and lists of [x, value] of what its metrics have.

    ``success`` is that of training episodes, with exploration; ``validation`` the mean PLW on validation tasks.
    """
    curves: dict[str, Any] = {"unit": "episodes", "success": [], "loss": [], "validation": []}
    for row in _rows(metrics):
        x = row.get("episodes")
        if "epoch" in row:
            curves["unit"], x, row = "epochs", row["epoch"], _of_cloning(row)
        elif "steps" in row:
            curves["unit"], x, row = "steps", row["steps"], _of_sb3(row)
        for name in ("success", "loss"):
            if name in row.get("train", {}):
                curves[name].append([x, round(row["train"][name], 4)])
        if "score" in row.get("validation", {}):
            curves["validation"].append([x, round(row["validation"]["score"], 4)])
    return curves


def _of_cloning(row: dict[str, Any]) -> dict[str, Any]:
    loss = sum(value for key, value in row.items() if key.endswith("_loss"))
    return {"train": {"loss": loss}, **({"validation": {"score": row["score"]}} if "score" in row else {})}


def _of_sb3(row: dict[str, Any]) -> dict[str, Any]:
    """Its loss is left out: it has another meaning for each algorithm."""
    success, plw = row.get("rollout/success_rate"), row.get("eval/mean_reward")
    train = {} if success is None else {"success": success}
    return {"train": train, **({} if plw is None else {"validation": {"score": plw}})}


def _rows(metrics: Path) -> list[dict[str, Any]]:
    return read_rows(metrics) if metrics.is_file() else []


def _lines(record: Record) -> str:
    """Return a record as JSON with a line for each key and each split: easy to read and to compare."""
    inner = dict(record["evaluation"])
    splits = ",\n".join(f"   {json.dumps(name)}: {json.dumps(value)}" for name, value in inner.pop("splits").items())
    head = ",\n".join(f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in inner.items())
    texts = {key: json.dumps(value) for key, value in record.items()}
    texts["evaluation"] = f'{{\n{head},\n  "splits": {{\n{splits}}}}}'
    return "{\n" + ",\n".join(f" {json.dumps(key)}: {text}" for key, text in texts.items()) + "\n}\n"


def read_records(results: Path, tables: Iterable[str]) -> dict[tuple[str, str], list[Record]]:
    """Return (table, row) -> its runs by seed.

    Raises:
        ResultError: a file is damaged or of another kind.
    """
    found: dict[tuple[str, str], list[Record]] = {}
    for path in sorted(path for table in tables for path in (results / table).glob("*.json")):
        record = read_record(path, results)
        found.setdefault((record["table"], record["row"]), []).append(record)
    return {key: sorted(records, key=lambda record: record["seed"]) for key, records in found.items()}


def read_record(path: Path, results: Path) -> Record:
    """Return what is kept of a run.

    Args:
        path: of the file.
        results: the folder of all.

    Raises:
        ResultError: it is damaged or of another kind.
    """
    try:
        record: Record = read_object(path)
        if record["format"] != FORMAT:
            raise ValueError(f"its format is {record['format']!r}, not {FORMAT!r}")
        check_record(record)
        named = f"{record['table']}/{record['row']}-seed{record['seed']}"
        if path.relative_to(results).with_suffix("").as_posix() != named:
            raise ValueError(f"it is that of {named}")
        return record
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise ResultError(f"{path}: not the result of a run: {error!r}; remove it and run the table") from error


def python(command: list[str]) -> list[str]:
    """Return a command as this Python runs it."""
    return [sys.executable, "-m", *command]
