"""Observations as the benchmark gives them: networks that read ids refuse what a wrapper has stacked or scaled."""

import math
from collections.abc import Mapping
from typing import Any, TypeGuard

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor

from chmarl_pb.envs.observations import Observer
from chmarl_pb.envs.options import Options
from chmarl_pb.learning.observation_keys import IMAGE, INSTRUCTION, MESSAGES, SELF, is_picture, named, prefixes
from chmarl_pb.tasks.language import ATTRIBUTES_LENGTH, INSTRUCTION_LENGTH

_MEMORY = (
    "the network reads one observation at a time; leave out VecFrameStack and the like (RecurrentPPO has a memory)"
)
_IDS = "ids of classes and words must stay whole numbers, but were normalised or scaled"
_PICTURE = "pictures were scaled already, which the network does itself; give policy_kwargs normalize_images=False"
_SCALED = "give VecNormalize norm_obs=False, and leave out wrappers that change observations"


class Check:
    """Refuses observations that were flattened, stacked, normalised or scaled."""

    def __init__(self, space: spaces.Space[Any], *read: str):
        """Check a space, and remember the keys whose values tell more.

        Args:
            space: of the observations.
            read: names of the keys that the network reads; none: all.

        Raises:
            ValueError: the space is not as the environment has it.
        """
        if not isinstance(space, spaces.Dict):
            raise ValueError(f"{space} is not the Dict that the environment gives; leave out wrappers that flatten it")
        for prefix in prefixes(space.spaces):
            _check_robot(prefix, {key.removeprefix(prefix): space[key] for key in space if key.startswith(prefix)})
        boxes = {key: space[key] for key in (named(space.spaces, *read) if read else space)}
        whole = {key: box for key, box in boxes.items() if _has_whole_numbers(box)}
        self._limits = {key: (torch.tensor(box.low), torch.tensor(box.high)) for key, box in whole.items()}

    def __call__(self, observation: Mapping[str, Tensor]) -> None:
        """Check a batch that is acted on; what is learned from has been acted on before.

        VecNormalize and Stable-Baselines3's own scaling of pictures change values, but not the space.

        Raises:
            ValueError: ids or pixels are no whole numbers of their space.
        """
        if torch.is_grad_enabled():
            return
        for key, limits in self._limits.items():
            values = observation[key]
            low, high = (limit.to(values.device) for limit in limits)
            if bool(((values != values.round()) | (values < low) | (values > high)).any()):
                raise ValueError(f"{key!r}: {_PICTURE if values.dim() == 4 else _IDS}; {_SCALED}")


def _check_robot(prefix: str, own: Mapping[str, spaces.Space[Any]]) -> None:
    """Check the keys of one robot, which are named here without its prefix."""
    rooms = _rooms(own)
    given = Observer(Options(goal=True, lookalikes=_among_lookalikes(own)), ("",) * rooms).space
    symbols = MESSAGES in own and own[MESSAGES].shape != (2, rooms)  # of a vocabulary of any size
    for name in (own.keys() & given.spaces.keys()) - ({MESSAGES} if symbols else set()):
        if own[name].shape != given[name].shape and not (name == INSTRUCTION and _of_several(own[name], given[name])):
            raise ValueError(f"{prefix + name!r} has the shape {own[name].shape}, not {given[name].shape}: {_MEMORY}")
        if _has_whole_numbers(given[name]) and not _holds(own[name], given[name]):
            raise ValueError(f"{prefix + name!r} is {own[name]}, not {given[name]}: {_IDS}; {_SCALED}")
    picture = own.get(IMAGE)
    if picture is not None and not is_picture(picture) and picture.dtype != np.float16:  # as frozen features have
        raise ValueError(f"{prefix + IMAGE!r} is {picture}, not one uint8 picture: stacked or scaled; {_SCALED}")


def _of_several(own: spaces.Space[Any], one: spaces.Space[Any]) -> bool:
    """Return whether an instruction has words for several objects; one that is stacked is not stacked alone."""
    return len(own.shape or ()) == 1 and math.prod(own.shape or ()) % math.prod(one.shape or ()) == 0


def _holds(own: spaces.Space[Any], given: spaces.Space[Any]) -> bool:
    """Return whether a space has the whole numbers of the benchmark's; classes and words of the user's own are more."""
    assert isinstance(given, spaces.Box)
    if not isinstance(own, spaces.Box) or own.dtype != given.dtype or own.low.any():
        return False
    return bool(own.high.max() >= given.high.max())


def _rooms(own: Mapping[str, spaces.Space[Any]]) -> int:
    """Return how many rooms a message has bits for."""
    if SELF in own:
        return max(spaces.flatdim(own[SELF]) - 4, 0)
    shape = own[MESSAGES].shape if MESSAGES in own else None
    return shape[-1] if shape else 0


def _among_lookalikes(own: Mapping[str, spaces.Space[Any]]) -> bool:
    """Return whether instructions name colours, which makes them longer."""
    words = INSTRUCTION_LENGTH + ATTRIBUTES_LENGTH
    return "goal_attributes" in own or (INSTRUCTION in own and own[INSTRUCTION].shape == (words,))


def _has_whole_numbers(space: spaces.Space[Any]) -> TypeGuard[spaces.Box]:
    """Return whether a space holds ids or pixels; bits may be scaled."""
    return isinstance(space, spaces.Box) and np.issubdtype(space.dtype, np.integer) and space.high.max() > 1
