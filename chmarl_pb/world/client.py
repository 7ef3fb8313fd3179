"""A PyBullet client that is told where bodies are only when somebody asks it: most steps of an episode never do."""

import gc
import weakref
from typing import ClassVar, NoReturn

from chmarl_pb.errors import ChmarlError, CopyError
from chmarl_pb.world.bodies import UPRIGHT, Vector
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
    """A client without a display, and the bodies that are still to be moved in it.

    It is disconnected by ``close``, when nothing refers to it any longer, and at the interpreter's exit.
    """

    def __init__(self) -> None:
        """Connect.

        Raises:
            ChmarlError: PyBullet has no free client.
        """
        self._number = _connect()
        self._disconnect = weakref.finalize(self, pybullet.disconnect, physicsClientId=self._number)
        self._moves: dict[int, tuple[Vector, Vector, Vector | None]] = {}
        self._is_shared = False

    @property
    def shared(self) -> int:
        """PyBullet's id for somebody who may keep it: from now on bodies are moved at once."""
        self._is_shared = True
        return self.number

    @property
    def number(self) -> int:
        """PyBullet's id of the client, once all bodies are where they were moved to."""
        if self._moves:
            for body, (position, quaternion, inertial) in self._moves.items():
                if inertial is not None:
                    position, _ = pybullet.multiplyTransforms(position, quaternion, inertial, UPRIGHT)
                pybullet.resetBasePositionAndOrientation(body, position, quaternion, physicsClientId=self._number)
            self._moves.clear()
        return self._number

    def move(self, body: int, position: Vector, quaternion: Vector, inertial: Vector | None = None) -> None:
        """Move a body, at rest: at once if the client is shared, else before it is next used.

        Args:
            body: body id.
            position: of its frame, metres.
            quaternion: of its frame (x, y, z, w).
            inertial: position of its inertial frame in its own frame, metres; None if they are one.
        """
        self._moves[body] = position, quaternion, inertial
        if self._is_shared:
            _ = self.number

    def close(self) -> None:
        """Disconnect; closing twice is allowed."""
        self._disconnect()
        self._number = -1
        self._moves.clear()


def _connect() -> int:
    number = pybullet.connect(pybullet.DIRECT)
    if number < 0:  # environments in reference cycles of their users' making may only wait to be collected
        gc.collect()
        number = pybullet.connect(pybullet.DIRECT)
    if number < 0:
        raise ChmarlError("PyBullet has no free client; close some environments")
    return int(number)
