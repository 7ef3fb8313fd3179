"""The flat view: vectors of one shape, one number as action, infos of numbers."""

import copy
import pickle
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.spaces import Box, Dict
from gymnasium.wrappers import FlattenObservation
from pettingzoo.test import parallel_api_test

import chmarl_pb
from chmarl_pb.envs.flat import FlatEnv
from chmarl_pb.envs.flat_vector import FlatVector
from chmarl_pb.errors import ActionError, OptionError
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.sensing.sensors import View

SPLIT = "val-unseen"


@pytest.fixture(scope="module")
def flat() -> Iterator[FlatEnv]:
    with closing(chmarl_pb.flat_env(split=SPLIT, goal=True)) as env:
        yield env


@pytest.mark.parametrize(
    "options",
    [{"goal": True}, {"track": "grounded"}, {"observation": "visual", "image_size": 16}, {"observation": "depth"}],
    ids=str,
)
def test_vectors_lie_in_one_space(options: dict[str, Any]) -> None:
    with closing(chmarl_pb.flat_env(**{"split": SPLIT, **options})) as env:
        space = env.observation_space("drone")
        assert space == env.observation_space("humanoid") and env.action_space("drone") == env.action_space("humanoid")
        observations = env.reset(seed=0)[0]
        for _ in range(5):
            assert all(space.contains(vector) and np.abs(vector).max() <= 1 for vector in observations.values())
            observations = env.step({robot: env.action_space(robot).sample() for robot in env.agents})[0]


def test_the_vector_holds_every_key_in_its_slice(flat: FlatEnv) -> None:
    with closing(chmarl_pb.parallel_env(split=SPLIT, goal=True)) as plain:
        seen, _ = plain.reset(seed=3)
        vectors, _ = flat.reset(seed=3)
        for number, robot in enumerate(plain.possible_agents):
            vector, space = vectors[robot], plain.observation_space(robot)
            assert vector[flat.layout["agent"]].tolist() == np.eye(2)[number].tolist()
            for key, box in space.items():
                assert isinstance(box, Box)
                most = box.high.ravel()
                np.testing.assert_allclose(vector[flat.layout[key]] * most, seen[robot][key].ravel(), atol=1e-3)
        assert sum(part.stop - part.start for part in flat.layout.values()) == len(vectors["drone"])


@pytest.mark.parametrize("actions", [None, [0, 0], {"humanoid": 0}, {"humanoid": 0, "drone": 0, "ghost": 0}])
def test_actions_that_are_none_are_refused(flat: FlatEnv, actions: Any) -> None:
    flat.reset(seed=0)
    with pytest.raises(ActionError, match="are not a dict with one action for each of"):
        flat.step(actions)


def test_a_ragged_action_is_refused(flat: FlatEnv) -> None:
    flat.reset(seed=0)
    with pytest.raises(ActionError, match="not an array of numbers"):
        flat.step({"humanoid": [[0], [0, 1]], "drone": 0})


def test_an_action_that_a_robot_has_not_is_stay(flat: FlatEnv) -> None:
    hashes = []
    for action in (8, 9):
        _, infos = flat.reset(seed=0)
        flat.step({"humanoid": 9, "drone": action})
        hashes.append(state_hash(flat.unwrapped))
    assert hashes[0] == hashes[1]
    assert infos["drone"]["action_mask"].tolist() == [1] * 9 + [0] and infos["humanoid"]["action_mask"].all()
    assert flat.action_space("drone").sample(infos["drone"]["action_mask"]) < 9


def test_episodes_are_those_of_the_core(flat: FlatEnv) -> None:
    with closing(chmarl_pb.parallel_env(split=SPLIT, goal=True)) as plain:
        plain.reset(seed=5)
        flat.reset(seed=5)
        rng = np.random.default_rng(0)
        while plain.agents:
            actions = {"humanoid": int(rng.integers(10)), "drone": int(rng.integers(9))}
            one, other = plain.step(actions), flat.step(actions)
            assert one[1:4] == other[1:4] and state_hash(plain) == state_hash(flat.unwrapped)
        assert flat.agents == []


def test_words_are_part_of_the_number() -> None:
    with closing(chmarl_pb.flat_env(split=SPLIT, messages="symbols")) as env:
        _, infos = env.reset(seed=0)
        assert env.action_space("drone").n == 160 and infos["drone"]["action_mask"].sum() == 144
        env.step({"humanoid": 9 * 16 + 5, "drone": 9 * 16 + 3})  # of the drone's ten actions the last is not its own
        assert env.unwrapped.said == {"humanoid": 5, "drone": 3}


def test_some_keys() -> None:
    with closing(chmarl_pb.flat_env(split=SPLIT, goal=True, keys=("self", "goal"))) as env:
        observations, _ = env.reset(seed=0)
        assert list(env.layout) == ["agent", "goal", "self"] and observations["drone"].shape == (2 + 4 + 8,)


@pytest.mark.parametrize("action", [10, -1, 1.5, [1, 2], None])
def test_a_wrong_action_is_refused(flat: FlatEnv, action: Any) -> None:
    flat.reset(seed=0)
    with pytest.raises(ActionError, match=r"drone: action .* from 0 to 9"):
        flat.step({"humanoid": 9, "drone": action})
    with pytest.raises(ActionError, match="one action for each"):
        flat.step({"humanoid": 9})


class Named:
    def spaces(self) -> dict[str, Box]:
        return {"agent": Box(0, 1, (1,), np.int8)}

    def observe(self, view: View) -> dict[str, Any]:
        return {"agent": np.zeros(1, np.int8)}


class Choices:
    """A sensor whose values are choices and bits."""

    def spaces(self) -> Any:
        low = spaces.Box(-2, 4, (2, 2), np.int16)
        return {
            "bits": spaces.MultiBinary(3), "choice": spaces.MultiDiscrete([3, 2], start=[5, 0]), "low": low,
            "rows": spaces.MultiDiscrete(np.full((2, 1), 2)),
        }  # fmt: skip

    def observe(self, view: View) -> dict[str, Any]:
        return {
            "bits": np.array([1, 0, 1], np.int8), "choice": np.array([7, 0]), "low": np.full((2, 2), -2, np.int16),
            "rows": np.array([[1], [0]]),
        }  # fmt: skip


def test_choices_are_one_hot() -> None:
    with closing(chmarl_pb.flat_env((Choices(), "scene_graph"), split=SPLIT)) as env:
        space = env.observation_space("drone")
        vector = env.reset(seed=0)[0]["drone"]
        values = {key: vector[env.layout[key]].tolist() for key in ("bits", "choice", "low", "rows")}
        assert values == {"bits": [1, 0, 1], "choice": [0, 0, 1, 1, 0], "low": [-0.5] * 4, "rows": [0, 1, 1, 0]}
        assert space.contains(vector) and vector.shape == space.shape and {"edges", "self"} < env.layout.keys()


def test_keys_that_cannot_be_flattened_are_refused_if_they_are_taken() -> None:
    own = {"self": spaces.Box(0, 1, (2,)), "many": spaces.Sequence(spaces.Discrete(2)), "one": spaces.Discrete(3)}
    flat = FlatVector(spaces.Dict(own), ("one", "self"))
    assert flat({"self": np.ones(2), "one": np.int64(2), "many": ()}).tolist() == [0, 0, 1, 1, 1]  # type: ignore[dict-item]
    for keys in (None, ("many", "self")):
        with pytest.raises(OptionError, match=r"^keys: no flat vector can hold 'many' \(Sequence\), .*: one, self$"):
            FlatVector(spaces.Dict(own), keys)
    with pytest.raises(OptionError, match=r"no flat vector can hold 'own' \(Space\), .*: self$"):
        FlatVector(spaces.Dict({"self": own["self"], "own": spaces.Space((2,), np.float32)}))
    with closing(chmarl_pb.flat_env(observation=("scene_graph", Choices()), keys=("messages", "self"))) as env:
        assert list(env.layout) == ["agent", "messages", "self"]


def test_wrong_keys_are_named() -> None:
    with pytest.raises(OptionError, match=r"\['gaol'\].*goal"):
        chmarl_pb.flat_env(split=SPLIT, goal=True, keys=["gaol"])
    with pytest.raises(OptionError, match=r"keys=\(\) names none"):
        chmarl_pb.flat_env(split=SPLIT, keys=())
    wrong: tuple[Any, ...] = (5, "self")
    for keys in wrong:
        with pytest.raises(OptionError, match="are not several in a row"):
            chmarl_pb.flat_env(split=SPLIT, keys=keys)
    with pytest.raises(OptionError, match="'agent'"):
        chmarl_pb.flat_env(Named())
    with pytest.raises(OptionError, match="Dict of Boxes"):
        chmarl_pb.FlatObservation(gymnasium.make("CartPole-v1"))


def test_copies_and_pettingzoo(flat: FlatEnv) -> None:
    for other in (copy.deepcopy(flat), pickle.loads(pickle.dumps(flat))):
        with closing(other):
            one, two = flat.reset(seed=1)[0], other.reset(seed=1)[0]
            assert all((one[robot] == two[robot]).all() for robot in one)
    parallel_api_test(flat, 30)


def test_infos_have_no_text() -> None:
    with closing(chmarl_pb.NumericInfos(chmarl_pb.parallel_env("text", split=SPLIT))) as env:
        _, first = env.reset(seed=0)
        *_, last = env.step({"humanoid": 9, "drone": 8})
        for infos in (first, last):
            assert set(infos["drone"]) == {"action_mask", "action_success", "success", "potential"}
            for value in infos["drone"].values():
                assert np.asarray(value).dtype.kind in "biuf"


@pytest.mark.parametrize("env_id", ["CHMARL/SceneGraphHumanoid-v1", "CHMARL/SceneGraph-v0"])
def test_ids_as_vectors(env_id: str) -> None:
    with (
        closing(chmarl_pb.FlatObservation(gymnasium.make(env_id, split=SPLIT))) as env,
        closing(FlattenObservation(gymnasium.make(env_id, split=SPLIT))) as raw,
    ):
        vector, plain = env.reset(seed=0)[0], raw.reset(seed=0)[0]
        assert isinstance(raw.observation_space, Box) and isinstance(env.observation_space, Box) and env.spec
        assert env.observation_space.contains(vector) and env.observation_space.shape == raw.observation_space.shape
        np.testing.assert_allclose(vector * raw.observation_space.high, plain, atol=1e-3)
        assert set(env.layout) == set(_keys(raw))  # and the spec makes it again:
    with closing(gymnasium.make(env.spec)) as again:
        assert (again.reset(seed=0)[0] == vector).all()


def _keys(env: gymnasium.Env[Any, Any]) -> list[str]:
    assert isinstance(env.unwrapped.observation_space, Dict)
    return list(env.unwrapped.observation_space)


def flat_humanoid() -> gymnasium.Env[Any, Any]:
    return chmarl_pb.FlatObservation(gymnasium.make("CHMARL/SceneGraphHumanoid-v1", split=SPLIT, goal=True), ["goal"])


def test_vectors_of_flat_environments_equal_those_of_gymnasium() -> None:
    with (
        closing(chmarl_pb.vector_env(2, flat_humanoid, workers=1)) as ours,
        closing(gymnasium.vector.SyncVectorEnv([flat_humanoid] * 2)) as theirs,
    ):
        seen, _ = ours.reset(seed=0)
        assert seen.shape == (2, 4) and (seen == theirs.reset(seed=0)[0]).all()
        for action in (1, 2, 3):
            assert (ours.step(np.array([action] * 2))[0] == theirs.step(np.array([action] * 2))[0]).all()
