"""Which instructions an encoder can read, by whose words."""

from typing import Any

from gymnasium import spaces

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.learning.networks.parts import id_count
from chmarl_pb.learning.observation_keys import INSTRUCTION, graphs, named
from chmarl_pb.tasks.language.tokens import ATTRIBUTES_LENGTH, INSTRUCTION_LENGTH, vocabulary_size

_CLASSES = len(BENCHMARK.rows) + 1  # ids of the benchmark's classes, with 0 for padding
_TAUGHT_BY = (
    "grounding_coef teaches what the benchmark's words say of its classes, and would teach wrong ones with a catalogue "
    "of your own; leave it at 0"
)


def tells_apart(instruction: spaces.Space[Any]) -> bool:
    """Return whether instructions name X's colour and Y's room, as among lookalikes."""
    among = instruction.shape is not None and instruction.shape[-1] % INSTRUCTION_LENGTH == ATTRIBUTES_LENGTH
    return among and id_count(instruction) >= vocabulary_size(attributes=True)


def check_reading(space: spaces.Dict, parses: bool, taught: bool) -> None:
    """Refuse a space whose instructions, or whose classes, cannot be read as it is wanted.

    Raises:
        ValueError: they are not the benchmark's, or instructions are parsed and there is nothing to teach.
    """
    for key in named(space.spaces, INSTRUCTION) if parses or taught else ():
        _check_readable(space[key], parses)
    classes = max((id_count(space[key]) for key in graphs(space)), default=_CLASSES)
    if parses and classes > _CLASSES:
        raise ValueError("graph_pool='parsed' knows the benchmark's classes alone; use 'grounded'")
    if taught and classes > _CLASSES:
        raise ValueError(_TAUGHT_BY)
    if parses and taught:
        raise ValueError(
            "graph_pool='parsed' reads instructions by rule and has nothing to learn; leave grounding_coef at 0"
        )


def _check_readable(instruction: spaces.Space[Any], parses: bool) -> None:
    """Refuse instructions that the benchmark's words do not read.

    Raises:
        ValueError: the ids of colours are others behind a user's own words, or nothing but the rule reads the
            instruction, and that does not know all of it.
    """
    among = tells_apart(instruction)
    own_words = id_count(instruction) != vocabulary_size(attributes=among)
    if own_words and among:
        raise ValueError(
            "words of your own among lookalikes: colours are not told apart; leave out the catalogue or "
            "graph_pool='parsed' and grounding_coef"
        )
    if own_words and not parses:
        raise ValueError(_TAUGHT_BY)
    length = INSTRUCTION_LENGTH + among * ATTRIBUTES_LENGTH
    if parses and (own_words or instruction.shape != (length,)):
        raise ValueError(
            "graph_pool='parsed' reads instructions of one object in the benchmark's words; use 'grounded'"
        )
