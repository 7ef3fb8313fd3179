"""Registries of what a user can add: looked up by name, or imported from ``module:name``."""

import inspect
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

from torch import nn

from chmarl_pb.named import import_named

T = TypeVar("T")

#: Names, as ``module:name`` with commas between them, that checkpoints may have imported, which runs their code.
TRUSTED = "CHMARL_TRUSTED"
_at_reading: ContextVar[bool] = ContextVar("_at_reading", default=False)


class UntrustedError(ValueError):
    """A file names code that would be run."""


@contextmanager
def guarded() -> Iterator[None]:
    """Within, import nothing but what the user trusts: names come from a file."""
    before = _at_reading.set(True)
    try:
        yield
    finally:
        _at_reading.reset(before)


def look_up(option: str, name: str, registry: Mapping[str, T]) -> T:
    """Return what a registry has under a name, or what ``module:name`` imports.

    Args:
        option: that gives the name, for the error.
        name: a key of the registry, or ``module:name``.
        registry: name -> what it stands for.

    Raises:
        ValueError: the registry has no such name, or there is nothing to import.
        UntrustedError: a file names it that is being read, and the user has not said that it may be imported.
    """
    if name in registry:
        return registry[name]
    if ":" not in name:
        raise ValueError(f"{option}={name!r} is not known; use one of: {', '.join(registry)}; or module:name")
    if _at_reading.get() and name not in os.environ.get(TRUSTED, "").split(","):
        raise UntrustedError(f"{option}={name!r} is code, which would be run; if you trust it, set {TRUSTED}={name}")
    try:
        found: T = import_named(name)
        return found
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"{option}={name!r}: {error}; name a module that can be imported from here") from error


def _kind(of: type[Any]) -> str:
    return f"{of.__module__}.{of.__qualname__}"


def make_network(
    option: str,
    name: str,
    registry: Mapping[str, Callable[..., nn.Module]],
    *arguments: Any,
    named: Mapping[str, Any] | None = None,
    kind: type[nn.Module] = nn.Module,
) -> nn.Module:
    """Return the network that what is looked up makes of arguments.

    Args:
        option: that gives the name, for the error.
        name: see :func:`look_up`.
        registry: name -> what makes a network.
        *arguments: that it is called with.
        named: the same, by name.
        kind: of network that it has to make.

    Raises:
        ValueError: there is nothing of this name, or it makes no network of these arguments.
    """
    make, named = look_up(option, name, registry), named or {}
    if not callable(make):
        raise ValueError(f"{option}={name!r}: is no function; name one that makes a {kind.__name__}")
    try:
        inspect.signature(make).bind(*arguments, **named)
    except (TypeError, ValueError) as error:  # the second of builtins
        given = ", ".join([*(type(one).__name__ for one in arguments), *named])
        raise ValueError(f"{option}={name!r}: {error}; it is called with ({given})") from error
    network = make(*arguments, **named)
    if not isinstance(network, kind):
        raise ValueError(f"{option}={name!r}: makes {_kind(type(network))}; derive what it makes from {_kind(kind)}")
    return network
