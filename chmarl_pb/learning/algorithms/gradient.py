"""One gradient step, as all learners of this package take it."""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor, nn

from chmarl_pb.errors import ChmarlError
from chmarl_pb.learning.algorithms.losses import grounding
from chmarl_pb.learning.rollouts.batch import Batch


class DivergedError(ChmarlError, ArithmeticError):
    """A gradient or a weight is infinite or no number, so that there is nothing left to learn from."""


def add_grounding(metrics: dict[str, Tensor], agents: nn.ModuleDict, batch: Batch, weight: float) -> dict[str, Tensor]:
    """Return figures whose ``loss`` also teaches encoders the classes that instructions name; see ``grounding``."""
    taught = grounding(agents, batch, weight)
    return metrics | taught | {"loss": metrics["loss"] + sum(taught.values())}


@contextmanager
def evaluating(*networks: nn.Module) -> Iterator[None]:
    """Put networks that are being trained into evaluation mode, as when they act: without dropout, say."""
    training = [network for network in networks if network.training]
    for network in training:
        network.eval()
    try:
        yield
    finally:
        for network in training:
            network.train()


def check_finite(networks: nn.Module) -> None:
    """Check weights after gradient steps, before they are kept.

    Raises:
        DivergedError: some are infinite or no numbers.
    """
    if not all(bool(torch.isfinite(weight).all()) for weight in networks.parameters()):
        raise DivergedError(
            "some weights are infinite or no numbers after a gradient step; lower learning_rate, or see whether the "
            "environment returns what is no number"
        )


def _check_norms(loss: Tensor, norms: Iterable[Tensor]) -> None:
    """Check the gradients of a loss, before the step that they make.

    Raises:
        DivergedError: a norm is infinite or no number.
    """
    if not all(math.isfinite(float(norm)) for norm in norms):
        raise DivergedError(
            f"the loss is {float(loss.detach())}, and its gradient is no number; lower learning_rate or "
            "reward_scale, or see whether the environment returns what is no number"
        )


def descend(
    metrics: dict[str, Tensor], optimizer: torch.optim.Optimizer, max_norm: float, *parts: Iterable[Tensor]
) -> dict[str, float]:
    """Take one gradient step down ``loss``, and return all figures as numbers, with the gradient's norm.

    Args:
        metrics: figures of the step, among them ``loss``.
        optimizer: of all weights.
        max_norm: largest norm of the gradient of each part.
        parts: weights whose gradients are clipped together; the norm is that of the first.

    Raises:
        DivergedError: a gradient is infinite or no number.
    """
    optimizer.zero_grad()
    loss: Any = metrics["loss"]
    loss.backward()
    norms = [nn.utils.clip_grad_norm_(part, max_norm) for part in parts]
    _check_norms(loss, norms)
    optimizer.step()
    return {name: float(value.detach()) for name, value in metrics.items()} | {"gradient_norm": float(norms[0])}
