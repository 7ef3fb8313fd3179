"""What encodes each part of an observation space."""

from typing import Any

from gymnasium import spaces
from torch import nn

from chmarl_pb.catalog import BENCHMARK, COLOURS
from chmarl_pb.learning.lookup import look_up
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS, Kind
from chmarl_pb.learning.networks.graphs import GraphEncoder
from chmarl_pb.learning.networks.grounded_graphs import GroundedGraphEncoder
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.networks.numbers import GoalEncoder
from chmarl_pb.learning.networks.parsed import ParsedInstruction
from chmarl_pb.learning.networks.parts import FlatEncoder, PartEncoder, TokenEncoder, id_count
from chmarl_pb.learning.networks.readable import tells_apart
from chmarl_pb.learning.networks.tables import Table, class_table, colour_table, word_table
from chmarl_pb.learning.observation_keys import (
    IMAGE,
    INSTRUCTION,
    NODE_CLASS,
    goals,
    graphs,
    is_features,
    is_picture,
    named,
    tokens,
)
from chmarl_pb.learning.spaces import FLAT, FLAT_NAMES


class PartMaker:
    """Makes the parts of an encoder of a space."""

    def __init__(
        self,
        space: spaces.Dict,
        pool: type[GraphEncoder],
        image_encoder: str,
        meaning: nn.Linear | None,
        parses: bool,
    ):
        self._space, self._pool, self._image_encoder, self._meaning = space, pool, image_encoder, meaning
        self._parsed = named(space.spaces, INSTRUCTION) if parses else []
        self._graphs, self._tokens, self._goals = graphs(space), tokens(space), goals(space)
        self._pictures = named(space, IMAGE)
        self._tables: dict[int, Table] = {}  # one for each size of vocabulary: instruction and feedback share it

    def part(self, key: str, beside: tuple[str, ...]) -> PartEncoder:
        """Return what encodes a key, with those beside it."""
        box, others = self._space[key], [self._space[other] if other else None for other in beside]
        if key in self._graphs:
            states, _, colours, views = others
            assert states is not None
            return self._pool(box, states, self._meaning, colours, views is not None)
        if key in self._parsed:
            return self._parsed_instruction(box)
        if key in self._tokens:
            count = id_count(box)
            return TokenEncoder(self._tables.setdefault(count, word_table(count, self._meaning)))
        if key in self._goals:
            return GoalEncoder(box, self._meaning, others[0])
        if key in self._pictures and is_features(box):
            return self._reader(key, box)
        return flat_or_image(box, self._image_encoder)

    def _parsed_instruction(self, words: spaces.Space[Any]) -> ParsedInstruction:
        colours = colour_table(len(COLOURS) + 1, self._meaning) if tells_apart(words) else None
        return ParsedInstruction(class_table(len(BENCHMARK.rows) + 1, self._meaning), colours)

    def _reader(self, key: str, features: spaces.Space[Any]) -> PartEncoder:
        """Return what reads the features of a picture; those are known under our own key alone."""
        name = self._image_encoder
        kind = look_up("image_encoder", name, FROZEN_ENCODERS) if ":" in name else FROZEN_ENCODERS.get(name)
        if not isinstance(kind, Kind):
            raise ValueError(
                f"{key!r} holds float16, as what a frozen network makes of pictures does, and "
                f"image_encoder={name!r} is none of these; name one of {', '.join(FROZEN_ENCODERS)}, or "
                "give numbers of your own as float32"
            )
        if features.shape not in kind.shapes:
            raise ValueError(
                f"pictures have features of shape {features.shape}, not those of {name}: "
                + " or ".join(map(str, kind.shapes))
            )
        words = self._space.spaces.get(instruction_beside(key))
        coloured = words is not None and tells_apart(words)
        return kind.reader(features.shape, self._meaning, self._pool is GroundedGraphEncoder, coloured)


def flat_or_image(space: spaces.Space[Any], image_encoder: str) -> PartEncoder:
    """Return what encodes a part of a space that needs nothing else."""
    if isinstance(space, spaces.Box) and is_picture(space):
        return look_up("image_encoder", image_encoder, IMAGE_ENCODERS)(space.shape)
    if isinstance(space, FLAT):
        return FlatEncoder(space)
    raise ValueError(f"{space} cannot be encoded; use a {FLAT_NAMES}, or a Dict of these")


def instruction_beside(key: str) -> str:
    """Return the key of the instruction beside that of a graph's nodes or of a picture: both have the same prefix."""
    return key.removesuffix(NODE_CLASS).removesuffix(IMAGE) + INSTRUCTION
