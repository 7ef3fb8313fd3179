"""ResNet-18 as a frozen encoder of pictures: 512 features.

Weights come from a file, by default the one that ``python -m training.pretrain`` makes, or from torchvision's own
loader. Its files of weights fit; torchvision itself is not needed.
"""

import hashlib
import os
import pickle
from collections import OrderedDict
from collections.abc import Callable
from functools import cache
from pathlib import Path

import torch
from torch import Tensor

from training.checkpoint import CheckpointError
from training.int8 import IntegerResNet18
from training.residual import FEATURES as FEATURES
from training.residual import ResNet18, folded

IMAGENET = "imagenet"  # name of torchvision's weights
RANGES = "ranges"  # key, in a file of weights, of what :func:`training.int8.ranges_of` returns
KEPT = 2**13  # pictures whose features are remembered: 12 MB
_TOGETHER = 16  # pictures that are computed at once: larger batches are not faster


class FrozenResNet18:
    """ResNet-18 that never learns; its features are rounded to float16, so that they can be kept on disk as they are.

    The features of a picture do not depend on the pictures that they are computed with. Those of pictures that came up
    lately are remembered. Weights with ranges are used in integers, others in float32, which is five times as slow.

    Attributes:
        fingerprint: sha256 of the weights.
        asked: number of pictures whose features were wanted.
        computed: number of those that were not remembered.
    """

    def __init__(self, weights: dict[str, Tensor], kept: int = KEPT):
        """Take weights with torchvision's names, and perhaps ranges; those of a last layer are left out.

        Args:
            weights: name -> weights.
            kept: number of pictures whose features are remembered.

        Raises:
            RuntimeError: they do not fit.
        """
        weights = {name: value for name, value in weights.items() if not name.startswith("fc.")}
        self.fingerprint = fingerprint(weights)
        self.asked, self.computed = 0, 0
        self._kept, self._known = kept, OrderedDict[bytes, Tensor]()
        self._network = _network(weights)

    @torch.no_grad()
    def __call__(self, images: Tensor) -> Tensor:
        """Return (B, 512) float16 of uint8 pictures (B, height, width, 3)."""
        keys = [hashlib.sha256(image).digest() for image in images.contiguous().numpy()]
        new = {key: row for row, key in enumerate(keys) if key not in self._known}
        for names, rows in zip(_chunks(list(new)), _chunks(list(new.values())), strict=True):
            features = self._network(images[rows]).half()
            self._known.update(zip(names, (row.clone() for row in features), strict=True))
        self.asked, self.computed = self.asked + len(keys), self.computed + len(new)
        for key in keys:
            self._known.move_to_end(key)
        found = torch.stack([self._known[key] for key in keys]) if keys else torch.empty(0, FEATURES).half()
        while len(self._known) > self._kept:
            self._known.popitem(last=False)
        return found


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


def _network(weights: dict[str, Tensor]) -> Callable[[Tensor], Tensor]:
    network = ResNet18()
    network.load_state_dict({name: value for name, value in weights.items() if name != RANGES})
    network = folded(network.eval().requires_grad_(False)).to(memory_format=torch.channels_last)
    if RANGES in weights:
        return IntegerResNet18(network, weights[RANGES])
    # Floats differ in the last bit with the size of the batch.
    return lambda images: torch.cat([network(image.unsqueeze(0)) for image in images])


def _chunks(values: list) -> list[list]:
    return [values[first : first + _TOGETHER] for first in range(0, len(values), _TOGETHER)]


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
