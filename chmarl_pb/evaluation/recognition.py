"""Recognition: how often a policy acts on what its robots see, as soon as they see it.

A robot that sees X with an empty gripper can pick, one that holds X and sees Y can place. A policy that does something
else in such a step has not told from the words and the view that this is the thing, or does not trust it. Under
pointing a Pick or a Place at any cell counts.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.policy import grasps
from chmarl_pb.robots.pointing import verb_of
from chmarl_pb.tasks.outcome import Outcome


@dataclass(frozen=True)
class Recognition:
    """Counts over some steps.

    Attributes:
        x_seen: steps in which a robot with an empty gripper sees X.
        picks: those of them in which it picks.
        y_seen: steps in which a robot that holds X sees Y.
        places: those of them in which it places.
    """

    x_seen: int = 0
    picks: int = 0
    y_seen: int = 0
    places: int = 0

    @property
    def pick_share(self) -> float | None:
        """Share of the steps with X in view in which the policy picks; None if there are none."""
        return self.picks / self.x_seen if self.x_seen else None

    @property
    def place_share(self) -> float | None:
        """Share of the steps with X held and Y in view in which the policy places; None if there are none."""
        return self.places / self.y_seen if self.y_seen else None

    def figures(self) -> dict[str, float]:
        """Return the shares that there are, by name."""
        shares = {"pick_share": self.pick_share, "place_share": self.place_share}
        return {name: round(share, 4) for name, share in shares.items() if share is not None}


def total(parts: Iterable[Recognition]) -> Recognition:
    """Return the sums of counts."""
    columns = list(zip(*((one.x_seen, one.picks, one.y_seen, one.places) for one in parts), strict=True))
    return Recognition(*map(sum, columns))


def recognition(
    env: HouseholdEnv, outcomes: Sequence[Outcome], actions: Sequence[Mapping[str, int]]
) -> Recognition | None:
    """Return the counts of an episode that an environment has just played; None for tasks of several objects.

    Args:
        env: the environment.
        outcomes: before each action; those after the last one are left out.
        actions: robot -> number of its action, in every step.
    """
    if len(env.setting.goals) > 1:
        return None
    goal, counts = env.setting.goal, {"pick": [0, 0], "place": [0, 0]}
    hands = [name for name, names in env.action_names.items() if grasps(names)]
    for outcome, chosen in zip(outcomes, actions, strict=False):
        for robot in hands:
            grip, seen = outcome.state.grips.get(robot), outcome.seen[robot]
            verb = "pick" if grip is None else "place"
            things = (goal.item,) if grip is None else goal.receptacles
            if (grip is None or grip.item == goal.item) and not set(things).isdisjoint(seen):
                counts[verb][0] += 1
                counts[verb][1] += verb_of(env.action_names[robot][chosen[robot]]) == verb
    return Recognition(*counts["pick"], *counts["place"])
