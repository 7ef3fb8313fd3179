"""The robot that grasps, by its belief: it looks where X or Y is likeliest for the steps that it takes to look."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.blas import one_thread
from chmarl_pb.catalog import Catalog
from chmarl_pb.policies.aiming import number_of
from chmarl_pb.policies.belief.follower import Follower
from chmarl_pb.policies.belief.hand import Hand
from chmarl_pb.policies.belief.knowledge import Belief, Evidence, Knowledge, Station
from chmarl_pb.policies.belief.lookahead import Prospects, best_look, joined, prospects
from chmarl_pb.policies.belief.looks import GOTO, Look, Plans, plans, soonest
from chmarl_pb.policies.belief.scouts import Scouts
from chmarl_pb.policies.belief.statistics import TURNS, Bits, statistics
from chmarl_pb.policies.code import BEARINGS, LIVE, SHARED, UNKNOWN
from chmarl_pb.policies.sights import classes_in_view, messages_read, own_room, places_in_view
from chmarl_pb.policies.tidying import Pair, Tidying
from chmarl_pb.robots.pointing import VERBS, verb_of
from chmarl_pb.tasks.language import read_pairs

_Y_TOO = 0.15  # what seeing Y counts beside seeing X, while X is searched for
_KNOWN = 0.9  # from this probability on the room is known
_LATE = 7.0  # steps after which others may find what they do not plan to find
_LEAST = 1e-3  # probability a step for which a look is not worth it
_OTHERS = 0.5  # what finding X counts in a room that another robot that grasps begins with
_DOUBT = 0.3  # that messages are of the object in question, if there are several
_HIDDEN = 0.3  # share of what is left of a room's probability below which its anchor is no place to look from
_BEHIND = TURNS // 2  # turns: what an anchor does not show is rather where it does not face
_ASIDE = 0, 6, 9, 3  # turns by which it goes on in another direction the next times
_AROUND = ("move_forward", *["turn_left"] * (TURNS - 1))
# Turns aside of the direction that was told, and ways from there: towards the thing, then past what may hide it.
_TOWARDS = (
    (0, (*["move_forward"] * 3, "turn_left", "turn_right", "turn_right")),
    (2, (*["move_forward"] * 2, *["turn_right"] * 3)),
    (-2, (*["move_forward"] * 2, *["turn_left"] * 3)),
)
_ALL = (1 << TURNS) - 1


class Searcher:
    """Drives one robot that grasps.

    Attributes:
        knowledge: what it has seen in this episode.
    """

    def __init__(
        self, actions: tuple[str, ...], rooms: tuple[str, ...], flyers: tuple[str, ...], part: tuple[int, int],
        known: Catalog,
    ):  # fmt: skip
        """Get to know the team.

        Args:
            actions: names of its actions, in the order of their numbers.
            rooms: names of the rooms.
            flyers: the robots that fly and on whose views it counts.
            part: its number among the robots that grasp, and their count.
            known: the classes that instructions name.
        """
        self.actions, self.rooms, self._flyers, self._part, self._catalog = actions, rooms, flyers, part, known
        self._hand = Hand(known)
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode; nothing is drawn at random."""
        self.knowledge = Knowledge(statistics(self.rooms))
        self._scouts: Scouts | None = None
        self._station: Station | None = None
        self._zero = 0  # heading at the anchor where it stands
        self._tidying = Tidying()
        self._tried = ""
        self._queue: list[str] = []  # the rest of a look around from elsewhere, backwards
        self._way: list[str] = []  # the same from the proposed action on
        self._follower = Follower()
        self._proposed = ""
        self._held = self._deaf = False
        self._hand.reset()
        self._vain: dict[str, Bits] = defaultdict(lambda: np.zeros(len(self.rooms), dtype=np.int64))  # such views
        self._origin: Station | None = None  # where it began to do something with what was in view
        self._goal: tuple[int, int | None] = -1, None  # the likeliest room, and the turn there that was told
        self._wandered: Counter[tuple[bool, int]] = Counter()  # times that it went on into rooms, for X and for Y
        self._seen = np.empty(0)  # what tells that a pace has led nowhere

    def propose(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> int:
        """Return the number of the action that is to be taken now; nothing counts as done before it is noted."""
        self._way = []
        self._follower.begin()
        with one_thread():
            self._proposed = self._choose(observation, info)
        return number_of(self.actions, self._proposed)

    def note(self, action: int) -> None:
        """Go on from the action that was taken, whatever was proposed."""
        done = self.actions[action]
        followed = action == number_of(self.actions, self._proposed)
        self._tried = verb_of(done)
        self._follower.note(done, followed)
        if self._hand.note(self._proposed if followed else done):
            self._origin = self._origin or self._station
        if not followed:
            self._queue = []
        elif self._way:
            self._wandered[self._held, self._goal[0]] += not self._queue
            self._queue = self._way[:-1]

    def _choose(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> str:
        pairs, holding = read_pairs(observation["instruction"], self._catalog), bool(observation["self"][-1])
        seen, done = classes_in_view(observation, info, self._catalog), holding != self._held
        self._held = holding
        self._origin = None if done else self._origin
        self._blocked(observation)
        self._look(observation, info, done)
        tried = "" if self._hand.away else self._tried
        wanted = self._tidying.wanted(pairs, holding, seen, tried)
        heard = messages_read(observation, self.rooms, self._catalog) > 0
        self._shared = messages_read(observation, self.rooms, self._catalog, SHARED) > 0
        self._told = observation.get(BEARINGS)
        self._bearings = np.full(heard.shape, UNKNOWN) if self._told is None else self._told
        self._ahead = self._pointed_out(observation, holding)
        beliefs = self._listen(heard, pairs, holding, wanted, seen)
        action = self._hand.choose(observation, wanted, {item for item, _ in pairs}, seen)
        if action is not None:
            self._queue = []
            return action
        self._give_up(wanted, seen)
        return self._search(beliefs, wanted)

    def _give_up(self, wanted: Collection[str], seen: Collection[str]) -> None:
        """Do not come back to what is in view here, nor to the view from which it led to nothing."""
        here = self._station if set(wanted) & set(seen) else None
        for station in filter(None, (here, self._origin)):
            for name in wanted:
                self._vain[name][station.room] |= 1 << station.turn
        self._origin = None

    def _look(self, observation: dict[str, np.ndarray], info: dict[str, Any], done: bool) -> None:
        """Note where the last action has led, and what is in view there."""
        cosine, sine = observation["self"][-3:-1]
        heading = round(float(np.arctan2(sine, cosine)) * TURNS / (2 * np.pi)) % TURNS
        if self._tried.startswith("goto_"):
            self._station, self._zero = Station(self.rooms.index(self._tried.removeprefix("goto_")), 0), heading
        elif self._tried == "move_forward" or (self._tried in VERBS and done):
            self._station = None
        if self._station is not None:
            self._station = Station(self._station.room, (heading - self._zero) % TURNS)
        places, known = places_in_view(observation, info, self.rooms, self._catalog), self._catalog.receptacles
        seen = [(name, room if name in known else "") for name, room in places]
        self.knowledge.view(seen, self._station, heading)

    def _listen(
        self,
        heard: NDArray[np.bool_],
        pairs: Sequence[Pair],
        holding: bool,
        wanted: Collection[str],
        seen: Collection[str],
    ) -> list[Belief]:
        """Keep account of the others, and return where what is wanted is; while X is, also where Y is."""
        several, targets = len(pairs) > 1, {target for _, target in pairs}
        self._targets = wanted if holding else targets
        self._deaf |= bool(targets & set(seen)) and not heard[1].any()  # its own view would have been told
        spots = self.knowledge.statistics.objects_off(targets), self.knowledge.statistics.receptacles_of(targets)
        if self._scouts is None:
            self._scouts = Scouts(self._flyers, self.knowledge.statistics, targets, several)
        scouts = self._scouts
        scouts.hear(self._shared, self._told)
        scouts.decide()
        doubt = _DOUBT if several else 0.0
        evidence = [
            Evidence(np.zeros_like(flown) if self._deaf else flown, bits, find, doubt, bearings)
            for flown, bits, find, bearings in zip(scouts.flown, heard, scouts.finds, self._bearings, strict=True)
        ]
        self._find = scouts.finds[holding]
        of_y = self.knowledge.statistics.receptacles_of(wanted) if holding else spots[1]
        y = (
            []
            if not holding and targets & self.knowledge.sighted.keys()
            else [self.knowledge.belief(of_y, evidence[1], False)]
        )
        return y if holding else [self.knowledge.belief(spots[0], evidence[0], True), *y]

    def _search(self, beliefs: list[Belief], wanted: Collection[str]) -> str:
        """Return the action by which what is wanted is likely to be seen soon.

        Args:
            beliefs: where it is, and where Y is, which it is good to see, too.
            wanted: the classes of what is wanted; what has been in view is gone back to.
        """
        in_rooms = beliefs[0].in_rooms(len(self.rooms))
        room = int(in_rooms.argmax())
        goal = room, self._told_turn(room)
        if goal != self._goal:
            self._goal, self._queue = goal, []
        looks = [*self._sighted(wanted)]
        step = self._follower.towards(self._ahead, self._stuck) if self._ahead is not None and not looks else None
        if step is not None:
            self._queue = []
            return step
        if in_rooms[room] >= _KNOWN:
            looks += self._known(beliefs[0], room) if not self._queue else []
            return min(looks, key=lambda look: look.value).action if looks else self._wander(room)
        if looks:
            return min(looks, key=lambda look: look.value).action
        best = self._promise(beliefs)
        return best.action if best.value > _LEAST else self._wander(room)

    def _pointed_out(self, observation: dict[str, np.ndarray], holding: bool) -> float | None:
        """Return how far to the left it is to where it has just been told to look in its room, in radians; or None."""
        room = own_room(observation, self.rooms)
        if LIVE not in observation or not room or self._tried.startswith(GOTO):  # told of where it was before
            return None
        fact = int(holding), self.rooms.index(room)
        cosine, sine = observation["self"][-3:-1]
        away = float(self._bearings[fact] - np.arctan2(sine, cosine) + np.pi) % (2 * np.pi) - np.pi
        return away if observation[LIVE][fact] else None

    def _sighted(self, wanted: Collection[str]) -> Iterator[Look]:
        """Yield the ways back to views that showed what is wanted."""
        for name in self.knowledge.sighted.keys() & set(wanted):
            views = self.knowledge.sighted[name] & ~self._vain[name]
            for room in np.flatnonzero(views).tolist():
                yield self._named(soonest(self._plans(room), views[[room]], np.ones(1)), room)

    def _known(self, belief: Belief, room: int) -> Iterator[Look]:
        """Yield the best way to look for a thing in the room that it is in; none if all has been looked at."""
        told = self._told_turn(room)
        if told is not None and self.knowledge.viewed[room] >> told % TURNS & 1:
            return
        masks, chance = self._unseen(belief, room)
        if chance[masks > 0].sum() > _HIDDEN * chance.sum():
            yield self._named(soonest(self._plans(room), masks, chance), room)

    def _promise(self, beliefs: list[Belief]) -> Look:
        """Return the first step of the way that promises most."""
        rows = (1,) if self._held else (0, 1)
        worths = (self._shares(beliefs[0]), np.full(len(self.rooms), _Y_TOO))
        found = zip(rows, beliefs, worths, strict=False)
        parts = [self._prospects(row, belief, worth) for row, belief, worth in found]
        look = best_look(len(self.rooms), self._station, joined(parts))
        if look.action.startswith(GOTO):
            return self._named(look._replace(action=GOTO), int(look.action.removeprefix(GOTO)))
        return look

    def _prospects(self, row: int, belief: Belief, worth: NDArray[np.float64]) -> Prospects:
        """Return what views bring for a thing, X or Y by the row; ``worth`` is what finding it counts in each room."""
        room, chance = belief.spots.room, belief.chance * worth[belief.spots.room]
        masks = belief.spots.near & (~self.knowledge.viewed[room] & _ALL)
        assert self._scouts is not None
        due = self._scouts.expected(row, _LATE)
        due = due[self.knowledge.statistics.is_of(self._targets)] if row else due
        return prospects(room, masks, chance, due + self._after(room, masks, chance))

    def _after(self, room: Bits, masks: Bits, chance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n,) the steps that it takes to see each spot once its room is known."""
        options, after = plans(None), np.zeros(len(room))
        for number in range(len(self.rooms)):
            there = room == number
            values = np.bincount(masks[there], chance[there], minlength=_ALL + 1)
            some = np.flatnonzero(values)
            if len(some):
                best = int((options.steps[:, some] @ values[some]).argmin())
                after[there] = options.steps[best, masks[there]]
        return after

    def _shares(self, belief: Belief) -> NDArray[np.float64]:
        """Return what finding X counts in each room: several robots that grasp begin with different rooms."""
        number, count = self._part
        rank = np.argsort(np.argsort(-belief.in_rooms(len(self.rooms)), kind="stable"))
        return np.where(rank % count == number, 1.0, _OTHERS)

    def _unseen(self, belief: Belief, room: int) -> tuple[Bits, NDArray[np.float64]]:
        """Return the turns in a room that show the spots of a belief and have not been seen, and their chances."""
        there = belief.spots.room == room
        return belief.spots.near[there] & (~self.knowledge.viewed[room] & _ALL), belief.chance[there]

    def _plans(self, room: int) -> Plans:
        here = self._station is not None and self._station.room == room
        return plans(self._station.turn if here and self._station is not None else None)

    def _named(self, look: Look, room: int) -> Look:
        return look._replace(action=f"goto_{self.rooms[room]}") if look.action == GOTO else look

    def _told_turn(self, room: int) -> int | None:
        """Return the turn at a room's anchor that looks in the direction that was told; None if none was."""
        told = float(self._bearings[int(self._held), room])
        return self.knowledge.turn_to(room, told) if told >= 0 else None

    def _wander(self, room: int) -> str:
        """Go on from the anchor of a room, from which the thing is not seen."""
        self._way = self._queue
        if not self._queue:
            here = self._station if self._station is not None and self._station.room == room else None
            aside, way = self._onward(room)
            away = (aside - (here.turn if here else 0)) % TURNS
            turns = ["turn_left"] * away if away <= TURNS // 2 else ["turn_right"] * (TURNS - away)
            start = [] if here else [f"goto_{self.rooms[room]}"]
            self._way = [*start, *turns, *way][::-1]
        return self._way[-1]

    def _onward(self, room: int) -> tuple[int, tuple[str, ...]]:
        """Return the turn at which it leaves a room's anchor now, and its actions from there."""
        told, count = self._told_turn(room), self._wandered[self._held, room]
        if told is not None and count < len(_TOWARDS):
            aside, way = _TOWARDS[count]
            return told + aside, way
        ahead = self.knowledge.ahead(self._find) if told is None else told
        return (_BEHIND if ahead is None else ahead) + _ASIDE[count % len(_ASIDE)], _AROUND

    def _blocked(self, observation: dict[str, np.ndarray]) -> None:
        """Leave out further paces where the last one has led nowhere."""
        view = observation.get("node_view", observation.get("node_class", np.empty(0)))
        self._stuck = bool(self._tried == "move_forward" and view.size and np.array_equal(view, self._seen))
        if self._stuck:
            while self._queue and self._queue[-1] == "move_forward":
                self._queue.pop()
        self._seen = view
