"""The code of the user's own that a checkpoint names beside its weights, by ``module:name`` or in a registry."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

from chmarl_pb.learning.algorithms.registry import find_algorithm
from chmarl_pb.learning.lookup import UntrustedError, look_up
from chmarl_pb.learning.networks.encoders import ENCODERS, GRAPH_POOLS
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.storage.checkpoint import CheckpointError, reading

_PACKAGE = f"{__name__.partition('.')[0]}."

#: What of a checkpoint may name code that plays -> what finds it. Mixers do not play.
_FINDERS: dict[str, Callable[[str], Any]] = {
    "algorithm": find_algorithm,
    "encoder": lambda name: look_up("encoder", name, ENCODERS),
    "graph_pool": lambda name: look_up("graph_pool", name, GRAPH_POOLS),
    "image_encoder": lambda name: look_up("image_encoder", name, {**FROZEN_ENCODERS, **IMAGE_ENCODERS}),
}


def own_code(named: Mapping[str, Any], path: Path) -> tuple[Any, ...]:
    """Return the user's own code by which a checkpoint is played.

    Args:
        named: algorithm and settings of the checkpoint.
        path: of the checkpoint, for the error.

    Raises:
        CheckpointError: there is no such code, or the user has not said that it may be imported.
    """
    with reading(path):
        return tuple(found for found in _found(named, path) if _is_own(found))


def _found(named: Mapping[str, Any], path: Path) -> Iterator[Any]:
    """Yield what is named; what is in no registry is no code for now, and is told when it is needed."""
    for option, find in _FINDERS.items():
        if option not in named:  # as in older checkpoints, and in those of other kinds
            continue
        try:
            yield find(named[option])
        except UntrustedError:
            raise
        except ValueError as error:
            if ":" in named[option]:
                raise CheckpointError(f"{path}: {error}") from error


def _is_own(found: Any) -> bool:
    """Return whether what is looked up is none of the package's; rows of registries may hold several callables."""
    parts = vars(found).values() if is_dataclass(found) and not isinstance(found, type) else (found,)
    return any(callable(part) and not _module_of(part).startswith(_PACKAGE) for part in parts)


def _module_of(part: Any) -> str:
    named = part if hasattr(part, "__qualname__") else type(part)
    return str(named.__module__)
