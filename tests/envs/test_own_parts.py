"""What a user's own sensor, channel, adviser or kind of tasks returns by mistake is told, with its name and place."""

from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

import chmarl_pb
from chmarl_pb.envs.frame import now_of
from chmarl_pb.errors import NotResetError, OptionError
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.tasks.kinds import Rearrange
from chmarl_pb.tasks.messages import Board
from chmarl_pb.tasks.symbols import Symbols
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.unreliable import NoisyBoard
from chmarl_pb.viewer.record import note

IDLE = {"humanoid": 9, "drone": 8}


def play(**options: Any) -> None:
    """Make an environment, and play some steps in it."""
    env = chmarl_pb.parallel_env(split="val-unseen", **options)
    try:
        env.reset(seed=0)
        actions = {name: (IDLE[name], 1) for name in IDLE} if env.symbols else IDLE
        for _ in range(3):
            observations = env.step(actions)[0]
            assert all(env.observation_space(name).contains(observations[name]) for name in observations)
    finally:
        env.close()


class Distance:
    """A sensor that returns what it is told to."""

    def __init__(self, value: Any, declared: Any = None):
        self.value, self.declared = value, {"x": spaces.Box(0, 1, (2,), np.float32)} if declared is None else declared

    def spaces(self) -> Any:
        return self.declared

    def observe(self, view: Any) -> Any:
        return self.value


RIGHT = np.array([0, 1], np.float32)


def test_a_sensor_that_keeps_to_its_space() -> None:
    play(observation=Distance({"x": RIGHT}))


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        (Distance(None), r"Distance\.observe\(\) is None; .* dict with the keys \['x'\]"),
        (Distance({"x": 1}, {"x": spaces.Discrete(3)}), r"spaces\(\) is .*Discrete.* with a dimension or more"),
        (Distance({}), r"observe\(\) is \{\}"),
        (Distance({"x": RIGHT, "y": RIGHT}), "keys"),
        (Distance({"x": RIGHT[:1]}), r"observe\(\)\['x'\] is an array \(1,\) of float32, from 0.0 to 0.0; .*Box"),
        (Distance({"x": RIGHT.astype(int)}), "of int64"),
        (Distance({"x": RIGHT + 1}), "from 1.0 to 2.0"),
        (Distance({"x": [0.0, 1.0]}), r"is \[0.0, 1.0\]"),
        (Distance({"x": "near"}), "is 'near'"),
        (Distance({"x": RIGHT}, declared=[]), r"Distance\.spaces\(\) is \[\]"),
        (Distance({"x": RIGHT}, declared={"x": None}), r"spaces\(\)"),
        (Distance({"x": RIGHT}, declared={1: spaces.Box(0, 1)}), r"spaces\(\)"),
    ],
)
def test_mistakes_of_a_sensor(sensor: Distance, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        play(observation=("scene_graph", sensor))


class Wire(Board):
    """A channel one of whose methods returns something else."""

    def __init__(self, **returned: Any):
        for name, value in returned.items():
            setattr(self, name, lambda *given, value=value: value)


@pytest.mark.parametrize(
    ("method", "value", "message"),
    [
        ("space", None, r"Wire\.space\(\) is None"),
        ("begin", [0, 0], r"Wire\.begin\(\) is \[0, 0\]; .* array of numbers"),
        ("update", None, r"Wire\.update\(\) is None"),
        ("update", np.zeros((2, 9), np.int8), r"update\(\) is an array \(2, 9\) of int8, .* as begin\(\) has given"),
        ("update", np.zeros((2, 8)), r"update\(\) is an array \(2, 8\) of float64"),
        ("begin", np.full((2, 8), np.nan), r"begin\(\) is .* finite numbers"),
        ("hear", None, r"Wire\.hear\(\) is None"),
        ("hear", np.zeros(3, np.int8), r"hear\(\) is an array \(3,\)"),
        ("hear", np.full((2, 8), 2, np.int8), "from 2 to 2"),
    ],
)
def test_mistakes_of_a_channel(method: str, value: Any, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        play(messages=Wire(**{method: value}))


class Growing(Board):
    """A channel whose messages are longer in each episode."""

    rows = 2

    def begin(self, rooms: Any) -> Any:
        type(self).rows += 1
        return np.zeros((self.rows, len(rooms)), np.int8)


def test_messages_keep_their_shape_from_episode_to_episode() -> None:
    with pytest.raises(OptionError, match=r"Growing\.begin\(\) is an array \(4, .* as begin\(\) has given"):
        play(messages=Growing())


class Fragile(Board):
    """A channel that breaks once, in the second step."""

    left = 3

    def update(self, messages: Any, *given: Any) -> Any:
        type(self).left -= 1
        if not self.left:
            raise RuntimeError("torn")
        return super().update(messages, *given)


def test_a_step_that_an_own_part_breaks_ends_the_episode() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen", messages=Fragile())) as env:
        env.reset(seed=0)
        env.step(IDLE)
        with pytest.raises(RuntimeError, match="torn"):
            env.step(IDLE)
        with pytest.raises(NotResetError):
            env.step(IDLE)
        env.reset(seed=0)
        env.step(IDLE)


class Numbers(Board):
    """A channel with other messages than the board's."""

    def space(self, rooms: Any) -> Any:
        return spaces.Box(0, 9, (3,), np.float32)

    def begin(self, rooms: Any) -> Any:
        return np.zeros(3, np.float32)

    def update(self, messages: Any, *given: Any) -> Any:
        return messages

    def hear(self, messages: Any, *given: Any) -> Any:
        return messages


def test_policies_that_read_the_board_refuse_other_messages() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen", messages=Numbers())) as env:
        for policy in BUILT_IN:
            if policy in ("planner", "random", "open-loop", "feedback-only"):
                episode = chmarl_pb.rollout(env, chmarl_pb.make_policy(policy, env), seed=0)
                assert episode.success == (policy in ("planner", "open-loop")), policy
            else:
                with pytest.raises(OptionError, match=f"'{policy}' reads the message board.*use one of: .*planner"):
                    chmarl_pb.make_policy(policy, env)


class Shaped(Board):
    """A channel of the board's shape, with values of a space of one's own: the board's bits, times a factor."""

    def __init__(self, values: Any, factor: float = 1):
        self._values, self._factor = values, factor

    def space(self, rooms: Any) -> Any:
        return self._values(len(rooms))

    def hear(self, messages: Any, *given: Any) -> Any:
        space = self.space(messages[0])
        return (messages * self._factor).astype(space.dtype)


OTHERS = [
    (lambda rooms: spaces.Box(0, 100, (2, rooms), np.int16), 100), (lambda rooms: spaces.Box(0, 1, (2, rooms)), 0.5),
    (lambda rooms: spaces.Box(-1, 1, (2, rooms), np.int8), -1),
    (lambda rooms: spaces.MultiDiscrete(np.full((2, rooms), 3)), 2),
    (lambda rooms: spaces.MultiDiscrete(np.full((2, rooms), 2), start=np.ones((2, rooms), np.int64)), 0),
]  # fmt: skip
BOARDS = [
    lambda rooms: spaces.Box(0, 1, (2, rooms), np.int64), lambda rooms: spaces.Box(0, 1, (2, rooms), np.uint64),
    lambda rooms: spaces.Box(0, 1, (2, rooms), np.bool_),  # type: ignore[arg-type]
    lambda rooms: spaces.MultiBinary((2, rooms)),
    lambda rooms: spaces.MultiDiscrete(np.full((2, rooms), 2)),
]  # fmt: skip


def heard_as_board(channel: Any) -> bool:
    """Return whether rooms that X or Y has been seen in are told by the text, and shown in frames."""
    given: dict[str, Any] = {"split": "val-unseen", "messages": channel, "observation": "scene_graph+text"}
    with closing(chmarl_pb.parallel_env(**given)) as env:
        _, infos = env.reset(seed=0)
        texts = ""
        while env.agents:
            *_, infos = env.step({"humanoid": env.steps % 4, "drone": env.steps % 4})
            texts += infos["drone"]["text"]
        told, shown = "been seen in the" in texts, now_of(env, env._last).recording.has_board
        assert told == shown == (note(env).messages is not None) == env.hears_board
        return told


@pytest.mark.parametrize(("values", "factor"), OTHERS)
def test_messages_of_the_boards_shape_are_none_if_they_mean_something_else(values: Any, factor: float) -> None:
    channel = Shaped(values, factor) if factor else Shaped(values)
    if not factor:
        channel.hear = lambda messages, *given: messages.astype(np.int64) + 1  # type: ignore[method-assign]
    assert not heard_as_board(channel)
    with closing(chmarl_pb.parallel_env(split="val-unseen", messages=channel, lookalikes=True)) as env:
        for policy in ("search", "belief", "belief-told", "reactive"):
            with pytest.raises(OptionError, match=f"'{policy}' reads the message board, an array .2, 4. of whole num"):
                chmarl_pb.make_policy(policy, env)


@pytest.mark.parametrize("values", BOARDS)
def test_a_board_is_one_in_any_type_of_whole_numbers(values: Any) -> None:
    assert heard_as_board(Shaped(values))
    with closing(chmarl_pb.parallel_env(split="val-unseen", messages=Shaped(values), max_steps=12)) as env:
        usual = chmarl_pb.parallel_env(split="val-unseen", max_steps=12)
        for policy in ("search", "search-alone", "belief-told", "search-silent"):
            own, board = (chmarl_pb.rollout(one, chmarl_pb.make_policy(policy, one), seed=0) for one in (env, usual))
            assert own.actions == board.actions
        usual.close()


@pytest.mark.parametrize(("channel", "is_told"), [(True, True), (False, False), (NoisyBoard(0.1), True)])
def test_the_packages_channels_are_boards(channel: Any, is_told: bool) -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen", messages=channel)) as env:
        assert env.hears_board == is_told and chmarl_pb.make_policy("search", env)
    with closing(chmarl_pb.parallel_env(split="val-unseen", messages="symbols")) as env:
        assert not env.hears_board


class Aging(Board):
    """A channel that keeps for how many steps each room has been known, and is heard as a board."""

    def update(self, messages: Any, *given: Any) -> Any:
        known = super().update(np.minimum(messages, 1), *given)
        return np.where(known, messages + 1, 0).astype(np.int8)

    def hear(self, messages: Any, *given: Any) -> Any:
        return np.minimum(messages, 1)


def test_what_a_channel_keeps_is_not_taken_for_the_board_that_is_heard() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen", messages=Aging())) as env:
        chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), seed=0)
        assert env.hears_board and env.messages.max() > 1 and note(env).messages is None


class Mumble(Symbols):
    """Own words one of whose methods returns something else."""

    def say(self, messages: Any, said: Any, rng: Any) -> Any:
        return self.price if self.price else super().say(messages, said, rng)

    def cost(self, said: Any) -> Any:
        return None


def test_mistakes_of_own_words() -> None:
    with pytest.raises(OptionError, match=r"Mumble\.cost\(\) is None; it is to be a finite number"):
        play(messages=Mumble())
    with pytest.raises(OptionError, match=r"Mumble\.say\(\) is 1.0"):
        play(messages=Mumble(price=1.0))


@pytest.mark.parametrize("count", [-1, 0, 1, 2.5, "a", None, True, 1025])
def test_numbers_of_words_that_cannot_be(count: Any) -> None:
    class Words(Symbols):
        def among(self, robots: Any) -> Any:
            return self

    words = Words()
    object.__setattr__(words, "vocabulary", count)
    with pytest.raises(OptionError, match=r"Words\.vocabulary=.* is not a whole number from 2 to 1,024"):
        play(messages=words)


class Filled(Distance):
    """A sensor that writes what it observes into one array."""

    def __init__(self) -> None:
        super().__init__(None)
        self.kept = np.zeros(2, np.float32)

    def observe(self, view: Any) -> Any:
        self.kept[0] += 0.125
        return {"x": self.kept}


def test_arrays_that_a_sensor_fills_again_are_copied() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen", observation=("scene_graph", Filled()))) as env:
        first, _ = env.reset(seed=0)
        env.step(IDLE)
        assert [first[name]["x"][0] for name in ("humanoid", "drone")] == [0.125, 0.25]


def test_texts_do_not_take_the_place_of_infos() -> None:
    class Loud(Distance):
        def spaces(self) -> Any:
            return {name: spaces.Box(0, 255, (8,), np.uint8) for name in self.value}

    play(observation=("scene_graph", Loud({"said": "hello"})))
    with closing(chmarl_pb.parallel_env(split="val-unseen")) as env:
        _, infos = env.reset(seed=0)
        for name in {*infos["drone"], "is_success"} - {"instruction", "feedback"}:
            with pytest.raises(OptionError, match=f"Loud.spaces.. is '{name}'; .* texts stand in infos"):
                play(observation=("scene_graph", Loud({name: "hello"})))


class Coach:
    """An adviser that returns what it is told to."""

    def __init__(self, advice: Any):
        self.advice = advice

    def begin(self, simulation: Any, task: Any, goals: Any) -> None: ...

    def before(self, actions: Any, outcome: Any) -> None: ...

    def after(self, succeeded: Any, step: int) -> Any:
        return self.advice


def test_an_adviser_that_says_sentences() -> None:
    play(feedback=Coach({"humanoid": "Look left."}))


@pytest.mark.parametrize("advice", [None, "Look left.", {"humanoid": 5}, {"robot": "Look left."}])
def test_mistakes_of_an_adviser(advice: Any) -> None:
    with pytest.raises(OptionError, match=r"Coach\.after\(\) is .*; .* sentences to some of \['humanoid', 'drone'\]"):
        play(feedback=Coach(advice))


class Errand(Rearrange):
    """A kind of tasks one of whose methods returns something else."""

    def __init__(self, **returned: Any):
        super().__init__()
        for name, value in returned.items():
            object.__setattr__(self, name, value if name == "objects" else lambda *given, value=value: value)


@dataclass(frozen=True)
class Polite(Task):
    """A task with a field of its own, which no file could hold."""

    polite: bool = True


@pytest.mark.parametrize(
    ("method", "value", "message"),
    [
        (
            "tasks",
            [Polite("a", "home_6", "mug", "desk", "bed", 0)],
            r"tasks\(\) is \[Polite.* no classes derived of it",
        ),
        ("objects", "a", r"Errand\.objects='a' is not a whole number from 1 on"),
        ("tasks", None, r"Errand\.tasks\(\) is None; it is to be a list of chmarl_pb\.Task"),
        ("tasks", ["val-unseen-000"], r"tasks\(\) is \['val-unseen-000'\]"),
        ("set_up", None, r"Errand\.set_up\(\) is None"),
        ("outcome", None, r"Errand\.outcome\(\) is None"),
        ("instruction", None, r"Errand\.instruction\(\) is None; it is to be a sentence"),
        ("instruction", "word " * 25, "at most 24 words"),
    ],
)
def test_mistakes_of_a_kind_of_tasks(method: str, value: Any, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        play(task=Errand(**{method: value}))


class Judge(Rearrange):
    """A kind of tasks whose outcomes have something else at one place."""

    def __init__(self, **changed: Any):
        super().__init__()
        object.__setattr__(self, "changed", changed)

    def outcome(self, state: Any, setting: Any, seen: Any) -> Any:
        found = super().outcome(state, setting, seen)
        changed: dict[str, Any] = vars(self)["changed"]
        for name, value in changed.items():
            object.__setattr__(found, name, (found,) * 2 if value == "two" else value)
        return found


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        ("potential", float("nan"), "is nan; it is to be a finite number"),
        ("potential", float("inf"), "is inf"),
        ("potential", None, "is None"),
        ("potential", "3", "is '3'"),
        ("success", None, "is None; it is to be True or False"),
        ("success", 1, "is 1"),
        ("seen", {}, "it is to be what it is given as seen"),
        ("parts", "two", "it is to be an Outcome for each goal of the setting, of which there are 1"),
        ("parts", None, "an Outcome for each goal"),
    ],
)
def test_mistakes_of_outcomes(place: str, value: Any, message: str) -> None:
    with pytest.raises(OptionError, match=rf"Judge\.outcome\(\)\.{place} .*{message}"):
        play(task=Judge(**{place: value}))


def test_numbers_of_numpy_in_outcomes_are_made_plain() -> None:
    with closing(
        chmarl_pb.parallel_env(split="val-unseen", task=Judge(potential=np.float32(3), success=np.False_))
    ) as env:
        env.reset(seed=0)
        _, rewards, terminations, _, infos = env.step(IDLE)
        assert rewards == {"humanoid": 0.0, "drone": 0.0} and type(rewards["drone"]) is float
        assert terminations["drone"] is False and type(infos["drone"]["potential"]) is float


def test_a_setting_without_goals() -> None:
    class Aimless(Rearrange):
        def set_up(self, *given: Any) -> Any:
            return replace(super().set_up(*given), goals=())

    with pytest.raises(OptionError, match=r"Aimless\.set_up\(\) .* a Setting with one goal or more"):
        play(task=Aimless())


@pytest.mark.parametrize("policy", ["search", "belief", "reactive", "open-loop"])
def test_an_instruction_that_names_nothing_ends_policies_that_read_it(policy: str) -> None:
    with pytest.raises(OptionError, match="names no known graspable and receptacle, by which this policy acts"):
        chmarl_pb.evaluate(policy, "val-unseen", tasks=["val-unseen-000"], workers=1, task=Errand(instruction="Fetch!"))


def test_a_kind_without_tasks_that_draws_none() -> None:
    with pytest.raises(OptionError, match=r"Errand\.sample\(\) is None; it is to be a chmarl_pb\.Task"):
        play(task=Errand(tasks=[], sample=None))


def test_a_goal_that_nothing_tells() -> None:
    with pytest.raises(OptionError, match=r"goal=True: .* 'Fetch it!' must name one known graspable"):
        play(task=Errand(instruction="Fetch it!"), goal=True)
