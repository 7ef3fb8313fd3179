"""Tables of ids -> features: learned row by row, or made from static word vectors, which know unseen synonyms."""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from chmarl_pb.tasks.language.vectors import class_vectors, token_vectors

EMBEDDING = 32  # features of a word, of a node's class, and of its state


class VectorTable(nn.Module):
    """A table whose rows are one learned linear map of fixed vectors.

    What lies near each other among the vectors does so here, too, whether or not training has ever shown it. Ids
    beyond the vectors, those of users' own things and words, have rows that are learned as usual.
    """

    def __init__(self, vectors: NDArray[np.float32], count: int):
        """Make the table for a number of ids.

        Args:
            vectors: of the first ids (ids, size), of length 1; zero for padding.
            count: of all ids.

        Raises:
            ValueError: there are fewer ids than vectors, so they are not the benchmark's.
        """
        super().__init__()
        if count < len(vectors):
            raise ValueError(f"word_vectors=True: a space has {count} ids, the benchmark {len(vectors)}; leave it out")
        size = vectors.shape[1]
        self.vectors: Tensor
        self.register_buffer("vectors", torch.from_numpy(vectors * size**0.5))  # numbers of about 1, as of other tables
        self.linear = nn.Linear(size, EMBEDDING, bias=False)
        self.own = nn.Parameter(torch.randn(count - len(vectors), EMBEDDING)) if count > len(vectors) else None

    @property
    def weight(self) -> Tensor:
        """The rows, (ids, EMBEDDING)."""
        rows: Tensor = self.linear(self.vectors)
        return rows if self.own is None else torch.cat([rows, self.own])

    def forward(self, ids: Tensor) -> Tensor:
        """Return the rows of ids (..., EMBEDDING)."""
        return nn.functional.embedding(ids, self.weight)


Table = nn.Embedding | VectorTable


def embedding(count: int) -> nn.Embedding:
    """Return a table for ids; that of 0, which is padding, stays zero."""
    return nn.Embedding(count, EMBEDDING, padding_idx=0)


def word_table(count: int, word_vectors: bool) -> Table:
    """Return a table for token ids, learned or from static word vectors."""
    return VectorTable(token_vectors(), count) if word_vectors else embedding(count)


def class_table(count: int, word_vectors: bool) -> Table:
    """Return a table for class ids, learned or from the static vectors of their names."""
    return VectorTable(class_vectors(), count) if word_vectors else embedding(count)
