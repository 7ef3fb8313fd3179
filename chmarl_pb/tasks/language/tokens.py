"""The fixed vocabulary: one word a line in vocabulary.txt; line n has token id n + 1."""

import re
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PADDING, UNKNOWN = 0, 1  # token ids; the first word has 2

INSTRUCTION_LENGTH = 24  # tokens that an instruction is padded to
FEEDBACK_LENGTH = 32

FILE = Path(__file__).with_name("vocabulary.txt")


def words(text: str) -> list[str]:
    """Return the words of a sentence in lower case, without punctuation."""
    return re.findall(r"[a-z0-9]+", text.lower())


@cache
def vocabulary() -> dict[str, int]:
    """Return word -> token id."""
    return {word: number for number, word in enumerate(FILE.read_text(encoding="ascii").split(), start=2)}


def vocabulary_size() -> int:
    """Return the number of token ids, padding and unknown included."""
    return len(vocabulary()) + 2


def tokenize(text: str, length: int) -> NDArray[np.int16]:
    """Return a sentence as token ids (length,), padded with 0 and cut to the length."""
    tokens = np.zeros(length, dtype=np.int16)
    if not text:
        return tokens
    ids = [vocabulary().get(word, UNKNOWN) for word in words(text)][:length]
    tokens[: len(ids)] = ids
    return tokens
