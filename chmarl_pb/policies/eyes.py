"""Eyes: what recognises things in pictures, so that a policy that reads scene graphs needs not be told the truth.

``search@detector`` is the policy ``search`` with the eyes ``detector``. Each robot's policy gets, in the place of the
graph, what the eyes say of that robot's own picture: classes, where they are in it, and as their room the robot's own.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.policies.sights import Observation, own_room

_IN_ROOM = catalog.RELATION_IDS["in_room"]


class Sight(NamedTuple):
    """A thing in a picture.

    Attributes:
        name: its class.
        across: column of its middle, from 0 at the left to 1.
        down: row of its middle, from 0 at the top to 1.
        share: part of the picture that it fills, 0 to 1.
        colour: id in ``COLOUR_IDS`` of an object's colour, by which lookalikes are told apart; 0: it is not known.
    """

    name: str
    across: float
    down: float
    share: float
    colour: int = 0


class Eyes(Protocol):
    """Recognises things.

    Attributes:
        fingerprint: sha256 of what it has learned.
    """

    fingerprint: str

    def __call__(self, image: NDArray[np.uint8]) -> Sequence[Sight]:
        """Return what a picture (height, width, 3) shows."""


class Seeing:
    """A policy that reads scene graphs, where there are pictures and eyes."""

    def __init__(self, policy: Policy, eyes: Eyes, env: Any):
        """Give eyes to a policy that was made for an environment, or for what stands in for it.

        Raises:
            OptionError: a robot observes no picture.
        """
        for robot in env.action_names:
            if "image" not in env.observation_space(robot).spaces:
                raise OptionError("eyes need pictures; use observation='visual', or a policy without eyes")
        self.policy, self.eyes = policy, eyes
        self._rooms, self._catalog, self._options = env.rooms, env.catalog, env.options

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return what the policy does by graphs of what the eyes see."""
        return self.policy.act({name: {**seen, **self._graph(seen)} for name, seen in observations.items()}, infos)

    def _graph(self, observation: Observation) -> Observation:
        """Return the nodes of things in a robot's picture, last that of its room, in which all stand but what it holds.

        What that is the eyes cannot tell, so while it holds something no object counts as standing anywhere.
        """
        things, room = self.eyes(observation["image"]), catalog.room_kind(own_room(observation, self._rooms))
        numbers = [self._catalog.class_ids[thing.name] for thing in things]
        holding = bool(observation["self"][-1])
        standing = [
            node for node, thing in enumerate(things)
            if room in self._catalog.class_ids and not (holding and thing.name in self._catalog.graspables)
        ]  # fmt: skip
        edges = [(node, len(things), _IN_ROOM) for node in standing]
        graph = {
            "node_class": np.array([*numbers, self._catalog.class_ids.get(room, 0)], np.int16),
            "node_state": np.zeros(len(things) + 1, np.int16),
            "edges": np.array(edges, np.int16).reshape(-1, 3),
        }
        if self._options.lookalikes:
            graph["node_color"] = np.array([*(thing.colour for thing in things), 0], np.int16)
        if self._options.pointing:
            views = [(thing.across, thing.down, thing.share) for thing in things]
            graph["node_view"] = np.array([*views, (0.0, 0.0, 0.0)], np.float32)
        return graph
