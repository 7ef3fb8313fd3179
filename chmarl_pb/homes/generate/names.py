"""Names of generated homes: ``generated-123`` is the home of the seed 123."""

import re

MOST_SEED = 10**15
"""Seeds are smaller than this."""

_NAME = re.compile(r"generated-(0|[1-9][0-9]{0,14})")


def home_name(seed: int) -> str:
    """Return the name of the home of a seed."""
    return f"generated-{seed}"


def seed_of(name: str) -> int | None:
    """Return the seed in the name of a generated home, or None for any other name."""
    found = _NAME.fullmatch(name)
    return int(found[1]) if found else None
