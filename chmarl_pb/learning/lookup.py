"""Registries of what a user can add: looked up by name, or imported from ``module:name``."""

import sys
from collections.abc import Mapping
from pathlib import Path
from pkgutil import resolve_name
from typing import TypeVar

T = TypeVar("T")


def look_up(option: str, name: str, registry: Mapping[str, T]) -> T:
    """Return what a registry has under a name, or what ``module:name`` imports.

    Args:
        option: that gives the name, for the error.
        name: a key of the registry, or ``module:name``.
        registry: name -> what it stands for.

    Raises:
        ValueError: the registry has no such name, or there is nothing to import.
    """
    if name in registry:
        return registry[name]
    if ":" not in name:
        raise ValueError(f"{option}={name!r} is not known; use one of: {', '.join(registry)}; or module:name")
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))  # as `python -m` has it; console scripts do not
    try:
        found: T = resolve_name(name)
        return found
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"{option}={name!r}: {error}; name a module that can be imported from here") from error
