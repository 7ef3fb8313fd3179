"""Static word vectors: words of like meaning lie near each other, also those that training never shows.

A small table for the vocabulary and for the names of classes, rooms, states and colours; where it comes from stands in
``tools/word_vectors.py``, which makes it.
"""

from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, ThingClass
from chmarl_pb.tasks.language.tokens import vocabulary, words

Vectors = NDArray[np.float32]

FILE = Path(__file__).with_name("word_vectors.npz")
COLOURS = (
    "red", "orange", "yellow", "green", "teal", "turquoise", "blue", "purple", "violet", "pink", "brown", "beige",
    "black", "grey", "gray", "white", "silver", "golden",
)  # fmt: skip


@cache
def word_vectors() -> dict[str, Vectors]:
    """Return word -> its vector (size,), of length 1."""
    with np.load(FILE) as table:
        return dict(zip(table["words"].tolist(), table["vectors"].astype(np.float32), strict=True))


def vector_of(text: str) -> Vectors:
    """Return the mean of the vectors of a text's words (size,); words without one are left out."""
    known = word_vectors()
    found = [known[word] for word in words(text) if word in known]
    return np.mean(found, axis=0) if found else np.zeros_like(known["the"])


def token_vectors(count: int = 0) -> Vectors:
    """Return the vectors of the benchmark's token ids (ids, size); those of padding and unknown words are zero.

    Args:
        count: of ids; if it is that of the vocabulary among lookalikes, words for colours have vectors, too.
    """
    among = vocabulary(attributes=True)
    return _rows([*(among if count == len(among) + 2 else vocabulary())], before=2)


def colour_vectors() -> Vectors:
    """Return the vectors of the ids of colours (ids, size); that of 0, of what has none, is zero."""
    return _rows(catalog.COLOURS, before=1)


def class_vectors() -> Vectors:
    """Return the vectors of the benchmark's class ids (ids, size), those of their names; that of padding is zero."""
    return _rows(map(canonical, BENCHMARK.rows), before=1)


def canonical(row: ThingClass) -> str:
    """Return the words that stand for a class: all its names that training shows."""
    return " ".join(name.text for name in row.names if not name.held_out)


def _rows(texts: Iterable[str], before: int) -> Vectors:
    vectors = np.stack([vector_of(text) for text in texts])
    return np.concatenate([np.zeros((before, vectors.shape[1]), np.float32), vectors])
