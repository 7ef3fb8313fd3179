"""What a robot that grasps does with what is in view: it picks, places, puts away, and moves where it sees better."""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.policies.aiming import SURE, Aim, Nodes, aimed, aims_at, held_class, nodes_of, turned
from chmarl_pb.robots.pointing import GRID, VERBS, Cell, verb_of

# Part of a cell from which on it is pointed at where nothing better is to be had: what is put down is hard to get back.
_RISKY = {VERBS[0]: 0.1, VERBS[1]: 0.35}
_MOVES = 4  # turns and paces for a better view of one thing
_SIDES = {1: "turn_left", -1: "turn_right"}
_BACK = {"turn_left": "turn_right", "turn_right": "turn_left"}
_ROUGH = 20  # views are told apart by this part of a picture

Observation = dict[str, np.ndarray]
_View = tuple[str, tuple[str, ...], bytes]  # the verb, and what is in view where


class _Try(NamedTuple):
    """A Pick or Place, and the view in which it was tried."""

    view: _View
    action: str


class Hand:
    """Decides what to do with what is in view, where Pick and Place point and where they do not."""

    def __init__(self, known: Catalog):
        """Remember the classes of things."""
        self._catalog = known
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self._vain: set[_Try] = set()  # what did not take what was wanted
        self._last: _Try | None = None
        self._moves = 0
        self._paced: _View | None = None  # the view before a pace
        self._turned: _Try | None = None  # a turn for a better view, just taken
        self.away = False  # whether it has just put down what was picked by mistake
        self._view: _View = VERBS[0], (), b""
        self._chosen: str | None = None
        self._wrong = False  # whether it holds what was picked by mistake

    def choose(
        self, observation: Observation, wanted: Collection[str], items: Collection[str], seen: Collection[str]
    ) -> str | None:
        """Return the name of an action, or None if nothing in view is worth one; nothing is done before it is noted.

        Args:
            observation: of the robot.
            wanted: classes of what is to be picked, or placed on.
            items: classes of what is to be picked at all.
            seen: classes of what is in view.
        """
        holding = bool(observation["self"][-1])
        verb, kinds = VERBS[holding], self._catalog.receptacles if holding else self._catalog.graspables
        nodes = nodes_of(observation, kinds, self._catalog)
        view = verb, nodes.names, np.round(nodes.views[:, :2] * _ROUGH).astype(np.int8).tobytes()
        wrong = holding and held_class(observation, self._catalog) not in (None, *items)
        self._judge(verb, wrong)
        self._wrong = wrong and "node_view" in observation
        self._view = view if "node_view" in observation else (verb, (), b"")
        if "node_view" not in observation:
            self._chosen = self._plainly(verb, bool(set(wanted) & set(seen)))
        elif wrong:
            self._chosen = self._put_away(nodes, view, self._where(observation, items))
        else:
            self._chosen = self._at(nodes, view, wanted) or self._back(nodes, wanted)
        self._turned = None
        return self._chosen

    def note(self, action: str) -> bool:
        """Go on from the action that was taken; return whether it is the one that was chosen."""
        if verb_of(action) == self._view[0]:
            self._last = _Try(self._view, action)
            self.away |= self._wrong
        elif action == self._chosen and not self._wrong:  # for a better view
            self._moves += 1
            self._turned = _Try(self._view, action) if action in _BACK else None
            self._paced = self._view if action == "move_forward" else self._paced
        return action == self._chosen

    def _judge(self, verb: str, wrong: bool) -> None:
        """Learn from the last Pick or Place, if there was one: this goes on, so no Place was the last."""
        last, self._last = self._last, None
        if last is None:
            self.away = False
            return
        taken = last.view[0] == VERBS[0] and verb == VERBS[1] and not wrong
        self.away = self.away and last.view[0] != verb
        if not taken:
            self._vain.add(last)
        if last.view[0] != verb:
            self._moves = 0

    def _plainly(self, verb: str, there: bool) -> str | None:
        """Return the verb where it takes no cell, unless it has just failed."""
        failed = _Try(self._view, verb) in self._vain
        self._vain.clear()
        return verb if there and not failed else None

    def _at(self, nodes: Nodes, view: _View, wanted: Collection[str]) -> str | None:
        """Return a Pick or Place at what is wanted, or a move by which it has a cell of its own."""
        if not set(wanted) & set(nodes.names):
            return None
        aims = [aim for aim in aims_at(nodes, wanted) if _Try(view, aimed(view[0], aim.cell)) not in self._vain]
        if aims and aims[0].part > SURE:
            return aimed(view[0], aims[0].cell)
        move = self._closer(nodes, view, wanted) if self._moves < _MOVES else None
        if move is None and aims and aims[0].part > _RISKY[view[0]]:
            return aimed(view[0], aims[0].cell)
        return move

    def _closer(self, nodes: Nodes, view: _View, wanted: Collection[str]) -> str | None:
        """Return a turn after which something wanted has most of a cell, else a pace towards it."""
        sides = [side for side, turn in _SIDES.items() if _Try(view, turn) not in self._vain]
        if self._moves < 2 and sides:
            parts = {side: _best(aims_at(turned(nodes, side), wanted)) for side in sides}
            side = max(parts, key=lambda side: parts[side])
            if parts[side] > SURE:
                return _SIDES[side]
        number = next(number for number, name in enumerate(nodes.names) if name in wanted)
        across = nodes.views[number, 0] - 0.5
        if abs(across) > 1 / 4 and (-1 if across > 0 else 1) in sides:
            return _SIDES[-1 if across > 0 else 1]
        if self._paced == view:  # the last one was blocked
            self._moves = _MOVES
            return None
        return "move_forward"

    def _back(self, nodes: Nodes, wanted: Collection[str]) -> str | None:
        """Return the turn back to a view that showed what is wanted, if the turn from it does not."""
        if self._turned is None or set(wanted) & set(nodes.names):
            return None
        self._vain.add(self._turned)
        return _BACK[self._turned.action]

    def _put_away(self, nodes: Nodes, view: _View, x: np.ndarray | None) -> str:
        """Put down what was picked by mistake, in view but away from X; turn if that does not go."""
        aims = [
            (aim, self._distance(aim.cell, x)) for name in dict.fromkeys(nodes.names) for aim in aims_at(nodes, (name,))
        ]
        left = [(aim, far) for aim, far in aims if _Try(view, aimed(view[0], aim.cell)) not in self._vain]
        if not left:
            return _SIDES[1]
        best, _ = max(left, key=lambda found: (found[0].part > SURE, found[1], found[0].part))
        return aimed(view[0], best.cell)

    def _where(self, observation: Observation, wanted: Collection[str]) -> np.ndarray | None:
        """Return where X is in the picture."""
        nodes = nodes_of(observation, self._catalog.graspables, self._catalog)
        there = [number for number, name in enumerate(nodes.names) if name in wanted]
        return nodes.views[there[0], :2] if there else None

    def _distance(self, cell: Cell, x: np.ndarray | None) -> float:
        return 0.0 if x is None else float(abs((np.array(cell)[::-1] + 0.5) / GRID - x).max())


def _best(aims: list[Aim]) -> float:
    return aims[0].part if aims else 0.0
