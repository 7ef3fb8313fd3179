"""What Pick and Place, which take no argument, act on."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Goal:
    """The object X and the receptacles Y of an instruction.

    Attributes:
        item: name of the object to be moved, e.g. ``mug_1``.
        receptacles: names of the things of the home that would do as target, e.g. all chairs.
    """

    item: str
    receptacles: tuple[str, ...]
