"""The outcome of a step: the facts that observation, reward, messages, feedback and metrics read."""

from collections.abc import Mapping
from dataclasses import dataclass

from chmarl_pb.robots.goal import Goal
from chmarl_pb.world import Support, WorldState


@dataclass(frozen=True)
class Outcome:
    """The facts after a step, or after a reset.

    Attributes:
        state: of the world.
        seen: robot -> names of the things visible to it.
        item_room: room in which X is.
        potential: phi of this state.
        success: X stands on a target receptacle.
        parts: of a task of several goals, the facts of each; else empty.
    """

    state: WorldState
    seen: dict[str, tuple[str, ...]]
    item_room: str
    potential: float
    success: bool
    parts: tuple["Outcome", ...] = ()

    @property
    def held(self) -> str | None:
        """Name of the object in the gripper, or None."""
        for grip in self.state.grips.values():
            return grip.item
        return None

    @property
    def supports(self) -> Mapping[str, Support]:
        """Object -> what carries it; the held object is not in it."""
        return self.state.objects.supports


def potential(success: bool, grasped: bool, item_seen_by: set[str], target_seen_by: set[str]) -> float:
    """Return phi: the first row of CH-MARL's table that holds.

    Args:
        success: X is placed on Y.
        grasped: X is in the gripper.
        item_seen_by: the robots that see X.
        target_seen_by: the robots that see Y.
    """
    if success:
        return 10.0
    seen_by = target_seen_by if grasped else item_seen_by
    humanoid, drone, nobody = (6.0, 5.0, 4.0) if grasped else (2.0, 1.0, 0.0)
    if "humanoid" in seen_by:
        return humanoid
    return drone if "drone" in seen_by else nobody


def judge(state: WorldState, goal: Goal, seen: dict[str, tuple[str, ...]], humanoid_room: str) -> Outcome:
    """Return the outcome of a state.

    Args:
        state: of the world after the actions.
        goal: what Pick and Place act on.
        seen: robot -> names of the things visible to it.
        humanoid_room: the humanoid's room, which is X's while it is held.
    """
    support = state.objects.supports.get(goal.item)
    success = support is not None and support.receptacle in goal.receptacles
    targets = set(goal.receptacles)
    phi = potential(
        success,
        goal.item in state.held,
        {robot for robot, names in seen.items() if goal.item in names},
        {robot for robot, names in seen.items() if not targets.isdisjoint(names)},
    )
    room = humanoid_room if support is None else support.receptacle.split("/")[0]
    return Outcome(state, seen, room, phi, success)


def reward(previous: Outcome, outcome: Outcome) -> float:
    """Return the shared reward phi(s') - phi(s) of a step."""
    return outcome.potential - previous.potential
