"""One vector of what is observed, for learners that know no dictionaries."""

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import RecordConstructorArgs

from chmarl_pb.errors import OptionError


class FlatVector:
    """Makes a vector of a dictionary of arrays: its keys in the order of the alphabet, each scaled to -1..1.

    A value is divided by the largest that its space allows: pictures by 255, ids by the highest id. Where that is
    infinite, values stay as they are. Choices, of a Discrete or a MultiDiscrete, are one-hot, one after the other.

    Attributes:
        layout: key -> slice of the vector that it fills.
        space: of the vector, float32.
    """

    def __init__(self, space: spaces.Space[Any], keys: Sequence[str] | None = None):
        """Read the space of what is to be flattened.

        Args:
            space: a Dict of Boxes, or of others that ``gymnasium.spaces.flatten`` makes arrays of one length of.
            keys: those to take; None: all.

        Raises:
            OptionError: it is another space, or has no such key, or a key that is taken has values of another kind.
        """
        parts = space.spaces if isinstance(space, spaces.Dict) else {}
        if not parts:
            raise OptionError(f"a flat vector is made of a Dict of Boxes, not of {space}; put it first")
        self._parts = {key: parts[key] for key in _chosen(keys, sorted(parts))}
        taken = _boxes(self._parts, sorted(parts))
        ends = np.cumsum([0, *(box.low.size for box in taken.values())]).tolist()
        self.layout = dict(zip(taken, map(slice, ends, ends[1:]), strict=False))
        low, high = (
            np.concatenate([getattr(box, side).ravel().astype(np.float32) for box in taken.values()])
            for side in ("low", "high")
        )
        most = np.maximum(np.abs(low), np.abs(high))
        self._scale = np.where(np.isfinite(most) & (most > 0), most, np.float32(1))
        self.space = spaces.Box(low / self._scale, high / self._scale, dtype=np.float32)

    def __call__(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Return the vector of an observation, (length,) float32."""
        flat = [_flat(part, observation[key]) for key, part in self._parts.items()]
        return np.concatenate(flat, dtype=np.float32) / self._scale


def _flat(space: spaces.Space[Any], value: Any) -> np.ndarray:
    """Return a value of a space as an array of one dimension."""
    flat: np.ndarray = value.ravel() if isinstance(space, spaces.Box) else spaces.flatten(space, value)  # type: ignore[assignment]
    return flat


def _flat_space(space: spaces.Space[Any]) -> spaces.Space[Any]:
    try:
        return spaces.flatten_space(space)
    except NotImplementedError:  # of a class of the user's own
        return space


def _boxes(parts: dict[str, spaces.Space[Any]], observed: list[str]) -> dict[str, spaces.Box]:
    """Return key -> Box of its flat values."""
    flat = ((key, _flat_space(part)) for key, part in parts.items())
    boxes = {key: box for key, box in flat if isinstance(box, spaces.Box)}
    if len(boxes) < len(parts):
        wrong = [f"{key!r} ({type(part).__name__})" for key, part in parts.items() if key not in boxes]
        others = [key for key in observed if key not in parts or key in boxes]
        raise OptionError(
            f"keys: no flat vector can hold {', '.join(wrong)}, whose values have no fixed length; give keys=(...) "
            f"without, some of: {', '.join(others)}"
        )
    return boxes


def _chosen(keys: Sequence[str] | None, observed: list[str]) -> list[str]:
    """Return those of the observed keys that are to be taken, in their order."""
    if keys is None:
        return observed
    if isinstance(keys, str) or not isinstance(keys, Iterable):
        raise OptionError(f"keys={keys!r} are not several in a row; write keys=({observed[0]!r},), or None for all")
    given = list(keys)
    if unknown := [key for key in given if key not in observed]:
        raise OptionError(f"keys={unknown} are not observed; use some of: {', '.join(observed)}")
    if not given:
        raise OptionError(f"keys={keys!r} names none; use some of: {', '.join(observed)}, or None for all")
    return [key for key in observed if key in given]


class FlatObservation(gymnasium.ObservationWrapper[Any, Any, Any], RecordConstructorArgs):
    """A Gymnasium id whose observation is one vector, float32 from -1 to 1; see :class:`FlatVector`.

    >>> env = chmarl_pb.FlatObservation(gymnasium.make("CHMARL/SceneGraphHumanoid-v1", split="val-unseen"))
    >>> env.observation_space.shape, env.layout["self"]
    ((840,), slice(832, 840, None))
    >>> env.close()

    Attributes:
        layout: key -> slice of the vector that it fills.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], keys: Sequence[str] | None = None):
        """Wrap an environment.

        Args:
            env: with a Dict of Boxes as observation.
            keys: those to take; None: all.

        Raises:
            OptionError: it observes something else, or no such key.
        """
        RecordConstructorArgs.__init__(self, keys=keys)
        super().__init__(env)
        self._flat = FlatVector(env.observation_space, keys)
        self.layout, self.observation_space = self._flat.layout, self._flat.space

    def observation(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Return the vector."""
        return self._flat(observation)
