"""Checkpoint files: written whole or not at all, read without running code, refused with a clear reason.

The reasons are our own words: torch's advise to load a file that it refuses in a way that can run code.
"""

import pickle
import warnings
from collections import Counter, OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
import torch
from torch import nn

from chmarl_pb.errors import ChmarlError
from chmarl_pb.files import replacing
from chmarl_pb.learning.lookup import UntrustedError, guarded
from chmarl_pb.learning.storage.seal import fault, seal

FORMAT = "chmarl_pb checkpoint 1"

_LONGEST = 300  # letters of what torch says of weights that do not fit
#: Kinds of what a checkpoint holds, beside lists, tuples, sets and dicts of these.
_KEPT = (
    str, int, float, complex, bool, bytes, bytearray, torch.Tensor, nn.Parameter, torch.Size, torch.dtype, torch.device,
    torch.layout,
)  # fmt: skip

#: What earlier versions called the settings of learners that play -> their names since then.
RENAMED = {
    "clip": "clip_range", "critic_rate": "critic_learning_rate", "entropy": "ent_coef", "epochs": "n_epochs",
    "epsilon_end": "exploration_final_eps", "epsilon_start": "exploration_initial_eps",
    "gradient_clip": "max_grad_norm", "teacher_share": "beta", "updates": "gradient_steps",
}  # fmt: skip
#: Algorithms that had them; those of users' own may call their settings so today.
RENAMED_IN = ("iql", "vdn", "qmix", "qtran", "imitation", "mappo")
#: The same of the parts of a checkpoint.
RENAMED_PARTS = {"minds": "actors", "pupil": "model"}
#: Algorithm -> what it did before it had these settings.
BEFORE: dict[str, dict[str, Any]] = {
    "imitation": {"expert": "search"},
    "mappo": {"normalize_values": False, "huber_delta": 0.0, "standardize_state": False},
}


class CheckpointError(ChmarlError, ValueError):
    """A checkpoint is missing, damaged, of another format, or of another architecture."""


def save(path: Path, kind: str, content: dict[str, Any]) -> None:
    """Write a checkpoint, whole or not at all; its folder is made if it is missing.

    Args:
        path: of the file.
        kind: what it holds, e.g. "value" or "bc"; says who can read it.
        content: tensors, numbers, texts, and lists and dicts of these.

    Raises:
        CheckpointError: there is something else in it.
    """
    whole = {name: plain(part, name) for name, part in {"format": FORMAT, "kind": kind, **content}.items()}
    with replacing(path) as temporary:
        with temporary.open("wb") as file:  # torch writes the name of a path into the file: equal weights would differ
            torch.save(whole, file)
        seal(temporary)


def plain(part: Any, place: str) -> Any:
    """Return what a checkpoint holds with Python's numbers in the place of NumPy's, which would not be read again.

    Args:
        part: of a checkpoint.
        place: of this part in it, for the error.

    Raises:
        CheckpointError: there is something in it that would not be read again.
    """
    if isinstance(part, np.generic):
        return part.item()
    if type(part) in (dict, OrderedDict, Counter):
        made = type(part)({plain(key, place): plain(value, f"{place}[{key!r}]") for key, value in part.items()})
        if type(part) is OrderedDict:  # torch's state of a module, which has the versions of its parts beside it
            vars(made).update(vars(part))
        return made
    if type(part) in (list, tuple, set):
        return type(part)(plain(value, f"{place}[{number}]") for number, value in enumerate(part))
    if part is not None and type(part) not in _KEPT:
        raise CheckpointError(
            f"{place}: a checkpoint keeps no {type(part).__name__}, which could not be read again; give tensors, "
            "numbers, texts, and lists and dicts of these"
        )
    return part


def load(path: Path, kind: str | None = None) -> dict[str, Any]:
    """Return what ``save`` wrote, with its ``kind``; no code of the file is run.

    Args:
        path: of the file.
        kind: what it has to hold; None: any kind.

    Raises:
        CheckpointError: the file is missing, damaged, or of another format or kind.
    """
    if not path.exists():
        raise CheckpointError(f"{path}: no such checkpoint; `chmarl-pb train` writes checkpoints")
    check_whole(path)
    content = tensors_of(path, path)
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = str(content.get("format") if isinstance(content, dict) else None)[:80]
        raise CheckpointError(
            f"{path}: its format is {found!r}, and that of policies of this version {FORMAT!r}; name the weights of a "
            "policy, or train it again"
        )
    if kind not in (None, content.get("kind")) or "kind" not in content:
        raise CheckpointError(
            f"{path}: holds a checkpoint of kind {content.get('kind')!r}, not {kind!r}; name another file, or folder"
        )
    return _with_present_names(content)


def _with_present_names(content: dict[str, Any]) -> dict[str, Any]:
    """Return what an earlier version may have written, by the names of today."""
    content = {RENAMED_PARTS.get(name, name): part for name, part in content.items()}
    algorithm = str(content.get("algorithm"))
    if content["kind"] in ("value", "run") and algorithm in RENAMED_IN and isinstance(content.get("config"), dict):
        known = {RENAMED.get(name, name): value for name, value in content["config"].items()}
        content["config"] = BEFORE.get(algorithm, {}) | known
    return content


def check_begun(last: Path, best: Path) -> None:
    """Check that a run that begins does not write over the best weights of another.

    Args:
        last: the checkpoint that a run goes on from.
        best: the best weights beside it.

    Raises:
        CheckpointError: there are best weights alone.
    """
    if best.is_file() and not last.exists():
        raise CheckpointError(
            f"{best}: the best weights of a run that cannot go on, as its {last.name} is gone; use another folder, or "
            "remove them"
        )


def check_kept(best: Path) -> None:
    """Check that the best weights of a run that is over are there.

    Raises:
        CheckpointError: they are not, or damaged, and no validation will write them again.
    """
    if not best.is_file():
        raise CheckpointError(
            f"{best}: the best weights are gone, and the run is over; put the file back, or train again in another "
            "folder"
        )
    check_whole(best)


def check_whole(path: Path) -> None:
    """Check that a file is as it was written.

    Raises:
        CheckpointError: it is damaged, or cannot be read.
    """
    try:
        reason = fault(path) if path.is_file() else "it is no file"
    except OSError as error:
        reason = error.strerror or type(error).__name__
    if reason:
        raise CheckpointError(f"{path}: not a whole checkpoint: {reason}; copy or train it again")


def is_whole(path: Path) -> bool:
    """Return whether a file is there, and as it was written."""
    try:
        check_whole(path)
    except CheckpointError:
        return False
    return True


def tensors_of(source: Path | IO[bytes], path: Path) -> Any:
    """Return what torch has written into a file; no code of the file is run.

    Args:
        source: the file, or an open part of it.
        path: of the file, for the error.

    Raises:
        CheckpointError: it is no such file, or holds what could run code.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of pickles that torch has not written
            return torch.load(source, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError:
        reason = "it holds something else than tensors, numbers and texts, which could run code and is never loaded"
    except Exception:  # torch raises nearly anything on files that it has not written
        reason = "it is not as torch writes it"
    raise CheckpointError(f"{path}: not a whole checkpoint: {reason}; copy or train it again")


def check_same(theirs: Mapping[str, Any], own: Mapping[str, Any], path: Path) -> None:
    """Check that a run goes on with the settings that it was begun with.

    Args:
        theirs: of the checkpoint; more than ``own`` may be among them.
        own: of the run that is to go on.
        path: of the checkpoint, for the error.

    Raises:
        CheckpointError: some differ.
    """
    differ = [f"{name}={was}, not {now}" for name, was, now in _differing(theirs, own)]
    if differ:
        raise CheckpointError(
            f"{path}: is of a run with other settings: {'; '.join(differ)}; go on with its own, or use another folder"
        )


def _differing(theirs: Mapping[str, Any], own: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield the name of each setting that differs, and both values; of settings in settings the innermost ones."""
    for name, value in own.items():
        was = theirs.get(name)
        if isinstance(value, Mapping) and isinstance(was, Mapping):
            yield from _differing({**dict.fromkeys(value), **was}, {**dict.fromkeys(was), **value})
        elif was != value:
            yield name, repr(was), repr(value)


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Refuse a file in which the block misses something, or finds it of another kind, or which names code to be run.

    Raises:
        CheckpointError: it does.
    """
    try:
        with guarded():
            yield
    except CheckpointError:
        raise
    except UntrustedError as error:
        raise CheckpointError(f"{path}: {error}") from error
    except (LookupError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise CheckpointError(
            f"{path}: does not hold what this version looks for ({repr(error)[:200]}); train it again, or read it with "
            "the version that wrote it"
        ) from error


def fill(module: nn.Module, weights: dict[str, torch.Tensor], path: Path) -> None:
    """Load weights into a module.

    Args:
        module: to be filled.
        weights: its ``state_dict``.
        path: of the file that they come from, for the error.

    Raises:
        CheckpointError: the weights are those of another architecture, or no numbers.
    """
    try:
        module.load_state_dict(weights)
    except (RuntimeError, AttributeError, TypeError) as error:
        lines = [line.strip() for line in str(error).splitlines()]
        reason = " ".join(lines[:2])
        reason = reason if len(reason) <= _LONGEST else f"{reason[:_LONGEST]} ..."
        raise CheckpointError(
            f"{path}: its weights do not fit this network: {reason} Use the configuration, observation and version "
            "that it was trained with"
        ) from error
    for name, weight in module.named_parameters():  # buffers may be infinite, as masks are
        if not torch.isfinite(weight).all():
            raise CheckpointError(f"{path}: its weights {name} are not all finite numbers; train it again")


def fill_optimizer(optimizer: torch.optim.Optimizer, state: dict[str, Any], path: Path) -> None:
    """Load the state of an optimizer that comes from a file.

    Raises:
        CheckpointError: it is of another architecture.
    """
    try:
        optimizer.load_state_dict(state)
    except (ValueError, KeyError) as error:
        raise CheckpointError(f"{path}: its optimizer does not fit this network ({error})") from error
