"""The names of classes in a sentence: which there are, and which are found in it."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog, Name, ThingClass
from chmarl_pb.tasks.language.tokens import vocabulary, words


class Named(NamedTuple):
    """A class that is named in a sentence: its row, its first word, and the word after its last."""

    row: ThingClass
    start: int
    end: int


def names_of(class_name: str, held_out: bool, known: Catalog = BENCHMARK) -> list[Name]:
    """Return the names of a class, with or without those held out of training."""
    return [name for name in known.classes[class_name].names if held_out or not name.held_out]


def named_in(sentence: Sequence[str], known: Catalog) -> Iterator[Named]:
    """Yield the classes that words name, in order: from left to right, the longest name that fits at each word."""
    meanings = _meanings(known)
    longest, start = max(map(len, meanings)), 0
    while start < len(sentence):
        length = next((n for n in range(longest, 0, -1) if tuple(sentence[start : start + n]) in meanings), 0)
        if length:
            yield Named(meanings[tuple(sentence[start : start + length])], start, start + length)
        start += max(length, 1)


def spelled(tokens: bytes, known: Catalog) -> list[str]:
    """Return the words of token ids as they are observed, without padding; an unknown one is empty."""
    spelling = {number: word for word, number in vocabulary(known, attributes=True).items()}
    return [spelling.get(number, "") for number in np.frombuffer(tokens, dtype=np.int16).tolist() if number]


@lru_cache(maxsize=64)
def _meanings(known: Catalog) -> dict[tuple[str, ...], ThingClass]:
    """Return words of a name -> the class that it names."""
    rows = [*known.graspables.values(), *known.receptacles.values()]
    return {tuple(words(name)): row for row in rows for name in row.synonyms}
