"""Policies see by the frozen encoder that they were trained with, whichever is their user's own by then."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
import torch

import chmarl_pb
from chmarl_pb.assets import WEIGHTS_DIR
from chmarl_pb.learning.config import FROZEN
from chmarl_pb.learning.networks.frozen import FrozenEncoder, frozen_encoder
from chmarl_pb.learning.policies.cloned import KIND, CloningConfig, encoder_of, make_actors, weights_of
from chmarl_pb.learning.storage import checkpoint

DETECTOR, EARLIER = WEIGHTS_DIR / "detector.pt", WEIGHTS_DIR / "detector-things.pt"


@pytest.fixture
def used(monkeypatch: pytest.MonkeyPatch) -> Iterator[set[str]]:
    """Fingerprints of the encoders that see from now on."""
    found = set[str]()
    see = FrozenEncoder.__call__

    def noting(encoder: FrozenEncoder, images: torch.Tensor) -> torch.Tensor:
        found.add(encoder.fingerprint)
        return see(encoder, images)

    monkeypatch.setattr(FrozenEncoder, "__call__", noting)
    frozen_encoder.cache_clear()
    yield found
    frozen_encoder.cache_clear()


def act_once(path: Path, **options: Any) -> None:
    with closing(chmarl_pb.parallel_env("visual", split="val-unseen", **options)) as env:
        policy = chmarl_pb.load_policy(path).make(env)
        observations, infos = env.reset(seed=0)
        policy.reset(0)
        policy.act(observations, infos)


def use(monkeypatch: pytest.MonkeyPatch, file: Path) -> None:
    monkeypatch.setenv("CHMARL_DETECTOR", str(file))
    frozen_encoder.cache_clear()


@pytest.mark.parametrize(("training", "later"), [(DETECTOR, EARLIER), (EARLIER, DETECTOR)])
def test_clones(training: Path, later: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, used: set[str]) -> None:
    use(monkeypatch, training)
    config = CloningConfig(observation="visual", image_encoder="detector", features=8, hidden=8)
    with closing(chmarl_pb.parallel_env("visual")) as env:
        actors, fingerprint = make_actors(env, config, encoder_of(config)), weights_of(config)
    content = {"config": asdict(config), FROZEN: fingerprint, "actors": actors.state_dict()}
    checkpoint.save(tmp_path / "best.pt", KIND, content)
    use(monkeypatch, later)
    act_once(tmp_path / "best.pt")
    assert used == {fingerprint}


@pytest.mark.parametrize(("training", "later"), [(DETECTOR, EARLIER), (EARLIER, DETECTOR)])
def test_stable_baselines(
    training: Path, later: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, used: set[str]
) -> None:
    pytest.importorskip("stable_baselines3")
    from chmarl_pb.learning.sb3.config import PRESETS, Config
    from chmarl_pb.learning.sb3.train import run

    use(monkeypatch, training)
    monkeypatch.setitem(PRESETS, "encoder", replace(PRESETS["encoder"], settings={"a2c": {"n_steps": 4}}))
    tiny: dict[str, Any] = {"steps": 8, "interval": 8, "tasks": 2, "max_steps": 4, "features": 8, "envs": 1}
    config = Config("a2c", "CHMARL/VisualHumanoid-v0", "encoder", image_encoder="detector", **tiny)
    run(config, tmp_path / "run", workers=0)
    fingerprint = frozen_encoder("detector").fingerprint
    use(monkeypatch, later)
    used.clear()
    act_once(tmp_path / "run" / "best.zip")
    assert used == {fingerprint}
