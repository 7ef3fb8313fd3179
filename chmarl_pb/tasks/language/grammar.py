"""Put names into a sentence: articles, pronouns, agreement of verbs, a capital at its start."""

import re

from chmarl_pb.catalog import Name

_SINGULAR = {"it": "it", "they": "it", "is": "is", "was": "was", "s": "s"}
_PLURAL = {"it": "them", "they": "they", "is": "are", "was": "were", "s": ""}


def definite(name: Name) -> str:
    """Return a name with the."""
    return f"the {name.text}"


def indefinite(name: Name) -> str:
    """Return a name with a, an or some."""
    if name.number != "count":
        return f"some {name.text}"
    return f"{'an' if name.text[0] in 'aeiou' else 'a'} {name.text}"


def agreement(name: Name) -> dict[str, str]:
    """Return the pronouns and verb forms that agree with a name, by their slots."""
    return _PLURAL if name.number == "plural" else _SINGULAR


def sentence(template: str, slots: dict[str, str]) -> str:
    """Return a template with its slots filled and a capital at its start."""
    text = re.sub(r"\btv\b", "TV", template.format_map(slots))
    return text[0].upper() + text[1:]
