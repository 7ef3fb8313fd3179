"""Narrowed views: what is left of an observation for a policy that has to do without the rest.

The policies that show what a score is made of get one of these and nothing else. So what they do cannot depend on
anything that is not named here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.policies.aiming import cells_of, number_of
from chmarl_pb.policies.policy import Actions, Infos, Observations
from chmarl_pb.policies.sights import classes_in_view, colors_in_view, messages_read, own_room, supports_in_view
from chmarl_pb.robots.pointing import Cell
from chmarl_pb.tasks.language import read_pairs

Observation = dict[str, np.ndarray]
Info = dict[str, Any]


@dataclass(frozen=True)
class BlindView:
    """Neither what a robot sees nor what it is asked to do.

    Attributes:
        messages: rooms where X has been seen, and rooms where Y has been seen.
        feedback: whether there is feedback; not its words.
        room: the robot's own, None between rooms.
        holding: whether the robot holds something.
    """

    messages: tuple[tuple[str, ...], tuple[str, ...]]
    feedback: bool
    room: str | None
    holding: bool


@dataclass(frozen=True)
class SeeingView(BlindView):
    """What a robot sees, but not what it is asked to do.

    Attributes:
        classes: of the things in its view.
        cells: class -> the cell at which it is pointed; empty where actions do not point, or pictures are seen.
        supports: class of an object -> class of the receptacle that it stands on, where a graph shows both.
        colors: class of an object -> ids of the colours in which it is in view; empty without lookalikes.
    """

    classes: frozenset[str]
    cells: Mapping[str, Cell]
    supports: Mapping[str, str]
    colors: Mapping[str, frozenset[int]]


@dataclass(frozen=True)
class FullView(SeeingView):
    """What a robot sees now and what it is asked to do.

    Attributes:
        wanted: the class of X, or of Y while the robot holds something; of all goals.
    """

    wanted: frozenset[str]


def blind_view(rooms: tuple[str, ...], observation: Observation, info: Info) -> BlindView:
    """Return the view of a policy that neither sees nor reads."""
    return BlindView(**_blind(rooms, observation))


def seeing_view(rooms: tuple[str, ...], observation: Observation, info: Info, known: Catalog) -> SeeingView:
    """Return the view of a policy that sees but does not read."""
    unread = {name: value for name, value in observation.items() if name != "instruction"}
    return SeeingView(**_blind(rooms, observation), **_seeing(unread, info, known))


def full_view(rooms: tuple[str, ...], observation: Observation, info: Info, known: Catalog) -> FullView:
    """Return the view of a policy that sees and reads."""
    blind = _blind(rooms, {**observation, "messages": messages_read(observation, rooms, known)})
    pairs = read_pairs(observation["instruction"], known)
    wanted = frozenset(pair[int(blind["holding"])] for pair in pairs)
    return FullView(**blind, **_seeing(observation, info, known), wanted=wanted)


def _blind(rooms: tuple[str, ...], observation: Observation) -> dict[str, Any]:
    known = [tuple(room for room, bit in zip(rooms, row, strict=True) if bit) for row in observation["messages"]]
    return {
        "messages": (known[0], known[1]), "feedback": bool(observation["feedback"].any()),
        "room": own_room(observation, rooms) or None, "holding": bool(observation["self"][-1]),
    }  # fmt: skip


def _seeing(observation: Observation, info: Info, known: Catalog) -> dict[str, Any]:
    return {
        "classes": classes_in_view(observation, info, known), "cells": cells_of(observation, known),
        "supports": supports_in_view(observation, known), "colors": colors_in_view(observation, known),
    }  # fmt: skip


View = TypeVar("View")
_View = TypeVar("_View", contravariant=True)


class Chooser(Protocol[_View]):
    """Drives one robot by a view of one kind."""

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""

    def choose(self, view: _View) -> str:
        """Return the name of the next action."""


class Narrowed(Generic[View]):
    """A policy whose robots each get their own narrowed view and nothing else."""

    def __init__(
        self,
        actions: dict[str, tuple[str, ...]],
        rooms: tuple[str, ...],
        view: Callable[[tuple[str, ...], Observation, Info], View],
        choosers: dict[str, Chooser[View]],
    ):
        """Join the robots' choosers.

        Args:
            actions: robot -> names of its actions, in the order of their numbers.
            rooms: names of the rooms, in the order of their bits.
            view: what is left of an observation and an info.
            choosers: robot -> what drives it.
        """
        self.actions, self.rooms, self.choosers = actions, rooms, choosers
        self._view = view

    def reset(self, seed: int | None) -> None:
        """Forget the last episode; all robots draw the same numbers, so that they can agree without a word."""
        seed = int(np.random.default_rng(seed).integers(2**32))
        for chooser in self.choosers.values():
            chooser.reset(np.random.default_rng(seed))

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action, each from its own view alone."""
        return {
            name: number_of(self.actions[name], chooser.choose(self._view(self.rooms, observations[name], infos[name])))
            for name, chooser in self.choosers.items()
            if name in observations
        }
