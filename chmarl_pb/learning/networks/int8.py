"""ResNet-18 in integers of 8 bits: several times as fast on a CPU, and exact.

Weights and intermediate results are whole numbers with a scale, and sums of whole numbers do not depend on their order:
the features of a picture are the same, to the last bit, whatever other pictures and however many threads there are. The
scales of the results come from the network's ranges on views of our homes (:func:`ranges_of`).
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property

import torch
from torch import Tensor, nn

from chmarl_pb.learning.networks.residual import Block, ResNet18

# Of weights, on each side of 0. With more, processors without VNNI would cut off sums of two products at 16 bits.
LEVELS = 63

RANGES = "ranges"  # key, in a file of weights, of what :func:`ranges_of` returns
LARGEST = ".largest"  # end of the key of the largest weight of each output, beside weights in whole numbers

_ONE = [1, 1]


@dataclass(frozen=True, eq=False)
class Convolution:
    """A convolution of whole numbers.

    Attributes:
        weight: (outputs, inputs, height, width) int8, a multiple of ``scales``.
        scales: (outputs) value of one step of a weight.
        bias: (outputs).
        stride: of both axes.
        padding: with zeros, of both axes.
        unit: value of one step of the inputs, which are uint8 with 0 at 0.
    """

    weight: Tensor
    scales: Tensor
    bias: Tensor
    stride: int
    padding: int
    unit: float
    _packed: dict[torch.Size, Tensor] = field(default_factory=dict, init=False, repr=False)

    def packed(self, maps: Tensor) -> Tensor:
        """Return the weights as oneDNN wants them for maps of this size; not told it, it may pack them at each call."""
        size = maps.shape[2:]
        if size not in self._packed:
            head = self.weight, self.scales, self.unit, 0, [self.stride] * 2, [self.padding] * 2, _ONE, 1
            self._packed[size] = torch.ops.onednn.qconv_prepack(*head, list(maps.shape))
        return self._packed[size]

    @cached_property
    def zeros(self) -> Tensor:
        """The weights' zero points."""
        return torch.zeros(len(self.scales), dtype=torch.long)


@dataclass(frozen=True)
class Quantization:
    """How uint8 stand for numbers: ``unit * (integer - zero)``."""

    unit: float
    zero: int = 0


#: (convolution, inputs, what the outputs stand for, what is added and what that stands for) -> outputs. Outputs with 0
#: at 0 are those of a ReLU.
Convolve = Callable[[Convolution, Tensor, Quantization, tuple[Tensor, Quantization] | None], Tensor]


def by_onednn(
    part: Convolution, maps: Tensor, out: Quantization, added: tuple[Tensor, Quantization] | None = None
) -> Tensor:
    """Convolve by oneDNN; what is added is overwritten."""
    two = [part.stride] * 2, [part.padding] * 2
    head = maps, part.unit, 0, part.packed(maps), part.scales, part.zeros
    tail = part.bias, *two, _ONE, 1, out.unit, out.zero, torch.uint8
    convolve = torch.ops.onednn.qconv2d_pointwise
    if added is not None:
        around, kind = added
        convolved: Tensor = convolve.binary(*head, around, *tail, kind.unit, kind.zero, "sum", 1.0, "relu", [], "")
    else:
        convolved = convolve(*head, *tail, "none" if out.zero else "relu", [], "")
    return convolved


def by_floats(
    part: Convolution, maps: Tensor, out: Quantization, added: tuple[Tensor, Quantization] | None = None
) -> Tensor:
    """Do the same in float32, which is slower but there everywhere; its whole numbers are exact to 2 ** 24.

    What they are multiplied with is rounded elsewhere than by oneDNN, so some results are one step more or less.
    """
    sums = nn.functional.conv2d(maps.float(), part.weight.float(), None, part.stride, part.padding)
    values = sums * (part.unit * part.scales).view(-1, 1, 1) + part.bias.view(-1, 1, 1)
    if added is not None:
        values = values + added[1].unit * (added[0].float() - added[1].zero)
    return (values / out.unit).round().add(out.zero).clamp(0, 255).to(torch.uint8)


@cache
def convolution() -> Convolve:
    """Return the fastest way to convolve that this machine's PyTorch has, tried on a small example."""
    numbers = torch.arange(2 * 4 * 6 * 6)
    maps = (numbers[:144] % 11).to(torch.uint8).view(1, 4, 6, 6).contiguous(memory_format=torch.channels_last)
    weight = (numbers % 7 - 3).to(torch.int8)[:288].view(2, 4, 6, 6)[..., :3, :3].contiguous()
    part = Convolution(weight, torch.tensor([0.5, 0.25]), torch.tensor([1.0, -2.0]), 1, 1, 0.5)
    for out, added in ((Quantization(0.5), (maps[:, :2], Quantization(0.25, 3))), (Quantization(1.0, 128), None)):
        own = None if added is None else (added[0].clone(memory_format=torch.channels_last), added[1])
        try:
            found = by_onednn(part, maps, out, own)
        except (AttributeError, NotImplementedError, RuntimeError, TypeError):
            return by_floats
        if not torch.equal(found, by_floats(part, maps, out, added)):
            return by_floats
    return by_onednn


class IntegerResNet18:
    """ResNet-18, or its beginning, in whole numbers."""

    def __init__(self, network: ResNet18, ranges: Tensor):
        """Round the weights of a network, whose batch normalisations are folded into its convolutions.

        Args:
            network: see :func:`chmarl_pb.learning.networks.residual.folded`.
            ranges: see :func:`ranges_of`.
        """
        self._convolve = convolution()
        mean, deviation = 255 * network.mean, 255 * network.deviation
        self._border = mean.flatten().round().to(torch.uint8)
        units = iter(_units(network, ranges))
        # The stem sees pictures as they are: brightness is scaled by its weights, and the border is what the mean is.
        weight = network.conv1.weight / deviation
        assert network.conv1.bias is not None  # of the batch normalisation
        bias = network.conv1.bias - (weight * mean).sum(dim=(1, 2, 3))
        self._stem = rounded(weight, bias, network.conv1.stride[0], 0, 1.0)
        self._first = out = next(units)
        self._blocks = []
        for block in blocks(network):
            around = None if block.downsample is None else (_of(block.downsample[0], out), next(units))
            middle = next(units)
            convolutions = _of(block.conv1, out), _of(block.conv2, middle)
            added, out = (around[1] if around else out), next(units)
            self._blocks.append((*convolutions, around and around[0], middle, added, out))
        self._out = out

    @torch.no_grad()
    def __call__(self, images: Tensor) -> Tensor:
        """Return (B, features) float32 of uint8 pictures (B, height, width, 3)."""
        return self._whole(images).float().mean(dim=(2, 3)) * self._out.unit

    @torch.no_grad()
    def maps(self, images: Tensor) -> Tensor:
        """Return the last maps, (B, features, height', width') float32, of uint8 pictures (B, height, width, 3)."""
        return self._whole(images).float() * self._out.unit

    def _whole(self, images: Tensor) -> Tensor:
        """Return the last maps as whole numbers."""
        convolve = self._convolve
        count, height, width, _ = images.shape
        framed = self._border.repeat(count, height + 6, width + 6, 1)
        framed[:, 3:-3, 3:-3] = images
        maps = _pooled(convolve(self._stem, framed.permute(0, 3, 1, 2), self._first, None))
        for first, second, way_around, middle, added, out in self._blocks:
            around = maps if way_around is None else convolve(way_around, maps, added, None)
            maps = convolve(second, convolve(first, maps, middle, None), out, (around, added))
        return maps


def blocks(network: ResNet18) -> Iterator[Block]:
    """Yield the blocks, two of each layer, in their order."""
    for layer in network.layers:
        yield from layer  # type: ignore[misc]


@torch.no_grad()
def ranges_of(network: ResNet18, images: Tensor) -> Tensor:
    """Return how large a network's intermediate results become on some pictures.

    They are those of the stem, and of each block: of the way around it, if that has a convolution, of its middle, and
    of its end.

    Args:
        network: see :func:`chmarl_pb.learning.networks.residual.folded`.
        images: uint8 (B, height, width, 3).
    """
    found = []

    def note(maps: Tensor) -> Tensor:
        found.append(maps.abs().amax())
        return maps

    maps = nn.functional.max_pool2d(note(torch.relu(network.conv1(network.scaled(images)))), 3, 2, 1)
    for block in blocks(network):
        around = maps if block.downsample is None else note(block.downsample(maps))
        middle = note(torch.relu(block.conv1(maps)))
        maps = note(torch.relu(block.conv2(middle) + around))
    return torch.stack(found)


def _units(network: ResNet18, ranges: Tensor) -> Iterator[Quantization]:
    """Yield what the integers of each range stand for; only those of the ways around have a sign."""
    signed = [False]
    for block in blocks(network):
        signed += [False, False] if block.downsample is None else [True, False, False]
    if len(ranges) != len(signed):
        raise RuntimeError(f"{len(signed)} ranges are needed, and there are {len(ranges)}")
    for largest, sign in zip(ranges.clamp(min=1e-6).tolist(), signed, strict=True):
        yield Quantization(largest / 127, 128) if sign else Quantization(largest / 255)


def _of(layer: nn.Module, inputs: Quantization) -> Convolution:
    assert isinstance(layer, nn.Conv2d) and layer.bias is not None
    return rounded(layer.weight, layer.bias, layer.stride[0], int(layer.padding[0]), inputs.unit)


def rounded(weight: Tensor, bias: Tensor, stride: int, padding: int, unit: float) -> Convolution:
    """Return a convolution in whole numbers; its attributes are those of :class:`Convolution`."""
    whole, largest = _whole(weight)
    return Convolution(whole, largest / LEVELS, bias.clone(), stride, padding, unit)


def _whole(weight: Tensor) -> tuple[Tensor, Tensor]:
    """Return weights in whole numbers, int8, and the largest of each output (outputs), which ``LEVELS`` stands for."""
    largest = weight.abs().amax(dim=(1, 2, 3)).clamp(min=1e-12)
    return (weight / (largest / LEVELS).view(-1, 1, 1, 1)).round().to(torch.int8).contiguous(), largest


def compact(network: ResNet18) -> dict[str, Tensor]:
    """Return the weights of a network with those of all but its first convolution in whole numbers.

    :class:`IntegerResNet18` computes the same of them, bit by bit, and they take a quarter of the room.

    Args:
        network: see :func:`chmarl_pb.learning.networks.residual.folded`.
    """
    kept = {name: value.clone().contiguous() for name, value in network.state_dict().items()}
    for name, part in network.named_modules():
        if isinstance(part, nn.Conv2d) and part is not network.conv1:
            kept[f"{name}.weight"], kept[f"{name}.weight{LARGEST}"] = _whole(part.weight.detach())
    return kept


def restored(weights: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return what :func:`compact` has made of weights in floats again, each output's largest weight exactly.

    Raises:
        RuntimeError: weights in whole numbers and the largest of their outputs do not go together.
    """
    floats = {name: value for name, value in weights.items() if not name.endswith(LARGEST)}
    whole = {name for name, value in floats.items() if value.dtype == torch.int8}
    if odd := whole ^ {name.removesuffix(LARGEST) for name in weights.keys() - floats.keys()}:
        raise RuntimeError(f"{min(odd)!r}: weights in whole numbers need the largest of each output beside them")
    for name in whole:
        largest = weights[name + LARGEST]
        if largest.dtype != torch.float32 or largest.shape != floats[name].shape[:1] or not _is_positive(largest):
            raise RuntimeError(f"{name + LARGEST!r}: not a positive number for each output")
        floats[name] = floats[name].float() / LEVELS * largest.view(-1, 1, 1, 1)
    return floats


def _is_positive(numbers: Tensor) -> bool:
    return bool((torch.isfinite(numbers) & (numbers > 0)).all())


def _pooled(maps: Tensor) -> Tensor:
    """Return the largest of 3 x 3 at every second place; torch's own takes no uint8 of this size."""
    height, width = maps.shape[2:]
    cells = nn.functional.pad(maps.permute(0, 2, 3, 1), (0, 0, 0, width % 2, 0, height % 2))
    for _ in range(2):  # rows, then columns
        even, odd = cells[:, ::2].contiguous(), cells[:, 1::2].contiguous()  # far faster than as they are
        largest = torch.maximum(even, odd)
        largest[:, 1:] = torch.maximum(largest[:, 1:].contiguous(), odd[:, :-1].contiguous())
        cells = largest.transpose(1, 2)
    return cells.contiguous().permute(0, 3, 1, 2)
