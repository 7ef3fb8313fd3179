"""What is kept of a run: a file of JSON, of which all is looked at that a page reads, before it is read."""

import math
from collections.abc import Sequence
from typing import Any

from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.learning.config import FROZEN
from chmarl_pb.tasks.language import WORDINGS
from chmarl_pb.tasks.splits import load_tasks
from training.tables.row import splits_of

Record = dict[str, Any]

_UNITS = ("episodes", "epochs", "steps")
_METRICS = ("plw", "success_rate")
_HEADLINE = SPLITS[-1]


def check_record(record: Record) -> None:
    """Refuse what a page could not show.

    Raises:
        KeyError: something is missing.
        TypeError: something is of another kind.
        ValueError: something is no number.
    """
    for name in ("table", "row", "name", "observation"):
        _text(record, name)
    _number(record, "seed")
    _numbers(_object(record, "seconds"))
    _check_curve(_object(record, "curve"))
    for name in (commands := _part(record, "commands")):
        _text(commands, name)
    _check_checkpoint(_object(record, "checkpoint"), record["curve"]["unit"])
    check_scores(record, splits_of(record["table"]))


def check_scores(kept: Record, splits: Sequence[str]) -> None:
    """Refuse scores of which something is missing, or of another kind, on some splits; see :func:`check_record`."""
    _text(_object(kept, "checkpoint"), "sha256")
    played = _object(kept, "evaluation")
    _text(played, "source_sha256")
    _object(played, "options")
    for split in splits:
        found = _object(_object(played, "splits"), split)
        _text(found, "tasks_sha256")
        _check_summary(_object(found, "summary"))
        _numbers(_part(found, "recognition"))
        _numbers(_part(found, "ends"))
        for wording in WORDINGS if "per_wording" in found else ():
            _check_summary(_object(_object(found, "per_wording"), wording))
        of_tasks = _part(found, "plw_of_tasks")
        _numbers(of_tasks)
        if of_tasks and split == _HEADLINE and set(of_tasks) != {task.id for task in load_tasks(split)}:
            raise ValueError(f"'plw_of_tasks' is not of the tasks of {split}")


def _check_checkpoint(checkpoint: Record, unit: str) -> None:
    for name in ("learners_sha256", FROZEN):
        if name in checkpoint:
            _text(checkpoint, name)
    chosen = _object(checkpoint, "validation") if checkpoint.get("validation") is not None else {}
    kept = {"episodes": checkpoint.get("episodes"), "epoch": chosen.get("epoch")}
    _numbers({name: value for name, value in kept.items() if value is not None})
    for config in (_part(checkpoint, "config"), _part(_part(checkpoint, "begun_with"), "config")):
        _numbers({unit: config[unit]} if unit in config else {})
        if "env_id" in config:
            _text(config, "env_id")


def _check_summary(summary: Record) -> None:
    for metric in _METRICS:
        figure = _object(summary, metric)
        _number(figure, "mean")
        _numbers({name: figure[name] for name in ("low", "high") if figure.get(name) is not None})


def _check_curve(curve: Record) -> None:
    if curve["unit"] not in _UNITS:
        raise ValueError(f"unit {curve['unit']!r}: use one of {', '.join(_UNITS)}")
    for name in ("success", "loss", "validation"):
        if not isinstance(curve[name], list):
            raise TypeError(f"{name!r} is no list")
        for point in curve[name]:
            x, value = point
            _numbers({f"x of {name}": x, name: value})


def _object(given: Record, name: str) -> Record:
    found = given[name]
    if not isinstance(found, dict):
        raise TypeError(f"{name!r} is no object")
    return found


def _part(given: Record, name: str) -> Record:
    """Return an object that need not be there."""
    return _object(given, name) if name in given else {}


def _text(given: Record, name: str) -> None:
    if not isinstance(given[name], str):
        raise TypeError(f"{name!r} is no text")


def _number(given: Record, name: str) -> None:
    _numbers({name: given[name]})


def _numbers(given: Record) -> None:
    for name, value in given.items():
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"{name!r} is {value!r}, and no number")
