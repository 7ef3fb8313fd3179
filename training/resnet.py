"""ResNet-18 (He et al. 2016, https://arxiv.org/abs/1512.03385) as a frozen encoder of pictures: 512 features.

Its parts have torchvision's names, so that torchvision's files of weights fit, but torchvision is not needed. Weights
come from a file, by default the one that ``python -m training.pretrain`` makes, or from torchvision's own loader.
"""

import hashlib
import os
import pickle
from collections import OrderedDict
from functools import cache
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from training.checkpoint import CheckpointError

FEATURES = 512
IMAGENET = "imagenet"  # name of torchvision's weights

# Of ImageNet's pictures, as torchvision's weights expect; ours are trained with the same.
_MEAN, _DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


class Block(nn.Module):
    """Two convolutions and a way around them."""

    def __init__(self, inputs: int, outputs: int, stride: int):
        """Make the layers; the way around has a convolution only where the shape changes."""
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride, padding=1, bias=False)
        self.bn1 = nn.BatchNorm2d(outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        self.downsample: nn.Sequential | None = None
        if stride > 1:
            self.downsample = nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))

    def forward(self, maps: Tensor) -> Tensor:
        """Return (B, outputs, height / stride, width / stride)."""
        around = maps if self.downsample is None else self.downsample(maps)
        maps = torch.relu(self.bn1(self.conv1(maps)))
        return torch.relu(self.bn2(self.conv2(maps)) + around)


class ResNet18(nn.Module):
    """The network without its last layer."""

    mean: Tensor
    deviation: Tensor

    def __init__(self) -> None:
        """Make the layers with random weights."""
        super().__init__()
        self.conv1 = nn.Conv2d(3, 64, 7, stride=2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.layer1 = nn.Sequential(Block(64, 64, 1), Block(64, 64, 1))
        self.layer2 = nn.Sequential(Block(64, 128, 2), Block(128, 128, 1))
        self.layer3 = nn.Sequential(Block(128, 256, 2), Block(256, 256, 1))
        self.layer4 = nn.Sequential(Block(256, 512, 2), Block(512, 512, 1))
        self.register_buffer("mean", torch.tensor(_MEAN).view(3, 1, 1), persistent=False)
        self.register_buffer("deviation", torch.tensor(_DEVIATION).view(3, 1, 1), persistent=False)

    def maps(self, images: Tensor) -> Tensor:
        """Return the last feature maps (B, 512, height / 32, width / 32) of uint8 pictures (B, height, width, 3)."""
        pictures = (images.permute(0, 3, 1, 2).float() / 255 - self.mean) / self.deviation
        stem = torch.relu(self.bn1(self.conv1(pictures.contiguous(memory_format=torch.channels_last))))
        pooled = nn.functional.max_pool2d(stem, 3, stride=2, padding=1)
        return self.layer4(self.layer3(self.layer2(self.layer1(pooled))))

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, 512) of uint8 pictures (B, height, width, 3)."""
        return self.maps(images).mean(dim=(2, 3))


class FrozenResNet18:
    """ResNet-18 that never learns; its features are rounded to float16, so that they can be kept on disk as they are.

    Attributes:
        fingerprint: sha256 of the weights.
    """

    def __init__(self, weights: dict[str, Tensor]):
        """Take weights with torchvision's names; those of a last layer are left out.

        Raises:
            RuntimeError: they do not fit.
        """
        weights = {name: value for name, value in weights.items() if not name.startswith("fc.")}
        network = ResNet18()
        network.load_state_dict(weights)
        self.fingerprint = fingerprint(weights)
        self._network = _folded(network.eval().requires_grad_(False)).to(memory_format=torch.channels_last)

    @torch.no_grad()
    def __call__(self, images: Tensor) -> Tensor:
        """Return (B, 512) float16 of uint8 pictures (B, height, width, 3)."""
        return self._network(images).half()


def weights_file() -> Path:
    """Return the default file of weights: ``$CHMARL_RESNET18``, or one in the user's folder for caches."""
    chosen = os.environ.get("CHMARL_RESNET18")
    caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(chosen).expanduser() if chosen else caches / "chmarl_pb" / "resnet18.pt"


@cache
def frozen_resnet18(source: str | None = None) -> FrozenResNet18:
    """Return ResNet-18, loaded once in a process.

    Args:
        source: a file of weights; ``"imagenet"`` for torchvision's; None: :func:`weights_file`.

    Raises:
        CheckpointError: there are no such weights, or they do not fit.
    """
    source = source or str(weights_file())
    try:
        return FrozenResNet18(_imagenet() if source == IMAGENET else _read(Path(source)))
    except RuntimeError as error:
        raise CheckpointError(f"{source}: no weights of ResNet-18: {str(error).splitlines()[0]}") from error


def fingerprint(weights: dict[str, Tensor]) -> str:
    """Return the sha256 of named tensors."""
    digest = hashlib.sha256()
    for name, value in sorted(weights.items()):
        digest.update(name.encode() + value.contiguous().numpy().tobytes())
    return digest.hexdigest()


def _read(path: Path) -> dict[str, Tensor]:
    try:
        weights = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError as error:
        raise CheckpointError(
            f"{path}: no weights of ResNet-18; make them by `python -m training.pretrain`, name another file by "
            "CHMARL_RESNET18, or use image_encoder='cnn', which needs none"
        ) from error
    except (RuntimeError, EOFError, OSError, ValueError, pickle.UnpicklingError) as error:
        raise CheckpointError(f"{path}: not a whole file of weights; copy or make it again") from error
    if not isinstance(weights, dict) or not all(isinstance(value, Tensor) for value in weights.values()):
        raise CheckpointError(f"{path}: not a file of weights: a dict of tensors is needed")
    return OrderedDict(weights)


def _imagenet() -> dict[str, Tensor]:
    try:
        from torchvision.models import ResNet18_Weights  # type: ignore[import-not-found]
    except ImportError as error:
        raise CheckpointError("ImageNet's weights need torchvision; run `pip install torchvision`") from error
    return ResNet18_Weights.IMAGENET1K_V1.get_state_dict(progress=True, check_hash=True)


def _folded(network: ResNet18) -> ResNet18:
    """Put every batch normalisation into the convolution before it, which is the same and faster."""
    pairs: list[tuple[nn.Module, str, str]] = [(network, "conv1", "bn1")]
    for block in network.modules():
        if isinstance(block, Block):
            pairs += [(block, "conv1", "bn1"), (block, "conv2", "bn2")]
        if isinstance(block, Block) and block.downsample is not None:
            pairs.append((block.downsample, "0", "1"))
    for owner, convolution, norm in pairs:
        setattr(owner, convolution, fuse_conv_bn_eval(getattr(owner, convolution), getattr(owner, norm)))
        setattr(owner, norm, nn.Identity())
    return network
