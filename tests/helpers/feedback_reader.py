"""Read a feedback sentence back: what it says was done, and what it recommends."""

import re

from chmarl_pb import catalog
from chmarl_pb.tasks.language import templates
from chmarl_pb.tasks.language.actions import ways_to_say

GOTOS = tuple(f"goto_{room}" for room in catalog.ROOM_KINDS)
MOVES = (*GOTOS, "move_forward", "turn_left", "turn_right")
ACTIONS = (*GOTOS, "pick", "place", "move_forward", "turn_left", "turn_right", "stay")


def _either(ways: list[str]) -> str:
    return "|".join(map(re.escape, sorted(ways, key=len, reverse=True)))


def _names(table: dict[str, catalog.ThingClass]) -> list[str]:
    return [f"the {name}" for row in table.values() for name in row.synonyms]


def _phrases(actions: tuple[str, ...], form: str) -> dict[str, str]:
    return {getattr(verb, form): action for action in actions for verb in ways_to_say(action, held_out=True)}


DOING, BASE = _phrases(ACTIONS, "doing"), _phrases(ACTIONS, "base")
BETTER = {phrase: action for form in ("base", "past", "doing") for phrase, action in _phrases(MOVES, form).items()}
SLOTS = {
    "the_x": _either(_names(catalog.BENCHMARK.graspables)),
    "y": _either(_names(catalog.BENCHMARK.receptacles)),
    "goal": _either(_names(catalog.BENCHMARK.graspables) + _names(catalog.BENCHMARK.receptacles)),
    "it": "it|them",
    "was": "was|were",
    "done": _either([*DOING, *(f"trying to {phrase}" for phrase in BASE)]),
    **{form: _either(list(_phrases(MOVES, form))) for form in ("base", "past", "doing")},
}


def pattern_of(template: str) -> re.Pattern[str]:
    """Return the pattern of all sentences that a template gives."""
    parts = re.split(r"\{(\w+)\}", template)
    seen: set[str] = set()
    text = ""
    for literal, slot in zip(parts[::2], [*parts[1::2], ""], strict=True):
        text += re.escape(literal)
        if slot:
            text += f"(?:{SLOTS[slot]})" if slot in seen else f"(?P<{slot}>{SLOTS[slot]})"
            seen.add(slot)
    return re.compile(text, re.IGNORECASE)


PATTERNS = [
    (verb, pattern_of(template))
    for verb, kind in (("pick", templates.MISSED_PICK), ("place", templates.MISSED_PLACE), ("", templates.DETOUR))
    for template in kind.pool(held_out=True)
]


def read(text: str) -> tuple[str, str, bool]:
    """Return what a sentence says: the better action, the action that was taken, and whether that could be done."""
    readings = set()
    for verb, pattern in PATTERNS:
        match = pattern.fullmatch(text)
        if match:
            slots = {slot: words.lower() for slot, words in match.groupdict().items()}
            better = verb or BETTER[slots.get("past") or slots.get("base") or slots["doing"]]
            tried = slots["done"].startswith("trying to ")
            done = BASE[slots["done"].removeprefix("trying to ")] if tried else DOING[slots["done"]]
            readings.add((better, done, not tried))
    assert len(readings) == 1, (text, readings)
    return readings.pop()
