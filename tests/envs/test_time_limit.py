"""How long an episode is: the registered ids carry Gymnasium's time limit, and every way to set another one holds."""

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.envs.tracks import TRACKS
from chmarl_pb.errors import NotResetError, OptionError
from chmarl_pb.policies.policy import core_of

HUMANOID, STAY = "CHMARL/SceneGraphHumanoid-v0", 9
GROUNDED = "CHMARL/GroundedSceneGraphHumanoid-v0"
HOME: dict[str, Any] = {"home": "home_6", "split": "val-unseen"}


def track_of(env_id: str) -> str:
    """Return the track that the name of an id says."""
    return "grounded" if "Grounded" in env_id else "paper"


def length(env: gymnasium.Env) -> int:
    """Return after how many steps an episode of doing nothing is truncated."""
    env.reset(seed=0)
    stay = core_of(env).action_names["humanoid"].index("stay")
    for number in range(1, 100):
        _, _, terminated, truncated, _ = env.step(stay)
        assert not terminated
        if truncated:
            return number
    raise AssertionError("the episode does not end")


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_registrations_tell_the_limit(env_id: str) -> None:
    assert gymnasium.spec(env_id).max_episode_steps == TRACKS[track_of(env_id)]["max_steps"]


@pytest.mark.parametrize(
    ("options", "steps"),
    [({}, 28), ({"max_episode_steps": 40}, 40), ({"max_episode_steps": 3}, 3), ({"max_steps": 5}, 5)],
    ids=str,
)
def test_gymnasium_ends_episodes_there(make: Callable[..., Any], options: dict[str, Any], steps: int) -> None:
    env = make(HUMANOID, **HOME, **options)
    assert length(env) == steps
    again = gymnasium.make(env.spec)  # a spec tells all of it
    assert length(again) == steps
    again.close()


def test_a_limit_that_would_not_hold_is_refused() -> None:
    """`gymnasium.make` does not tell an environment its own limit, which would cut the episode in silence."""
    with pytest.raises(OptionError, match="give max_episode_steps=50 instead"):
        gymnasium.make(HUMANOID, **HOME, max_steps=50)


def test_grounded_ids_have_the_limit_of_their_track(make: Callable[..., Any]) -> None:
    steps = TRACKS["grounded"]["max_steps"]
    assert length(make(GROUNDED, **HOME)) == steps
    assert length(make(GROUNDED, **HOME, max_steps=20)) == 20
    assert length(make(HUMANOID, **HOME, track="grounded")) == 28, "an id keeps its own limit"
    with pytest.raises(OptionError, match=f"give max_episode_steps={steps + 1} instead"):
        gymnasium.make(GROUNDED, **HOME, max_steps=steps + 1)
    vector = chmarl_pb.vector_env(1, GROUNDED, 0, **HOME, max_steps=steps + 1)
    assert vector.get_attr("spec")[0].max_episode_steps == steps + 1
    vector.close()


@pytest.mark.parametrize("options", [{"max_steps": 40}, {"max_episode_steps": 40}], ids=str)
def test_vectors_take_both(options: dict[str, Any]) -> None:
    for vector in (
        chmarl_pb.vector_env(1, HUMANOID, 0, **HOME, **options),
        gymnasium.make_vec(HUMANOID, 1, workers=0, **HOME, **options),
    ):
        vector.reset(seed=0)
        ends = [bool(vector.step(np.array([STAY]))[3][0]) for _ in range(40)]
        assert ends == [False] * 39 + [True]
        vector.close()


@pytest.mark.parametrize(
    ("options", "limit"), [({}, 28), ({"max_episode_steps": 3}, 3), ({"max_steps": 40}, 40)], ids=str
)
def test_the_spec_of_a_vector_has_the_limit_of_its_environments(options: dict[str, Any], limit: int) -> None:
    vector: Any = gymnasium.make_vec(HUMANOID, 1, workers=0, **HOME, **options)
    spec = vector.spec
    assert spec is not None and spec.id == HUMANOID
    assert spec.max_episode_steps == vector.get_attr("spec")[0].max_episode_steps == limit
    vector.close()
    again = gymnasium.make_vec(spec)
    assert again.spec == spec
    again.close()


def test_a_vector_without_autoreset_refuses_a_step_too_many() -> None:
    vector = chmarl_pb.vector_env(1, HUMANOID, 0, autoreset_mode="Disabled", **HOME, max_episode_steps=1)
    vector.reset(seed=0)
    vector.step(np.array([STAY]))
    with pytest.raises(NotResetError, match="environment 0"):
        vector.step(np.array([STAY]))


def test_what_lies_behind_an_id_ends_by_itself(make: Callable[..., Any]) -> None:
    """Data sets and rollouts play in the ParallelEnv of a view, where Gymnasium's limit is not."""
    joint = make("CHMARL/SceneGraph-v0", **HOME, max_episode_steps=40)
    staying = Staying()
    assert len(chmarl_pb.rollout(core_of(joint), staying, seed=0)) == 28
    joint.reset(seed=0)
    ends = [joint.step([STAY, 8])[2:4] for _ in range(40)]
    assert ends == [(False, False)] * 39 + [(False, True)]


class Staying:
    def reset(self, seed: int | None) -> None:
        pass

    def act(self, observations: Any, infos: Any) -> dict[str, int]:
        return {"humanoid": STAY, "drone": 8}


def test_frames_of_a_longer_id_do_not_say_that_it_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    env = gymnasium.make(HUMANOID, max_episode_steps=30, **HOME)
    core, shown = core_of(env), list[bool]()
    monkeypatch.setattr(core, "render_mode", "human")
    monkeypatch.setattr(core, "render", lambda: shown.append(bool(core.agents)))
    assert length(env) == 30
    assert len(shown) == 31 and all(shown) and core.state().max() <= 1
    env.close()
