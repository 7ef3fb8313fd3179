"""The instruction-blind policy: it sees, but is not told what to bring where.

It follows the messages as the blind policy does, and by elimination: what stood in view while no message named a room
of X is not X, nor is anything that a Pick did not take; Y likewise. So it picks what is left.
"""

from functools import partial

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.policies.aiming import aimed
from chmarl_pb.policies.blind import BlindGrasper, BlindScout
from chmarl_pb.policies.carrying import Carrier
from chmarl_pb.policies.narrow_views import Chooser, Narrowed, SeeingView, seeing_view
from chmarl_pb.policies.policy import grasps
from chmarl_pb.robots.pointing import VERBS, Cell


class InstructionBlindGrasper(BlindGrasper[SeeingView]):
    """Goes where messages say, and tries what it sees there until it was the right thing."""

    def __init__(self, rooms: tuple[str, ...], known: Catalog, feedback: bool, messages: bool):
        """Remember the rooms, the classes that X and Y can be of, and whether there are feedback and messages."""
        super().__init__(rooms, feedback)
        self._messages = messages
        self._kinds = frozenset(known.graspables), frozenset(known.receptacles)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""
        super().reset(rng)
        self._ruled_out: tuple[set[str], set[str]] = set(), set()
        self._seen: frozenset[str] = frozenset()

    def choose(self, view: SeeingView) -> str:
        """Return the name of the next action."""
        for messages, ruled_out in zip(view.messages, self._ruled_out, strict=True):
            if self._messages and not messages:
                ruled_out |= view.classes
        if self._last == VERBS[view.holding]:  # in vain
            self._ruled_out[view.holding].update(self._seen)
        self._seen = view.classes
        verb = super().choose(view)
        return aimed(verb, self._cell(view)) if verb in VERBS else verb

    def _cell(self, view: SeeingView) -> Cell | None:
        """Return where what may be wanted is in view."""
        kinds = self._kinds[view.holding] - self._ruled_out[view.holding]
        return next((cell for name, cell in view.cells.items() if name in kinds), None)

    def _worth_trying(self, view: SeeingView) -> bool:
        return bool((view.classes & self._kinds[view.holding]) - self._ruled_out[view.holding])


class InstructionBlindPolicy(Narrowed[SeeingView]):
    """All robots, by :class:`SeeingView` alone."""

    def __init__(
        self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...], known: Catalog,
        feedback: bool, messages: bool,
    ):  # fmt: skip
        """Make the team.

        Args:
            actions: robot -> names of its actions.
            rooms: names of the rooms.
            known: the classes that there are.
            feedback: whether there is any.
            messages: whether there are any.
        """

        def grasper(names: tuple[str, ...]) -> Chooser[SeeingView]:
            if feedback or "pick" in names:
                return InstructionBlindGrasper(rooms, known, feedback, messages)
            return Carrier(rooms, known)

        choosers: dict[str, Chooser[SeeingView]] = {
            name: grasper(names) if grasps(names) else BlindScout(names, rooms) for name, names in actions.items()
        }
        super().__init__(actions, rooms, partial(seeing_view, known=known), choosers)
