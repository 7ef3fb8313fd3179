"""Feedback read back: the action that its words name."""

import re
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.robots.pointing import VERBS, verb_of
from chmarl_pb.tasks.language.actions import ways_to_say
from chmarl_pb.tasks.language.templates import DETOUR
from chmarl_pb.tasks.language.tokens import vocabulary, words

_FORMS = ("base", "past", "doing")  # slots of the better action


def read_detour(tokens: NDArray[np.int16], actions: Sequence[str], known: Catalog = BENCHMARK) -> str | None:
    """Return the action that feedback names as the better one; None if it names none, or Pick or Place.

    Args:
        tokens: feedback as it is observed.
        actions: names of the robot's actions.
        known: the classes of things, whose words have token ids.
    """
    if not tokens.any():
        return None
    spelling = _spelling(known)
    text = " ".join(spelling.get(number, "?") for number in tokens.tolist() if number)
    meanings, patterns = _grammar(tuple(dict.fromkeys(map(verb_of, actions))))
    found = (pattern.match(text) for pattern in patterns)
    return next((meanings[match["better"]] for match in found if match), None)


@cache
def _spelling(known: Catalog) -> dict[int, str]:
    return {number: word for word, number in vocabulary(known, attributes=True).items()}


@cache
def _grammar(actions: tuple[str, ...]) -> tuple[dict[str, str], list[re.Pattern[str]]]:
    """Return words -> the action that they mean, and the sentences in which they stand."""
    verbs = [(action, verb) for action in actions if action not in VERBS for verb in ways_to_say(action, True)]
    meanings = {_plain(getattr(verb, form)): action for action, verb in verbs for form in _FORMS}
    forms = {form: [_plain(getattr(verb, form)) for _, verb in verbs] for form in _FORMS}
    return meanings, [re.compile(_pattern(template, forms)) for template in DETOUR.pool(True)]


def _pattern(template: str, forms: dict[str, list[str]]) -> str:
    """Return a regular expression for a sentence; the words of the better action are its group ``better``."""
    parts, seen = re.split(r"\{(\w+)\}", template), False
    patterns = [_plain(parts[0])]
    for slot, literal in zip(parts[1::2], parts[2::2], strict=True):
        better = slot in forms and not seen
        seen |= better
        patterns += [f"(?P<better>{'|'.join(forms[slot])})" if better else ".+", _plain(literal)]
    return " ".join(filter(None, patterns))


def _plain(text: str) -> str:
    return " ".join(words(text))
