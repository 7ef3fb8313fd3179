"""Policies made of others: without messages, colours, or robots that cannot grasp, or told the rooms of X and Y."""

from typing import Any

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy, PolicyEnv, grasps
from chmarl_pb.policies.sights import classes_of_names
from chmarl_pb.tasks.language import read_attributes, read_pairs


class Unheard:
    """A policy whose robots do not hear each other: messages read as zeros."""

    def __init__(self, policy: Policy, shape: tuple[int, ...] | None = None):
        """Silence a policy; its messages are of this shape, or of that of the channel."""
        self.policy, self.shape = policy, shape

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the policy does when no message reaches it."""
        silent = {name: {**seen, "messages": self._nothing(seen["messages"])} for name, seen in observations.items()}
        return self.policy.act(silent, infos)

    def _nothing(self, messages: np.ndarray) -> np.ndarray:
        return np.zeros(messages.shape if self.shape is None else self.shape, messages.dtype)


class ColourBlind:
    """A policy that tells no colours apart: of lookalikes each is X to it."""

    def __init__(self, policy: Policy, known: Catalog):
        """Take the colours away from a policy, in a world of known classes."""
        self.policy, self._catalog = policy, known

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the policy does when all things of a class look alike."""
        seen = {
            name: {key: part for key, part in own.items() if key != "node_color"} for name, own in observations.items()
        }
        return self.policy.act(seen, {name: self._alike(observations[name], info) for name, info in infos.items()})

    def _alike(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> dict[str, Any]:
        """Return infos in which what is truly in view has the colour that the instruction names."""
        asked = read_attributes(observation["instruction"], self._catalog)
        colours = {kind: catalog.COLOUR_IDS[named] for kind, named in asked.items() if named in catalog.COLOUR_IDS}
        if not colours or "visible" not in info:
            return info
        kinds = map(catalog.class_of, info["visible"])
        alike = zip(info["visible"], kinds, strict=True)
        return info | {"visible": tuple(f"{kind}_{colours[kind]}" if kind in colours else name for name, kind in alike)}


class Staying:
    """Robots that grasp without the others, which stay at their starts."""

    def __init__(self, policy: Policy, action_names: dict[str, tuple[str, ...]]):
        """Take the robots that cannot grasp out of a policy."""
        self.policy = policy
        self._staying = {name: names.index("stay") for name, names in action_names.items() if not grasps(names)}

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the robots that grasp do by themselves."""
        return {**self.policy.act(observations, infos), **self._staying}


class Noting:
    """A policy whose robots hear nobody: messages hold what each has seen itself."""

    def __init__(
        self,
        policy: Policy,
        action_names: dict[str, tuple[str, ...]],
        rooms: tuple[str, ...],
        known: Catalog = BENCHMARK,
    ):
        """Let robots take notes."""
        self.policy, self.rooms, self._catalog = policy, rooms, known
        self._notes = {name: np.zeros((2, len(rooms)), dtype=np.int8) for name in action_names}

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)
        for notes in self._notes.values():
            notes[:] = 0

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the policy does by these messages."""
        own = {}
        for name, seen in observations.items():
            if seen["messages"].shape != self._notes[name].shape:  # own words: those of who stays are silence
                own[name] = seen
                continue
            self._note(self._notes[name], seen, infos[name])
            own[name] = {**seen, "messages": self._notes[name].copy()}
        return self.policy.act(own, infos)

    def _note(self, notes: np.ndarray, seen: dict[str, np.ndarray], info: dict[str, Any]) -> None:
        """Keep the bits that a robot's own view explains; X is in one room until it is carried."""
        pairs = read_pairs(seen["instruction"], self._catalog)
        graspables, receptacles = (set(names) for names in zip(*pairs, strict=True))
        visible = info["visible"]
        for name, kind in zip(visible, classes_of_names(seen, visible, self._catalog), strict=True):
            if kind in graspables:
                notes[0] |= seen["messages"][0].astype(notes.dtype)
            elif kind in receptacles:
                notes[1] |= np.array([room == catalog.room_of(name) for room in self.rooms], dtype=np.int8)


class Told:
    """A policy that is told at the start in which rooms X and Y are: privileged, a mark of what messages may bring."""

    def __init__(self, policy: Policy, env: PolicyEnv):
        """Tell a policy what an environment knows."""
        self.policy, self.env = policy, env

    def reset(self, seed: int | None) -> None:
        """Forget the last episode, and look up the rooms of the present one."""
        self.policy.reset(seed)
        supports = self.env.simulation.world.supports
        goals = self.env.setting.goals
        items = {catalog.room_of(supports[goal.item].receptacle) for goal in goals}
        targets = {catalog.room_of(name) for goal in goals for name in goal.receptacles}
        self._board = np.array([[room in rooms for room in self.env.rooms] for rooms in (items, targets)], np.int8)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the policy does when messages name these rooms from the start."""
        told = {name: {**seen, "messages": self._with_board(seen["messages"])} for name, seen in observations.items()}
        return self.policy.act(told, infos)

    def _with_board(self, heard: np.ndarray) -> np.ndarray:
        told: np.ndarray = heard | self._board.astype(heard.dtype)
        return told
