"""Checkpoint files: written whole or not at all, read without running code, refused with a clear reason."""

import pickle
from pathlib import Path
from typing import Any

import torch
from torch import nn

from chmarl_pb.errors import ChmarlError
from chmarl_pb.files import replacing

FORMAT = "chmarl_pb checkpoint 1"


class CheckpointError(ChmarlError, ValueError):
    """A checkpoint is missing, damaged, of another format, or of another architecture."""


def save(path: Path, kind: str, content: dict[str, Any]) -> None:
    """Write a checkpoint, whole or not at all; its folder is made if it is missing.

    Args:
        path: of the file.
        kind: what it holds, e.g. "value" or "bc"; says who can read it.
        content: tensors, numbers, texts, and lists and dicts of these.
    """
    with replacing(path) as temporary:
        torch.save({"format": FORMAT, "kind": kind, **content}, temporary)


def load(path: Path, kind: str | None = None) -> dict[str, Any]:
    """Return what ``save`` wrote, with its ``kind``; no code of the file is run.

    Args:
        path: of the file.
        kind: what it has to hold; None: any kind.

    Raises:
        CheckpointError: the file is missing, damaged, or of another format or kind.
    """
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError as error:
        raise CheckpointError(f"{path}: no such checkpoint; `python -m training.train` writes checkpoints") from error
    except (RuntimeError, EOFError, ValueError, OSError, LookupError, pickle.UnpicklingError) as error:
        first = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise CheckpointError(f"{path}: not a whole checkpoint ({first}); copy or train it again") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        found = content.get("format") if isinstance(content, dict) else None
        raise CheckpointError(f"{path}: its format is {found!r}, this version reads {FORMAT!r}; train it again")
    if kind not in (None, content.get("kind")) or "kind" not in content:
        raise CheckpointError(f"{path}: holds a checkpoint of kind {content.get('kind')!r}, not {kind!r}")
    return content


def fill(module: nn.Module, weights: dict[str, torch.Tensor], path: Path) -> None:
    """Load weights into a module.

    Args:
        module: to be filled.
        weights: its ``state_dict``.
        path: of the file that they come from, for the error.

    Raises:
        CheckpointError: the weights are those of another architecture.
    """
    try:
        module.load_state_dict(weights)
    except (RuntimeError, AttributeError, TypeError) as error:
        lines = [line.strip() for line in str(error).splitlines()]
        reason = " ".join(lines[:2])
        raise CheckpointError(
            f"{path}: its weights do not fit this network: {reason} Use the configuration, observation and version "
            "that it was trained with"
        ) from error


def fill_optimizer(optimizer: torch.optim.Optimizer, state: dict[str, Any], path: Path) -> None:
    """Load the state of an optimizer that comes from a file.

    Raises:
        CheckpointError: it is of another architecture.
    """
    try:
        optimizer.load_state_dict(state)
    except (ValueError, KeyError) as error:
        raise CheckpointError(f"{path}: its optimizer does not fit this network ({error})") from error
