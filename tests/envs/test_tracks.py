"""Tracks: what their environments are given where nothing else is asked for, and the ids of each."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.envs.tracks import TRACKS
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.episode_file import record_episode, replay_episode
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.policies.registry import make_policy

GROUNDED = tuple(env_id for env_id in ENV_IDS if "Grounded" in env_id)
HOME: dict[str, Any] = {"split": "val-unseen", "home": "home_6"}
TASK = chmarl_pb.load_tasks("val-unseen")[0]


def test_the_paper_s_is_the_default() -> None:
    assert vars(Options()) == vars(Options(track="paper"))
    assert Options().recorded() == Options(track="paper", pointing=False, messages=True).recorded()
    assert "track" not in Options().recorded(), "as in older results"


def test_a_track_gives_what_is_not_asked_for() -> None:
    grounded = Options(track="grounded")
    assert {name: getattr(grounded, name) for name in TRACKS["grounded"]} == TRACKS["grounded"]
    assert grounded.recorded().items() >= {**TRACKS["grounded"], "track": "grounded"}.items()


@pytest.mark.parametrize(
    "given",
    [
        {"pointing": False}, {"messages": True}, {"messages": False}, {"feedback": True}, {"split": "train"},
        {"max_steps": 28},
    ],
    ids=str,
)  # fmt: skip
def test_each_option_can_be_switched_off_by_itself(given: dict[str, Any]) -> None:
    options = Options(track="grounded", **given)
    assert {name: getattr(options, name) for name in TRACKS["grounded"]} == TRACKS["grounded"] | given
    assert Options(**vars(options)) == options, "copies are made from them"
    recorded = options.recorded()
    assert Options(**recorded).recorded() == recorded, "replays of results are made from them"


def test_ids_are_there_for_both() -> None:
    assert GROUNDED == (
        "CHMARL/GroundedSceneGraph-v0", "CHMARL/GroundedVisual-v0", "CHMARL/GroundedSceneGraphHumanoid-v0",
        "CHMARL/GroundedVisualHumanoid-v0",
    )  # fmt: skip


@pytest.mark.parametrize("env_id", GROUNDED)
def test_grounded_ids(make: Callable[..., Any], env_id: str) -> None:
    env = make(env_id, image_size=32, **HOME)
    options = env.unwrapped.parallel.options
    assert (options.track, options.pointing, options.messages, options.feedback) == ("grounded", True, "symbols", False)
    alone = [26, 16] if "Humanoid" in env_id else [26, 16, 9, 16]
    assert env.action_space == gymnasium.spaces.MultiDiscrete(alone)
    switched = make(env_id, image_size=32, pointing=False, messages=False, **HOME)
    assert switched.unwrapped.parallel.options.pointing is False
    assert switched.unwrapped.parallel.action_names["humanoid"][4] == "pick"


@pytest.mark.parametrize("env_id", [name for name in ENV_IDS if "Humanoid" in name])
def test_the_partner_is_the_built_in_policy(make: Callable[..., Any], env_id: str) -> None:
    """The drone does and says what it does in a rollout of its policy."""
    view = make(env_id, image_size=32, **HOME)
    name = "search" if env_id in ("CHMARL/SceneGraphHumanoid-v0", "CHMARL/VisualHumanoid-v0") else "belief"
    assert view.unwrapped.partner == name
    core = view.unwrapped.parallel
    beside = HouseholdEnv(**vars(core.options))
    policy = make_policy(name, beside)
    observation, _ = view.reset(seed=3, options={"task": TASK})
    seen, infos = beside.reset(seed=3, options={"task": TASK})
    policy.reset(3)
    for _ in range(12):
        actions = policy.act(seen, infos)
        observation, _, terminated, _, _ = view.step(actions["humanoid"])
        seen, _, _, _, infos = beside.step(actions)
        assert digest({"humanoid": observation}) == digest({"humanoid": seen["humanoid"]})
        assert core.said == beside.said
        if terminated:
            break
    beside.close()


def test_another_partner_is_refused(make: Callable[..., Any]) -> None:
    with pytest.raises(OptionError, match="partner='planner'"):
        make("CHMARL/SceneGraphHumanoid-v1", partner="planner")


def test_vectors_find_the_ids() -> None:
    for env_id in ("CHMARL/SceneGraphHumanoid-v1", *GROUNDED):
        made: Any = gymnasium.make_vec(env_id, 1, workers=0, image_size=32, **HOME)
        made.reset(seed=0)
        made.step(np.zeros(made.action_space.shape, np.int64))
        assert made.get_attr("spec")[0].id == env_id
        made.close()


def test_results_say_the_track() -> None:
    report = evaluate("belief", "val-unseen", tasks=[TASK], workers=1, track="grounded")
    assert report.settings["options"]["track"] == report.track == "grounded"
    assert report.changed == "grounded track" and report.without == [] and report.cooperation is None
    other = evaluate(
        "belief", "val-unseen", tasks=[TASK], workers=1, track="grounded", pointing=False, messages=True, feedback=True
    )
    assert other.changed == "grounded track, no pointing, message board, feedback"
    silent = evaluate("belief", "val-unseen", tasks=[TASK], workers=1, track="grounded", messages=False)
    assert (silent.changed, silent.without) == ("grounded track", ["messages"])


def test_the_split_of_an_evaluation_is_that_of_the_track() -> None:
    task = chmarl_pb.load_tasks("generated-test")[0]
    with pytest.raises(chmarl_pb.ChmarlError, match="is of the split 'generated-test', not 'test-unseen'"):
        evaluate("random", tasks=[task])
    with pytest.raises(chmarl_pb.ChmarlError, match="is of the split 'test-unseen', not 'generated-test'"):
        evaluate("random", tasks=["test-unseen-000"], track="grounded")


def test_an_episode_file_of_the_track_plays_again() -> None:
    env = HouseholdEnv(track="grounded", **HOME)
    file = record_episode(env, make_policy("belief", env), "belief", 0, TASK)
    env.close()
    assert file.options["pointing"] and any(symbol for said in file.said for symbol in said)
    assert replay_episode(file) is None
