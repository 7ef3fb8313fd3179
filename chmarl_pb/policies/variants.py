"""Policies made of others: without messages, and without the drone."""

from typing import Any

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.tasks.language import parse_instruction


class Unheard:
    """A policy whose robots do not hear each other: messages read as zeros."""

    def __init__(self, policy: Policy):
        """Silence a policy."""
        self.policy = policy

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the policy does when no message reaches it."""
        silent = {name: {**seen, "messages": np.zeros_like(seen["messages"])} for name, seen in observations.items()}
        return self.policy.act(silent, infos)


class Alone:
    """The humanoid without the drone, which stays at its start; the messages hold only what the humanoid saw."""

    def __init__(self, policy: Policy, action_names: dict[str, tuple[str, ...]], rooms: tuple[str, ...]):
        """Take the drone out of a policy."""
        self.policy, self.rooms = policy, rooms
        self._stay = action_names["drone"].index("stay")
        self._notes = np.zeros((2, len(rooms)), dtype=np.int8)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)
        self._notes[:] = 0

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the humanoid does by itself."""
        self._note(observations["humanoid"]["messages"], infos["humanoid"])
        own = {name: {**seen, "messages": self._notes.copy()} for name, seen in observations.items()}
        return {**self.policy.act(own, infos), "drone": self._stay}

    def _note(self, messages: np.ndarray, info: dict[str, Any]) -> None:
        """Keep the bits that the humanoid's own view explains; X is in one room until it is carried."""
        graspable, receptacle = parse_instruction(info["instruction"])
        for name in info["visible"]:
            if catalog.class_of(name) == graspable:
                self._notes[0] |= messages[0]
            elif catalog.class_of(name) == receptacle:
                self._notes[1] |= np.array([room == catalog.room_of(name) for room in self.rooms], dtype=np.int8)
