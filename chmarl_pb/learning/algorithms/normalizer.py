"""Running means and deviations, by which states and values are brought to the same scale whatever the environment."""

import torch
from torch import Tensor, nn

_LEAST = 0.01  # weight of a new batch, once there have been many
_FLAT = 1e-4  # least variance


class Normalizer(nn.Module):
    """The mean and variance of each of D columns over the batches so far; older batches than the last 100 fade.

    >>> normalizer = Normalizer(1)
    >>> normalizer.update(torch.tensor([[1.0], [3.0]]), torch.ones(2, 1))
    >>> normalizer.normalize(torch.tensor([4.0])), normalizer.denormalize(torch.tensor([2.0]))
    (tensor([2.]), tensor([4.]))
    """

    mean: Tensor
    variance: Tensor
    batches: Tensor

    def __init__(self, columns: int):
        """Begin with mean 0 and variance 1, which the first batch replaces."""
        super().__init__()
        self.register_buffer("mean", torch.zeros(columns))
        self.register_buffer("variance", torch.ones(columns))
        self.register_buffer("batches", torch.zeros(columns))

    @torch.no_grad()
    def update(self, values: Tensor, mask: Tensor) -> None:
        """Take in a batch of values (..., D); those count that ``mask``, of the same shape or (..., 1), says."""
        counts = mask.expand_as(values).flatten(0, -2)
        rows, seen = values.flatten(0, -2), counts.sum(dim=0)
        mean = (rows * counts).sum(dim=0) / seen.clamp(min=1)
        variance = ((rows - mean).square() * counts).sum(dim=0) / seen.clamp(min=1)
        self.batches += seen > 0
        weight = (seen > 0) * (1 / self.batches.clamp(min=1)).clamp(min=_LEAST)
        change = mean - self.mean
        self.variance.copy_((1 - weight) * (self.variance + weight * change.square()) + weight * variance)
        self.mean.add_(weight * change)

    @property
    def deviation(self) -> Tensor:
        """(D) the standard deviations, at least 0.01."""
        return self.variance.clamp(min=_FLAT).sqrt()

    def normalize(self, values: Tensor) -> Tensor:
        """Return values (..., D) with mean 0 and deviation 1."""
        return (values - self.mean) / self.deviation

    def denormalize(self, normal: Tensor) -> Tensor:
        """Return what ``normalize`` has made values (..., D) of."""
        return normal * self.deviation + self.mean


@torch.no_grad()
def update_and_preserve(normalizer: Normalizer, head: nn.Linear, values: Tensor, mask: Tensor) -> None:
    """Take in values, and change the layer that gives normal ones so that what it gives stays the same denormalized.

    This is PopArt (van Hasselt et al. 2016, https://arxiv.org/abs/1602.07714).
    """
    mean, deviation = normalizer.mean.clone(), normalizer.deviation.clone()
    normalizer.update(values, mask)
    head.weight.mul_((deviation / normalizer.deviation).unsqueeze(-1))
    head.bias.copy_((head.bias * deviation + mean - normalizer.mean) / normalizer.deviation)
