"""Plain English: instructions, feedback, the vocabulary, and reading an instruction back."""

from chmarl_pb.tasks.language.attributes import read_attributes
from chmarl_pb.tasks.language.corpus import CorpusStatistics, all_words, corpus_statistics
from chmarl_pb.tasks.language.feedback import Advice, say
from chmarl_pb.tasks.language.heeding import read_detour
from chmarl_pb.tasks.language.instructions import instruction, parse_instruction, parse_instructions, read_pairs
from chmarl_pb.tasks.language.seen import WORDINGS, held_out_words, wording_of, wording_of_task
from chmarl_pb.tasks.language.tokens import (
    ATTRIBUTES_LENGTH,
    FEEDBACK_LENGTH,
    INSTRUCTION_LENGTH,
    PADDING,
    UNKNOWN,
    tokenize,
    vocabulary,
    vocabulary_size,
    words,
)

__all__ = [
    "ATTRIBUTES_LENGTH",
    "FEEDBACK_LENGTH",
    "INSTRUCTION_LENGTH",
    "PADDING",
    "UNKNOWN",
    "WORDINGS",
    "Advice",
    "CorpusStatistics",
    "all_words",
    "corpus_statistics",
    "held_out_words",
    "instruction",
    "parse_instruction",
    "parse_instructions",
    "read_attributes",
    "read_detour",
    "read_pairs",
    "say",
    "tokenize",
    "vocabulary",
    "vocabulary_size",
    "wording_of",
    "wording_of_task",
    "words",
]
