"""Whether the words of an instruction are those that training shows, or some are held out of it."""

from collections.abc import Iterable
from functools import cache

from chmarl_pb.catalog import BENCHMARK, Name
from chmarl_pb.tasks.language.choice import may_use_held_out
from chmarl_pb.tasks.language.grammar import indefinite
from chmarl_pb.tasks.language.instructions import instruction, phrase
from chmarl_pb.tasks.language.templates import INSTRUCTIONS
from chmarl_pb.tasks.language.tokens import words
from chmarl_pb.tasks.tidy_task import AnyTask

SEEN, HELD_OUT = WORDINGS = ("seen", "held-out")


def wording_of(text: str) -> str:
    """Return "held-out" if an instruction has a word that training never shows, else "seen"."""
    return SEEN if held_out_words().isdisjoint(words(text)) else HELD_OUT


def wording_of_task(task: AnyTask) -> str:
    """Return the wording of a task in the benchmark's words; only tasks of val and test splits can be held-out."""
    return wording_of(" ".join(instruction(move) for move in task.moves if may_use_held_out(move)))


@cache
def held_out_words() -> frozenset[str]:
    """Return the words of templates and names held out of training that no template and no name of training has."""
    rows = (BENCHMARK.graspables, BENCHMARK.receptacles, BENCHMARK.rooms)
    names = [name for kind in rows for row in kind.values() for name in row.names]
    shown = [name for name in names if not name.held_out]
    return _words(INSTRUCTIONS.held_out, names, shown) - _words(INSTRUCTIONS.train, shown, shown)


def _words(templates: Iterable[str], names: Iterable[Name], inside: Iterable[Name]) -> frozenset[str]:
    """Return the words of names, and of templates around a singular, a mass and a plural name."""
    one_each = {name.number: name for name in inside}.values()
    texts = [phrase(text, name, name, True, True) for text in templates for name in one_each]
    return frozenset(word for text in [*texts, *map(indefinite, names)] for word in words(text))
