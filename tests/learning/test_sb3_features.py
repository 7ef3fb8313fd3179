"""Features extractors for Stable-Baselines3: what they read, and wrappers' traces that they refuse with a sentence."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

pytest.importorskip("stable_baselines3")
import stable_baselines3 as sb3
import torch
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.preprocessing import preprocess_obs
from stable_baselines3.common.vec_env import VecFrameStack, VecNormalize, VecTransposeImage

import chmarl_pb
from chmarl_pb.errors import OptionError
from chmarl_pb.learning.networks import DictEncoder, build_encoder
from chmarl_pb.learning.networks.numbers import GoalEncoder
from chmarl_pb.learning.observation_keys import are_of_all
from chmarl_pb.learning.sb3 import GoalFeatures, HouseholdFeatures, policy_of

torch.set_num_threads(1)
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")
HUMANOID, JOINT, PICTURES = "CHMARL/SceneGraphHumanoid-v0", "CHMARL/SceneGraph-v0", "CHMARL/VisualHumanoid-v0"
OPTIONS: dict[str, Any] = {"split": "val-unseen", "image_size": 36, "max_steps": 3, "goal": True}
FEATURES = pytest.mark.parametrize("features", [HouseholdFeatures, GoalFeatures])


def vec(env_id: str = HUMANOID, wrap: Callable[[Any], Any] = lambda env: env, **options: Any) -> Any:
    """Return one environment as SB3 has it."""
    return wrap(chmarl_pb.sb3_vec_env(1, env_id, 0, **{**OPTIONS, **options}))


def wrapped(env_id: str, wrap: Callable[[Any], Any]) -> Any:
    """Return one environment with a wrapper of Gymnasium."""
    return chmarl_pb.sb3_vec_env(1, lambda: wrap(gymnasium.make(env_id, **OPTIONS)), 0)


def ppo(env: Any, features: Any, normalize_images: bool = False, **network: Any) -> Any:
    small = {"features_dim": 8} if features is HouseholdFeatures else {}
    kwargs = {"features_extractor_class": features, "features_extractor_kwargs": small | network}
    kwargs |= {"normalize_images": normalize_images}
    return sb3.PPO("MultiInputPolicy", env, policy_kwargs=kwargs, n_steps=4, batch_size=4, n_epochs=1, device="cpu")


# What they read


def test_goal_features_are_the_numbers_alone() -> None:
    env = gymnasium.make(JOINT, **OPTIONS)
    seen, _ = env.reset(seed=0)
    assert isinstance(env.observation_space, spaces.Dict)
    batch = {key: torch.tensor(value)[None] for key, value in seen.items()}
    batch["drone_goal"] = torch.tensor([[5, 7, 1, 0]])
    features = GoalFeatures(env.observation_space)
    row = features(batch)[0]
    wanted = [[1, 0], seen["drone_messages"].ravel(), seen["drone_self"], seen["humanoid_goal"][2:]]
    wanted += [seen["humanoid_messages"].ravel(), seen["humanoid_self"]]
    assert row.tolist() == pytest.approx(np.concatenate(wanted).tolist()) and features.features_dim == len(row) == 36
    batch["drone_goal"] = torch.tensor([[50, 60, 1, 0]])  # other ids, the same bits
    assert torch.equal(features(batch)[0], row)
    env.close()


def test_numbers_go_past_the_encoder() -> None:
    env = gymnasium.make(HUMANOID, **OPTIONS)
    seen, _ = env.reset(seed=0)
    assert isinstance(env.observation_space, spaces.Dict)
    batch = {key: torch.tensor(value)[None] for key, value in seen.items()}
    plain, past = (HouseholdFeatures(env.observation_space, 8, numbers_past=on) for on in (False, True))
    past.encoder.load_state_dict(plain.encoder.state_dict())  # nothing about the encoder is another
    numbers = GoalFeatures(env.observation_space)(batch)
    assert torch.equal(past(batch), torch.cat([plain(batch), numbers], dim=1))
    assert past.features_dim == plain.features_dim + 18
    env.close()


def test_classes_of_the_goal_are_embedded() -> None:
    env = gymnasium.make(HUMANOID, **OPTIONS)
    torch.manual_seed(0)  # few weights of a ReLU may all be dead by chance
    encoder = build_encoder(env.observation_space, 32)
    batch = {key: torch.tensor(value)[None] for key, value in env.reset(seed=0)[0].items()}
    one, other = ({**batch, "goal": torch.tensor([[number, 50, 0, 0]])} for number in (3, 4))
    assert isinstance(encoder, DictEncoder) and not torch.equal(encoder(one), encoder(other))
    encoder(one).sum().backward()
    part = encoder.parts[encoder.keys.index("goal")]
    assert isinstance(part, GoalEncoder) and part.classes.weight.grad is not None
    assert part.classes.weight.grad.abs().sum(dim=1).nonzero().flatten().tolist() == [3, 50]
    env.close()


def test_pictures_may_have_their_channels_first() -> None:
    env = vec(PICTURES)
    torch.manual_seed(0)
    last = HouseholdFeatures(env.observation_space, 32)
    channels_first = VecTransposeImage(env)
    assert isinstance(channels_first.observation_space, spaces.Dict)
    first = HouseholdFeatures(channels_first.observation_space, 32)
    first.load_state_dict(last.state_dict())
    seen = env.reset()
    turned = channels_first.transpose_observations(dict(seen))
    assert isinstance(turned, dict) and turned["image"].shape == (1, 3, 36, 36)
    features = [
        extract(preprocess_obs({key: torch.tensor(value) for key, value in part.items()}, space, False))
        for extract, part, space in (
            (last, seen, last._observation_space),
            (first, turned, first._observation_space),
        )
    ]
    torch.testing.assert_close(*features)  # sums in another order
    assert features[0].any()
    env.close()


# What they refuse


@FEATURES
@pytest.mark.parametrize("env_id", [HUMANOID, JOINT, PICTURES])
def test_stacked_observations(features: Any, env_id: str) -> None:
    env = vec(env_id, partial(VecFrameStack, n_stack=4))
    with pytest.raises(ValueError, match=r"has the shape .* one observation at a time; leave out VecFrameStack"):
        ppo(env, features)
    env.close()


@FEATURES
def test_frames_of_gymnasium(features: Any) -> None:
    env = wrapped(HUMANOID, partial(gymnasium.wrappers.FrameStackObservation, stack_size=4))
    with pytest.raises(ValueError, match="one observation at a time"):
        ppo(env, features)
    env.close()


@FEATURES
@pytest.mark.parametrize("env_id", [HUMANOID, JOINT, PICTURES])
def test_normalised_observations(features: Any, env_id: str) -> None:
    env = vec(env_id, VecNormalize)
    with pytest.raises(ValueError, match=r"give VecNormalize norm_obs=False"):
        ppo(env, features).learn(4)
    env.close()


def test_normalised_observations_after_a_training_without() -> None:
    plain = vec()
    model = ppo(plain, GoalFeatures).learn(4)
    with pytest.raises(ValueError, match="whole numbers"):
        evaluate_policy(model, vec(wrap=VecNormalize), 1)
    plain.close()


class Compass:
    """A sensor of whole numbers, also below 0."""

    def spaces(self) -> Any:
        return {"compass": spaces.Box(-8, 8, (2,), np.int16)}

    def observe(self, view: Any) -> Any:
        return {"compass": np.array([-8, 8], np.int16)}


def learns(env: Any, features: Any) -> bool:
    """Return whether some steps of PPO change its weights, to numbers."""
    model = ppo(env, features)
    before = [weight.clone() for weight in model.policy.parameters()]
    model.learn(4)
    after = list(model.policy.parameters())
    return all(weight.isfinite().all() for weight in after) and not all(map(torch.equal, before, after))


def test_whole_numbers_below_zero_are_welcome() -> None:
    env = vec(observation=("scene_graph", Compass()))
    assert learns(env, HouseholdFeatures)
    env.close()


def test_normalised_rewards_and_numbers_are_welcome() -> None:
    env = vec(wrap=partial(VecNormalize, norm_obs=False))
    assert learns(env, HouseholdFeatures)
    env.close()
    env = vec(wrap=partial(VecNormalize, norm_obs_keys=["self", "messages"]))
    assert learns(env, GoalFeatures)
    env.close()


def test_pictures_scaled_twice() -> None:
    env = vec(PICTURES)
    with pytest.raises(ValueError, match="give policy_kwargs normalize_images=False"):
        ppo(env, HouseholdFeatures, normalize_images=True).learn(4)
    ppo(env, HouseholdFeatures).learn(4)
    env.close()


def rescaled(env: Any, key: str) -> Any:
    """Return an environment of which a key is scaled to 0..1, as many do it by hand."""
    parts = dict(env.observation_space.spaces)
    high = parts[key].high
    parts[key] = spaces.Box(0, 1, high.shape, np.float32)
    scale = lambda seen: {**seen, key: (seen[key] / high).astype(np.float32)}  # noqa: E731
    return gymnasium.wrappers.TransformObservation(env, scale, spaces.Dict(parts))


@pytest.mark.parametrize(("env_id", "key"), [(HUMANOID, "node_class"), (HUMANOID, "instruction"), (PICTURES, "image")])
def test_scaled_observations(env_id: str, key: str) -> None:
    env = wrapped(env_id, partial(rescaled, key=key))
    with pytest.raises(ValueError, match=rf"'{key}' is Box.*scaled"):
        ppo(env, HouseholdFeatures)
    env.close()


@FEATURES
def test_flattened_observations(features: Any) -> None:
    env = gymnasium.wrappers.FlattenObservation(gymnasium.make(HUMANOID, **OPTIONS))
    with pytest.raises(ValueError, match="not the Dict that the environment gives"):
        features(env.observation_space)
    env.close()


def test_goal_features_without_the_goal() -> None:
    env = vec(goal=False)
    with pytest.raises(ValueError, match="make the environment with goal=True"):
        ppo(env, GoalFeatures)
    env.close()


# Models of one's own as policies


@pytest.mark.parametrize(
    ("name", "env_id", "options"),
    [("PPO", HUMANOID, {}), ("A2C", JOINT, {}), ("DQN", JOINT, {"flat_actions": True}), ("DQN", HUMANOID, {})],
)
def test_models_are_policies(name: str, env_id: str, options: dict[str, Any], tmp_path: Path) -> None:
    env = vec(env_id, **options)
    settings: dict[str, Any] = {"buffer_size": 50} if name == "DQN" else {"n_steps": 4}
    if name == "PPO":
        settings["batch_size"] = 4
    network = {"features_extractor_class": GoalFeatures, "net_arch": [8]}
    model = getattr(sb3, name)("MultiInputPolicy", env, policy_kwargs=network, seed=0, device="cpu", **settings)
    policies = policy_of(model.learn(4))
    given: dict[str, Any] = {
        "split": "val-unseen",
        "tasks": ["val-unseen-000"],
        "workers": 1,
        "seeds": (0, 1),
        "max_steps": 4,
    }
    report = chmarl_pb.evaluate(policies, goal=True, **given)
    assert len(report.episodes) == (1 if name == "DQN" else 2)  # the best actions, or drawn ones
    assert report.episodes == chmarl_pb.evaluate(policies, goal=True, **given).episodes
    model.save(tmp_path / "model")
    loaded = getattr(sb3, name).load(tmp_path / "model", device="cpu")
    assert policies.fingerprint == policy_of(loaded, "search").fingerprint == report.settings["policy_sha256"]
    with torch.no_grad():
        next(iter(loaded.policy.parameters())).add_(1.0)
    assert policies.fingerprint != policy_of(loaded, "search").fingerprint
    with pytest.raises(OptionError, match="goal=True"):
        chmarl_pb.evaluate(policies, **given)
    with pytest.raises(OptionError, match=r"the model chooses among .* actions, and here there are"):
        chmarl_pb.evaluate(policies, goal=True, pointing=True, **given)
    with pytest.raises(OptionError, match=r"the model observes .* of shape"):
        chmarl_pb.evaluate(policies, goal=True, lookalikes=True, **given)
    env.close()


def test_models_of_normalised_observations_are_no_policies() -> None:
    env = vec(wrap=partial(VecNormalize, norm_obs_keys=["self"]))
    with pytest.raises(ValueError, match="norm_obs=False"):
        policy_of(ppo(env, GoalFeatures))
    env.close()


def test_tasks_of_several_objects_have_longer_instructions() -> None:
    env = gymnasium.make("CHMARL/SceneGraph-v0", task="tidy", split="val-unseen")
    space = env.observation_space
    env.close()
    assert isinstance(space, spaces.Dict) and HouseholdFeatures(space, 8).features_dim == 8


@pytest.mark.parametrize(
    ("keys", "are_all"),
    [
        (("image",), False), (("node_state",), False), (("messages", "drone_battery"), False), (("battery",), False),
        (("humanoid_image", "drone_image"), True), (("walker_messages", "glider_messages"), True),
        (("walker_self", "walker_battery"), True), (("drone_battery",), True), (("force_feedback",), False),
    ],
)  # fmt: skip
def test_keys_tell_whether_they_are_of_all_robots(keys: tuple[str, ...], are_all: bool) -> None:
    assert are_of_all(keys) == are_all
