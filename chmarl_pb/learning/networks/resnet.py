"""ResNet-18 as a frozen encoder of pictures: 512 features, as in CH-MARL; see ``frozen.py``.

Ours come in whole numbers; torchvision's files of weights fit too, and torchvision itself is not needed.
"""

from collections.abc import Callable

import torch
from torch import Tensor

from chmarl_pb.learning.networks.int8 import LARGEST, RANGES, IntegerResNet18, restored
from chmarl_pb.learning.networks.residual import FEATURES, ResNet18, folded
from chmarl_pb.learning.storage.checkpoint import CheckpointError

SHAPE = (FEATURES,)  # of the features of a picture


def build(weights: dict[str, Tensor]) -> Callable[[Tensor], Tensor]:
    """Return what computes (B, 512) of uint8 pictures (B, height, width, 3).

    Weights with ranges are used in integers, others in float32, which is five times as slow.

    Raises:
        RuntimeError: the weights do not fit.
    """
    network, is_compact = ResNet18().eval().requires_grad_(False), any(name.endswith(LARGEST) for name in weights)
    if is_compact:
        network = folded(network).requires_grad_(False)
    network.load_state_dict({name: value for name, value in restored(weights).items() if name != RANGES})
    network = (network if is_compact else folded(network)).to(memory_format=torch.channels_last)
    if RANGES in weights:
        return IntegerResNet18(network, weights[RANGES])
    # Floats differ in the last bit with the size of the batch.
    return lambda images: torch.cat([network(image.unsqueeze(0)) for image in images])


def imagenet() -> dict[str, Tensor]:
    """Return the weights that torchvision's own loader fetches.

    Raises:
        CheckpointError: torchvision is not there.
    """
    try:
        from torchvision.models import ResNet18_Weights  # type: ignore[import-not-found]
    except ImportError as error:
        raise CheckpointError("ImageNet's weights need torchvision; run `pip install torchvision`") from error
    weights: dict[str, Tensor] = ResNet18_Weights.IMAGENET1K_V1.get_state_dict(progress=True, check_hash=True)
    return weights
