"""What is sent to other processes, pickled once for all of them: also what notebooks and functions define."""

import pickle
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

from gymnasium.vector.utils import CloudpickleWrapper

from chmarl_pb.errors import OptionError
from chmarl_pb.fingerprint import name_of

_LONGEST = 200  # characters of a reason in a message


class Sent:
    """What has been pickled, and is a ``CloudpickleWrapper`` of the same where it is read."""

    def __init__(self, pickled: bytes):
        """Take what :func:`pickled` returns."""
        self._pickled = pickled

    def __reduce__(self) -> tuple[Any, ...]:
        """Let it be read as what was pickled."""
        return pickle.loads, (self._pickled,)


def pickled(content: Any, what: str, instead: str = "give workers=1") -> bytes:
    """Return what another process reads as a ``CloudpickleWrapper`` of this content.

    Args:
        content: to be sent.
        what: it is, for the error.
        instead: what to do where nothing else helps.

    Raises:
        OptionError: it holds what cannot be pickled.
    """
    try:
        return pickle.dumps(CloudpickleWrapper(content))
    except Exception as error:  # whatever the methods raise by which objects say what they hold
        reason = " ".join(str(error).split())[:_LONGEST] or type(error).__name__
        raise OptionError(
            f"{what} cannot be sent to other processes{_culprit(content)} ({reason}); keep what cannot be copied out "
            f"of it, or {instead}"
        ) from error


def _culprit(content: Any, name: str = "") -> str:
    """Return which innermost argument or option cannot be sent, in words; nothing where it has no name."""
    for own, part in _parts(content):
        if not _can_be_sent(part):
            return _culprit(part, own or name)
    return f", as {name}={name_of(content)} holds what cannot be pickled" if name else ""


def _parts(content: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and value of what a function is called with, or a setting has; without a name in a row."""
    if isinstance(content, partial):
        yield from (("", one) for one in content.args)
        yield from content.keywords.items()
    elif isinstance(content, tuple | list):
        yield from (("", one) for one in content)
    elif is_dataclass(content) and not isinstance(content, type) and type(content).__module__.startswith("chmarl_pb."):
        yield from ((one.name, getattr(content, one.name)) for one in fields(content))


def _can_be_sent(content: Any) -> bool:
    try:
        pickle.dumps(CloudpickleWrapper(content))
    except Exception:
        return False
    return True
