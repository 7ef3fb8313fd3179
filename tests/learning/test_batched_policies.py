"""Episodes that are played side by side equal those that are played one after the other."""

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import torch

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning import Config, train
from chmarl_pb.learning.config import FROZEN
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.networks.kept_features import FeatureEnv
from chmarl_pb.learning.networks.residual import ResNet18
from chmarl_pb.learning.policies.cloned import KIND, CloningConfig, make_actors
from chmarl_pb.learning.policies.side_by_side import play_side_by_side
from chmarl_pb.learning.rollouts.batched import IndependentPolicies, as_batched
from chmarl_pb.learning.runs.run import BEST
from chmarl_pb.learning.storage import checkpoint
from chmarl_pb.tasks.splits import load_tasks

if TYPE_CHECKING:
    from chmarl_pb.learning.sb3.config import AlgorithmName, PresetName

torch.set_num_threads(1)  # these networks are too small for more
SPLITS = ("val-seen", "val-unseen")
TINY = Config(
    episodes=8, envs=2, horizon=4, gradient_steps=4, batch_size=4, learning_starts=4, buffer_size=8, features=16,
    hidden=16,
        learning_rate=1e-2, validation_interval=8,
)  # fmt: skip


def assert_same(
    policy: str, observation: str = "scene_graph", splits: tuple[str, ...] = SPLITS, **options: Any
) -> None:
    """Compare all that results keep of three tasks of each split, in rollouts of two."""
    for split in splits:
        given = {"tasks": load_tasks(split)[::41][:3], "max_steps": 6, **options}
        alone = chmarl_pb.evaluate(policy, split, observation, workers=1, **given)
        together = chmarl_pb.evaluate(policy, split, observation, plays=partial(play_side_by_side, width=2), **given)
        assert together.episodes == alone.episodes and together.settings == alone.settings
        assert {len(episode.actions) for episode in alone.episodes} != {0}


def trained(
    folder: Path, wrap: Callable[[Any], Any] = lambda env: env, setting: Any = None, config: Any = TINY, **options: Any
) -> str:
    make = partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=4, **options)
    train(lambda: wrap(make()), "qmix", config, folder, lambda collector, agents: {"score": 0.0}, setting or {})
    return str(folder / BEST)


def test_value_factorisation(tmp_path: Path) -> None:
    assert_same(trained(tmp_path, setting={"messages": False}))


def test_value_factorisation_on_frozen_features(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    torch.save(ResNet18().state_dict(), tmp_path / "weights.pt")
    monkeypatch.setenv("CHMARL_RESNET18", str(tmp_path / "weights.pt"))
    frozen_encoder.cache_clear()
    encoder, config = frozen_encoder("resnet18"), replace(TINY, image_encoder="resnet18")
    wrap = partial(FeatureEnv, encoder=encoder)
    path = trained(tmp_path, wrap, {FROZEN: encoder.fingerprint}, config, observation="visual", image_size=32)
    assert_same(path, "visual", SPLITS[1:], image_size=32, max_steps=2)
    frozen_encoder.cache_clear()


@pytest.mark.parametrize(("centralized", "temperature"), [(False, 0.0), (True, 0.0), (False, 1.0)])
def test_cloning(centralized: bool, temperature: float, tmp_path: Path) -> None:
    config = CloningConfig(centralized=centralized, messages=False, features=16, hidden=16, temperature=temperature)
    env = chmarl_pb.parallel_env()
    torch.manual_seed(1)
    actors = make_actors(env, config, None)
    env.close()
    content = {"config": asdict(config), "actors": actors.state_dict(), "frozen": ""}
    checkpoint.save(tmp_path / BEST, KIND, content)
    assert_same(str(tmp_path / BEST))


@pytest.mark.parametrize(
    ("algo", "env_id", "preset"),
    [
        ("ppo", "CHMARL/SceneGraph-v0", "encoder"),
        ("ppo", "CHMARL/SceneGraphHumanoid-v0", "goal"),
        ("recurrent-ppo", "CHMARL/SceneGraph-v0", "encoder"),
        ("recurrent-ppo", "CHMARL/SceneGraphHumanoid-v0", "goal"),
        ("dqn", "CHMARL/SceneGraph-v0", "goal"),
        ("dqn", "CHMARL/SceneGraphHumanoid-v0", "encoder"),
    ],
)
def test_stable_baselines3(
    algo: "AlgorithmName", env_id: str, preset: "PresetName", tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("sb3_contrib")
    from chmarl_pb.learning.sb3.config import PRESETS
    from chmarl_pb.learning.sb3.config import Config as Sb3Config
    from chmarl_pb.learning.sb3.train import BEST, run

    small = {"learning_starts": 4} if algo == "dqn" else {"n_steps": 4}
    known = PRESETS[preset].settings[algo]
    settings: dict[str, Any] = {algo: {**known, **small, "batch_size": 4}}
    monkeypatch.setitem(PRESETS, preset, replace(PRESETS[preset], settings=settings))
    tiny: dict[str, Any] = {"steps": 8, "interval": 8, "envs": 1, "tasks": 2, "max_steps": 4, "features": 8}
    config = Sb3Config(algo, env_id, preset, messages=False, **tiny)
    run(config, tmp_path, workers=0)
    goal = PRESETS[preset].goal
    assert_same(str(tmp_path / BEST), splits=SPLITS[1:], messages=False, seeds=(0, 1), goal=goal)


def test_any_other_policy_plays_by_itself() -> None:
    assert_same("random")
    env = chmarl_pb.parallel_env()
    assert isinstance(as_batched([chmarl_pb.make_policy("search", env)]), IndependentPolicies)
    env.close()


def test_environments_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    closed = []
    close = HouseholdEnv.close

    def noted(env: HouseholdEnv) -> None:
        closed.append(env)
        close(env)

    monkeypatch.setattr(HouseholdEnv, "close", noted)
    plays = partial(play_side_by_side, width=3)
    chmarl_pb.evaluate("random", "val-unseen", seeds=(0,), tasks=load_tasks("val-unseen")[:2], max_steps=2, plays=plays)
    assert len(closed) == 2  # no more environments than tasks
