"""Experts: policies that say in every state what to do, and go on from what was done instead."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy


class Expert(Protocol):
    """Says in every state what to do, and goes on from what was done instead.

    Any :class:`chmarl_pb.policies.policy.Policy` can teach; one that keeps count of what it has done should be able to
    do this, as :class:`chmarl_pb.policies.search.SearchPolicy` is: ``act`` of a policy counts what it says.
    """

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""

    def propose(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return agent -> what it should do."""

    def note(self, actions: dict[str, Any]) -> None:
        """Learn what the agents have done."""


class RobotExpert(Protocol):
    """One robot of a :class:`Team`: an expert for it alone, by its own observation and info."""

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""

    def propose(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> int:
        """Return the number of the action that it should take now; nothing counts as done before it is noted."""

    def note(self, action: int) -> None:
        """Go on from the action that was taken, whatever was proposed."""


class Team:
    """Robots, each driven by an object of its own, as a policy and as an expert.

    Attributes:
        parts: robot -> what drives it.
    """

    def __init__(self, parts: Mapping[str, RobotExpert]):
        """Take what drives each robot."""
        self.parts = dict(parts)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        for part in self.parts.values():
            part.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action, each from its own observation and info alone."""
        actions = self.propose(observations, infos)
        self.note(actions)
        return actions

    def propose(self, observations: Observations, infos: Infos) -> Actions:
        """Return what all would do now; to be followed by :meth:`note`, of that or of what was done instead."""
        return {name: self.parts[name].propose(seen, infos[name]) for name, seen in observations.items()}

    def note(self, actions: Actions) -> None:
        """Go on from what the robots have done."""
        for name, action in actions.items():
            self.parts[name].note(action)


class PlainExpert:
    """A policy as an expert that does not want to know what was done."""

    def __init__(self, policy: Policy):
        """Take a policy."""
        self.reset, self.propose = policy.reset, policy.act

    def note(self, actions: dict[str, Any]) -> None:
        """Do nothing."""


class Informed:
    """An expert that is given the true scene graphs where robots see pictures: it points, so it has to know where."""

    def __init__(self, expert: Expert, env: Any):
        """Inform an expert of what there is in an environment's views."""
        self.reset, self.note, self._expert, self._env = expert.reset, expert.note, expert, env

    def propose(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return what each agent should do."""
        informed = {name: {**seen, **self._env.true_graph(name)} for name, seen in observations.items()}
        return self._expert.propose(informed, infos)


def as_expert(policy: Any) -> Expert:
    """Return a policy as an expert.

    Raises:
        ValueError: it is neither.
    """
    teaches = hasattr(policy, "propose") and hasattr(policy, "note")
    if not hasattr(policy, "reset") or not (teaches or hasattr(policy, "act")):
        raise ValueError(f"expert makes {policy!r}: make a policy, with reset and act, or an Expert")
    return policy if teaches else PlainExpert(policy)
