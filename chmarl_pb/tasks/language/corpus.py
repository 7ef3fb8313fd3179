"""The corpus: which words the sentences can hold, and statistics of sentences."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from chmarl_pb import catalog
from chmarl_pb.tasks.language import actions, feedback, instructions
from chmarl_pb.tasks.language.grammar import definite, indefinite
from chmarl_pb.tasks.language.templates import FEEDBACK, INSTRUCTIONS
from chmarl_pb.tasks.language.tokens import words


@dataclass(frozen=True)
class CorpusStatistics:
    """Statistics of a corpus of sentences.

    Attributes:
        sentences: how many there are.
        distinct_words: how many different words they hold.
        mean_length: words in a sentence, on average.
        histogram: number of words -> number of sentences, by the number of words.
    """

    sentences: int
    distinct_words: int
    mean_length: float
    histogram: dict[int, int]


def corpus_statistics(sentences: Iterable[str]) -> CorpusStatistics:
    """Return the statistics of sentences: one is one instruction or one feedback; empty ones are left out."""
    spoken = [split for split in map(words, sentences) if split]
    lengths = Counter(map(len, spoken))
    total = sum(map(len, spoken))
    return CorpusStatistics(
        sentences=len(spoken),
        distinct_words=len({word for split in spoken for word in split}),
        mean_length=total / len(spoken) if spoken else 0.0,
        histogram=dict(sorted(lengths.items())),
    )


def all_words() -> list[str]:
    """Return every word that instructions and feedback can hold, sorted: what vocabulary.txt must say."""
    rows = [*catalog.BENCHMARK.graspables.values(), *catalog.BENCHMARK.receptacles.values()]
    names = [name for row in rows for name in row.names]
    texts = [article(name) for name in names for article in (definite, indefinite)]
    gotos = [f"goto_{room}" for room in catalog.ROOM_KINDS]
    verbs = [verb for action in (*actions.VERBS, *gotos) for verb in actions.ways_to_say(action, held_out=True)]
    texts += [text for verb in (actions.TRY, *verbs) for text in (verb.base, verb.past, verb.doing)]
    texts += _sentences()
    texts += "123456789"  # of rooms, in homes with several of a kind
    return sorted({word for text in texts for word in words(text)})


def _sentences() -> list[str]:
    """Return every template filled with a singular, a mass and a plural name."""
    x_names = {name.number: name for row in catalog.BENCHMARK.graspables.values() for name in row.names}.values()
    y = catalog.BENCHMARK.receptacles["desk"].names[0]
    verb = actions.VERBS["turn_left"][0]
    filled = [instructions.phrase(text, x, y, True, True) for text in INSTRUCTIONS.pool(True) for x in x_names]
    for held in (False, True):
        advice = feedback.Advice("turn_left", True, "turn_left", held)
        for text in (text for kind in FEEDBACK for text in kind.pool(True)):
            filled += [feedback.phrase(text, x, y, advice, verb, verb) for x in x_names]
    return filled
