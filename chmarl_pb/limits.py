"""Numbers that users give, checked: whole numbers, and others, in a range."""

import math

import numpy as np

from chmarl_pb.errors import OptionError


def whole_number(name: str, value: object, least: int = 0, most: int | None = None) -> int:
    """Return a whole number, also one of NumPy's, as Python's own.

    Args:
        name: what it is called where it was given.
        value: what was given.
        least: the smallest that may be.
        most: the greatest that may be; None: any.

    Raises:
        OptionError: it is no whole number, or out of range.
    """
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        if value >= least and (most is None or value <= most):
            return int(value)
    limits = f"from {least} on" if most is None else f"from {least} to {most:,}"
    raise OptionError(f"{name}={value!r} is not a whole number {limits}")


def real_number(name: str, value: object, least: float, most: float = math.inf) -> float:
    """Return a finite number, also one of NumPy's, as Python's own; the arguments are those of ``whole_number``.

    Raises:
        OptionError: it is no number, or out of range.
    """
    if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool):
        if least <= value <= most and math.isfinite(value):
            return float(value)
    limits = f"from {least:g} on" if most == math.inf else f"from {least:g} to {most:g}"
    raise OptionError(f"{name}={value!r} is not a number {limits}")
