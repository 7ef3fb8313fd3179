"""Instructions: from a task to a sentence, and from a sentence back to what it asks for."""

import re
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, Catalog, Name
from chmarl_pb.errors import OptionError
from chmarl_pb.tasks.language.attributes import name_x, name_y
from chmarl_pb.tasks.language.choice import may_use_held_out, pick_from
from chmarl_pb.tasks.language.grammar import agreement, definite, indefinite, sentence
from chmarl_pb.tasks.language.names import named_in, spelled
from chmarl_pb.tasks.language.templates import INSTRUCTIONS, revised
from chmarl_pb.tasks.language.tokens import words
from chmarl_pb.tasks.task import Task


@lru_cache(maxsize=8192)
def instruction(task: Task, known: Catalog = BENCHMARK, templates: int = 1) -> str:
    """Return the task's instruction; its seed chooses the template, the names and the articles.

    Args:
        task: names X and Y.
        known: the classes of X and Y.
        templates: revision of the sentences: 1, the benchmark's, or 2, mended.
    """
    rng = np.random.default_rng([task.seed, 1])
    template = revised(pick_from(INSTRUCTIONS.pool(may_use_held_out(task)), rng), templates)
    x, y = name_x(task, rng, known), name_y(task, rng, known)
    return phrase(template, x, y, *(bool(bit) for bit in rng.integers(2, size=2)))


def phrase(template: str, x: Name, y: Name, the_x: bool, the_y: bool) -> str:
    """Return an instruction.

    Args:
        template: the sentence with slots.
        x: name of the object.
        y: name of the receptacle.
        the_x: whether the object takes the rather than a, an or some.
        the_y: the same for the receptacle.
    """
    slots = {"the_x": definite(x), "a_x": indefinite(x), **agreement(x)}
    slots |= {"x": definite(x) if the_x else indefinite(x), "y": definite(y) if the_y else indefinite(y)}
    return sentence(template, slots)


def parse_instruction(text: str, known: Catalog = BENCHMARK) -> tuple[str, str]:
    """Return the classes (graspable, receptacle) that an instruction names.

    The longest name that fits counts: "the wine glass" is no glass.

    Raises:
        OptionError: it does not name exactly one graspable and one receptacle, or is no text.
    """
    if not isinstance(text, str):
        raise OptionError(f"{text!r} is no text; give an instruction, as 'Put the mug on the desk.'")
    found: dict[str, set[str]] = {"graspable": set(), "receptacle": set()}
    for row, *_ in named_in(words(text), known):
        found[row.kind].add(row.name)
    for kind, classes in found.items():
        if len(classes) != 1:
            named = " and ".join(sorted(classes)) or "none"
            raise OptionError(f"{text!r} must name one known {kind}, but names {named}")
    return min(found["graspable"]), min(found["receptacle"])


@lru_cache(maxsize=8192)
def parse_instructions(text: str, known: Catalog = BENCHMARK) -> tuple[tuple[str, str], ...]:
    """Return the classes (graspable, receptacle) that each sentence of an instruction names.

    Raises:
        ValueError: a sentence does not name exactly one graspable and one receptacle.
    """
    return tuple(parse_instruction(part, known) for part in re.split(r"(?<=[.!?]) ", text))


def read_pairs(tokens: NDArray[np.int16], known: Catalog = BENCHMARK) -> tuple[tuple[str, str], ...]:
    """Return the classes (graspable, receptacle) that an instruction names, from its token ids as they are observed.

    Each names one pair after the other: a name of another class begins the next pair once a pair is whole.

    Raises:
        OptionError: the instruction names no pair.
    """
    return _pairs(tokens.tobytes(), known)


@lru_cache(maxsize=8192)
def _pairs(tokens: bytes, known: Catalog) -> tuple[tuple[str, str], ...]:
    left = spelled(tokens, known)
    pairs: list[dict[str, str]] = [{}]
    for row, *_ in named_in(left, known):
        if len(pairs[-1]) == 2 and row.name not in pairs[-1].values():
            pairs.append({})
        pairs[-1][row.kind] = row.name
    if any(len(pair) < 2 for pair in pairs):
        raise OptionError(
            f"the instruction (of its words are known: {' '.join(left)!r}) names no known graspable and receptacle, "
            "by which this policy acts; name a pair, or several, or take one that does not read, e.g. 'planner'"
        )
    return tuple((pair["graspable"], pair["receptacle"]) for pair in pairs)
