"""Flags of a command from a dataclass of settings: names, types, defaults, and the descriptions of its docstring."""

import argparse
import inspect
import re
from collections.abc import Collection
from dataclasses import fields
from typing import Any


def add_flags(parser: argparse.ArgumentParser, settings: type[Any], without: Collection[str] = ()) -> list[str]:
    """Add a flag for each field of a dataclass whose fields all have defaults, and return the fields' names.

    Args:
        parser: that gets the flags.
        settings: the dataclass; its docstring and those of its bases describe the fields under ``Attributes:``.
        without: fields that get none.
    """
    texts = descriptions(settings)
    group = parser.add_argument_group(f"settings of --algo, from {settings.__name__}")
    names = [field.name for field in fields(settings) if field.name not in without]
    for field in fields(settings):
        if field.name in names:
            text = f"{texts.get(field.name, '')} (default: {field.default})".replace("%", "%%")
            kind: dict[str, Any] = {"type": type(field.default)}
            if isinstance(field.default, bool):
                kind = {"action": argparse.BooleanOptionalAction}
            group.add_argument(f"--{field.name.replace('_', '-')}", default=field.default, help=text, **kind)
    return names


def descriptions(settings: type[Any]) -> dict[str, str]:
    """Return field -> what the docstring of a class, or of one of its bases, says of it under ``Attributes:``."""
    found: dict[str, str] = {}
    for kind in reversed(settings.__mro__):
        told = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[2]
        for name, text in re.findall(r"^    (\w+): (.*(?:\n {6,}.*)*)", told, flags=re.MULTILINE):
            found[name] = " ".join(text.split()).removesuffix(".")
    return found
