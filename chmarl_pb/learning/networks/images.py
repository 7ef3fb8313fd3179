"""Pictures: a small network that learns, or a frozen ResNet-18 with a linear layer."""

from collections.abc import Callable
from itertools import pairwise

from torch import Tensor, nn

from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.networks.parts import FeatureEncoder, PartEncoder, flattened

IMAGE = 256  # features of a picture


class ConvEncoder(PartEncoder):
    """A small convolutional network that is trained with all the rest; for pictures of any size from 32 pixels."""

    size = IMAGE

    def __init__(self, shape: tuple[int, ...]):
        """Make the layers for pictures (height, width, channels) or (channels, height, width)."""
        super().__init__()
        self.shape, self.channels_first = shape, shape[0] < min(shape[1:])
        widths = (shape[0] if self.channels_first else shape[2], 32, 48, 64, 64)
        layers: list[nn.Module] = []
        for number, (inputs, outputs) in enumerate(pairwise(widths)):
            layers += [nn.Conv2d(inputs, outputs, 5 if number == 0 else 3, stride=2, padding=2 if number == 0 else 1)]
            layers += [nn.ReLU()]
        # 4 x 4 cells keep where things are.
        self.layers = nn.Sequential(
            *layers, nn.AdaptiveAvgPool2d(4), nn.Flatten(), nn.Linear(widths[-1] * 16, IMAGE), nn.ReLU()
        )

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, IMAGE) from uint8 pictures (B, *shape)."""
        pictures = flattened(images, self.shape)
        if not self.channels_first:
            pictures = pictures.permute(0, 3, 1, 2)
        features: Tensor = self.layers(pictures.float() / 255 - 0.5)
        return features


class PretrainedEncoder(FeatureEncoder):
    """ResNet-18, which does not learn, and a linear layer; see ``kept_features`` for what is faster.

    The frozen weights are not among the module's parameters; its state holds their fingerprint, and fits no others.
    """

    def __init__(self, shape: tuple[int, ...]):
        """Load the frozen weights for pictures (height, width, 3) or (3, height, width)."""
        super().__init__()
        self.shape, self.channels_first = shape, shape[0] < min(shape[1:])
        self.resnet = frozen_encoder("resnet18")

    def forward(self, images: Tensor) -> Tensor:
        """Return (B, 512) from uint8 pictures (B, *shape)."""
        pictures = flattened(images, self.shape)
        features = self.resnet((pictures.permute(0, 2, 3, 1) if self.channels_first else pictures).cpu())
        return super().forward(features.to(images.device))

    def get_extra_state(self) -> str:
        """Return the fingerprint of the frozen weights."""
        return self.resnet.fingerprint

    def set_extra_state(self, state: str) -> None:
        """Check that the frozen weights are those that the module was trained with."""
        if state != self.resnet.fingerprint:
            raise RuntimeError("trained with other weights of ResNet-18; name their file by CHMARL_RESNET18.")


#: Name -> encoder of pictures; made from their shape.
IMAGE_ENCODERS: dict[str, Callable[[tuple[int, ...]], PartEncoder]] = {
    "cnn": ConvEncoder,
    "resnet18": PretrainedEncoder,
}
