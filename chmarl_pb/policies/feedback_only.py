"""The feedback-only policy: robots that grasp obey what feedback tells them, and know nothing else.

Feedback in the planner's style says what the shortest plan was, so that an action that changes nothing draws the next
one out of it; the Pick or Place that ends each part of a plan is tried meanwhile. Feedback in the paper's style says
when to pick or place, which is all that the blind policy heeds of it, too: until then they look around.
"""

from dataclasses import dataclass
from functools import partial

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.policies.blind import BlindGrasper
from chmarl_pb.policies.narrow_views import BlindView, Chooser, Info, Narrowed, Observation, blind_view
from chmarl_pb.policies.policy import grasps
from chmarl_pb.robots.pointing import VERBS
from chmarl_pb.tasks.language import read_detour


@dataclass(frozen=True)
class AdvisedView(BlindView):
    """A blind view, and the words of feedback.

    Attributes:
        advice: the better action, as feedback names it, if that is neither Pick nor Place.
    """

    advice: str | None


def advised_view(
    rooms: tuple[str, ...], observation: Observation, info: Info, actions: tuple[str, ...], known: Catalog
) -> AdvisedView:
    """Return the view of a policy that reads feedback alone."""
    advice = read_detour(observation["feedback"], actions, known)
    return AdvisedView(**vars(blind_view(rooms, observation, info)), advice=advice)


class ObedientGrasper(BlindGrasper[AdvisedView]):
    """Does what feedback names; where feedback comes with every detour, it else tries to pick or place."""

    def __init__(self, rooms: tuple[str, ...], planner: bool):
        """Remember the rooms, and whether feedback is in the planner's style."""
        super().__init__(rooms)
        self._planner = planner

    def _heed(self, view: AdvisedView) -> list[str]:
        return [view.advice] if view.advice else super()._heed(view)

    def _explore(self, view: AdvisedView) -> str:
        return VERBS[view.holding] if self._planner else super()._explore(view)


class FeedbackOnlyPolicy(Narrowed[AdvisedView]):
    """Robots that grasp, by :class:`AdvisedView` alone."""

    def __init__(
        self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...], planner: bool, known: Catalog = BENCHMARK
    ):
        """Remember the names of each robot's actions and of the rooms.

        Args:
            actions: robot -> names of its actions.
            rooms: names of the rooms.
            planner: whether feedback is in the planner's style, and so comes with every detour.
            known: the classes whose names feedback may hold.
        """
        choosers: dict[str, Chooser[AdvisedView]] = {
            name: ObedientGrasper(rooms, planner) for name, names in actions.items() if grasps(names)
        }
        names = next((names for names in actions.values() if grasps(names)), ())
        super().__init__(actions, rooms, partial(advised_view, actions=names, known=known), choosers)
