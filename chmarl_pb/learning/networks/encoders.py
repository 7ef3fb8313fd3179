"""Encoders: a batch of observations -> one feature vector each.

:func:`build_encoder` reads the observation space alone. Of our own keys (``observation_keys.py``), a scene graph goes
through a graph convolution, tokens through an embedding; any picture goes through a convolutional network; every other
key is flattened.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, cast

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.lookup import look_up
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS
from chmarl_pb.learning.networks.graphs import GatedGraphEncoder, GraphEncoder
from chmarl_pb.learning.networks.grounded_graphs import GroundedGraphEncoder
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.networks.match import ROOMS, Match
from chmarl_pb.learning.networks.numbers import Numbers
from chmarl_pb.learning.networks.parsed import Parsed, ParsedInstruction
from chmarl_pb.learning.networks.part_maker import PartMaker, flat_or_image, instruction_beside
from chmarl_pb.learning.networks.parts import Asked, TokenEncoder, flattened
from chmarl_pb.learning.networks.readable import check_reading
from chmarl_pb.learning.networks.tables import Table, shared_map
from chmarl_pb.learning.observation_keys import goal_attributes, goals, graphs, node_color, node_view, tokens

PARSED = "parsed"  # the pool that is told what instructions name

GRAPH_POOLS: dict[str, type[GraphEncoder]] = {
    "mean": GraphEncoder, "gated": GatedGraphEncoder, "grounded": GroundedGraphEncoder, PARSED: GroundedGraphEncoder
}  # fmt: skip


def build_encoder(
    space: spaces.Space[Any],
    size: int = 128,
    image_encoder: str = "cnn",
    graph_pool: str = "mean",
    numbers_past: bool = False,
    word_vectors: bool = False,
    taught: bool = False,
    cells_past: bool = False,
) -> nn.Module:
    """Return a module that encodes batches of a space's observations.

    >>> encoder = build_encoder(spaces.Dict({"range": spaces.Box(0, 10, (8,))}), size=16)
    >>> encoder({"range": torch.zeros(3, 8)}).shape
    torch.Size([3, 16])

    The module takes one tensor, or a dict of tensors for a Dict, with any leading dimensions, which it flattens to
    one: it returns (B, size), float32. Our keys may have a robot's name before them (``humanoid_image``). Graphs may be
    cut to fewer rows than their space has, but not to none.

    Args:
        space: a Box, a Discrete, a MultiDiscrete, a MultiBinary, or a Dict of these.
        size: number of features.
        image_encoder: of pictures: a name in ``IMAGE_ENCODERS``; where ``FeatureEnv`` gives features in their place,
            the name in ``FROZEN_ENCODERS`` of what they come from.
        graph_pool: how a scene graph's nodes are pooled: "mean"; "gated" by the instruction; "grounded", by how likely
            each is what the instruction calls X and Y; or "parsed": the same, but ``parse_instruction`` reads the
            instruction, of which nothing else is encoded.
        numbers_past: whether our keys of a few numbers, ``messages``, ``self`` and the bits of ``goal``, are also
            appended to the features as they are; see :class:`chmarl_pb.learning.networks.numbers.Numbers`.
        word_vectors: whether words and classes come from static word vectors, of which one linear map is learned, so
            that synonyms that training never shows are understood; see :mod:`chmarl_pb.tasks.language.vectors`.
        taught: whether ``grounding_loss`` is to teach which classes the instruction names, whatever the pool.
        cells_past: whether what pointing and guiding take is also appended to the features: the cells of the picture in
            which X and Y can be taken, their directions from another robot, the room of Y that the instruction names,
            and messages by the robot's own heading; needs the grounded or the parsed pool, and detections or nodes
            with places in the picture.

    Raises:
        ValueError: the space is of another kind, there is no such encoder, nothing tells of cells, instructions have
            words that are not read, or there is nothing to teach, as they are parsed.
        CheckpointError: there are no weights of ResNet-18.
    """
    look_up("graph_pool", graph_pool, GRAPH_POOLS)
    look_up("image_encoder", image_encoder, {**IMAGE_ENCODERS, **FROZEN_ENCODERS})
    if isinstance(space, spaces.Dict):
        return DictEncoder(
            space, size, image_encoder, graph_pool,
            numbers_past=numbers_past, word_vectors=word_vectors, taught=taught, cells_past=cells_past,
        )  # fmt: skip
    part = flat_or_image(space, image_encoder)
    return nn.Sequential(part, nn.Linear(part.size, size), nn.ReLU(), nn.Linear(size, size), nn.ReLU())


#: Option of encoders -> what an observation has to have for it.
_NEEDED = {
    "taught": "a scene graph, or detections of pictures with graph_pool='grounded', beside an instruction",
    "word_vectors": "words or classes",
    "numbers_past": "messages, self or goal",
    "cells_past": "cells",
}


def check_found(encoders: Iterable[nn.Module], asked: Iterable[str]) -> None:
    """Refuse options for which none of the observations that encoders of ``build_encoder`` read has anything.

    Args:
        encoders: of all agents, which share the options.
        asked: names of the options that are on.

    Raises:
        ValueError: there is one.
    """
    found = set[str]().union(*(getattr(encoder, "found", ()) for encoder in encoders))
    for name in asked:
        if name not in found:
            option = "grounding_coef" if name == "taught" else name
            raise ValueError(f"{option}: no observation has {_NEEDED[name]}; leave it out")


class DictEncoder(nn.Module):
    """Encodes each part of a Dict by itself, and all of them together by two linear layers.

    Attributes:
        past: number of the numbers that go past the layers.
        size: number of features, with these.
        found: names of the options for which the space has something.
    """

    def __init__(
        self,
        space: spaces.Dict,
        size: int,
        image_encoder: str,
        graph_pool: str,
        *,
        numbers_past: bool,
        word_vectors: bool,
        taught: bool,
        cells_past: bool,
    ):
        """Make the parts that a space needs; see :func:`build_encoder`."""
        super().__init__()
        check_reading(space, graph_pool == PARSED, taught)
        self.space = space
        self.meaning = shared_map() if word_vectors else None
        self._tokens, self._beside = tokens(space), _beside(space)
        inside = {key for others in self._beside.values() for key in others if key}
        self._parses = graph_pool == PARSED
        pool = look_up("graph_pool", graph_pool, GRAPH_POOLS)
        if not (isinstance(pool, type) and issubclass(pool, GraphEncoder)):
            raise ValueError(f"graph_pool={graph_pool!r}: is no pool; derive a class from GraphEncoder")
        make = PartMaker(space, pool, image_encoder, self.meaning, self._parses)
        parts = {key: make.part(key, self._beside.get(key, ())) for key in space.spaces if key not in inside}
        self.keys, self.parts = tuple(parts), nn.ModuleList(parts.values())
        matched = [key for key, part in parts.items() if part.matches or (taught and isinstance(part, GraphEncoder))]
        self.matches = nn.ModuleDict({key: self._match(key) for key in matched})
        width = sum(part.size for part in parts.values())
        self.joint = nn.Sequential(nn.Linear(width, size), nn.ReLU(), nn.Linear(size, size), nn.ReLU())
        numbers = Numbers(space, cells_past) if numbers_past else None
        self.numbers = numbers if numbers and numbers.size else None
        meant = self._tokens or any(hasattr(part, "classes") for part in parts.values())
        found = {"taught": matched, "word_vectors": meant, "numbers_past": self.numbers}
        self.found = {name for name, of in found.items() if of} | ({"cells_past"} if cells_past else set())
        self._locating = {key: part.locates for key, part in parts.items() if part.locates} if cells_past else {}
        if cells_past and not self._locating:
            raise ValueError(
                "cells_past needs graph_pool='grounded' or 'parsed', and detections or nodes with a node_view"
            )
        self.past = (self.numbers.size if self.numbers else 0) + sum(self._locating.values())
        self.past += sum(len(ROOMS) for key in self._locating if self._colours(key) is not None)
        self.size = size + self.past

    def forward(self, observation: Mapping[str, Tensor]) -> Tensor:
        """Return (B, size)."""
        flat = {key: flattened(observation[key], box.shape) for key, box in self.space.spaces.items()}
        features, past = [], [self.numbers(observation)] if self.numbers else []
        for key, part in zip(self.keys, self.parts, strict=True):
            beside = [flat[other] if other else None for other in self._beside.get(key, ())]
            asked = {"asked": self._asked(key, flat)} if part.asks else {}
            features.append(part(flat[key], *beside, **asked))
            if key in self._locating:
                past += [cast(Any, part).places(flat[key], *beside, **asked), *_named_rooms(asked["asked"])]
        return torch.cat([self.joint(torch.cat(features, dim=1)), *past], dim=1)

    def grounding_loss(self, observation: Mapping[str, Tensor]) -> Tensor:
        """Return how badly the classes and colours of X and Y are known from the instructions; 0 without any."""
        losses = [next(self.joint.parameters()).new_zeros(())]
        for key, match in ({} if self._parses else self.matches).items():
            instruction = instruction_beside(key)
            flat = flattened(observation[instruction], self.space[instruction].shape)
            losses.append(cast(Match, match).loss(flat, *self._tables(key)))
        return torch.stack(losses).sum()

    def _part(self, key: str) -> Any:
        return self.parts[self.keys.index(key)]

    def _match(self, key: str) -> Match | Parsed:
        classes, colours = len(self._part(key).classes.weight), self._colours(key)
        if self._parses:
            return Parsed(classes, 0 if colours is None else len(colours.weight))
        return Match(classes, colours is not None)

    def _colours(self, key: str) -> Table | None:
        return getattr(self._part(key), "colours", None)

    def _tables(self, key: str) -> tuple[Table, Table, Table | None]:
        """Return the tables of words, classes and colours that belong to a part."""
        return cast(TokenEncoder, self._words(key)).words, self._part(key).classes, self._colours(key)

    def _words(self, key: str) -> TokenEncoder | ParsedInstruction:
        """Return what encodes the instruction beside a part."""
        instruction = instruction_beside(key)
        if instruction not in self._tokens:
            raise ValueError(f"pooling by the instruction needs its tokens, {instruction!r}, in the observation")
        return cast(TokenEncoder | ParsedInstruction, self._part(instruction))

    def _asked(self, key: str, flat: Mapping[str, Tensor]) -> Asked:
        """Return what the instruction beside a part says."""
        words, ids = self._words(key), flat[instruction_beside(key)]
        if not self._part(key).matches:
            return Asked(words.total(ids))
        return Asked(words.total(ids), self.matches[key](ids, *(() if self._parses else self._tables(key))))


def _beside(space: spaces.Dict) -> dict[str, tuple[str, ...]]:
    """Return the keys of what is encoded together with other keys -> those; "" for one that is not there."""
    found: dict[str, tuple[str, ...]] = {
        key: (*others, node_color(space, key), node_view(space, key)) for key, others in graphs(space).items()
    }
    return found | {key: (goal_attributes(space, key),) for key in goals(space)}


def _named_rooms(asked: Asked) -> list[Tensor]:
    """Return how likely each kind of room is named as that of Y, (B, ROOMS), where instructions name any."""
    return [] if asked.wanted is None or asked.wanted.rooms is None else [asked.wanted.rooms[:, 1:]]


#: Name -> what makes the encoder of a space: called with the space, the number of features, and the names of the
#: encoder of pictures and of the pool of graphs; where a run asks for it, also with ``word_vectors=True``,
#: ``numbers_past=True``, ``cells_past=True`` and ``taught=True``.
ENCODERS: dict[str, Callable[..., nn.Module]] = {"household": build_encoder}
