"""A room's bit is set once either robot has identified X or Y there, and stays."""

import numpy as np

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.messages import Board
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import WorldState
from tests.helpers.playing import room_at

ROOMS = ("kitchen", "bedroom", "bathroom", "livingroom")
GOAL = Goal("mug_1", ("bedroom/desk_1", "livingroom/desk_1", "hallway/desk_1"))
RNG = np.random.default_rng(0)


def outcome(humanoid: tuple[str, ...] = (), drone: tuple[str, ...] = (), room: str = "kitchen") -> Outcome:
    return Outcome(WorldState(), {"humanoid": humanoid, "drone": drone}, room, 0.0, False)


def bits(*outcomes: Outcome) -> list[list[int]]:
    messages = Board().begin(ROOMS)
    for one in outcomes:
        messages = Board().update(messages, one, GOAL, ROOMS, RNG)
    told: list[list[int]] = messages.tolist()
    return told


def test_nothing_is_known_at_first() -> None:
    assert bits() == bits(outcome()) == bits(outcome(("plate_1", "kitchen/stove_1"))) == [[0] * 4, [0] * 4]


def test_either_robot_tells() -> None:
    assert bits(outcome(("mug_1",))) == bits(outcome((), ("mug_1",))) == [[1, 0, 0, 0], [0] * 4]


def test_every_target_seen_sets_its_own_room() -> None:
    assert bits(outcome(("bedroom/desk_1",), ("livingroom/desk_1",))) == [[0] * 4, [0, 1, 0, 1]]


def test_bits_stay_and_are_added_when_x_is_carried_on() -> None:
    assert bits(outcome(("mug_1",)), outcome(), outcome(("mug_1",), room="bathroom")) == [[1, 0, 1, 0], [0] * 4]


def test_a_room_without_a_bit_is_not_told() -> None:
    assert bits(outcome(("hallway/desk_1", "mug_1"), room="hallway")) == [[0] * 4, [0] * 4]


def test_update_leaves_what_it_was_given() -> None:
    before = Board().begin(ROOMS)
    Board().update(before, outcome(("mug_1",)), GOAL, ROOMS, RNG)
    assert not before.any()


def test_messages_of_random_episodes_are_true_and_grow(env: HouseholdEnv, tasks: list[Task]) -> None:
    for number, task in enumerate(tasks[:7]):
        rng, known = np.random.default_rng(number), np.zeros((2, len(env.rooms)), dtype=int)
        observations, infos = env.reset(options={"task": task})
        while True:
            seen = {name for info in infos.values() for name in info["visible"]}
            for row, rooms in enumerate(rooms_of(env, seen)):
                for room in rooms & set(env.rooms):
                    known[row, env.rooms.index(room)] = 1
            for name in infos:
                np.testing.assert_array_equal(observations[name]["messages"], known)
            if not env.agents:
                break
            actions = {name: int(rng.integers(env.action_space(name).n)) for name in env.agents}
            observations, _, _, _, infos = env.step(actions)


def rooms_of(env: HouseholdEnv, seen: set[str]) -> tuple[set[str], set[str]]:
    """Return the rooms of what is seen of X, and of Y."""
    assert isinstance(env.task, Task)
    item = env.task.item
    support = env.world.supports.get(item)
    if support is None:
        x, y, _ = env.world.robots["humanoid"].base[0]
        where = room_at(env.world.home, x, y)
    else:
        where = support.receptacle.split("/")[0]
    targets = {name.split("/")[0] for name in seen if name in env.setting.goal.receptacles}
    return ({where} if item in seen and where else set()), targets
