"""Tables of ids -> features: learned row by row, or made from static word vectors, which know unseen synonyms."""

from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from chmarl_pb.tasks.language.vectors import class_vectors, colour_vectors, token_vectors

EMBEDDING = 32  # features of a word, of a node's class, of its state, and of its colour


class VectorTable(nn.Module):
    """A table whose rows are one learned linear map of fixed vectors.

    What lies near each other among the vectors does so here, too, whether or not training has ever shown it. Ids
    beyond the vectors, those of users' own things and words, have rows that are learned as usual. Tables of one
    observation share the map, so that a word and the class that it names have like rows.
    """

    def __init__(self, vectors: NDArray[np.float32], count: int, meaning: nn.Linear):
        """Make the table for a number of ids.

        Args:
            vectors: of the first ids (ids, size), of length 1; zero for padding.
            count: of all ids.
            meaning: the map, see :func:`shared_map`; its owner learns it.

        Raises:
            ValueError: there are fewer ids than vectors, so they are not the benchmark's.
        """
        super().__init__()
        if count < len(vectors):
            raise ValueError(f"word_vectors=True: a space has {count} ids, the benchmark {len(vectors)}; leave it out")
        self.vectors: Tensor
        self.register_buffer("vectors", _scaled(vectors))
        self._meaning = (meaning,)  # not a part of this module: it is learned, moved and saved once
        self.own = nn.Parameter(torch.randn(count - len(vectors), EMBEDDING)) if count > len(vectors) else None

    @property
    def weight(self) -> Tensor:
        """The rows, (ids, EMBEDDING)."""
        rows: Tensor = self._meaning[0](self.vectors)
        return rows if self.own is None else torch.cat([rows, self.own])

    def forward(self, ids: Tensor) -> Tensor:
        """Return the rows of ids (..., EMBEDDING)."""
        return nn.functional.embedding(ids, self.weight)

    def blurred(self, ids: Tensor, noise: Tensor) -> Tensor:
        """Return the rows of ids as if their vectors were others by a noise (..., size); padding and own rows stay."""
        fixed = (ids > 0) & (ids < len(self.vectors))
        rows: Tensor = self(ids) + fixed.unsqueeze(-1) * self._meaning[0](noise)
        return rows


Table = nn.Embedding | VectorTable


def shared_map() -> nn.Linear:
    """Return a map from word vectors to rows of tables: at first it keeps as much as so few features can hold.

    Its rows are the principal directions of all words and classes, by which 55 of the 61 classes are nearest to their
    held-out names, as many as by the whole vectors; by random directions 47 are.
    """
    directions = torch.from_numpy(_directions())
    meaning = nn.Linear(directions.shape[1], EMBEDDING, bias=False)
    with torch.no_grad():
        meaning.weight.copy_(directions)
    return meaning


def embedding(count: int) -> nn.Embedding:
    """Return a table for ids; that of 0, which is padding, stays zero."""
    return nn.Embedding(count, EMBEDDING, padding_idx=0)


def word_table(count: int, meaning: nn.Linear | None) -> Table:
    """Return a table for token ids, learned or from static word vectors."""
    return embedding(count) if meaning is None else VectorTable(token_vectors(count), count, meaning)


def class_table(count: int, meaning: nn.Linear | None) -> Table:
    """Return a table for class ids, learned or from the static vectors of their names."""
    return embedding(count) if meaning is None else VectorTable(class_vectors(), count, meaning)


def colour_table(count: int, meaning: nn.Linear | None) -> Table:
    """Return a table for ids of colours, learned or from the static vectors of their names."""
    return embedding(count) if meaning is None else VectorTable(colour_vectors(), count, meaning)


def _scaled(vectors: NDArray[np.float32]) -> Tensor:
    """Return vectors of length 1 as numbers of about 1, as those of other tables are."""
    return torch.from_numpy(vectors * vectors.shape[1] ** 0.5)


@cache
def _directions() -> NDArray[np.float32]:
    """Return the principal directions (EMBEDDING, size) of the vectors of all words and classes."""
    every = np.concatenate([class_vectors(), token_vectors()]).astype(np.float64)
    _, _, directions = np.linalg.svd(every, full_matrices=False)
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    found: NDArray[np.float32] = (directions * np.sign(largest))[:EMBEDDING].astype(np.float32)
    return found
