"""A connection to PyBullet that is given back."""

import gc
import weakref
from typing import ClassVar, NoReturn

from chmarl_pb.errors import ChmarlError, CopyError
from chmarl_pb.world.bullet import pybullet


class Uncopied:
    """What would share a PyBullet client or processes with its copies: none are made."""

    _instead: ClassVar[str] = "copy the environment instead, which makes a new one of the same options"

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied or pickled.

        Raises:
            CopyError: always.
        """
        raise CopyError(f"{type(self).__name__} cannot be copied or pickled; {self._instead}")


class Client(Uncopied):
    """A client without a display.

    It is disconnected by ``close``, when nothing refers to it any longer, and at the interpreter's exit.

    Attributes:
        number: PyBullet's id of it; -1 once it is closed.
    """

    def __init__(self) -> None:
        """Connect.

        Raises:
            ChmarlError: PyBullet has no free client.
        """
        self.number = _connect()
        self._disconnect = weakref.finalize(self, pybullet.disconnect, physicsClientId=self.number)

    def close(self) -> None:
        """Disconnect; closing twice is allowed."""
        self._disconnect()
        self.number = -1


def _connect() -> int:
    number = pybullet.connect(pybullet.DIRECT)
    if number < 0:  # environments in reference cycles of their users' making may only wait to be collected
        gc.collect()
        number = pybullet.connect(pybullet.DIRECT)
    if number < 0:
        raise ChmarlError("PyBullet has no free client; close some environments")
    return int(number)
