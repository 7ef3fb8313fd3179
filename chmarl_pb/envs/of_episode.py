"""Attributes of an environment that ``reset`` sets: until then they say so."""

from typing import Any, NoReturn

from chmarl_pb.errors import NotResetError


class _NotSetError(NotResetError, AttributeError):
    """There is no episode yet; to ``hasattr`` there is no such attribute."""


class _OfEpisode:
    """What an instance has of its own comes before it, so that it costs no time once it is set."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, env: object, owner: type) -> NoReturn:
        raise _NotSetError(f"{self._name} before reset(); call reset() first")


def of_episode() -> Any:
    """Return the value in a class of an attribute that ``reset`` sets.

    Reading it before raises a :class:`chmarl_pb.errors.NotResetError`.
    """
    return _OfEpisode()
