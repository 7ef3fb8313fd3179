"""Random weights of ResNet-18 for tests."""

import torch

from chmarl_pb.learning.networks.int8 import RANGES, ranges_of
from chmarl_pb.learning.networks.residual import ResNet18, folded


def random_weights(ranges: bool = True) -> dict[str, torch.Tensor]:
    """Return weights with statistics that are not those of the start, perhaps with ranges on noise."""
    with torch.random.fork_rng():
        torch.manual_seed(3)
        network = ResNet18().eval().requires_grad_(False)
        for module in network.modules():
            if isinstance(module, torch.nn.BatchNorm2d):
                assert module.running_mean is not None and module.running_var is not None
                module.running_mean.normal_(0, 0.1)
                module.running_var.uniform_(0.5, 2)
        weights = {name: value.clone() for name, value in network.state_dict().items()}
        if ranges:
            weights[RANGES] = ranges_of(folded(network), pictures(8, 64))
    return weights


def pictures(count: int, size: int, seed: int = 0) -> torch.Tensor:
    """Return pictures (count, size, size, 3) uint8 of patches of colour."""
    stream = torch.Generator().manual_seed(seed)
    patches = torch.randint(0, 256, (count, 3, 5, 5), generator=stream).float()
    images = torch.nn.functional.interpolate(patches, size=size) + torch.randn(count, 3, size, size, generator=stream)
    return images.clamp(0, 255).to(torch.uint8).permute(0, 2, 3, 1).contiguous()
