"""The vocabulary: one word a line in vocabulary.txt, line n has token id n + 1; then the words of users' own names."""

import re
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, COLOURS, Catalog

PADDING, UNKNOWN = 0, 1  # token ids; the first word has 2

INSTRUCTION_LENGTH = 24  # tokens that an instruction is padded to
ATTRIBUTES_LENGTH = 8  # more tokens where it names colours and rooms
FEEDBACK_LENGTH = 32

FILE = Path(__file__).with_name("vocabulary.txt")

#: Words for colours and rooms that instructions name among lookalikes only; their ids follow all others.
ATTRIBUTES = (*COLOURS, "hallway", "hall", "corridor")


def words(text: str) -> list[str]:
    """Return the words of a sentence in lower case, without punctuation."""
    return re.findall(r"[a-z0-9]+", text.lower())


@lru_cache(maxsize=64)
def vocabulary(known: Catalog = BENCHMARK, attributes: bool = False) -> dict[str, int]:
    """Return word -> token id; what a catalogue adds to the benchmark's words follows these.

    Args:
        known: the classes of things.
        attributes: whether ``ATTRIBUTES`` follow, which only instructions among lookalikes hold.
    """
    fixed = FILE.read_text(encoding="ascii").split()
    own = [word for row in known.rows[len(BENCHMARK.rows) :] for name in row.names for word in words(name.text)]
    more = ATTRIBUTES if attributes else ()
    return {word: number for number, word in enumerate(dict.fromkeys([*fixed, *own, *more]), start=2)}


def vocabulary_size(known: Catalog = BENCHMARK, attributes: bool = False) -> int:
    """Return the number of token ids, padding and unknown included; see :func:`vocabulary`."""
    return len(vocabulary(known, attributes)) + 2


def tokenize(text: str, length: int, known: Catalog = BENCHMARK, attributes: bool = False) -> NDArray[np.int16]:
    """Return a sentence as token ids (length,), padded with 0 and cut to the length; see :func:`vocabulary`."""
    tokens = np.zeros(length, dtype=np.int16)
    if not text:
        return tokens
    ids_of = vocabulary(known, attributes)
    ids = [ids_of.get(word, UNKNOWN) for word in words(text)][:length]
    tokens[: len(ids)] = ids
    return tokens
