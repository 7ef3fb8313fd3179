"""Actions of one number (Discrete) or of several components (MultiDiscrete), laid out alike for all learners.

With K components, of which the largest has A values, an action is (K), its values are (K, A), and a mask (K, A) says
which values there are and may be taken. A Discrete action is one component.

Every component has a head of its own, not their product: value learners add the values of an agent's components, which
is VDN inside the agent; actor-critics draw them independently of each other, so that log-probabilities and entropies
add up. So 26 actions and 16 symbols have 42 outputs in the place of 416.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from torch import Tensor, nn

NEVER = -1e9  # value of what lies beyond a component's last value: no mask is needed to leave it out

MOST_ACTIONS = 2**15 - 1  # that a replay buffer's int16 holds

#: Number of an agent's actions; or of the values of each component.
Counts = int | tuple[int, ...]


def counts_in(agent: str, space: spaces.Space[Any]) -> Counts:
    """Return how many actions a space has.

    Raises:
        ValueError: it is neither Discrete nor a MultiDiscrete of one dimension, both from 0 on, or has too many actions
            for a replay buffer.
    """
    if (
        isinstance(space, spaces.Discrete | spaces.MultiDiscrete)
        and np.max(space.n if isinstance(space, spaces.Discrete) else space.nvec) > MOST_ACTIONS
    ):
        raise ValueError(f"the action space of {agent!r} is {space}; learners know {MOST_ACTIONS:,} values at most")
    if isinstance(space, spaces.Discrete) and space.start == 0:
        return int(space.n)
    if isinstance(space, spaces.MultiDiscrete) and space.nvec.ndim == 1 and not np.any(space.start):
        return tuple(map(int, space.nvec))
    raise ValueError(f"the action space of {agent!r} is {space}; learners need Discrete or MultiDiscrete from 0 on")


def of_each(counts: Counts) -> tuple[int, ...]:
    """Return the number of values of each component."""
    return (counts,) if isinstance(counts, int) else counts


def as_row(action: Any, counts: Counts, missing: int) -> NDArray[np.int64]:
    """Return an action as (K) numbers; components that it does not name are ``missing``."""
    row = np.full(len(of_each(counts)), missing)
    named = np.ravel(action)
    row[: len(named)] = named
    return row


def as_label(agent: str, label: Any, counts: Counts, missing: int) -> NDArray[np.int64]:
    """Return what an expert would do in an agent's place as (K) numbers; components that it leaves out are ``missing``.

    Raises:
        ValueError: the agent has no such action.
    """
    sizes, named = of_each(counts), np.ravel(label)
    if not (named.dtype.kind in "iu" and len(named) <= len(sizes)) or any(
        not (number == missing or 0 <= number < size) for number, size in zip(named.tolist(), sizes, strict=False)
    ):
        raise ValueError(
            f"the expert would do {label!r} in the place of {agent!r}, which has as many actions as {sizes}; let it "
            f"name one of them, or {missing} where it knows none"
        )
    return as_row(named, counts, missing)


def as_action(row: NDArray[np.integer[Any]], counts: Counts) -> Any:
    """Return what an environment is given for (K) numbers: a number for Discrete, else an array."""
    return int(row[0]) if isinstance(counts, int) else np.array(row, np.int64)


def mask_of(agent: str, infos: Mapping[str, Any], counts: Counts) -> NDArray[np.bool_]:
    """Return (K, A) what an agent may do: ``infos[agent]["action_mask"]`` is about the first component.

    Without a mask, or where it allows nothing, all is allowed; what allows all is shared, and read-only.

    Raises:
        ValueError: the agent's info is no dict, or its mask has another length than it has actions.
    """
    info, number = infos.get(agent, {}), of_each(counts)[0]
    if not isinstance(info, Mapping):
        raise ValueError(f"the info of {agent!r} is {info!r}; return a dict, which may be empty")
    allowed = info.get("action_mask")
    if allowed is None or not (there := np.count_nonzero(own := np.asarray(allowed, dtype=bool))):
        return _all_allowed(counts)
    if own.shape != (number,):
        raise ValueError(
            f"the action_mask of {agent!r} has the shape {own.shape}; give it ({number},), a value for each action"
        )
    if there == number:
        return _all_allowed(counts)
    mask = _all_allowed(counts).copy()
    mask[0, :number] = own
    return mask


@cache
def _all_allowed(counts: Counts) -> NDArray[np.bool_]:
    """Return (K, A) which values there are; it is shared, so nobody may write to it."""
    sizes = np.array(of_each(counts))
    mask: NDArray[np.bool_] = np.arange(sizes.max()) < sizes[:, None]
    mask.flags.writeable = False
    return mask


def one_hot(actions: Tensor, counts: Counts) -> Tensor:
    """Return (..., sum of the components' values) from actions (..., K); zeros for -1, which is none."""
    parts = zip(actions.unbind(dim=-1), of_each(counts), strict=True)
    return torch.cat([nn.functional.one_hot(part + 1, count + 1)[..., 1:] for part, count in parts], dim=-1)


def apart(outputs: Tensor, counts: Counts) -> Tensor:
    """Return values (..., K, A) from the outputs of all heads in a row (..., sum of the components' values)."""
    sizes = of_each(counts)
    parts = outputs.split(sizes, dim=-1)
    most = max(sizes)
    return torch.stack([nn.functional.pad(part, (0, most - part.shape[-1]), value=NEVER) for part in parts], dim=-2)


def taken(values: Tensor, actions: Tensor) -> Tensor:
    """Return the sum (...) over the components of what values (..., K, A) have for actions (..., K)."""
    return values.gather(-1, actions.unsqueeze(-1)).squeeze(-1).sum(dim=-1)


def best_action(values: Tensor, action_mask: Tensor) -> Tensor:
    """Return the best action (...) of values (..., A) among those that a mask (..., A) allows."""
    return values.masked_fill(~action_mask, -torch.inf).argmax(dim=-1)
