"""Checkpoints as policies of the benchmark."""

import importlib
import sys
import warnings
from contextlib import closing
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import chmarl_pb
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.files import file_hash
from chmarl_pb.learning import Config, train
from chmarl_pb.learning.algorithms.registry import find_algorithm
from chmarl_pb.learning.config import FROZEN
from chmarl_pb.learning.networks.encoders import ENCODERS
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.networks.kept_features import FeatureEnv
from chmarl_pb.learning.networks.residual import ResNet18
from chmarl_pb.learning.policies.checks import check_size, silenced
from chmarl_pb.learning.policies.learned import ValuePolicies, ValuePolicy
from chmarl_pb.learning.policies.load import load_policy
from chmarl_pb.learning.rollouts.batched import BatchOfOne
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load, save
from chmarl_pb.named import import_named
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.sensing.sensors import SceneGraphSensor
from chmarl_pb.tasks.advisers import CRITICS, SpokenAdviser
from chmarl_pb.tasks.kinds import Rearrange
from chmarl_pb.tasks.messages import Board
from chmarl_pb.tasks.unreliable import NoisyBoard
from training.score import score

torch.set_num_threads(1)  # these networks are too small for more
TINY = Config(
    episodes=4,
    envs=1,
    horizon=4,
    gradient_steps=1,
    batch_size=2,
    learning_starts=2,
    buffer_size=4,
    features=8,
    hidden=8,
)


def make_env(**options: Any) -> HouseholdEnv:
    return chmarl_pb.parallel_env(split="val-unseen", max_steps=4, **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    train(make_env, "qmix", TINY, folder, setting={"messages": False, "feedback": True})
    return folder


@pytest.fixture(scope="module")
def env() -> Any:
    env = make_env()
    yield env
    env.close()


def test_checkpoint_plays_the_same_episode_again(folder: Path, env: HouseholdEnv) -> None:
    source = find_policy(str(folder / BEST))
    assert source.deterministic and source.sha256
    policy = source.make(env)
    first = chmarl_pb.rollout(env, policy, seed=1)
    chmarl_pb.rollout(env, policy, seed=2)
    again = chmarl_pb.rollout(env, policy, seed=1)
    assert first.actions == again.actions and len(first) == 4


def test_silenced_keys_change_nothing(folder: Path, env: HouseholdEnv) -> None:
    observations, infos = env.reset(seed=3)
    known = {name: {**seen, "messages": 1 - seen["messages"]} for name, seen in observations.items()}
    policy = load_policy(folder / BEST)(env)
    assert isinstance(policy, BatchOfOne) and isinstance(policy.batched, ValuePolicy)
    assert policy.batched.silenced == ("messages",) == silenced({"messages": False})
    chosen = []
    for seen in (observations, known):
        policy.reset(0)
        chosen.append(policy.act(seen, infos))
    assert chosen[0] == chosen[1]
    assert any(np.any(seen["messages"]) for seen in known.values())


def test_pictures_become_features_of_the_same_frozen_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def use(seed: int) -> str:
        torch.manual_seed(seed)
        torch.save(ResNet18().state_dict(), tmp_path / "weights.pt")
        frozen_encoder.cache_clear()
        return frozen_encoder("resnet18").fingerprint

    monkeypatch.setenv("CHMARL_RESNET18", str(tmp_path / "weights.pt"))
    frozen = use(0)
    options = {"observation": "visual", "image_size": 32}
    config, encoder = replace(TINY, image_encoder="resnet18"), frozen_encoder("resnet18")
    train(lambda: FeatureEnv(make_env(**options), encoder), "vdn", config, tmp_path, setting={FROZEN: frozen})
    env = make_env(**options)
    assert len(chmarl_pb.rollout(env, load_policy(tmp_path / BEST)(env), seed=1)) == 4
    use(1)
    with pytest.raises(CheckpointError, match="other weights of resnet18"):
        load_policy(tmp_path / BEST)(env)
    env.close()
    frozen_encoder.cache_clear()


def test_unfit_checkpoints_are_refused(folder: Path, env: HouseholdEnv, tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"kind 'run', which is no policy; use best\.pt"):
        load_policy(folder / LAST)
    other = chmarl_pb.parallel_env("visual", split="val-unseen", image_size=32)
    with pytest.raises(CheckpointError, match="observations"):
        load_policy(folder / BEST)(other)
    other.close()
    save(tmp_path / "x.pt", "other", {})
    with pytest.raises(CheckpointError, match="kind 'other'"):
        load_policy(tmp_path / "x.pt")


def flat(space: Any, size: int, image_encoder: str, graph_pool: str) -> torch.nn.Module:
    """Return an encoder of one's own, which keeps the dimensions that come before an observation's own."""

    class Flat(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.layer = torch.nn.Linear(space["self"].shape[0], size)

        def forward(self, observation: Any) -> torch.Tensor:
            found: torch.Tensor = self.layer(observation["self"])
            return found

    return Flat()


def narrow(space: Any, size: int, image_encoder: str, graph_pool: str) -> torch.nn.Module:
    return flat(space, size - 1, image_encoder, graph_pool)


def test_code_that_a_checkpoint_names_is_run_for_who_trusts_it_alone(
    env: HouseholdEnv, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"{__name__}:flat"
    train(make_env, "qmix", replace(TINY, encoder=name), tmp_path)
    with pytest.raises(CheckpointError, match=rf"{BEST}: encoder='{name}' is code, .* set CHMARL_TRUSTED={name}$"):
        load_policy(tmp_path / BEST)(env)
    monkeypatch.setenv("CHMARL_TRUSTED", f"a:b,{name}")
    policy = load_policy(tmp_path / BEST)(env)
    observations, infos = env.reset(seed=0)
    policy.reset(0)
    assert policy.act(observations, infos).keys() == {"humanoid", "drone"}


class LateBoard(Board):
    """A channel of one's own."""

    def __init__(self, share: float = 0.5):
        self.share = share


class Mute(SpokenAdviser):
    """An adviser of one's own."""


class Chore(Rearrange):
    """A kind of tasks of one's own."""


class Graphs(SceneGraphSensor):
    """A sensor of one's own with the keys of another."""


OWN_PARTS: dict[str, Any] = {
    "messages": LateBoard(), "feedback": Mute(CRITICS["paper"]), "task": Chore(), "observation": Graphs()
}  # fmt: skip


def test_own_parts_of_a_training_that_an_environment_lacks_are_named(tmp_path: Path) -> None:
    train(partial(make_env, **OWN_PARTS), "qmix", TINY, tmp_path)
    given: dict[str, Any] = {"workers": 1, "tasks": ["val-unseen-000"], "seeds": [0], "max_steps": 2}
    words = [f"messages={__name__}:LateBoard", f"feedback={__name__}:Mute", f"task={__name__}:Chore", "observation=a"]
    with pytest.warns(match=f"{BEST}: was trained with {' and '.join(words)} sensor of your own, and") as said:
        chmarl_pb.evaluate(tmp_path / BEST, "val-unseen", **given)
    assert sum("was trained with" in str(one.message) for one in said) == 1
    for others in ({"messages": Board()}, {"messages": NoisyBoard()}, {"messages": False}):
        with (
            pytest.warns(UserWarning, match=rf"trained with {words[0]}, and this environment has other"),
            closing(make_env(**{**OWN_PARTS, **others})) as env,
        ):
            load_policy(tmp_path / BEST)(env)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chmarl_pb.evaluate(tmp_path / BEST, "val-unseen", **{**given, **OWN_PARTS, "messages": LateBoard(0.1)})


def test_without_own_parts_nothing_is_said(folder: Path, env: HouseholdEnv) -> None:
    with warnings.catch_warnings(), closing(make_env(messages=LateBoard())) as own:
        warnings.simplefilter("error")
        load_policy(folder / BEST)(env)
        load_policy(folder / BEST)(own)


OWN_CODE = """
import torch
from chmarl_pb.learning.algorithms.registry import Algorithm
from chmarl_pb.learning.algorithms.value import Config, ValueLearner


class Encoder(torch.nn.Module):
    def __init__(self, space, size, image_encoder, graph_pool):
        super().__init__()
        self.layer = torch.nn.Linear(space["self"].shape[0], size)

    def forward(self, observation):
        return self.layer(observation["self"]) * FACTOR


class OwnConfig(Config):
    pass


OWN = Algorithm(ValueLearner, OwnConfig)
"""


def written(folder: Path, factor: int) -> None:
    """Write the module of one's own, to be imported anew."""
    (folder / "own_code.py").write_text(OWN_CODE.replace("FACTOR", str(factor)))
    importlib.invalidate_caches()
    sys.modules.pop("own_code", None)


@pytest.mark.parametrize(
    ("algorithm", "given"),
    [
        ("qmix", {"encoder": "own_code:Encoder"}), ("own_code:OWN", {"mixer": "qmix"}),
        ("qmix", {"encoder": "registered"}),
    ],
)  # fmt: skip
def test_code_that_a_checkpoint_names_tells_it_apart(
    algorithm: str, given: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setenv("CHMARL_TRUSTED", "own_code:Encoder,own_code:OWN")

    def hashed(factor: int) -> str | None:
        written(tmp_path, factor)
        monkeypatch.setitem(ENCODERS, "registered", import_named("own_code:Encoder"))
        return find_policy(tmp_path / "run" / BEST).sha256

    written(tmp_path, 1)
    monkeypatch.setitem(ENCODERS, "registered", import_named("own_code:Encoder"))
    config = find_algorithm(algorithm).config(**{**asdict(TINY), **given})
    train(make_env, algorithm, config, tmp_path / "run")
    first, other, again = (hashed(factor) for factor in (1, 5, 1))
    assert first == again and len({first, other, file_hash(tmp_path / "run" / BEST)}) == 3
    monkeypatch.delenv("CHMARL_TRUSTED")
    if given.get("encoder") != "registered":
        with pytest.raises(CheckpointError, match="is code, which would be run; if you trust it, set CHMARL_TRUSTED"):
            find_policy(tmp_path / "run" / BEST)


def test_a_checkpoint_that_names_no_code_is_told_by_its_file(folder: Path) -> None:
    assert find_policy(folder / BEST).sha256 == file_hash(folder / BEST)
    assert ValuePolicies(folder / BEST).code == ()


def test_an_encoder_gives_as_many_numbers_as_it_is_asked_for() -> None:
    with pytest.raises(ValueError, match=r"the encoder Flat gives \(.*7\); it is to give \(\.\.\., 8\)"):
        train(make_env, "qmix", replace(TINY, encoder=f"{__name__}:narrow"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"observation": "visual"}, r"those of the humanoid with edges, node_.*; without image; give the options"),
        ({"goal": True}, r"those of the humanoid without goal; give"),
        ({"robots": ("humanoid",)}, r"of the robots humanoid, drone, not humanoid$"),
    ],
)
def test_other_observations_are_named(folder: Path, options: dict[str, Any], words: str) -> None:
    other = make_env(**options)
    with pytest.raises(CheckpointError, match=f"was trained with other observations, {words}"):
        load_policy(folder / BEST)(other)
    other.close()


def test_a_run_goes_on_where_it_was_trained(tmp_path: Path, small_home: Path) -> None:
    """Also if nobody says so: environments of the benchmark tell their homes, robots and rules."""
    path = tmp_path / "run"
    make = partial(make_env, home=small_home)
    train(make, "qmix", TINY, path)
    train(make, "qmix", TINY, path)
    for options, words in (
        ({"messages": False}, "messages=True, not False"), ({"feedback": "planner"}, "feedback=True, not 'planner'"),
        ({"home": "home_6"}, "home_sha256="),
    ):  # fmt: skip
        with pytest.raises(CheckpointError, match=words):
            train(partial(make, **options), "qmix", TINY, path)
    small_home.write_text(small_home.read_text().replace("desk_1", "bench_1"))
    with pytest.raises(CheckpointError, match="home_sha256="):
        train(make, "qmix", TINY, path)


@pytest.mark.parametrize(
    "options",
    [
        {"messages": False}, {"goal": True}, {"lookalikes": True, "templates": 2},
        {"track": "grounded", "split": "val-unseen", "max_steps": 3},
    ],
    ids=str,
)  # fmt: skip
def test_a_run_without_a_setting_is_evaluated_by_its_rules(tmp_path: Path, options: dict[str, Any]) -> None:
    train(partial(chmarl_pb.parallel_env, **{"split": "val-unseen", "max_steps": 3, **options}), "vdn", TINY, tmp_path)
    task = chmarl_pb.load_tasks("val-unseen")[:1]
    played = chmarl_pb.evaluate(tmp_path / BEST, "val-unseen", tasks=task, seeds=[0], workers=1)
    own = {name: value for name, value in options.items() if name not in ("split", "messages")}
    assert played.settings["options"].items() >= own.items()
    asked = Options(**options)
    quiet = tuple(name for name in ("messages", "feedback") if not getattr(asked, name))
    assert silenced(load(tmp_path / BEST, "value")["setting"]) == quiet


def test_a_run_without_a_setting_keeps_its_rules(tmp_path: Path) -> None:
    make = partial(make_env, lookalikes=True)
    train(make, "vdn", TINY, tmp_path)
    with pytest.raises(CheckpointError, match="templates"):
        train(partial(make, templates=2), "vdn", TINY, tmp_path)


def test_frozen_features_are_told_without_a_setting(tmp_path: Path) -> None:
    encoder = frozen_encoder("resnet18")
    small = replace(TINY, image_encoder="resnet18")
    train(lambda: FeatureEnv(make_env(observation="visual"), encoder), "vdn", small, tmp_path)
    assert load(tmp_path / BEST, "value")["setting"][FROZEN] == encoder.fingerprint


def test_pictures_of_another_size_are_refused(env: HouseholdEnv) -> None:
    visual = chmarl_pb.parallel_env("visual", split="val-unseen", image_size=32)
    check_size(visual, {"image_size": 32}, Path("best.pt"))
    check_size(env, {"image_size": 32}, Path("best.pt"))  # who sees graphs does not actor
    with pytest.raises(CheckpointError, match=r"best\.pt: was trained with pictures of 64 pixels, not 32"):
        check_size(visual, {"image_size": 64}, Path("best.pt"))
    visual.close()


@pytest.mark.parametrize(
    ("change", "words"),
    [({"algorithm": "sarsa"}, "algorithm='sarsa' is not known.*import what adds it"),
     ({"algorithm": "own:SARSA"}, "algorithm='own:SARSA' is code, which would be run"),
     ({"config": {"cleverness": 9}}, "its settings are of another version")],
)  # fmt: skip
def test_checkpoints_of_another_version_are_refused(
    folder: Path, env: HouseholdEnv, tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    save(tmp_path / "x.pt", "value", load(folder / BEST) | change)
    with pytest.raises(CheckpointError, match=rf"x\.pt: {words}"):
        load_policy(tmp_path / "x.pt")(env)


def test_scores_are_of_weights(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"\.pt or \.zip"):
        score(tmp_path / "weights.bin", "scene_graph", tmp_path / "scores")
    assert not (tmp_path / "scores").exists()
