"""Plain English: instructions, feedback, the vocabulary, and reading an instruction back."""

import re
from functools import cache

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.tasks.task import Task

INSTRUCTION_LENGTH = 24  # tokens
FEEDBACK_LENGTH = 32

_PLURAL = {"slippers", "house shoes", "notes"}

_INSTRUCTIONS = (
    "Put {x} on {y}.",
    "Place {x} on top of {y}.",
    "Grab {x} and keep it on {y}.",
    "Pick up {x} and put it onto {y}.",
    "Take {x} and set it down on {y}.",
    "Find {x} and bring it to {y}.",
    "Please move {x} over to {y}.",
    "Look for {x} in the home and leave it on {y}.",
)
_MISSED_PICK = "You should have picked up {x} instead of {action}."
_MISSED_PLACE = "You should have placed {x} on {y} instead of {action}."

_ACTIONS = {
    "pick": "picking something up",
    "place": "placing something",
    "move_forward": "moving forward",
    "turn_left": "turning left",
    "turn_right": "turning right",
    "stay": "staying where you are",
}

PADDING, UNKNOWN = 0, 1


def instruction(task: Task) -> str:
    """Return the task's instruction; its seed chooses the template and the words."""
    rng = np.random.default_rng([task.seed, 1])
    template = str(rng.choice(_INSTRUCTIONS))
    x = str(rng.choice(catalog.GRASPABLES[task.graspable].synonyms))
    y = str(rng.choice(catalog.RECEPTACLES[task.target].synonyms))
    if x in _PLURAL:
        template = template.replace(" it ", " them ")
    article = "the" if x in _PLURAL or rng.random() < 0.5 else "an" if x[0] in "aeiou" else "a"
    return template.format(x=f"{article} {x}", y=f"the {y}")


def missed_pick(task: Task, action: str) -> str:
    """Return the feedback for doing something else while X could be picked."""
    x = catalog.GRASPABLES[task.graspable].noun
    return _MISSED_PICK.format(x=f"the {x}", action=describe_action(action))


def missed_place(task: Task, action: str) -> str:
    """Return the feedback for doing something else while X could be placed on Y."""
    x, y = catalog.GRASPABLES[task.graspable].noun, catalog.RECEPTACLES[task.target].noun
    return _MISSED_PLACE.format(x=f"the {x}", y=f"the {y}", action=describe_action(action))


def describe_action(action: str) -> str:
    """Return an action's name as words: ``goto_livingroom`` -> ``going to the living room``."""
    if action.startswith("goto_"):
        room = action.removeprefix("goto_")
        return f"going to the {_room_words(room)}"
    return _ACTIONS[action]


def _room_words(room: str) -> str:
    number = room.removeprefix(catalog.room_kind(room)).strip("_")
    return f"{catalog.ROOMS[catalog.room_kind(room)].synonyms[-1]} {number}".strip()


def words(text: str) -> list[str]:
    """Return the words of a sentence in lower case, without punctuation."""
    return re.findall(r"[a-z0-9]+", text.lower())


@cache
def vocabulary() -> dict[str, int]:
    """Return word -> token id of every word that instructions and feedback can hold."""
    texts = [*_INSTRUCTIONS, _MISSED_PICK, _MISSED_PLACE, *_ACTIONS.values(), "going to the", "a an the them"]
    texts += [name for row in catalog.CLASSES.values() for name in row.synonyms]
    found = {word for text in texts for word in words(re.sub(r"\{\w+\}", " ", text))}
    return {word: number for number, word in enumerate(sorted(found), start=2)}


def vocabulary_size() -> int:
    """Return the number of token ids, padding and unknown included."""
    return len(vocabulary()) + 2


def tokenize(text: str, length: int) -> NDArray[np.int16]:
    """Return a sentence as token ids (length,), padded with 0 and cut to the length."""
    tokens = np.zeros(length, dtype=np.int16)
    ids = [vocabulary().get(word, UNKNOWN) for word in words(text)][:length]
    tokens[: len(ids)] = ids
    return tokens


def parse_instruction(text: str) -> tuple[str, str]:
    """Return the classes (graspable, receptacle) that an instruction names.

    Raises:
        ValueError: it names no known object or no known receptacle.
    """
    sentence = f" {' '.join(words(text))} "
    receptacle, rest = _take(sentence, catalog.RECEPTACLES)
    graspable, _ = _take(rest, catalog.GRASPABLES)
    return graspable, receptacle


def _take(sentence: str, classes: dict[str, catalog.ThingClass]) -> tuple[str, str]:
    """Return the class whose longest name stands last in the sentence, and the sentence without it."""
    names = [(name, row.name) for row in classes.values() for name in row.synonyms if f" {name} " in sentence]
    if not names:
        raise ValueError(f"no known object or place in {sentence.strip()!r}")
    name, class_name = max(names, key=lambda found: (len(found[0]), found[0]))
    return class_name, sentence.replace(f" {name} ", " ", 1)
