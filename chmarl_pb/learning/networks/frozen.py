"""Frozen networks that encode pictures: they never learn, and what they give can be kept on disk as it is.

Each is a file of weights, made by ``python -m training.pretrain``; those of ImageNet come from torchvision (ResNet-18)
or with a package (EfficientNet-Lite0).
"""

import hashlib
import os
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from chmarl_pb.errors import OptionError
from chmarl_pb.files import cache_folder
from chmarl_pb.learning.networks import detections, detector, efficientnet, resnet
from chmarl_pb.learning.networks.parts import FeatureEncoder, PartEncoder
from chmarl_pb.learning.storage.checkpoint import CheckpointError, check_whole, tensors_of
from chmarl_pb.policies.weights import ENCODER, checked_file, published, published_encoders

IMAGENET = "imagenet"  # name of torchvision's weights
BEFORE = "fingerprint"  # key, in a file of rounded weights, of what :func:`with_hash` adds
KEPT = 2**13  # pictures whose features are remembered: 12 MB
_BLANK = torch.zeros(1, 32, 32, 3, dtype=torch.uint8)  # a picture
_TOGETHER = 16  # pictures that are computed at once: larger batches are not faster

#: Named weights -> what computes the features of uint8 pictures (B, height, width, 3).
Build = Callable[[dict[str, Tensor]], Callable[[Tensor], Tensor]]


@dataclass(frozen=True)
class Kind:
    """One frozen network.

    Attributes:
        build: makes it from its weights.
        shapes: that the features of one picture may have, by the weights; the first is that of present ones.
        reader: makes the part of an agent's network that reads the features; called with their shape, the map of word
            vectors, if there is one, whether the pool is grounded, and whether instructions name colours.
    """

    build: Build
    shapes: tuple[tuple[int, ...], ...]
    reader: Callable[[tuple[int, ...], nn.Linear | None, bool, bool], PartEncoder]


FROZEN_ENCODERS: dict[str, Kind] = {
    "resnet18": Kind(resnet.build, (resnet.SHAPE,), lambda *_: FeatureEncoder()),
    "detector": Kind(detector.build, detections.SHAPES, detections.reader),
    efficientnet.NAME: Kind(
        efficientnet.build, (efficientnet.SHAPE,), lambda *_: FeatureEncoder(efficientnet.FEATURES)
    ),
}


class FrozenEncoder:
    """A network that never learns; its features are rounded to float16.

    The features of a picture do not depend on the pictures that they are computed with. Those of pictures that came up
    lately are remembered.

    Attributes:
        name: one of ``FROZEN_ENCODERS``.
        shape: of the features of one picture.
        fingerprint: of the weights, see :func:`weights_hash`.
        asked: number of pictures whose features were wanted.
        computed: number of those that were not remembered.
    """

    def __deepcopy__(self, memo: dict[int, Any]) -> "FrozenEncoder":
        """Return itself, as it never changes: networks that look through it are copied without it."""
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Let another process make it anew of its weights, as what oneDNN has packed cannot be sent."""
        return FrozenEncoder, self._made_of

    def __init__(self, name: str, weights: dict[str, Tensor], kept: int = KEPT):
        """Take weights; those of a last layer of torchvision's are left out.

        Args:
            name: one of ``FROZEN_ENCODERS``.
            weights: name -> weights.
            kept: number of pictures whose features are remembered.

        Raises:
            RuntimeError: they do not fit, or are no numbers.
        """
        for part, value in weights.items():
            if not value.isfinite().all():
                raise RuntimeError(f"{part!r} holds what is no number")
        weights = {part: value for part, value in weights.items() if not part.startswith("fc.")}
        kind = FROZEN_ENCODERS[name]
        self.name, self.fingerprint = name, weights_hash(weights)
        self._made_of = name, dict(weights), kept
        weights.pop(BEFORE, None)
        self.asked, self.computed = 0, 0
        self._kept, self._known = kept, OrderedDict[bytes, Tensor]()
        self._network = kind.build(weights)
        self.shape = tuple(self._network(_BLANK)[0].shape)

    @torch.no_grad()
    def __call__(self, images: Tensor) -> Tensor:
        """Return (B, *shape) float16 of uint8 pictures (B, height, width, 3)."""
        keys = [hashlib.sha256(image).digest() for image in images.contiguous().numpy()]
        new = {key: row for row, key in enumerate(keys) if key not in self._known}
        for names, rows in zip(_chunks(list(new)), _chunks(list(new.values())), strict=True):
            features = self._network(images[rows]).half()
            self._known.update(zip(names, (row.clone() for row in features), strict=True))
        self.asked, self.computed = self.asked + len(keys), self.computed + len(new)
        for key in keys:
            self._known.move_to_end(key)
        found = torch.stack([self._known[key] for key in keys]) if keys else torch.empty(0, *self.shape).half()
        while len(self._known) > self._kept:
            self._known.popitem(last=False)
        return found


def weights_file(name: str) -> Path:
    """Return an encoder's default file of weights.

    It is its package's; or the user's own, see :func:`own_file`; or if there is none, the one that is published.

    Raises:
        MissingExtraError: the package is not there.
        OptionError: the published file was changed.
    """
    if name == efficientnet.NAME:
        return efficientnet.weights_file()
    own, row = own_file(name), published(name, ENCODER)
    if row is None or own.exists() or os.environ.get(f"CHMARL_{name.upper()}"):
        return own
    return checked_file(row)


def own_file(name: str) -> Path:
    """Return the user's own file of an encoder's weights: the one that ``$CHMARL_NAME`` names, or in the cache.

    Where there is to be no cache, it is in ``~/.cache/chmarl_pb`` all the same, as it cannot be made again at once.
    """
    if chosen := os.environ.get(f"CHMARL_{name.upper()}"):
        return Path(chosen).expanduser()
    return (cache_folder() or Path.home() / ".cache" / "chmarl_pb") / f"{name}.pt"


@cache
def frozen_encoder(name: str, source: str | None = None) -> FrozenEncoder:
    """Return an encoder, loaded once in a process.

    Args:
        name: one of ``FROZEN_ENCODERS``.
        source: a file of weights; ``"imagenet"`` for torchvision's; None: :func:`weights_file`.

    Raises:
        CheckpointError: there are no such weights, or they do not fit.
    """
    source = source or str(weights_file(name))
    try:
        return FrozenEncoder(name, resnet.imagenet() if source == IMAGENET else read_weights(Path(source), name))
    except (RuntimeError, TypeError, LookupError) as error:
        raise CheckpointError(f"{source}: no weights of {name}: {str(error).splitlines()[0]}") from error


def trained_with(name: str, fingerprint: str, path: Path) -> FrozenEncoder:
    """Return an encoder, after checking that a policy was trained with the same one.

    Raises:
        CheckpointError: there are no weights, or others than those of the policy in a file.
    """
    if name not in FROZEN_ENCODERS:
        raise CheckpointError(f"{path}: image_encoder={name!r} is not frozen; use one of: {', '.join(FROZEN_ENCODERS)}")
    try:
        encoder = frozen_encoder(name)
        for row in published_encoders(name):
            if encoder.fingerprint != fingerprint:
                encoder = frozen_encoder(name, str(checked_file(row)))  # what published policies see by
    except OptionError as error:  # a published file is missing or was changed; the policy's own is whole
        raise CheckpointError(str(error)) from error
    if encoder.fingerprint != fingerprint:
        raise CheckpointError(
            f"{path}: was trained with other weights of {name} (fingerprint {fingerprint[:12]}); "
            + ("its package has changed" if name == efficientnet.NAME else f"name their file by CHMARL_{name.upper()}")
        )
    return encoder


def weights_hash(weights: dict[str, Tensor]) -> str:
    """Return the sha256 of named tensors; of weights that were rounded, that of before, as they do the same.

    Raises:
        RuntimeError: the weights have changed since they were rounded.
    """
    if BEFORE not in weights:
        return _sha256(weights).hex()
    own = _sha256({name: value for name, value in weights.items() if name != BEFORE})
    kept = weights[BEFORE].numpy().tobytes()
    if len(kept) != 2 * len(own) or kept[len(own) :] != own:
        raise RuntimeError(f"{BEFORE!r}: the weights have changed since they were rounded")
    return kept[: len(own)].hex()


def with_hash(weights: dict[str, Tensor], before: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return rounded weights with their fingerprint before, and a hash by which other weights are told from them."""
    both = _sha256(before) + _sha256(weights)
    return {**weights, BEFORE: torch.tensor(list(both), dtype=torch.uint8)}


def _sha256(weights: dict[str, Tensor]) -> bytes:
    digest = hashlib.sha256()
    for name, value in sorted(weights.items()):
        digest.update(name.encode() + value.contiguous().numpy().tobytes())
    return digest.digest()


def _chunks(values: list[Any]) -> list[list[Any]]:
    return [values[first : first + _TOGETHER] for first in range(0, len(values), _TOGETHER)]


def read_weights(path: Path, name: str) -> dict[str, Tensor]:
    """Return the weights in a file.

    Args:
        path: of the file.
        name: of what they are, one of ``FROZEN_ENCODERS``.

    Raises:
        CheckpointError: it is missing, damaged or another.
    """
    if not path.exists():
        if name == efficientnet.NAME:
            raise CheckpointError(f"{path}: no weights of {name}; install its package again")
        raise CheckpointError(
            f"{path}: no weights of {name}; make them by `python -m training.pretrain --network {name}`, name another "
            f"file by CHMARL_{name.upper()}, or use image_encoder='cnn', which needs none"
        )
    check_whole(path)
    if name == efficientnet.NAME:
        efficientnet.check(path)
    weights = tensors_of(path, path)
    if not isinstance(weights, dict) or not all(
        isinstance(name, str) and isinstance(value, Tensor) for name, value in weights.items()
    ):
        raise CheckpointError(f"{path}: not a file of weights: a dict of tensors is needed")
    return OrderedDict(weights)
