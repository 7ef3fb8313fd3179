"""Demonstrations: a data set of the planner's episodes in memory, and batches of whole episodes from it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from chmarl_pb.data.read import Dataset
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.store import dataset_folder
from chmarl_pb.learning.networks.agents import NO_ACTION
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.networks.kept_features import kept_features
from chmarl_pb.learning.observation_keys import EDGES, GRAPH, named
from chmarl_pb.learning.policies.cloned import CloningConfig


@dataclass(frozen=True, eq=False)
class DemonstrationBatch:
    """Whole episodes side by side, T is the length of the longest.

    Attributes:
        observation: key -> (B, T, ...); zeros after the end of an episode.
        last: (B, T, robots) what each robot did in the step before, or ``NO_ACTION``.
        labels: (B, T, robots) what the planner would do.
        mask: (B, T) which steps are none of padding.
    """

    observation: dict[str, Tensor]
    last: Tensor
    labels: Tensor
    mask: Tensor

    def to(self, device: torch.device) -> "DemonstrationBatch":
        """Return the batch on a device."""
        observation = {key: part.to(device) for key, part in self.observation.items()}
        return DemonstrationBatch(observation, self.last.to(device), self.labels.to(device), self.mask.to(device))


@dataclass(frozen=True, eq=False)
class Demonstrations:
    """All steps of a data set, one after the other; S is their number.

    Attributes:
        observations: key of the joint environment -> (S + 1, ...); the row after the last is zeros.
        actions: (S + 1, robots) what was done.
        labels: (S + 1, robots) what the planner would do.
        starts: (episodes) number of each episode's first step.
        lengths: (episodes) in steps.
        sha256: of the data set.
    """

    observations: dict[str, Tensor]
    actions: Tensor
    labels: Tensor
    starts: Tensor
    lengths: Tensor
    sha256: str

    def batch(self, episodes: Tensor) -> DemonstrationBatch:
        """Return some episodes, by their numbers."""
        lengths = self.lengths[episodes]
        steps = torch.arange(int(lengths.max()))
        mask = steps < lengths.unsqueeze(1)
        rows = torch.where(mask, self.starts[episodes].unsqueeze(1) + steps, len(self.labels) - 1)
        last = self.actions[rows].roll(1, dims=1)
        last[:, 0] = NO_ACTION
        observation = {key: part[rows] for key, part in self.observations.items()}
        return DemonstrationBatch(observation, last, self.labels[rows], mask)

    def batches(self, size: int, seed: Sequence[int] | None = None, skip: int = 0) -> Iterator[DemonstrationBatch]:
        """Yield all episodes in batches, shuffled if there is a seed, without some of the first batches."""
        count = len(self.lengths)
        order = np.arange(count) if seed is None else np.random.default_rng(seed).permutation(count)
        for first in range(skip * size, count, size):
            yield self.batch(torch.from_numpy(order[first : first + size]))


def read_demonstrations(root: Path, recipe: Recipe, config: CloningConfig, quiet: bool = True) -> Demonstrations:
    """Read what a run of cloning needs of a data set into memory.

    The state after the last action is left out: nobody acts in it. Rows of padding that no graph of the data set fills
    are cut off. Pictures that the run encodes by frozen weights are replaced by their features.

    Args:
        root: folder of Minari data sets.
        recipe: of the data set.
        config: of the run.
        quiet: whether no progress is shown while pictures are encoded.

    Raises:
        DatasetError: the data set is missing or damaged.
    """
    dataset = Dataset(dataset_folder(root, recipe.dataset_id))
    ready = kept_features(dataset, frozen_encoder(config.image_encoder), quiet) if config.uses_features else {}
    columns: dict[str, list[np.ndarray]] = {"actions": [], "labels": []}
    with dataset.open() as file:
        every = list(file["episode_0/observations"])
        names = [name for name in every if name not in named(every, *config.left_out)]
        columns |= {name: [] for name in names if name not in ready}
        for number in range(dataset.episodes):
            episode = file[f"episode_{number}"]
            columns["actions"].append(episode["actions"][()])
            columns["labels"].append(episode["infos/planner_action"][:-1])
            for name in columns.keys() - {"actions", "labels"}:
                columns[name].append(episode[f"observations/{name}"][:-1])
    lengths = torch.tensor([len(actions) for actions in columns["actions"]])
    tensors = {name: _with_padding(columns.pop(name)) for name in list(columns)}
    tensors |= {name: _with_padding([features]) for name, features in ready.items()}
    actions, labels = tensors.pop("actions"), tensors.pop("labels")
    for name in named(tensors, *GRAPH):
        # Edges have their relation, which is not 0, at the end; a node's state is not 0 either.
        tensors[name] = _cut(tensors[name], name.endswith(EDGES))
    return Demonstrations(
        actions=actions,
        labels=labels,
        observations={name: tensors[name] for name in sorted(tensors)},
        starts=torch.cumsum(lengths, 0) - lengths,
        lengths=lengths,
        sha256=dataset.sha256,
    )


def _with_padding(parts: list[np.ndarray]) -> Tensor:
    return torch.from_numpy(np.concatenate([*parts, np.zeros_like(parts[0][:1])]))


def _cut(values: Tensor, edges: bool) -> Tensor:
    """Return a part of graphs without the rows of padding that are empty everywhere."""
    filled = (values[..., -1] if edges else values).any(dim=0).sum()
    return values[:, : max(int(filled), 1)].clone()
