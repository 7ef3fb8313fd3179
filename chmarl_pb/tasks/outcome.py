"""The outcome of a step: the facts that observation, reward, messages, feedback and metrics read."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from chmarl_pb.errors import TaskError
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
        """Name of the first object in a gripper, or None."""
        for grip in self.state.grips.values():
            return grip.item
        return None

    @property
    def supports(self) -> Mapping[str, Support]:
        """Object -> what carries it; one in a gripper is not in it."""
        return self.state.objects.supports


def potential(success: bool, grasped: bool, seen_by: Collection[str], graspers: Collection[str]) -> float:
    """Return phi: the first row of CH-MARL's table that holds.

    The table's "visible to the humanoid" is read as "to any robot that can grasp", "to the drone" as "to any other".

    Args:
        success: X is placed on Y.
        grasped: X is in a gripper.
        seen_by: the robots that see what is wanted: X, or Y once X is in a gripper.
        graspers: the robots that can grasp.
    """
    if success:
        return 10.0
    grasper, other, nobody = (6.0, 5.0, 4.0) if grasped else (2.0, 1.0, 0.0)
    if not seen_by:
        return nobody
    return other if set(seen_by).isdisjoint(graspers) else grasper


def outcome_of(
    state: WorldState, goal: Goal, seen: dict[str, tuple[str, ...]], graspers: Collection[str], rooms: Sequence[str]
) -> Outcome:
    """Return the outcome of a state.

    Args:
        state: of the world after the actions.
        goal: what Pick and Place act on.
        seen: robot -> names of the things visible to it.
        graspers: the robots that can grasp.
        rooms: names of the home's rooms, in the order of a robot's ``room``.

    Raises:
        TaskError: X has not been laid out.
    """
    support = state.objects.supports.get(goal.item)
    if support is None:
        holder = next((robot for robot, grip in state.grips.items() if grip.item == goal.item), None)
        if holder is None:
            raise TaskError(f"{goal.item} is nowhere in the home; lay out every object that is a goal")
        seen_by = [robot for robot, names in seen.items() if not set(goal.receptacles).isdisjoint(names)]
        phi = potential(False, True, seen_by, graspers)
        return Outcome(state, seen, rooms[state.robots[holder].room], phi, False)
    success = support.receptacle in goal.receptacles
    seen_by = [robot for robot, names in seen.items() if goal.item in names]
    phi = potential(success, False, seen_by, graspers)
    return Outcome(state, seen, support.receptacle.split("/")[0], phi, success)


def reward(previous: Outcome, outcome: Outcome) -> float:
    """Return the shared reward phi(s') - phi(s) of a step."""
    return outcome.potential - previous.potential
