"""ResNet-18 (He et al. 2016, https://arxiv.org/abs/1512.03385) without its last layer; torchvision's names of parts."""

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

WIDTH = 64  # channels of the first layer
FEATURES = 8 * WIDTH
_LAYERS = ("layer1", "layer2", "layer3", "layer4")

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
        """Make the stem and the four layers, with random weights."""
        super().__init__()
        self.conv1 = nn.Conv2d(3, WIDTH, 7, stride=2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(WIDTH)
        inputs = WIDTH
        for number, name in enumerate(_LAYERS):
            outputs = WIDTH << number
            setattr(self, name, nn.Sequential(Block(inputs, outputs, 2 if number else 1), Block(outputs, outputs, 1)))
            inputs = outputs
        self.register_buffer("mean", torch.tensor(_MEAN).view(3, 1, 1), persistent=False)
        self.register_buffer("deviation", torch.tensor(_DEVIATION).view(3, 1, 1), persistent=False)

    @property
    def layers(self) -> list[nn.Sequential]:
        """The layers, in their order."""
        return [getattr(self, name) for name in _LAYERS]

    def scaled(self, images: Tensor) -> Tensor:
        """Return (B, 3, height, width) of uint8 pictures (B, height, width, 3), as the weights expect them."""
        pictures = (images.permute(0, 3, 1, 2).float() / 255 - self.mean) / self.deviation
        return pictures.contiguous(memory_format=torch.channels_last)

    def maps(self, images: Tensor) -> Tensor:
        """Return the last maps (B, 512, height / 32, width / 32) of uint8 pictures (B, height, width, 3)."""
        stem = torch.relu(self.bn1(self.conv1(self.scaled(images))))
        maps = nn.functional.max_pool2d(stem, 3, stride=2, padding=1)
        for layer in self.layers:
            maps = layer(maps)
        return maps

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, 512) of uint8 pictures (B, height, width, 3)."""
        return self.maps(images).mean(dim=(2, 3))


def folded(network: ResNet18) -> ResNet18:
    """Return a network whose batch normalisations have gone into the convolutions before them: the same, and faster."""
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
