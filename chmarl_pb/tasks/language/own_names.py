"""Whether a user's names can be told from the words that sentences have anyway: "on" names nothing in "put it on"."""

import re
from collections.abc import Iterator
from functools import cache, lru_cache
from pathlib import Path

from chmarl_pb.catalog import BENCHMARK, COLOURS, Catalog, Name, ThingClass
from chmarl_pb.errors import AssetError
from chmarl_pb.homes.catalog_file import load_catalog
from chmarl_pb.tasks.language import feedback, instructions
from chmarl_pb.tasks.language.actions import VERBS, Verb, ways_to_say
from chmarl_pb.tasks.language.attributes import names_of_room
from chmarl_pb.tasks.language.templates import FEEDBACK, INSTRUCTIONS, REVISIONS, Templates, revised
from chmarl_pb.tasks.language.tokens import words

Words = tuple[str, ...]

_SLOT = "~"  # stands for any name, or any words for an action
_NAMES = (Name(_SLOT), Name(f"a{_SLOT}"), Name(_SLOT, "mass"), Name(_SLOT, "plural"))  # after a, an, some and some
_ANY = Verb(_SLOT, _SLOT, _SLOT)
_NUMBERS = ("", *(f"_{number}" for number in range(1, 10)))  # of rooms of a kind


def load_things(path: str | Path, lookalikes: bool = False) -> Catalog:
    """Return the classes that :func:`chmarl_pb.homes.catalog_file.load_catalog` does, if sentences can name them.

    Args:
        path: of a catalogue file.
        lookalikes: whether instructions name colours and rooms, too.

    Raises:
        AssetError: the file cannot be used, or a name stands in sentences that ask for something else.
    """
    known = load_catalog(path)
    if fault := name_fault(known, lookalikes):
        raise AssetError(f"{path}: {fault}; choose another name")
    return known


def name_fault(known: Catalog, lookalikes: bool) -> str:
    """Return which of a user's names stands in sentences that ask for something else; empty if none does.

    Args:
        known: the user's classes among others.
        lookalikes: whether instructions name colours and rooms, too.
    """
    if (found := _misread(known, lookalikes)) is None:
        return ""
    row, name, sentence = found
    return (
        f"[[{row.kind}]] ({row.name!r}): {name!r} would name it in sentences that ask for other things, "
        f"as in {re.sub(rf'[a-z]?{_SLOT}', '...', sentence)!r}"
    )


@lru_cache(maxsize=64)
def _misread(known: Catalog, lookalikes: bool) -> tuple[ThingClass, str, str] | None:
    """Return the first class with a name that is found in a sentence of others, that name and the sentence."""
    for row in (one for one in known.rows[len(BENCHMARK.rows) :] if one.kind in ("graspable", "receptacle")):
        parts = _parts(known, row)
        for name in row.synonyms:
            for reading in _readings(tuple(words(name)), parts):
                if sentence := _runs(len(reading), lookalikes).get(reading):
                    return row, name, sentence
    return None


def _parts(known: Catalog, row: ThingClass) -> dict[tuple[bool, bool], set[Words]]:
    """Return the words of other classes that may stand in a name, by whether they begin it and whether they end it.

    Within it these are whole names; at its beginning also the last words of one, and at its end the first.
    """
    others = [other for other in (*known.graspables.values(), *known.receptacles.values()) if other != row]
    names = [tuple(words(name)) for other in others for name in other.synonyms]
    cuts = [(name, cut) for name in names for cut in range(len(name))]
    return {
        (False, False): set(names),
        (True, False): {name[cut:] for name, cut in cuts},
        (False, True): {name[: len(name) - cut] for name, cut in cuts},
    }


def _readings(name: Words, parts: dict[tuple[bool, bool], set[Words]], begins: bool = True) -> Iterator[Words]:
    """Yield a name in all ways in which it can be read, with slots for the names of others in it."""
    if not name:
        yield ()
    for end in range(1, len(name) + 1):
        if name[:end] in parts.get((begins, end == len(name)), ()):
            yield from ((_SLOT, *rest) for rest in _readings(name[end:], parts, False))
    if name:
        yield from ((name[0], *rest) for rest in _readings(name[1:], parts, False))


@cache
def _runs(length: int, lookalikes: bool) -> dict[Words, str]:
    """Return so many words in a row, not all of them slots -> a sentence that they stand in."""
    found: dict[Words, str] = {}
    for sentence, spoken in _spoken(lookalikes).items():
        for start in range(len(spoken) - length + 1):
            run = spoken[start : start + length]
            if run not in found and set(run) != {_SLOT}:
                found[run] = sentence
    return found


@cache
def _spoken(lookalikes: bool) -> dict[str, Words]:
    """Return sentence -> its words."""
    split = {text: re.findall(rf"[a-z0-9{_SLOT}]+", text.lower()) for text in _sentences(lookalikes)}
    return {text: tuple(_SLOT if _SLOT in word else word for word in spoken) for text, spoken in split.items()}


def _sentences(lookalikes: bool) -> Iterator[str]:
    """Yield what robots may be told, with slots for names; each of the rest is varied by itself."""
    pairs = [(name, name) for name in _NAMES]
    pairs += [(Name(f"{colour} {_SLOT}"), _NAMES[0]) for colour in COLOURS if lookalikes]
    rooms = [name for kind in BENCHMARK.rooms for number in _NUMBERS for name in names_of_room(f"{kind}{number}", True)]
    for template in _revised(INSTRUCTIONS):
        yield from (instructions.phrase(template, *pair, the, the) for pair in pairs for the in (True, False))
    for kind in FEEDBACK:
        yield from _advices(kind, pairs)
    for room in rooms:
        yield from (f"You should have gone to {room}.", *[f"Put it on the {_SLOT} in {room}."] * lookalikes)


def _advices(kind: Templates, pairs: list[tuple[Name, Name]]) -> Iterator[str]:
    """Yield the sentences of a kind of feedback: for every name, and for every way to say an action."""
    actions = (*VERBS, *(f"goto_{room}" for room in BENCHMARK.rooms))
    verbs = [verb for action in actions for verb in ways_to_say(action, True)]
    for template in _revised(kind):
        for succeeded in (True, False):
            advice = feedback.Advice("stay", succeeded, "stay", True)
            yield from (feedback.phrase(template, *pair, advice, _ANY, _ANY) for pair in pairs)
            yield from (feedback.phrase(template, *pairs[0], advice, verb, _ANY) for verb in verbs)
        yield from (feedback.phrase(template, *pairs[0], advice, _ANY, verb) for verb in verbs)


def _revised(kind: Templates) -> list[str]:
    """Return the templates of all revisions."""
    return list(dict.fromkeys(revised(one, revision) for revision in REVISIONS for one in kind.pool(True)))
