"""Baselines of Stable-Baselines3: training, interruption, and their models as policies of the benchmark."""

import json
import sys
import zipfile
from contextlib import closing
from dataclasses import asdict, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, get_args

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecMonitor

import chmarl_pb
from chmarl_pb.cli import program
from chmarl_pb.cli.sb3 import main, parse
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.errors import MissingExtraError
from chmarl_pb.learning.algorithms.gradient import DivergedError
from chmarl_pb.learning.networks import build_encoder
from chmarl_pb.learning.networks.frozen import FrozenEncoder
from chmarl_pb.learning.networks.residual import FEATURES, ResNet18
from chmarl_pb.learning.policies.side_by_side import play_side_by_side
from chmarl_pb.learning.runs.logger import METRICS, read_rows
from chmarl_pb.learning.sb3 import GoalFeatures, load_policy, policy_of
from chmarl_pb.learning.sb3.bar import Bar
from chmarl_pb.learning.sb3.checkpoint import read_model
from chmarl_pb.learning.sb3.config import PRESETS, AlgorithmName, Config, EnvId, PresetName
from chmarl_pb.learning.sb3.features import HouseholdFeatures
from chmarl_pb.learning.sb3.run import Log
from chmarl_pb.learning.sb3.train import BEST, LAST, RESULT, run
from chmarl_pb.learning.sb3.validation import make_validation, validation_tasks
from chmarl_pb.learning.sb3.wrappers import ScaledRewards, encode_pictures
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load, save
from chmarl_pb.learning.storage.seal import LENGTH
from chmarl_pb.policies.policy import Policy
from chmarl_pb.policies.seats import seated
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.tasks.splits import load_tasks
from tests.helpers.damage import Evil, flipped
from tests.helpers.own_things import write_things
from tests.helpers.stopping import in_pieces

torch.set_num_threads(1)  # these networks are too small for more
HUMANOID, JOINT = "CHMARL/SceneGraphHumanoid-v0", "CHMARL/SceneGraph-v0"
BESIDE_BELIEF, GROUNDED = "CHMARL/SceneGraphHumanoid-v1", "CHMARL/GroundedSceneGraphHumanoid-v0"
ALGORITHMS = (pytest.param("ppo", marks=pytest.mark.slow), "dqn", "recurrent-ppo")  # the last does all that PPO does
TINY: dict[str, Any] = {"envs": 1, "tasks": 2, "max_steps": 4, "features": 8, "image_size": 32}


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make rollouts small enough for tests."""
    on_policy = {"n_steps": 4, "batch_size": 4, "n_epochs": 1}
    smaller = {"ppo": on_policy, "recurrent-ppo": on_policy, "a2c": {"n_steps": 4}}
    smaller["dqn"] = smaller["qr-dqn"] = {"learning_starts": 4, "batch_size": 4}
    for name, preset in PRESETS.items():
        settings = {algo: {**known, **smaller[algo]} for algo, known in preset.settings.items()}
        monkeypatch.setitem(PRESETS, name, replace(preset, settings=settings))


class Both(Policy):
    """Plays one policy and notes what another would have done."""

    def __init__(self, first: Policy, second: Policy):
        self.first, self.second, self.same = first, second, True

    def reset(self, seed: int | None) -> None:
        self.first.reset(seed)
        self.second.reset(seed)

    def act(self, observations: Any, infos: Any) -> Any:
        actions = self.first.act(observations, infos)
        self.same &= actions == self.second.act(observations, infos)
        return actions


@pytest.mark.parametrize(
    ("algo", "env_id", "preset"),
    [
        ("ppo", HUMANOID, "goal"),
        ("ppo", "CHMARL/Visual-v0", "encoder"),
        ("ppo", "CHMARL/VisualHumanoid-v0", "goal-encoder"),
        ("a2c", JOINT, "goal"),
        ("a2c", JOINT, "encoder"),
        ("dqn", JOINT, "goal"),
        ("qr-dqn", JOINT, "goal"),
        ("qr-dqn", BESIDE_BELIEF, "goal"),
        ("dqn", "CHMARL/VisualHumanoid-v0", "encoder"),
        ("recurrent-ppo", JOINT, "goal-encoder"),
        ("recurrent-ppo", JOINT, "encoder"),
    ],
)
def test_trained_model_is_a_policy(algo: AlgorithmName, env_id: str, preset: PresetName, tmp_path: Path) -> None:
    config = Config(algo, env_id, preset, steps=8, interval=8, messages=False, **TINY)
    run(config, tmp_path, workers=0)
    source = find_policy(str(tmp_path / BEST))
    assert source.deterministic == algo.endswith("dqn") and source.sha256
    goal = {"goal": True} if config.env_options.get("goal") else {}
    assert source.rules.get("goal", False) == bool(goal), "who evaluates it need not say so"
    env = chmarl_pb.parallel_env(config.observation, split="val-unseen", max_steps=4, image_size=32, **goal)
    both = Both(source.make(env), source.make(env))
    episode = chmarl_pb.rollout(env, both, seed=1)
    again = chmarl_pb.rollout(env, both, seed=1)
    assert both.same and episode.actions == again.actions and len(episode) == 4
    env.close()
    other = "visual" if config.observation == "scene_graph" else "scene_graph"
    # Numbers are the same with graphs and pictures; what an encoder reads is not, and the goal is not always there.
    wrong = chmarl_pb.parallel_env(config.observation if preset == "goal" else other, image_size=32)
    with pytest.raises(CheckpointError, match="--goal" if goal else None):
        source.make(wrong)
    wrong.close()
    result = json.loads((tmp_path / RESULT).read_text())
    assert result["best"]["plw"] == max(row["plw"] for row in result["validations"]) and result["steps"] >= 8


@pytest.mark.parametrize("env_id", [HUMANOID, BESIDE_BELIEF])
def test_drone_is_the_one_that_the_id_names(env_id: str, tmp_path: Path) -> None:
    """What a model does beside it is what the environment's own drone does."""
    config = Config("ppo", env_id, steps=8, interval=8, **TINY)
    model = run(config, tmp_path, workers=0)
    own = gymnasium.make(env_id, goal=True, split="val-unseen").unwrapped
    env = chmarl_pb.parallel_env(split="val-unseen", goal=True)
    for make in (load_policy(tmp_path / BEST), policy_of(model, config.partner)):
        policy = seated(make, env)
        own.reset(seed=3)
        seen, infos = env.reset(seed=3)
        policy.reset(3)
        for _ in range(12):
            actions = policy.act(seen, infos)
            assert actions["drone"] == own._other_actions["drone"]  # type: ignore[attr-defined]
            own.step(actions["humanoid"])
            seen, _, ended, cut, infos = env.step(actions)
            if ended["drone"] or cut["drone"]:
                break
    with pytest.raises(ValueError, match="are closed; say what drove the drone there: partner='search' or"):
        policy_of(model)
    own.close()
    env.close()


def whatever_is_heard(make: Any) -> list[dict[str, str]]:
    """Return the first actions of a policy where nothing has been said, and where everything has."""
    env = chmarl_pb.parallel_env(split="val-unseen", goal=True)
    policy = make(env)
    seen, infos = env.reset(seed=0)
    heard = {name: {**part, "messages": np.ones_like(part["messages"])} for name, part in seen.items()}
    chosen = []
    for observations in (seen, heard):
        policy.reset(0)
        chosen.append({name: env.action_names[name][act] for name, act in policy.act(observations, infos).items()})
    env.close()
    return chosen


def test_a_model_in_memory_hears_what_it_heard_in_training() -> None:
    from stable_baselines3 import PPO

    envs = chmarl_pb.sb3_vec_env(1, BESIDE_BELIEF, 0, split="val-unseen", goal=True, messages=False)
    model = PPO("MultiInputPolicy", envs, policy_kwargs={"features_extractor_class": GoalFeatures}, device="cpu")
    silent = policy_of(model)
    envs.close()
    told, untold = policy_of(model, "belief", ["messages"]), policy_of(model, "belief")  # closed ones do not tell
    assert silent._unheard == told._unheard == ("messages",) and untold._unheard == ()
    assert silent.fingerprint == told.fingerprint != untold.fingerprint
    unheard, heard = whatever_is_heard(silent)
    assert unheard == heard


def test_a_model_whose_processes_have_ended_plays_on() -> None:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import SubprocVecEnv

    envs = SubprocVecEnv([partial(gymnasium.make, "chmarl_pb:CHMARL/SceneGraph-v0", goal=True)], start_method="spawn")
    model = PPO("MultiInputPolicy", envs, policy_kwargs={"features_extractor_class": GoalFeatures}, device="cpu")
    assert policy_of(model)._unheard == ()
    envs.close()
    assert policy_of(model).centralized


def test_a_model_in_memory_knows_its_drone_by_its_environments() -> None:
    from stable_baselines3 import PPO

    for env_id, partner in ((HUMANOID, "search"), (BESIDE_BELIEF, "belief")):
        envs = chmarl_pb.sb3_vec_env(1, env_id, 0, split="val-unseen", goal=True)
        model = PPO("MultiInputPolicy", envs, policy_kwargs={"features_extractor_class": GoalFeatures}, device="cpu")
        assert policy_of(model)._partner == partner
        envs.close()


@pytest.mark.parametrize(("key", "is_told"), [("image", True), ("self", False), ("messages", False)])
def test_a_model_that_sees_one_key_of_one_robot_drives_one(key: str, is_told: bool) -> None:
    from gymnasium.wrappers import FilterObservation
    from stable_baselines3 import PPO

    def make() -> Any:
        env = gymnasium.make("CHMARL/VisualHumanoid-v1", split="val-unseen", image_size=64)
        return FilterObservation(env, [key])

    envs = chmarl_pb.sb3_vec_env(1, make, workers=0)
    policies = policy_of(PPO("MultiInputPolicy", envs, policy_kwargs={"net_arch": [4]}, device="cpu"))
    envs.close()
    assert (policies._partner, policies.centralized, policies.privileged) == ("belief", False, is_told)
    given: dict[str, Any] = {"observation": "visual", "image_size": 64, "seeds": [0], "workers": 1, "max_steps": 2}
    assert len(chmarl_pb.evaluate(policies, "val-unseen", tasks=["val-unseen-000"], **given).episodes) == 1


def test_pictures_of_a_lone_humanoid_are_evaluated(tmp_path: Path) -> None:
    """Its drone is told what is in view, as in training, which results say."""
    run(Config("ppo", "CHMARL/VisualHumanoid-v1", steps=8, interval=8, **TINY), tmp_path, workers=0)
    options: dict[str, Any] = {"goal": True, "image_size": 32, "max_steps": 4}
    path = str(tmp_path / BEST)
    report = chmarl_pb.evaluate(path, "val-unseen", "visual", [0], 1, tasks=["val-unseen-000"], **options)
    assert report.settings["privileged"] and len(report.episodes) == 1


@pytest.mark.slow
@pytest.mark.parametrize("env_id", [GROUNDED, "CHMARL/GroundedSceneGraph-v0"])
def test_own_words_are_learned_and_played(env_id: str, tmp_path: Path) -> None:
    config = Config("ppo", env_id, "goal-encoder", steps=8, interval=8, **TINY)
    assert config.env_options["messages"] == "symbols" and not config.env_options["feedback"]
    run(config, tmp_path, workers=0)
    assert read_model(tmp_path / BEST)[0].feedback is False, "there is none, whatever was asked for"
    assert find_policy(str(tmp_path / BEST)).rules == {
        "track": "grounded",
        "goal": True,
        "max_steps": 4,
        "image_size": 32,
    }, "nobody has to say so again"
    options: dict[str, Any] = {"goal": True, "max_steps": 4}
    for plays in (None, play_side_by_side):
        tasks = load_tasks("generated-val")[:2]
        report = chmarl_pb.evaluate(
            str(tmp_path / BEST), "generated-val", seeds=[0], workers=1, tasks=tasks, plays=plays, **options
        )
        assert len(report.episodes) == 2 and report.track == "grounded"
    with pytest.raises(CheckpointError, match="trained by other rules"):
        chmarl_pb.evaluate(str(tmp_path / BEST), "val-unseen", seeds=[0], workers=1, **options, track="paper")


def test_values_of_single_numbers_cannot_choose_words() -> None:
    with pytest.raises(ValueError, match="qr-dqn chooses single numbers"):
        Config("qr-dqn", GROUNDED)


def test_every_id_can_be_trained_on() -> None:
    assert set(get_args(EnvId)) == set(ENV_IDS)


def test_drone_beside_a_silent_humanoid_hears_nothing(tmp_path: Path) -> None:
    run(Config("ppo", HUMANOID, steps=8, interval=8, messages=False, **TINY), tmp_path, workers=0)
    unheard, heard = whatever_is_heard(load_policy(tmp_path / BEST))
    assert unheard == heard and unheard["drone"] != "stay"


def weights(model: Any) -> dict[str, torch.Tensor]:
    state: dict[str, torch.Tensor] = model.policy.state_dict()
    return state


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_killed_run_ends_with_the_same_numbers(
    algo: AlgorithmName, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = Config(algo, HUMANOID, steps=24, interval=8, **TINY)
    whole = weights(run(config, tmp_path / "whole", workers=0))

    with monkeypatch.context() as patch:
        patch.setattr(Log, "write", killed_at_row(3))
        with pytest.raises(KeyboardInterrupt):
            run(config, tmp_path / "killed", workers=0)
    assert (tmp_path / "killed" / LAST).exists()
    resumed = weights(run(config, tmp_path / "killed", workers=0))
    assert json.loads((tmp_path / "killed" / RESULT).read_text())["resumed_at"] > 0
    assert all(torch.equal(value, resumed[name]) for name, value in whole.items())
    results = [json.loads((tmp_path / name / RESULT).read_text()) for name in ("whole", "killed")]
    assert results[0]["validations"] == results[1]["validations"]
    run(config, tmp_path / "killed", workers=0)  # a finished run is not played again
    with pytest.raises(CheckpointError, match="other settings: seed=0, not 1;"):
        run(Config(algo, HUMANOID, steps=24, interval=8, seed=1, **TINY), tmp_path / "killed", workers=0)


def test_a_run_goes_on_in_the_same_home_alone(tmp_path: Path, small_home: Path) -> None:
    config = Config("a2c", HUMANOID, steps=8, interval=8, home=str(small_home), **TINY)
    run(config, tmp_path / "run", workers=0)
    run(config, tmp_path / "run", workers=0)
    small_home.write_text(small_home.read_text().replace("desk_1", "bench_1"))
    with pytest.raises(CheckpointError, match="home_sha256="):
        run(config, tmp_path / "run", workers=0)


@pytest.mark.parametrize("other", [{"rooms": ""}, {"feedback": True}])
def test_a_run_from_before_settings_told_what_is_had_goes_on(
    other: dict[str, Any], tmp_path: Path, small_home: Path
) -> None:
    """Of one home they did not tell the rooms; in the grounded track they said that there is feedback."""
    home = str(small_home) if "rooms" in other else None
    config = Config("ppo", HUMANOID if home else GROUNDED, steps=8, interval=8, home=home, **TINY)
    run(config, tmp_path, workers=0)
    content = load(tmp_path / LAST)
    settings = {**content["settings"], **other}
    if "rooms" in other:
        del settings["rooms"]
    kept = {key: part for key, part in content.items() if key not in ("format", "kind")}
    save(tmp_path / LAST, content["kind"], {**kept, "settings": settings})
    run(config, tmp_path, workers=0)


def test_episodes_may_be_longer_than_those_of_the_id(tmp_path: Path) -> None:
    config = Config("a2c", HUMANOID, steps=8, interval=8, **TINY | {"max_steps": 30})
    run(config, tmp_path, workers=0)
    rows = json.loads((tmp_path / RESULT).read_text())["validations"]
    assert [row["steps"] for row in rows] == [8]
    with closing(chmarl_pb.parallel_env(split="val-unseen", max_steps=30, goal=True)) as env:
        assert len(chmarl_pb.rollout(env, load_policy(tmp_path / BEST)(env), seed=0).actions) <= 30
    tasks = make_validation(HUMANOID, validation_tasks(1)[:1], 1, {"max_steps": 30})
    tasks.reset(seed=0)
    lasted = next(step for step in range(1, 40) if tasks.step(0)[3])
    tasks.close()
    assert lasted == 30


@pytest.mark.parametrize("preset", get_args(PresetName))
def test_own_things_are_more_ids(preset: PresetName, tmp_path: Path) -> None:
    """The hash of the catalogue is kept, by which weights are refused among other things."""
    catalog = write_things(tmp_path)
    config = Config("ppo", HUMANOID, preset=preset, steps=8, interval=8, catalog=str(catalog), **TINY)
    run(config, tmp_path / "run", workers=0)
    options: dict[str, Any] = {"split": "val-unseen", "goal": True}
    with pytest.raises(CheckpointError, match="give the catalogue file that it was trained with"):
        load_policy(tmp_path / "run" / BEST)(chmarl_pb.parallel_env(**options))
    load_policy(tmp_path / "run" / BEST)(chmarl_pb.parallel_env(**options, catalog=catalog))


def test_encoders_of_pictures_need_a_preset_that_looks_at_them() -> None:
    with pytest.raises(ValueError, match="preset 'goal' looks at no picture; use goal-encoder or encoder"):
        Config("ppo", "CHMARL/Visual-v0", image_encoder="resnet18")


def test_folders_are_named_after_homes_and_robots() -> None:
    folders = {str(parse(["--algo", "ppo", *options]).folder) for options in (
        [], ["--home", "my/cabin.urdf"], ["--home", "den.urdf"], ["--catalog", "own.toml"],
        ["--robots", "humanoid,scout.toml"],
    )}  # fmt: skip
    assert len(folders) == 5 and "out/sb3/ppo-scenegraph-messages-feedback-goal-seed0" in folders
    grounded = parse(["--algo", "ppo", "--env", GROUNDED]).folder
    assert grounded.name == "ppo-groundedscenegraphhumanoid-messages-goal-seed0", "no feedback, as there is none"


@pytest.mark.parametrize("damaged", [False, True])
def test_best_weights_that_are_gone_are_written_again_or_missed(
    damaged: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = Config("recurrent-ppo", HUMANOID, steps=24, interval=8, **TINY)
    scores = iter([0.5, 0.3, 0.1])

    def validate(*_: Any, callback: Any, **__: Any) -> tuple[list[float], list[int]]:
        callback({"done": True, "info": {"is_success": False}}, {})
        return [next(scores)], [4]

    monkeypatch.setattr("stable_baselines3.common.callbacks.evaluate_policy", validate)
    with monkeypatch.context() as patch:
        patch.setattr(Bar, "say", killed_at_call(3))  # after the title and the first validation
        with pytest.raises(KeyboardInterrupt):
            run(config, tmp_path, workers=0)
    if damaged:
        (tmp_path / BEST).write_bytes((tmp_path / BEST).read_bytes()[:-9])
    else:
        (tmp_path / BEST).unlink()
    scores = iter([0.3, 0.1])
    run(config, tmp_path, workers=0)
    assert json.loads((tmp_path / RESULT).read_text())["best"]["plw"] == 0.3
    (tmp_path / BEST).unlink()
    with pytest.raises(CheckpointError, match="the best weights are gone"):
        run(config, tmp_path, workers=0)


def test_a_finished_run_tells_the_same_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SB3's monitor sums in 32 bits, in which the mean of these is greater than in 64."""
    config = Config("recurrent-ppo", HUMANOID, steps=24, interval=8, **TINY)
    scores = iter([[0.0, 0.1, 0.1], [0.1, 0.1, 0.2], [0.1, 0.1, 0.1]])

    def validate(*_: Any, callback: Any, **__: Any) -> tuple[list[float], list[int]]:
        infos = [{"is_success": True, "episode": {"r": np.float32(score)}} for score in next(scores)]
        for info in infos:
            callback({"done": True, "info": info}, {})
        return [info["episode"]["r"] for info in infos], [4] * len(infos)  # type: ignore[index]

    monkeypatch.setattr("stable_baselines3.common.callbacks.evaluate_policy", validate)
    told = []
    for _ in range(3):
        run(config, tmp_path, workers=0)
        told.append(json.loads((tmp_path / RESULT).read_text()))
        if len(told) == 2:
            (tmp_path / RESULT).unlink()  # then it is told anew, from what is kept of the validations
    assert told[0] == told[1] and told[0]["best"] == told[0]["validations"][1]
    assert all(told[0][key] == told[2][key] for key in ("best", "validations", "steps"))


@pytest.mark.parametrize("interval", [4, 24])  # noticed at a milestone, and as torch refuses to draw
def test_a_run_whose_weights_are_no_numbers_ends_with_a_word(interval: int, tmp_path: Path) -> None:
    config = Config("recurrent-ppo", HUMANOID, steps=24, interval=interval, learning_rate=1e30, **TINY)
    with pytest.raises(DivergedError, match=r"weights are infinite or no numbers .* lower learning_rate"):
        run(config, tmp_path, workers=0)


def test_a_run_that_is_killed_after_a_validation_logs_it_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = Config("recurrent-ppo", HUMANOID, steps=16, interval=8, **TINY)
    with monkeypatch.context() as patch:
        patch.setattr(Bar, "say", killed_at_call(2))  # after the title
        with pytest.raises(KeyboardInterrupt):
            run(config, tmp_path, workers=0)
    assert [row["steps"] for row in read_rows(tmp_path / METRICS) if "eval/mean_reward" in row] == [8]
    run(config, tmp_path, workers=0)
    assert [row["steps"] for row in read_rows(tmp_path / METRICS) if "eval/mean_reward" in row] == [8, 16]


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_run_that_is_asked_to_end_goes_on_from_where_it_was(
    algo: AlgorithmName, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between two milestones, too: in the middle of episodes and of validations."""
    config = Config(algo, HUMANOID, steps=48, interval=24, **TINY)
    monkeypatch.setattr("chmarl_pb.learning.sb3.train._log_interval", lambda config: 2 if config.algo == "dqn" else 8)
    whole = weights(run(config, tmp_path / "whole", workers=0))
    model, times = in_pieces(lambda: run(config, tmp_path / "pieces", workers=0), 17, monkeypatch)
    assert times >= 3
    assert all(torch.equal(value, weights(model)[name]) for name, value in whole.items())
    results = [json.loads((tmp_path / name / RESULT).read_text()) for name in ("whole", "pieces")]
    assert results[0]["validations"] == results[1]["validations"]
    rows = [
        [
            {name: value for name, value in row.items() if not name.startswith("time/")}
            for row in read_rows(tmp_path / folder / METRICS)
        ]
        for folder in ("whole", "pieces")
    ]
    assert rows[0] == rows[1] and len(rows[0]) >= 6


def killed_at_call(number: int) -> Any:
    """Return a method that does nothing, and dies when it is called for the so many-th time."""
    calls = count(1)

    def call(*arguments: Any) -> None:
        if next(calls) == number:
            raise KeyboardInterrupt

    return call


def killed_at_row(number: int) -> Any:
    """Return a writer of log rows that dies at one of them."""
    rows, write = count(1), Log.write

    def dies(*arguments: Any) -> None:
        if next(rows) == number:
            raise KeyboardInterrupt
        write(*arguments)

    return dies


@pytest.mark.parametrize("env_id", [JOINT, "CHMARL/VisualHumanoid-v0"])
def test_extractor_sees_what_the_encoder_sees(env_id: str) -> None:
    """SB3's floats are taken back to the same ids and pictures."""
    from stable_baselines3.common.preprocessing import preprocess_obs

    env = gymnasium.make(env_id, image_size=32, split="val-unseen")
    seen = {key: torch.from_numpy(np.asarray(value)[None]) for key, value in env.reset(seed=0)[0].items()}
    assert isinstance(env.observation_space, spaces.Dict)
    extractor = HouseholdFeatures(env.observation_space, 8)
    encoder = build_encoder(env.observation_space, 8)
    encoder.load_state_dict(extractor.encoder.state_dict())
    processed = preprocess_obs(seen, env.observation_space, normalize_images=False)
    assert torch.equal(extractor(processed), encoder(seen))
    env.close()


def test_frozen_features_take_the_place_of_pictures() -> None:
    torch.manual_seed(0)
    resnet = FrozenEncoder("resnet18", ResNet18().state_dict())
    options = {"split": "val-unseen", "image_size": 32, "max_steps": 2}
    env = encode_pictures(chmarl_pb.sb3_vec_env(2, "CHMARL/Visual-v0", workers=0, **options), resnet)
    space = env.observation_space
    assert isinstance(space, spaces.Dict) and space["drone_image"].shape == (FEATURES,)
    seen = env.reset()
    assert isinstance(seen, dict)
    assert seen["humanoid_image"].shape == (2, FEATURES) and seen["humanoid_image"].dtype == np.float16
    for _ in range(2):
        seen, _, ends, infos = env.step(np.array([env.action_space.sample()] * 2))
    assert ends.all() and infos[1]["terminal_observation"]["drone_image"].shape == (FEATURES,)
    env.close()


def test_validation_pays_plw_and_begins_again_at_a_seed() -> None:
    tasks = validation_tasks(3)
    env = make_validation(JOINT, tasks, 2, {"max_steps": 3})
    played = []
    for seed in (0, None, None, 0):
        _, info = env.reset(seed=seed)
        played.append(info["humanoid"]["task_id"])
    assert played == [tasks[0].id, tasks[2].id, tasks[4].id, tasks[0].id]
    assert [task.id.rsplit("-", 1)[0] for task in tasks] == ["val-seen"] * 3 + ["val-unseen"] * 3
    rewards = [env.step(np.array([9, 8]))[1] for _ in range(3)]
    assert rewards == [0, 0, 0]  # both stay
    env.close()


@pytest.mark.parametrize(("env_id", "track"), [(JOINT, "paper"), ("CHMARL/GroundedSceneGraph-v0", "grounded")])
def test_environments_side_by_side_share_the_validation_tasks(env_id: str, track: str) -> None:
    """Also in generated homes, where the seeds of environments that train are far apart."""
    tasks = validation_tasks(4, track=track)[:4]
    make = partial(make_validation, env_id, tasks, 2, {"max_steps": 1})
    env = chmarl_pb.sb3_vec_env(2, make, 0)
    env.seed(0)
    env.reset()
    played = [info["humanoid"]["task_id"] for info in env.reset_infos]
    env.step(np.stack([env.action_space.sample() for _ in range(2)]))
    played += [info["humanoid"]["task_id"] for info in env.reset_infos]
    env.close()
    assert sorted(played) == sorted(task.id for task in tasks)


@pytest.mark.parametrize("number", [1, 4, 5])
def test_every_validation_task_counts_once(number: int) -> None:
    """SB3 lets the first of two environments play fewer episodes of an odd number."""
    tasks, played = validation_tasks(3)[:number], []

    def note(found: dict[str, Any], _: dict[str, Any]) -> None:
        if found["done"]:
            played.append(found["info"]["humanoid"]["task_id"])

    env = chmarl_pb.sb3_vec_env(2, partial(make_validation, JOINT, tasks, 2, {"max_steps": 1}), 0)
    model = PPO("MultiInputPolicy", env, n_steps=2, batch_size=2)
    env.seed(0)
    evaluate_policy(model, env, number, callback=note, warn=False)
    env.close()
    assert sorted(played) == sorted(task.id for task in tasks)


@pytest.mark.parametrize("option", ["image_encoder", "graph_pool"])
def test_unknown_parts_of_networks_are_refused(option: str) -> None:
    given: dict[str, Any] = {option: "resnett"}
    with pytest.raises(ValueError, match=f"{option}='resnett' is not known"):
        Config("ppo", JOINT, **given)


def test_log_is_written_for_tensorboard_too(tmp_path: Path) -> None:
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    run(Config("ppo", HUMANOID, steps=8, interval=8, **TINY), tmp_path, workers=0)
    board = events.EventAccumulator(str(tmp_path / "tensorboard"))
    board.Reload()
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert {"eval/mean_reward", "eval/success_rate", "train/loss"} <= set(board.Tags()["scalars"])
    for name in ("eval/mean_reward", "train/loss"):
        heard = [(event.step, event.value) for event in board.Scalars(name)]
        assert heard == [(row["steps"], pytest.approx(row[name], rel=1e-6)) for row in rows if name in row] != []


def test_rows_of_tables_name_the_observation_instead_of_the_id() -> None:
    arguments = ["--algo", "dqn", "--observation", "scene_graph", "--humanoid-only", "--no-messages", "--seed", "4"]
    command = parse(arguments)
    config = command.config
    assert (config.env_id, config.messages, config.feedback, config.seed) == (BESIDE_BELIEF, False, True, 4)
    assert command.folder == Path("out/sb3/dqn-scenegraphhumanoid-v1-feedback-goal-seed4")
    older = parse(["--algo", "ppo", "--env", HUMANOID, "--observation", "scene_graph"]).config
    assert (older.env_id, older.partner, config.partner) == (HUMANOID, "search", "belief")
    joint = [parse(["--algo", "ppo", *env]).config.env_id for env in ([], ["--env", JOINT])]
    assert joint == [JOINT, JOINT]


def test_other_files_are_refused_without_running_code(tmp_path: Path) -> None:
    from stable_baselines3 import PPO

    foreign, broken = tmp_path / "foreign.zip", tmp_path / "broken.zip"
    PPO("MlpPolicy", "CartPole-v1", device="cpu").save(foreign)
    with pytest.raises(CheckpointError, match="not written by chmarl-pb sb3"):
        load_policy(foreign)
    broken.write_bytes(foreign.read_bytes()[:1000])
    with pytest.raises(CheckpointError, match="not a whole checkpoint"):
        load_policy(broken)


def test_every_flipped_byte_of_a_model_is_noticed(tmp_path: Path) -> None:
    from stable_baselines3 import PPO

    run(Config("ppo", HUMANOID, steps=4, interval=4, **TINY), tmp_path, workers=0)
    path, whole = tmp_path / BEST, (tmp_path / BEST).read_bytes()
    assert PPO.load(path, device="cpu").num_timesteps == 4
    rng = np.random.default_rng(0)
    for place in (0, 1, len(whole) - LENGTH, len(whole) - 1, *rng.integers(0, len(whole), 20).tolist()):
        path.write_bytes(flipped(whole, place))
        with pytest.raises(CheckpointError, match=r"best\.zip: not a whole checkpoint"):
            load_policy(path)


def test_code_in_a_model_is_not_run_and_not_made_easy(tmp_path: Path) -> None:
    run(Config("ppo", HUMANOID, steps=4, interval=4, **TINY), tmp_path, workers=0)
    evil, touched = tmp_path / "evil.zip", tmp_path / "code ran"
    torch.save({"format": Evil(touched)}, tmp_path / "evil.pth")
    with zipfile.ZipFile(tmp_path / BEST) as archive, zipfile.ZipFile(evil, "w") as other:
        for name in archive.namelist():
            other.writestr(name, (tmp_path / "evil.pth").read_bytes() if name == "policy.pth" else archive.read(name))
    with pytest.raises(CheckpointError, match="could run code and is never loaded") as caught:
        load_policy(evil)
    assert "weights_only" not in str(caught.value) and caught.value.__cause__ is None and not touched.exists()


def test_command_says_what_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--algo", "qmix", "--env", JOINT])
    with pytest.raises(SystemExit):
        main(["--algo", "ppo", "--env", "CartPole-v1"])
    assert "CHMARL/SceneGraph-v0" in capsys.readouterr().err
    for wrong in (["--interval", "0"], ["--steps", "0"], ["--seed", "-1"]):
        assert main(["--algo", "ppo", *wrong]) == 2
        assert f"{wrong[0].strip('-')}={wrong[1]}: must be " in capsys.readouterr().err
    for other in (["--humanoid-only"], ["--observation", "visual"]):
        with pytest.raises(SystemExit):
            main(["--algo", "ppo", "--env", JOINT, *other])
        assert "--env names" in capsys.readouterr().err


def test_models_from_before_there_were_presets_are_read(tmp_path: Path) -> None:
    """Their settings name no preset; they were trained without the goal, through the encoder."""
    config = Config("ppo", HUMANOID, "encoder", steps=8, interval=8, **TINY)
    run(config, tmp_path, workers=0)
    settings = {name: value for name, value in asdict(config).items() if name != "preset"}
    before, last = tmp_path / "before.zip", torch.load(tmp_path / LAST, weights_only=True)
    with zipfile.ZipFile(tmp_path / BEST) as new, zipfile.ZipFile(before, "w") as old:
        for name in new.namelist():
            old.writestr(name, json.dumps(settings) if name == "chmarl_pb.json" else new.read(name))
    assert read_model(before)[0] == config
    env = chmarl_pb.parallel_env(split="val-unseen", max_steps=4, goal=True)  # what it does not know does no harm
    policies = [load_policy(path)(env) for path in (tmp_path / BEST, before)]
    played = [chmarl_pb.rollout(env, policy, seed=1).actions for policy in policies]
    assert played[0] == played[1]
    env.close()
    torch.save({**last, "settings": settings}, tmp_path / LAST)
    (tmp_path / RESULT).unlink()
    run(config, tmp_path, workers=0)  # goes on, which here means that it is finished
    assert json.loads((tmp_path / RESULT).read_text())["resumed_at"] == 8


def test_rewards_are_scaled_for_learning_only() -> None:
    env = ScaledRewards(VecMonitor(chmarl_pb.sb3_vec_env(1, HUMANOID, 0, split="val-unseen", max_steps=12)), 0.2)
    plain = chmarl_pb.sb3_vec_env(1, HUMANOID, 0, split="val-unseen", max_steps=12)
    for each in (env, plain):
        each.seed(0)
        each.reset()
    rewards = []
    for action in [0, 1, 2, 3, 7, 7, 7, 0, 8, 8, 8, 8]:
        scaled, wanted = (each.step(np.array([action])) for each in (env, plain))
        assert scaled[1] == pytest.approx(0.2 * wanted[1])
        rewards.append(float(wanted[1][0]))
    assert any(rewards) and scaled[3][0]["episode"]["r"] == pytest.approx(sum(rewards))
    env.close()
    plain.close()


def test_progress_is_shown_before_there_are_environments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def slow(*arguments: Any, **options: Any) -> None:
        raise KeyboardInterrupt  # of somebody who waits and sees nothing

    with monkeypatch.context() as patch:
        patch.setattr(chmarl_pb, "sb3_vec_env", slow)
        with pytest.raises(KeyboardInterrupt):
            run(Config("ppo", HUMANOID, **TINY), tmp_path, quiet=False)
    shown = capsys.readouterr().err
    assert "ppo on CHMARL/SceneGraphHumanoid-v0, preset goal" in shown and "making environments" in shown
    run(Config("ppo", HUMANOID, steps=8, interval=8, **TINY), tmp_path, workers=0, quiet=False)
    assert "steps 8  validation: SR" in capsys.readouterr().err


def test_command_says_that_it_loads_pytorch(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def slow(name: str) -> None:
        raise MissingExtraError("not there")

    monkeypatch.delitem(sys.modules, "torch")
    monkeypatch.setattr(program, "import_module", slow)
    assert program.main(["sb3", "--algo", "ppo"]) == 2
    assert capsys.readouterr().err.splitlines()[0] == "chmarl-pb sb3: loading PyTorch"


def test_unknown_presets_are_refused() -> None:
    with pytest.raises(ValueError, match="preset='best' is not known"):
        Config("ppo", HUMANOID, "best")  # type: ignore[arg-type]
    for algo in ("reinforce", "os:path"):
        with pytest.raises(ValueError, match=f"algo='{algo}' is not known; use one of: "):
            Config(algo)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'CHMARL/Garden-v0' is no id of the benchmark; use one of: CHMARL/"):
        Config("ppo", "CHMARL/Garden-v0")
