"""The belief search: what it has seen, and not seen, makes it look elsewhere; its robots share nothing but messages."""

from collections.abc import Iterator

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.belief.knowledge import Belief, Evidence, Find, Knowledge, Station
from chmarl_pb.policies.belief.lookahead import Prospects, best_look, prospects
from chmarl_pb.policies.belief.looks import GOTO, NEVER, plans, soonest
from chmarl_pb.policies.belief.policy import BeliefPolicy
from chmarl_pb.policies.belief.scouts import Scouts
from chmarl_pb.policies.belief.searcher import Searcher
from chmarl_pb.policies.belief.statistics import FLIGHTS, TURNS, class_bits, statistics
from chmarl_pb.policies.code import UNKNOWN
from chmarl_pb.tasks.splits import homes_of
from tools.build_belief import HOMES, measure

ROOMS = ("kitchen", "bedroom", "bathroom", "livingroom")
STATISTICS = statistics(ROOMS)
SPOTS = STATISTICS.objects_off(["desk"]), STATISTICS.receptacles_of(["desk"])
NOTHING = np.zeros((2, len(ROOMS)), dtype=bool)


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split="val-unseen", feedback=False)
    yield env
    env.close()


def belief(knowledge: Knowledge, flown: list[int] | None = None, heard: str = "", find: Find | None = None) -> Belief:
    bits = np.array([room == heard for room in ROOMS])
    return knowledge.belief(SPOTS[0], Evidence(np.array(flown or [0] * 4), bits, find), True)


def test_a_belief_sums_to_one_whatever_has_been_seen() -> None:
    knowledge = Knowledge(STATISTICS)
    for room, turn, seen in ((0, 0, "stove"), (0, 1, "kitchen_counter"), (3, 5, "sofa"), (1, 2, "towel_rack")):
        knowledge.view([(seen, ROOMS[room]), ("mug", "")], Station(room, turn), turn)
        for row in (0, 1):
            found = knowledge.belief(SPOTS[row], Evidence(np.array([1, 0, 1 << 12, 0]), NOTHING[0]), row == 0)
            assert found.chance.sum() == pytest.approx(1) and (found.chance >= 0).all()


def test_a_room_that_has_been_looked_at_in_vain_is_less_likely() -> None:
    knowledge, chances = Knowledge(STATISTICS), []
    for turn in range(TURNS):
        chances.append(belief(knowledge).in_rooms(4)[3])
        knowledge.view([], Station(3, turn))
    assert chances[1] < chances[0] and chances[-1] < chances[0] / 2


def test_a_room_that_was_looked_at_from_above_in_vain_is_less_likely() -> None:
    fresh = Knowledge(STATISTICS)
    anchor = 1 << FLIGHTS.index((0, 0))
    assert belief(fresh, [anchor, 0, 0, 0]).in_rooms(4)[0] < belief(fresh).in_rooms(4)[0] / 1.5


def test_a_message_leaves_one_room_and_the_flight_that_found_it_the_direction() -> None:
    knowledge = Knowledge(STATISTICS)
    knowledge.view([], Station(1, 0), heading=3)  # it looks along +y
    heard = belief(knowledge, heard="bedroom")
    assert heard.in_rooms(4)[1] == pytest.approx(1)
    right = belief(knowledge, heard="bedroom", find=Find(1, FLIGHTS.index((1, 0))))  # +x: three turns to the right

    def at(found: Belief, turn: int) -> float:
        return float(found.chance[found.spots.near >> turn & 1 == 1].sum())

    assert at(right, 9) > at(heard, 9) and at(right, 3) < at(heard, 3)


def test_objects_are_not_sought_on_the_receptacles_that_they_are_to_be_brought_to() -> None:
    objects = STATISTICS.objects_off(["bed"])
    assert not objects.weight[objects.support == np.bincount(STATISTICS.receptacles_of(["bed"]).support).argmax()].any()


def test_what_a_view_shows_tells_which_layouts_fit() -> None:
    knowledge = Knowledge(STATISTICS)
    before = knowledge.belief(SPOTS[1], Evidence(np.zeros(4, dtype=int), NOTHING[0]), False).in_rooms(4)
    knowledge.view([("desk", "bedroom")], None)
    after = knowledge.belief(SPOTS[1], Evidence(np.zeros(4, dtype=int), NOTHING[0]), False).in_rooms(4)
    assert after[1] > before[1]


def test_a_home_of_training_is_known_by_one_room_and_others_are_not_taken_for_it() -> None:
    def chance(knowledge: Knowledge, home: int) -> list[float]:
        fit = knowledge._fit()
        there = [(STATISTICS.layouts == room) & (STATISTICS.homes == home) for room in range(len(ROOMS))]
        return [float(fit[mine].sum() / (STATISTICS.layouts == room).sum()) for room, mine in enumerate(there)]

    of = np.flatnonzero((STATISTICS.layouts == 3) & (STATISTICS.homes == 2))[0]
    knowledge, before = Knowledge(STATISTICS), chance(Knowledge(STATISTICS), 2)
    for turn in range(TURNS // 2):
        shown = [name for name in BENCHMARK.receptacles if class_bits([name]) & int(STATISTICS.shown[of, turn])]
        knowledge.view([(name, "livingroom") for name in shown], Station(3, turn), turn)
    assert before == pytest.approx([before[0]] * 4) and min(chance(knowledge, 2)) > 0.9
    strange = Knowledge(STATISTICS)
    strange.view([(name, "livingroom") for name in ("stove", "bed", "towel_rack")], Station(3, 0), 0)
    assert all(sum(chance(strange, home)[room] for home in range(1, 6)) < 0.2 for room in range(4))


def test_only_views_that_show_a_thing_still_are_known_to() -> None:
    knowledge = Knowledge(STATISTICS)
    for seen in ([("mug", "")], [("mug", ""), ("book", "")], [("book", "")]):
        knowledge.view(seen, Station(1, 4), 4)
    assert not knowledge.sighted["mug"].any() and knowledge.sighted["book"][1] == 1 << 4


def test_the_shortest_turn_is_chosen() -> None:
    sure = np.ones(1)
    for turns, action, steps in ((11, "turn_right", 1), (1, "turn_left", 1), (4, "turn_left", 4)):
        assert soonest(plans(0), np.array([1 << turns]), sure) == (action, steps)
    assert soonest(plans(5), np.array([1]), sure) == (GOTO, 1)
    assert soonest(plans(None), np.array([1 << 2]), sure) == (GOTO, 3)
    assert soonest(plans(None), np.array([0]), sure).value == NEVER


def found(*spots: tuple[int, int, float, int]) -> Prospects:
    """Return the prospects of spots: room, turn that shows it, its chance, and when others find it."""
    room, turn, chance, due = zip(*spots, strict=True)
    return prospects(np.array(room), 1 << np.array(turn), np.array(chance), np.array(due, dtype=float))


def test_the_way_that_shows_most_soonest_is_chosen() -> None:
    sides = found((0, 1, 0.3, 20), (0, 10, 0.4, 20), (0, 11, 0.3, 20))
    assert best_look(4, Station(0, 0), sides).action == "turn_right"
    assert best_look(4, Station(0, 0), found((1, 0, 0.6, 20), (0, 4, 0.4, 20))).action == f"{GOTO}1"


def test_what_others_will_see_soon_is_left_to_them() -> None:
    assert best_look(4, None, found((1, 0, 0.6, 1), (2, 0, 0.4, 9))).action == f"{GOTO}2"
    assert best_look(4, None, found((1, 0, 0.6, 1))).value == 0


def test_flyers_look_into_all_rooms_and_nowhere_twice() -> None:
    scouts, places = Scouts(["drone"], STATISTICS, ["desk"]), []
    for _ in range(10):
        scouts.hear(NOTHING)
        scouts.decide()
        places.append(scouts._places["drone"])
    assert {place[0] for place in places[:6] if place} == {0, 1, 2, 3}, "the half that has not been seen comes first"
    assert len(set(places)) >= 8


def test_flyers_go_on_in_the_largest_rooms_once_they_have_looked_into_all() -> None:
    scouts, places = Scouts(["drone"], STATISTICS, ["desk"]), []
    for _ in range(8):
        scouts.hear(NOTHING)
        scouts.decide()
        places.append(scouts.place("drone"))
    assert all(place and ROOMS[place[0]] == "livingroom" for place in places[4:8])


def test_it_is_known_when_flyers_will_see_a_spot() -> None:
    scouts, objects = Scouts(["drone"], STATISTICS, ["desk"]), STATISTICS.objects
    scouts.hear(NOTHING)
    scouts.decide()
    steps, place = scouts.expected(0, 40.0), scouts.place("drone")
    assert place is not None
    now = (objects.room == place[0]) & (objects.above >> FLIGHTS.index(place[1]) & 1 == 1)
    assert (steps[now] == 1).all() and (steps[~now] > 1).all() and steps.max() == 40


def test_two_flyers_see_more_than_one() -> None:
    scouts, places = Scouts(["drone_0", "drone_1"], STATISTICS, ["desk"]), set()
    for _ in range(5):
        scouts.hear(NOTHING)
        scouts.decide()
        places |= set(scouts._places.values())
    assert len(places) > 5, "one robot comes to as many places as it takes steps"


def test_flyers_stay_once_both_are_found_and_turn_to_y_once_x_is() -> None:
    scouts, heard = Scouts(["drone"], STATISTICS, ["desk"]), NOTHING.copy()
    scouts.hear(heard)
    scouts.decide()
    heard[0, 1] = True
    scouts.hear(heard)
    scouts.decide()
    assert scouts.actions["drone"] != "stay"
    heard[1, 1] = True
    scouts.hear(heard)
    scouts.decide()
    assert scouts.actions["drone"] == "stay"


def test_flyers_look_where_a_thing_is_in_a_known_room_and_no_direction_was_told() -> None:
    heard, bearings = NOTHING.copy(), np.full((2, len(ROOMS)), UNKNOWN)
    scouts, actions = Scouts(["drone"], STATISTICS, ["desk"]), []
    for step in range(6):
        heard[0, 1] = heard[1, 2] = step > 0  # X is in the bedroom, Y in the bathroom
        bearings[1, 2] = 0.5
        scouts.hear(heard, bearings)
        scouts.decide()
        actions.append(scouts.actions["drone"])
    assert actions.count("goto_bedroom") == 1 and actions[3:] == ["stay"] * 3, actions
    silent = Scouts(["drone"], STATISTICS, ["desk"])
    silent.hear(heard)
    silent.decide()
    assert silent.actions["drone"] == "stay", "a board tells no directions"


def test_it_goes_on_in_the_direction_that_was_told_and_not_where_it_is_blocked(env: HouseholdEnv) -> None:
    observations, _ = env.reset(seed=3)
    seen = {**observations["humanoid"], "messages": np.zeros((2, 4), np.int8)}
    seen["messages"][0, 0] = 1
    part = BeliefPolicy(env.action_names, env.rooms, env.catalog).parts["humanoid"]
    assert isinstance(part, Searcher)
    actions = []
    for _ in range(6):
        seen["bearings"] = np.full((2, 4), UNKNOWN)
        seen["bearings"][0, 0] = float(np.arctan2(*observations["humanoid"]["self"][-2:-4:-1]))
        number = part.propose(seen, {})
        part.note(number)
        actions.append(env.action_names["humanoid"][number])
    assert actions[:2] == ["goto_kitchen", "move_forward"], "nothing is to be seen there"
    assert "move_forward" not in actions[2:4], "the view has not changed, so something is in the way"


def test_episodes_are_the_same_for_every_seed(env: HouseholdEnv) -> None:
    policy = chmarl_pb.make_policy("belief", env)
    for task in ("val-unseen-003", "val-unseen-008"):
        first, second = (chmarl_pb.rollout(env, policy, seed, task).actions for seed in (0, 1))
        assert first == second


def test_each_robot_acts_on_its_own(env: HouseholdEnv) -> None:
    together, apart = (BeliefPolicy(env.action_names, env.rooms, env.catalog) for _ in range(2))
    observations, infos = env.reset(seed=3)
    together.reset(0)
    apart.reset(0)
    for _ in range(6):
        chosen = together.act(observations, infos)
        for name, part in apart.parts.items():
            keys = ("instruction", "self", "messages", "node_class", "node_state", "edges")
            own = {key: observations[name][key] for key in keys}
            assert part.propose(own, {}) == chosen[name], "it read more than it says"
            part.note(chosen[name])
        if not env.agents:
            break
        observations, *_, infos = env.step(chosen)


def test_it_solves_most_tasks_and_messages_help(env: HouseholdEnv) -> None:
    tasks = [f"val-unseen-{number:03}" for number in range(7, 19)]
    won = {}
    for name in ("belief", "belief-told", "belief-alone"):
        policy = chmarl_pb.make_policy(name, env)
        episodes = [chmarl_pb.rollout(env, policy, 0, task) for task in tasks]
        won[name] = sum(episode.success for episode in episodes), -sum(episode.steps for episode in episodes)
    assert won["belief"][0] >= 10
    assert won["belief-told"] > won["belief"] > won["belief-alone"]


def test_the_statistics_are_those_of_the_command() -> None:
    assert [home for home in HOMES if not home.startswith("generated")] == list(homes_of("train"))
    rooms = measure("home_2", 1)
    things = [thing for room in rooms.values() for thing in room]
    assert rooms.keys() == set(ROOMS) and sum(thing["weight"] for thing in things) == pytest.approx(1, abs=1e-4)
    assert sum(count for thing in things for *_, count in thing["objects"]) >= 19
    kept = statistics(ROOMS)
    assert len(kept.layouts) >= 4 * len(HOMES) and kept.objects.near.max() < 1 << TURNS


def test_homes_with_more_rooms_and_rooms_of_unknown_kinds_are_known_by_their_kinds() -> None:
    more = statistics((*ROOMS, "bedroom_2", "workshop"))
    knowledge = Knowledge(more)
    found = knowledge.belief(more.objects_off([]), Evidence(np.zeros(6, dtype=int), np.zeros(6, dtype=bool)), True)
    chances = found.in_rooms(6)
    assert chances[1] == pytest.approx(chances[4]) and chances[5] > 0
