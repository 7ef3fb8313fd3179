"""Own words: symbols that robots choose, heard late, lost, flipped and paid for."""

import copy
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from pettingzoo.test import parallel_api_test
from pettingzoo.utils import BaseParallelWrapper

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import Episode
from chmarl_pb.errors import ActionError, OptionError
from chmarl_pb.evaluation.episode_file import load_episode, record_episode, replay_episode, save_episode
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.frames import wording
from chmarl_pb.policies.code import REPEATS, RoomCode
from chmarl_pb.policies.registry import BUILT_IN, make_policy
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.symbols import Symbols
from chmarl_pb.viewer.record import record_file

ROBOTS = ("humanoid", "drone")
TASKS = load_tasks("val-unseen")[::6]
STAY = {"humanoid": 9, "drone": 8}


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split="val-unseen", messages="symbols")
    yield env
    env.close()


def heard(observations: dict[str, dict[str, np.ndarray]]) -> dict[str, int]:
    """Return robot -> the symbol that it hears of the other, 0 for nothing."""
    rows = {robot: seen["messages"] for robot, seen in observations.items()}
    assert all(row.shape[0] == 1 and row.sum() <= 1 and not row[0, 0] for row in rows.values())
    return {robot: int(row[0].argmax()) for robot, row in rows.items()}


def talk(env: HouseholdEnv, said: list[tuple[int, int]]) -> list[dict[str, int]]:
    """Let the robots say pairs of symbols while they stay; return what they hear after each step."""
    found = []
    for pair in said:
        actions = {robot: (STAY[robot], symbol) for robot, symbol in zip(ROBOTS, pair, strict=True)}
        found.append(heard(env.step(actions)[0]))
    return found


def test_the_others_hear_it_in_the_next_observation(env: HouseholdEnv) -> None:
    observations, _ = env.reset(seed=0)
    assert heard(observations) == {"humanoid": 0, "drone": 0}
    assert talk(env, [(5, 0), (0, 15), (7, 7), (0, 0)]) == [
        {"humanoid": 0, "drone": 5}, {"humanoid": 15, "drone": 0}, {"humanoid": 7, "drone": 7},
        {"humanoid": 0, "drone": 0},
    ]  # fmt: skip
    assert env.state().shape == env.state_space.shape


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_delay_in_steps(delay: int) -> None:
    env = chmarl_pb.parallel_env(split="val-unseen", messages=Symbols(delay=delay))
    env.reset(seed=0)
    said = [(number, 15 - number) for number in range(1, 9)]
    found = talk(env, said)
    assert found[: delay - 1] == [{"humanoid": 0, "drone": 0}] * (delay - 1)
    assert found[delay - 1 :] == [{"humanoid": other, "drone": own} for own, other in said[: len(said) - delay + 1]]
    observations, _ = env.reset(seed=0)
    assert heard(observations) == {"humanoid": 0, "drone": 0}, "words do not reach the next episode"
    env.close()


def test_loss_and_flips_by_the_seed() -> None:
    channel = Symbols(vocabulary=8, loss=0.3, flips=0.2).among(ROBOTS)

    def arrived(seed: int) -> list[int]:
        rng, messages, found = np.random.default_rng(seed), channel.begin(()), []
        for _ in range(3000):
            messages = channel.say(messages, {"humanoid": 3, "drone": 0}, rng)
            row = channel.hear(messages, "drone", rng)[0]
            found.append(int(row.argmax()) if row.any() else 0)
            assert not channel.hear(messages, "humanoid", rng).any(), "silence stays silence"
        return found

    found = arrived(0)
    assert found == arrived(0) != arrived(1)
    shares = np.bincount(found, minlength=8) / len(found)
    assert shares[0] == pytest.approx(0.3, abs=0.03) and shares[3] == pytest.approx(0.7 * 0.8, abs=0.03)
    others = np.delete(shares, [0, 3])
    assert others == pytest.approx(0.7 * 0.2 / 6, abs=0.012)
    certain = Symbols(vocabulary=4, flips=1.0).among(ROBOTS)
    rng = np.random.default_rng(0)
    for symbol in (1, 2, 3):
        rows = [certain.say(certain.begin(()), {"humanoid": symbol}, rng)[0, 0] for _ in range(50)]
        assert {int(row.argmax()) for row in rows} == {1, 2, 3} - {symbol}


def test_price_is_shared_and_silence_is_free() -> None:
    free, dear = (chmarl_pb.parallel_env(split="val-unseen", messages=Symbols(price=price)) for price in (0.0, 0.25))
    rng = np.random.default_rng(0)
    for env in (free, dear):
        env.reset(seed=1)
    for _ in range(10):
        actions = {
            robot: (int(rng.integers(count)), int(rng.integers(3))) for robot, count in (("humanoid", 10), ("drone", 9))
        }
        (_, plain, *_), (_, priced, *_) = (env.step(actions) for env in (free, dear))
        spoken = sum(symbol > 0 for _, symbol in actions.values())
        assert priced == pytest.approx({robot: reward - 0.25 * spoken for robot, reward in plain.items()})
        assert len(set(priced.values())) == 1
    free.close()
    dear.close()


def test_only_the_words_differ_from_the_paper(env: HouseholdEnv) -> None:
    """Actions alone say nothing; all but the messages is as with the board."""
    board = chmarl_pb.parallel_env(split="val-unseen")
    found: list[list[Any]] = [[], []]
    for kept, other in zip(found, (board, env), strict=True):
        rng = np.random.default_rng(0)
        results: tuple[Any, ...] = other.reset(seed=5)
        while other.agents:
            for seen in results[0].values():
                del seen["messages"]
            kept.append(results)
            results = other.step({"humanoid": int(rng.integers(10)), "drone": int(rng.integers(9))})
    assert digest(*found[0]) == digest(*found[1])
    assert env.said == dict.fromkeys(ROBOTS, 0) and board.said == {} and board.symbols == 0
    board.close()


def test_spaces_and_wrong_pairs(env: HouseholdEnv) -> None:
    assert env.action_space("humanoid") == spaces.MultiDiscrete([10, 16])
    assert env.action_space("drone") == spaces.MultiDiscrete([9, 16])
    env.reset(seed=0)
    for wrong in ((9, 16), (9, -1), (9, 0, 0), (9.0, 1.0), (10, 0)):
        with pytest.raises(ActionError, match="humanoid"):
            env.step({"humanoid": wrong, "drone": (8, 0)})
    assert env.steps == 0
    plain = chmarl_pb.parallel_env(split="val-unseen")
    plain.reset(seed=0)
    with pytest.raises(ActionError):
        plain.step({"humanoid": (9, 0), "drone": 8})
    plain.close()


@pytest.mark.parametrize(
    ("dials", "words"),
    [
        ({"vocabulary": 1}, "2 to 1,024"), ({"delay": 0}, "1 to 1,000"), ({"loss": 1.5}, "from 0 to 1"),
        ({"loss": "0.5"}, "loss='0.5'"), ({"loss": True}, "loss=True"), ({"flips": -0.1}, "from 0 to 1"),
        ({"price": -1}, "from 0 on"), ({"vocabulary": 2, "flips": 0.1}, "needs a"),
    ],
)  # fmt: skip
def test_wrong_dials_are_refused(dials: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        Symbols(**dials)


def test_one_robot_has_nobody_to_talk_to() -> None:
    with pytest.raises(OptionError, match="two robots"):
        chmarl_pb.parallel_env(robots=("humanoid",), messages="symbols")
    with pytest.raises(OptionError, match="messages='words' is not known"):
        chmarl_pb.parallel_env(messages="words")


def test_three_robots_hear_each_other_in_their_order() -> None:
    env = chmarl_pb.parallel_env(robots=("humanoid", "drone", "drone"), messages=Symbols(4), split="val-unseen")
    env.reset(seed=0)
    observations, *_ = env.step({"humanoid": (9, 1), "drone_0": (8, 2), "drone_1": (8, 3)})
    assert {robot: seen["messages"].argmax(axis=1).tolist() for robot, seen in observations.items()} == {
        "humanoid": [2, 3], "drone_0": [1, 3], "drone_1": [1, 2]
    }  # fmt: skip
    env.close()


def test_interfaces_take_pairs(env: HouseholdEnv) -> None:
    parallel_api_test(env, 20)
    turns = chmarl_pb.env(split="val-unseen", messages="symbols")
    turns.reset(seed=0)
    for robot in turns.agent_iter(max_iter=4):
        turns.step(np.array([turns.action_space(robot).nvec[0] - 1, 3]))
    assert turns.unwrapped.steps == 2 and turns.unwrapped.said == dict.fromkeys(ROBOTS, 3)
    turns.close()
    joint = gymnasium.make("CHMARL/SceneGraph-v0", messages="symbols", split="val-unseen")
    assert joint.action_space == spaces.MultiDiscrete([10, 16, 9, 16])
    joint.reset(seed=0)
    observation, *_ = joint.step(np.array([9, 4, 8, 6]))
    assert observation["drone_messages"].argmax() == 4 and observation["humanoid_messages"].argmax() == 6
    joint.close()
    flat = gymnasium.make("CHMARL/SceneGraph-v0", messages="symbols", split="val-unseen", flat_actions=True)
    assert flat.action_space == spaces.Discrete(10 * 16 * 9 * 16)
    flat.reset(seed=0)
    observation, *_ = flat.step(int(np.ravel_multi_index((9, 4, 8, 6), (10, 16, 9, 16))))
    assert observation["drone_messages"].argmax() == 4
    flat.close()
    vector = chmarl_pb.vector_env(2, workers=0, messages="symbols", split="val-unseen")
    vector.reset(seed=0)
    observations, *_ = vector.step(np.array([[9, 4, 8, 6], [9, 0, 8, 1]]))
    assert observations["drone_messages"].argmax(axis=2).ravel().tolist() == [4, 0]
    vector.close()


class FlatWords(BaseParallelWrapper):  # type: ignore[misc]
    """The wrapper of docs/environments.md: one number for a pair."""

    def action_space(self, agent: str) -> spaces.Discrete:
        return spaces.Discrete(int(self.env.action_space(agent).nvec.prod()))

    def step(self, actions: dict[str, int]) -> Any:
        pairs = {robot: np.unravel_index(n, self.env.action_space(robot).nvec) for robot, n in actions.items()}
        return self.env.step(pairs)


def test_flat_learners_wrap_it(env: HouseholdEnv) -> None:
    pytest.importorskip("torch")
    from chmarl_pb.learning.spaces import spaces_of

    flat = FlatWords(env)
    assert spaces_of(env)[1] == {"humanoid": (10, 16), "drone": (9, 16)}
    assert spaces_of(flat)[1] == {"humanoid": 160, "drone": 144}

    class Saying:
        def reset(self, seed: int | None) -> None:
            pass

        def act(self, observations: Any, infos: Any) -> dict[str, int]:
            return {"humanoid": 9 * 16 + 5, "drone": 8 * 16 + 3}

    episode = chmarl_pb.rollout(flat, Saying(), 0)
    assert episode.said[0] == {"humanoid": 5, "drone": 3} and len(episode.said) == len(episode)


def test_the_drone_of_the_humanoid_alone_talks() -> None:
    single = gymnasium.make("CHMARL/SceneGraphHumanoid-v0", messages="symbols", split="val-unseen")
    observation, _ = single.reset(seed=0)
    told = []
    for _ in range(28):
        observation, _, terminated, truncated, _ = single.step([9, 0])
        told.append(int(observation["messages"].argmax()))
        if terminated or truncated:
            break
    assert any(told), "it has found nothing to tell"
    single.close()


def test_code_says_each_fact_and_reads_it_back() -> None:
    rooms = ("kitchen", "bedroom", "bathroom", "livingroom")
    code = RoomCode(rooms, 16)
    facts = [(row, room) for row in range(2) for room in range(4)]
    assert [code.fact_of(code.symbol_of(fact)) for fact in facts] == facts
    assert code.fact_of(0) is None and code.fact_of(9) is None
    assert RoomCode(rooms, 6).symbol_of((1, 3)) == 0, "there are too few symbols"


def test_code_tells_directions_by_what_is_left_of_the_symbols(env: HouseholdEnv) -> None:
    observations, infos = env.reset(options={"task": TASKS[0]})
    told = [0.1, 2.0, 6.2]
    for angle in told:
        speaker, hearer = (RoomCode(env.rooms, 16, bearing=lambda *_: angle) for _ in range(2))  # noqa: B023
        seen = {**observations["drone"], "messages": np.zeros((1, 16), np.int8)}
        speaker._seen = lambda *_: [("mug", (0, 2))]  # type: ignore[method-assign]
        hearer._seen = lambda *_: []  # type: ignore[method-assign]
        for step in range(3):
            own = speaker.listen(seen, infos["drone"])
            assert own["shared"][0, 2] == (step > 0), "it is known to all when it has been heard"
            seen["messages"] = np.zeros((1, 16), np.int8)
            symbol = speaker.propose()
            speaker.note(symbol)
            heard = {**seen, "messages": np.eye(16, dtype=np.int8)[[symbol]]}
            found = hearer.listen(heard, infos["drone"])
        assert found["messages"].tolist() == found["shared"].tolist() and found["messages"][0].tolist() == [0, 0, 1, 0]
        assert abs(found["bearings"][0, 2] - angle) <= np.pi / 7 + 1e-9
    assert RoomCode(env.rooms, 10, bearing=lambda *_: 1.0)._directions == 0, "too few symbols are left"


def test_x_is_told_first_and_its_direction_as_soon_as_it_is_known(env: HouseholdEnv) -> None:
    observations, infos = env.reset(options={"task": TASKS[0]})
    angle: list[float | None] = [None]
    code = RoomCode(env.rooms, 16, bearing=lambda *_: angle[0])
    code._seen = lambda *_: [("desk", (1, 0)), ("mug", (0, 2))]  # type: ignore[method-assign]
    seen, said = {**observations["drone"], "messages": np.zeros((1, 16), np.int8)}, []
    for step in range(6):
        angle[0] = 1.0 if step > 2 else None
        code.listen(seen, infos["drone"])
        said.append(code.propose())
        code.note(said[-1])
    direction = 9 + int(1.0 / (2 * np.pi) * 7)
    assert said == [3, 5, 3, direction, 5, direction], "what it names last is not named again before its direction"


def test_what_is_heard_beyond_the_code_does_no_harm(env: HouseholdEnv) -> None:
    observations, infos = env.reset(options={"task": TASKS[0]})
    code = RoomCode(env.rooms, 10)
    for symbol in (1, 9):
        heard = {**observations["drone"], "messages": np.eye(10, dtype=np.int8)[[symbol]]}
        found = code.listen(heard, infos["drone"])
    assert "bearings" not in found, "there are no symbols for directions"


def test_search_talks_and_its_partner_understands(env: HouseholdEnv) -> None:
    """By the code the pair is nearly as good as by the board, and better than where nothing is heard."""
    episodes: dict[str, list[Episode]] = {}
    for name in ("search", "search-silent"):
        policy = make_policy(name, env)
        episodes[name] = [chmarl_pb.rollout(env, policy, 1, task) for task in TASKS]
    said = [[tuple(words.values()) for words in episode.said] for episode in episodes["search"]]
    used = [symbol for rows in said for row in rows for symbol in row if symbol]
    assert used and max(used) <= 8
    for rows in said:
        for own in zip(*rows, strict=True):
            assert all(own.count(symbol) <= REPEATS for symbol in set(own) - {0})
    solved = {name: sum(episode.success for episode in kept) for name, kept in episodes.items()}
    assert solved["search"] > solved["search-silent"], solved


@pytest.mark.parametrize("name", BUILT_IN)
def test_every_policy_plays(env: HouseholdEnv, name: str) -> None:
    first, second = (chmarl_pb.rollout(env, make_policy(name, env), 0, TASKS[1]) for _ in range(2))
    assert len(first.said) == len(first) and first.said == second.said and first.actions == second.actions
    if not BUILT_IN[name].talks:
        assert not any(any(words.values()) for words in first.said)


def test_search_talks_on_pictures_and_in_copies(env: HouseholdEnv) -> None:
    pictures = chmarl_pb.parallel_env("visual", split="val-unseen", messages=Symbols(loss=0.5), image_size=32)
    twin = copy.deepcopy(pictures)
    found = [chmarl_pb.rollout(one, make_policy("search", one), 3, TASKS[0]) for one in (pictures, twin)]
    assert found[0].said == found[1].said and digest(*found[0].observations) == digest(*found[1].observations)
    for one in (pictures, twin):
        one.close()


def test_episode_files_and_films_keep_what_was_said(env: HouseholdEnv, tmp_path: Path) -> None:
    short = replace(env.options, max_steps=6)
    few = HouseholdEnv(**vars(short))
    file = record_episode(few, make_policy("search", few), "search", 0, TASKS[0])
    save_episode(file, tmp_path / "episode.json")
    again = load_episode(tmp_path / "episode.json")
    assert again == file and any(map(any, again.said)) and replay_episode(again) is None
    recording = record_file(again)
    step = next(number for number, words in enumerate(again.said, start=1) if any(words))
    assert list(recording.moments[step].said.values()) == list(again.said[step - 1])
    robot = next(robot for robot, symbol in recording.moments[step].said.items() if symbol)
    assert wording.said_words(recording.moments[step], robot).startswith(" and says ")
    few.close()
    board = chmarl_pb.parallel_env(split="val-unseen", max_steps=2)
    save_episode(record_episode(board, make_policy("search", board), "search", 0, TASKS[0]), tmp_path / "plain.json")
    assert "said" not in json.loads((tmp_path / "plain.json").read_text())
    board.close()


def test_results_stand_apart() -> None:
    for messages in ("symbols", Symbols(loss=0.1)):
        report = chmarl_pb.evaluate("search", "val-unseen", tasks=TASKS[:2], seeds=[0], workers=1, messages=messages)
        assert report.changed and report.cooperation is None


def test_own_words_are_no_board_in_texts() -> None:
    """Three robots with four words have messages of the shape of a board of four rooms."""
    env = chmarl_pb.parallel_env(
        observation="text", split="val-unseen", messages=Symbols(vocabulary=4), robots=("humanoid", "drone", "drone")
    )
    env.reset(seed=0)
    stay = {name: env.action_names[name].index("stay") for name in env.agents}
    _, _, _, _, infos = env.step({name: (action, 3) for name, action in stay.items()})
    assert not any("has been seen in" in info["text"] for info in infos.values())
    env.close()
