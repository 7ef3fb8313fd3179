"""A small pyramid of features: a network whose maps are fine enough for tiny things, and know what is around them.

Convolutions halve the maps down to a 32nd of the picture; on the way back each coarse map is enlarged and added to the
finer one before it (feature pyramids, Lin et al. 2017, https://arxiv.org/abs/1612.03144), to a quarter of the picture.
The same walk through the layers serves floats, the measuring of ranges, and whole numbers (:class:`IntegerPyramid`).
"""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import TypeVar

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from chmarl_pb.learning.networks.int8 import Convolution, Quantization, convolution, rounded

CELL = 4  # pixels of a picture along each side of a cell of the last maps

WIDTHS = (24, 48, 80, 112, 112)  # channels of the maps of a half, a quarter and so on of the picture
FEATURES = 48  # channels of the last maps

Maps = TypeVar("Maps")


class Layer(nn.Module):
    """A convolution with batch normalisation."""

    def __init__(self, inputs: int, outputs: int, kernel: int = 3, stride: int = 1):
        """Make the layers; the maps keep their size but for the stride."""
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, padding=kernel // 2, bias=False)
        self.norm: nn.Module = nn.BatchNorm2d(outputs)

    def forward(self, maps: Tensor, added: Tensor | None = None) -> Tensor:
        """Return the convolved maps, plus others where there are some, through a ReLU."""
        maps = self.norm(self.conv(maps))
        return torch.relu(maps if added is None else maps + added)

    def fold(self) -> None:
        """Let the normalisation go into the convolution: the same, and faster."""
        if isinstance(self.norm, nn.BatchNorm2d):
            self.conv, self.norm = fuse_conv_bn_eval(self.conv, self.norm), nn.Identity()


class Pyramid(nn.Module):
    """The network in floats."""

    def __init__(self) -> None:
        """Make the layers, with random weights."""
        super().__init__()
        self.stem = Layer(3, WIDTHS[0], 3, 2)
        self.halve, self.further = nn.ModuleList(), nn.ModuleList()
        for inputs, outputs in pairwise(WIDTHS):
            self.halve.append(Layer(inputs, outputs, 3, 2))
            self.further.append(Layer(outputs, outputs))
        self.beside = nn.ModuleList([Layer(width, FEATURES, 1) for width in WIDTHS[1:]])
        self.last = Layer(FEATURES, FEATURES)

    @property
    def layers(self) -> Iterator[Layer]:
        """The layers, in a fixed order."""
        return (part for part in self.modules() if isinstance(part, Layer))

    def walk(
        self, maps: Maps, convolve: Callable[[Layer, Maps, Maps | None], Maps], enlarge: Callable[[Maps, Maps], Maps]
    ) -> Maps:
        """Return the last maps of pictures.

        Args:
            maps: the pictures.
            convolve: (layer, maps, what is added to them) -> maps.
            enlarge: (maps, finer ones) -> maps as large as the finer ones.
        """
        maps, levels = convolve(self.stem, maps, None), []
        for halve, further in zip(self.halve, self.further, strict=True):
            maps = convolve(further, convolve(halve, maps, None), None)  # type: ignore[arg-type]
            levels.append(maps)
        maps = convolve(self.beside[-1], levels[-1], None)  # type: ignore[arg-type]
        for beside, finer in zip(reversed(self.beside[:-1]), reversed(levels[:-1]), strict=True):
            maps = convolve(beside, finer, enlarge(maps, finer))  # type: ignore[arg-type]
        return convolve(self.last, maps, None)

    def forward(self, images: Tensor) -> Tensor:
        """Return the last maps (B, FEATURES, rows, columns) of uint8 pictures (B, height, width, 3)."""
        pictures = (images.permute(0, 3, 1, 2).float() / 255).contiguous(memory_format=torch.channels_last)
        return self.walk(pictures, lambda layer, maps, added: layer(maps, added), enlarged)

    def fold(self) -> "Pyramid":
        """Let all normalisations go into the convolutions before them, and return the network."""
        for layer in self.layers:
            layer.fold()
        return self


def enlarged(maps: Tensor, finer: Tensor) -> Tensor:
    """Return maps of twice the size, cut to that of finer ones."""
    count, channels, height, width = maps.shape
    twice = maps.permute(0, 2, 3, 1).view(count, height, 1, width, 1, channels).expand(-1, -1, 2, -1, 2, -1)
    whole = twice.reshape(count, 2 * height, 2 * width, channels)[:, : finer.shape[2], : finer.shape[3]]
    return whole.permute(0, 3, 1, 2)


@torch.no_grad()
def pyramid_ranges(network: Pyramid, images: Tensor) -> Tensor:
    """Return how large the results of each layer become on some pictures.

    Args:
        network: folded.
        images: uint8 (B, height, width, 3).
    """
    found: dict[Layer, Tensor] = {}

    def note(layer: Layer, maps: Tensor, added: Tensor | None) -> Tensor:
        maps = layer(maps, added)
        found[layer] = maps.amax()
        return maps

    network.walk((images.permute(0, 3, 1, 2).float() / 255), note, enlarged)
    return torch.stack([found[layer] for layer in network.layers])


class IntegerPyramid:
    """The network in whole numbers, whose sums are exact, so the same in every batch and by any number of threads."""

    def __init__(self, network: Pyramid, ranges: Tensor):
        """Round the weights.

        Args:
            network: folded.
            ranges: see :func:`pyramid_ranges`.

        Raises:
            RuntimeError: there are more or fewer ranges than layers.
        """
        layers = list(network.layers)
        if len(layers) != len(ranges):
            raise RuntimeError(f"{len(layers)} ranges are needed, and there are {len(ranges)}")
        self._network, self._convolve = network, convolution()
        units = ranges.clamp(min=1e-6) / 255
        self._out = {layer: Quantization(float(unit)) for layer, unit in zip(layers, units, strict=True)}
        self._parts: dict[Layer, Convolution] = {}
        self.unit = self._out[network.last].unit  # of the last maps

    @torch.no_grad()
    def __call__(self, images: Tensor) -> Tensor:
        """Return the last maps (B, FEATURES, rows, columns), uint8 in steps of ``unit``, of uint8 pictures (B, ...)."""
        pictures = images.permute(0, 3, 1, 2).contiguous(memory_format=torch.channels_last)
        return self._network.walk((pictures, Quantization(1 / 255)), self._layer, _enlarged)[0]

    def _layer(
        self, layer: Layer, maps: tuple[Tensor, Quantization], added: tuple[Tensor, Quantization] | None
    ) -> tuple[Tensor, Quantization]:
        if layer not in self._parts:
            conv = layer.conv
            assert conv.bias is not None  # of the batch normalisation
            self._parts[layer] = rounded(conv.weight, conv.bias, conv.stride[0], int(conv.padding[0]), maps[1].unit)
        out = self._out[layer]
        return self._convolve(self._parts[layer], maps[0], out, added), out


def _enlarged(maps: tuple[Tensor, Quantization], finer: tuple[Tensor, Quantization]) -> tuple[Tensor, Quantization]:
    return enlarged(maps[0], finer[0]).contiguous(memory_format=torch.channels_last), maps[1]
