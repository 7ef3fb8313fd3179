"""What the detector's mistakes cost: ``python -m benchmarks.true_eyes WEIGHTS``.

Plays weights that see by the detector on validation tasks, by the rules that they were trained by, with what pictures
truly show in the place of what it finds in them: of no class, of receptacles, of objects, of robots, of all. Test
splits are refused.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from benchmarks.scores import Scores, parser_of, run
from chmarl_pb import catalog
from chmarl_pb.learning.networks.detections import LABELS, OBJECTS, PLACE, SHAPE, THINGS
from chmarl_pb.learning.networks.frozen import FrozenEncoder
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.learning.storage.checkpoint import CheckpointError
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS, classes_of

TRUE = {
    "none": slice(0), "receptacles": slice(OBJECTS, THINGS), "objects": slice(OBJECTS), "robots": slice(THINGS, None),
    "all": slice(None),
}  # fmt: skip
_CELL = 4  # pixels along a side of what the detector tells apart


class TrueEyes:
    """A policy that sees by the detector, told the truth of some classes."""

    def __init__(self, inner: Any, env: Any, told: slice):
        """Take the place of a policy's encoder.

        Args:
            inner: the policy.
            env: what it plays in.
            told: the classes, of ``LABELS``, of which it is told the truth.

        Raises:
            CheckpointError: it sees by something else.
        """
        if getattr(inner.batched.encoder, "name", "") != "detector":
            raise CheckpointError("these weights do not see by the detector, whose mistakes are to be told")
        self._inner, self._env, self._told = inner, env, told
        self._encoder: FrozenEncoder = inner.batched.encoder
        self._models = {name: robot.model for name, robot in env.simulation.robots.items()}
        self._robots: list[str] = []
        inner.batched.encoder = self

    def reset(self, seed: int | None) -> None:
        """Begin an episode."""
        self._inner.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the robots' actions."""
        self._robots = list(observations)
        actions: Actions = self._inner.act(observations, infos)
        return actions

    def __call__(self, images: Tensor) -> Tensor:
        """Return the detections (B, C, 6) in the pictures of all robots."""
        found, renderer = self._encoder(images).clone(), self._env.simulation.renderer
        for number, robot in enumerate(self._robots):
            segmentation = renderer.picture(robot, VISIBILITY_SIZE).segmentation
            others = np.where(segmentation == renderer.names.index(robot), -1, segmentation)
            shown = detections_of(others, classes_of(renderer.names, self._models), renderer.names)[: found.shape[1]]
            # Elsewhere the number in an object's name is not that of its colour, and nothing asks for colours.
            width = None if self._env.options.lookalikes else PLACE
            found[number, self._told, :width] = shown[self._told, :width].to(found.dtype)
        return found


def detections_of(segmentation: np.ndarray, kinds: Sequence[str], names: Sequence[str]) -> Tensor:
    """Return detections (C, 6) of which a picture's segmentation is known; a class has the colour of its most pixels.

    Args:
        segmentation: (size, size) number of the thing in each pixel, negative for none.
        kinds: classes of the things.
        names: theirs.
    """
    labels = [LABELS.index(kind) if kind in LABELS else -1 for kind in kinds]
    shown = np.array([*labels, -1])[segmentation]
    colours = np.array([*map(catalog.colour_of, names), 0])[segmentation]
    cells, found = len(segmentation) // _CELL, torch.zeros(SHAPE)
    for label in np.unique(shown[shown >= 0]).tolist():
        row, column = np.nonzero(shown == label)
        if len(row) < VISIBLE_PIXELS:
            continue
        touched = len(np.unique(row // _CELL * cells + column // _CELL))
        middle = [2 * float(line.mean()) / (len(segmentation) - 1) - 1 for line in (column, row)]
        found[label, :PLACE] = torch.tensor([1.0, *middle, np.log2(1 + touched) / np.log2(1 + cells**2)])
        if (colour := int(np.bincount(colours[row, column]).argmax())) > 0:
            found[label, PLACE:] = torch.tensor([colour, 1.0])
    return found


class Told:
    """Makes the policy of weights, told the truth of some classes; can be sent to other processes."""

    privileged = deterministic = True  # it reads the environment's segmentation

    def __init__(self, weights: Path, told: slice):
        """Remember a file of weights, and the classes."""
        self.inner, self.told = ValuePolicies(weights), told

    def __call__(self, env: Any) -> Policy:
        """Return the policy for an environment."""
        return TrueEyes(self.inner(env), env, self.told)


def main() -> int:
    """Play and print."""
    return run(parser_of("benchmarks.true_eyes", __doc__, observation="visual"), _play)


def _play(chosen: argparse.Namespace) -> None:
    scores = Scores("told the truth of", chosen)
    for split in scores.splits:
        for name, told in TRUE.items():
            scores.play(name, Told(chosen.weights, told), split)


if __name__ == "__main__":
    raise SystemExit(main())
