"""The vocabulary: one word a line in vocabulary.txt, line n has token id n + 1; then the words of users' own names."""

import re
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, Catalog

PADDING, UNKNOWN = 0, 1  # token ids; the first word has 2

INSTRUCTION_LENGTH = 24  # tokens that an instruction is padded to
FEEDBACK_LENGTH = 32

FILE = Path(__file__).with_name("vocabulary.txt")


def words(text: str) -> list[str]:
    """Return the words of a sentence in lower case, without punctuation."""
    return re.findall(r"[a-z0-9]+", text.lower())


@lru_cache(maxsize=64)
def vocabulary(known: Catalog = BENCHMARK) -> dict[str, int]:
    """Return word -> token id; what a catalogue adds to the benchmark's words follows these."""
    fixed = FILE.read_text(encoding="ascii").split()
    own = [word for row in known.rows[len(BENCHMARK.rows) :] for name in row.names for word in words(name.text)]
    return {word: number for number, word in enumerate(dict.fromkeys([*fixed, *own]), start=2)}


def vocabulary_size(known: Catalog = BENCHMARK) -> int:
    """Return the number of token ids, padding and unknown included."""
    return len(vocabulary(known)) + 2


def tokenize(text: str, length: int, known: Catalog = BENCHMARK) -> NDArray[np.int16]:
    """Return a sentence as token ids (length,), padded with 0 and cut to the length."""
    tokens = np.zeros(length, dtype=np.int16)
    if not text:
        return tokens
    ids_of = vocabulary(known)
    ids = [ids_of.get(word, UNKNOWN) for word in words(text)][:length]
    tokens[: len(ids)] = ids
    return tokens
