"""What an instruction asks for, among the classes, colours and rooms that nodes have: which are X, and which Y.

Nothing but the right action tells a network which words name which class, and that late. :class:`Match` compares words
with classes, and can be taught so directly: every instruction names its classes (``parse_instruction``), which every
robot may read off its own observation.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.learning.networks.tables import EMBEDDING, Table, VectorTable
from chmarl_pb.tasks import language

ROLES = 2  # X and Y
ROOMS = tuple(BENCHMARK.class_ids[name] for name in BENCHMARK.rooms)  # ids of the classes of rooms
_UNNAMED = -100  # label that cross_entropy leaves out
_SHARPNESS = 10.0  # of the comparison at first: a cosine of 0.5 more is e^5 times as likely
_QUICK = 10.0  # how much faster than other weights those learn that say which classes are ever X, and ever Y
_NOISE = 1.5  # standard deviation of what is added to numbers of about 1, so that a word means all that lies near it


class Wanted(NamedTuple):
    """How likely classes and colours are those of X and Y.

    Attributes:
        classes: (B, ROLES, classes) probabilities, which sum to 1 over the classes.
        colours: (B, ROLES, colours) the same of colours; None where nodes have none.
        rooms: (B, 1 + ROOMS) the same of Y's room, the first that none is named; None where instructions name none.
    """

    classes: Tensor
    colours: Tensor | None = None
    rooms: Tensor | None = None


class Match(nn.Module):
    """Finds the words that name X and Y and compares them with the names of all classes.

    For each of the two, the words of a sentence have weights that depend on the words beside them; the mean of the
    embeddings of words with these weights is compared with those of the classes by the cosine. A class is likely if
    no other one is nearer, so that a synonym that training never shows needs only be nearest to its class. Weights of
    their own say which classes are X at all, and which Y: no synonym of a receptacle is read as an object.

    The loss hears word vectors with noise: each word stands for all words near it. The noise follows from how often
    the loss was taken, so that a run that is resumed hears what it would have heard.
    """

    def __init__(self, classes: int, colours: bool):
        """Make the layers.

        Args:
            classes: their number, with 0 for padding.
            colours: whether the words that name colours, and Y's room, are looked for, too.
        """
        super().__init__()
        self.looks = [ROLES, ROLES, 1] if colours else [ROLES]
        self.anywhere = nn.Parameter(torch.zeros(())) if colours else None  # the score of no room
        self.roles = nn.Parameter(torch.zeros(ROLES, classes))
        self.taught: Tensor
        self.register_buffer("taught", torch.zeros((), dtype=torch.int64))
        self.beside = nn.Conv1d(EMBEDDING, EMBEDDING, 3, padding=1)
        self.weights = nn.Linear(EMBEDDING, sum(self.looks))
        self.query = nn.Linear(EMBEDDING, EMBEDDING, bias=False)
        nn.init.eye_(self.query.weight)
        self.sharpness = nn.Parameter(torch.tensor(_SHARPNESS).log())

    def scores(self, tokens: Tensor, embedded: Tensor, classes: Table, colours: Table | None) -> tuple[Tensor, ...]:
        """Return logits of the classes (B, ROLES, classes), and with colours also of these and of rooms (B, 1, rooms).

        Args:
            tokens: ids (B, L).
            embedded: their rows (B, L, EMBEDDING).
            classes: the table of their names.
            colours: the table of theirs.
        """
        heard = torch.relu(self.beside(embedded.transpose(1, 2))).transpose(1, 2)
        weights = self.weights(heard).masked_fill((tokens == 0).unsqueeze(2), -1e9).softmax(dim=1)
        named = self.query(weights.transpose(1, 2) @ embedded)
        looks = named.split(self.looks, 1)
        found = self._compared(looks[0], classes.weight) + _QUICK * self.roles
        if colours is None or self.anywhere is None:
            return (found,)
        return found, self._compared(looks[1], colours.weight), self._rooms(looks[2], classes.weight)

    def forward(self, tokens: Tensor, words: Table, classes: Table, colours: Table | None = None) -> Wanted:
        """Return what instructions ask for, from token ids (B, L) and the tables of words, classes and colours."""
        different, place = tokens.long().unique(dim=0, return_inverse=True)
        found = [part.softmax(dim=-1)[place] for part in self.scores(different, words(different), classes, colours)]
        return Wanted(*found[:2], *(part.squeeze(1) for part in found[2:]))

    def loss(self, tokens: Tensor, words: Table, classes: Table, colours: Table | None = None) -> Tensor:
        """Return the cross-entropy of the classes, colours and rooms that different instructions name; 0 for none."""
        different = tokens.long().unique(dim=0)
        labels = torch.from_numpy(np.stack([named_by(row) for row in different.cpu().numpy()])).to(different.device)
        scores = self.scores(different, self._blurred(different, words), classes, colours)
        losses = [_cross_entropy(part, labels[:, kind, : part.shape[1]]) for kind, part in enumerate(scores)]
        return torch.stack(losses).sum()

    def _blurred(self, tokens: Tensor, words: Table) -> Tensor:
        """Return the rows of token ids, with noise where a table is made from vectors.

        The noise follows from ``taught`` alone, so it is the same for every seed of a run and for every agent; several
        trainings of other seeds do not tell how much it matters.
        """
        if not isinstance(words, VectorTable):
            rows: Tensor = words(tokens)
            return rows
        stream = torch.Generator().manual_seed(int(self.taught))
        self.taught += 1
        noise = _NOISE * torch.randn(*tokens.shape, words.vectors.shape[1], generator=stream)
        return words.blurred(tokens, noise.to(tokens.device))

    def _compared(self, named: Tensor, rows: Tensor) -> Tensor:
        """Return the scores (B, looks, ids) of the rows of a table; none for 0, which is padding."""
        scores = self._likeness(named, rows)
        return torch.cat([torch.full_like(scores[..., :1], -1e9), scores[..., 1:]], dim=-1)

    def _rooms(self, named: Tensor, rows: Tensor) -> Tensor:
        """Return the scores (B, 1, 1 + ROOMS) that none is named, and of each room, from the rows of classes."""
        assert self.anywhere is not None
        scores = self._likeness(named, rows[list(ROOMS)])
        return torch.cat([self.anywhere.expand_as(scores[..., :1]), scores], dim=-1)

    def _likeness(self, named: Tensor, rows: Tensor) -> Tensor:
        return nn.functional.normalize(named, dim=-1) @ nn.functional.normalize(rows, dim=-1).T * self.sharpness.exp()


def _cross_entropy(scores: Tensor, labels: Tensor) -> Tensor:
    """Return the mean over X and Y of those instructions that name them."""
    named = (labels != _UNNAMED) & (labels < scores.shape[-1])
    return nn.functional.cross_entropy(scores[named], labels[named]) if named.any() else 0 * scores.sum()


def named_by(tokens: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the ids that an instruction names, (3, ROLES): classes of X and Y, the colour of X, the room of Y.

    The room is the number of its kind from 1 on, or 0 for none. What an instruction does not name otherwise has a
    label that no loss counts; so has all of an instruction of several objects.
    """
    return _named_by(tokens.astype(np.int16).tobytes())


@lru_cache(maxsize=8192)
def _named_by(tokens: bytes) -> NDArray[np.int64]:
    ids, labels = np.frombuffer(tokens, dtype=np.int16), np.full((3, ROLES), _UNNAMED)
    try:
        pairs = language.read_pairs(ids)
    except ValueError:
        return labels
    if len(pairs) == 1:
        labels[0] = [BENCHMARK.class_ids[name] for name in pairs[0]]
        item, target = (language.read_attributes(ids).get(name, "") for name in pairs[0])
        labels[1, 0] = catalog.COLOUR_IDS.get(item, _UNNAMED)
        labels[2, 0] = 1 + list(BENCHMARK.rooms).index(catalog.room_kind(target)) if target else 0
    return labels
