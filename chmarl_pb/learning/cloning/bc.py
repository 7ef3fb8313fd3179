"""Behaviour cloning: robots learn to do what the planner did, from stored episodes.

Three forms, as in the paper: decentralized (each robot has its own network and its own observations), the same with
messages, and centralized (one network sees and drives all robots). All are recurrent over the episode.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.store import default_root
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.evaluation.metrics import score_now
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.learning.algorithms.gradient import check_finite, descend
from chmarl_pb.learning.cloning.demonstrations import DemonstrationBatch, Demonstrations, read_demonstrations
from chmarl_pb.learning.config import CATALOG, FROZEN, ROOMS
from chmarl_pb.learning.policies.cloned import (
    KIND,
    BCActor,
    BCPolicy,
    CloningConfig,
    encoder_of,
    make_actors,
    weights_of,
)
from chmarl_pb.learning.rollouts.batched import BatchOfOne
from chmarl_pb.learning.runs import interrupts
from chmarl_pb.learning.runs.device import find_device
from chmarl_pb.learning.runs.interrupts import Signals, StopRequested
from chmarl_pb.learning.runs.lock import run_lock
from chmarl_pb.learning.runs.logger import Logger
from chmarl_pb.learning.runs.validation import spread_tasks
from chmarl_pb.learning.storage import checkpoint
from chmarl_pb.learning.threads import threads as torch_threads
from chmarl_pb.robots.registry import TEAM, listed
from chmarl_pb.tasks.splits import VALIDATION

BEST, LAST = "best.pt", "last.pt"
_NOTHING = {"score": -1.0}  # figures before the first validation
UNFINISHED = "bc-unfinished"  # kind of ``last.pt``


def clone(
    config: CloningConfig,
    folder: Path,
    data: Path | None = None,
    quiet: bool = True,
    threads: int = 1,
    device: str = "cpu",
) -> dict[str, Any]:
    """Train clones and keep the best; interrupted, the same call goes on and ends with the same numbers.

    Unlike the clones of Sharma et al. (Adam, end to end), these learn by AdamW with a rate that falls along a cosine,
    see pictures by frozen weights, and observe their own last action (``past_actions``). The best epoch is the one with
    the best PLW on validation tasks, not the one with the least loss.

    A signal that asks the run to end has it saved after the present batch; a killed run loses a minute at most.

    Args:
        config: of the run.
        folder: gets ``best.pt``, ``last.pt`` (what an interrupted run goes on from), and metrics as other runs do.
        data: folder of Minari data sets; None: Minari's own.
        quiet: whether no progress is shown.
        threads: of torch, while this runs; networks as small as these are fastest with one.
        device: of torch, that the networks learn on; an interrupted run may go on on another.

    Returns:
        The figures of the best epoch.

    Raises:
        Interrupted: a signal asked the run to end.
        DatasetError: the data set is missing or damaged.
        CheckpointError: ``last.pt`` is damaged or of other settings, another process trains in the folder, or the run
            is over and its best weights are gone.
    """
    recipe = Recipe(config.split, config.observation, config.noise, robots=listed(config.robots))
    signals, where = Signals(), find_device(device)
    with torch_threads(threads):
        demonstrations = read_demonstrations(data or default_root(), recipe, config, quiet)
        run = _Run(config, demonstrations, folder, signals.check, where)
        with closing(run.examiner), run_lock(folder, LAST, BEST):
            run.restore()
            with closing(Logger(folder, config.epochs, run.epoch, quiet, unit="epoch")) as logger, signals:
                try:
                    while run.epoch < config.epochs:
                        run.next_epoch(logger)
                        signals.check()
                except StopRequested:
                    run.save()
                    raise signals.interrupted(f"{run.epoch} epochs and {run.batch} batches", folder / LAST) from None
    checkpoint.check_kept(folder / BEST)
    return run.best


class _Run:
    """A training in progress.

    Attributes:
        epoch: number of finished epochs.
        batch: number of batches of the next epoch that are learned from.
        best: figures of the best one.
        examiner: measures.
    """

    def __init__(
        self, config: CloningConfig, data: Demonstrations, folder: Path, check: Callable[[], None], device: torch.device
    ):
        """Make networks and optimizer; ``check`` is called where the run can end."""
        self.config, self.data, self.folder = config, data, folder
        self._check, self._device = check, device
        self.examiner = Examiner(config)
        with torch.random.fork_rng():
            torch.manual_seed(config.seed)
            self.actors = make_actors(self.examiner.env, config, encoder_of(config)).to(device)
        self.optimizer = torch.optim.AdamW(
            self.actors.parameters(), config.learning_rate, weight_decay=config.weight_decay
        )
        batches = -(-len(data.lengths) // config.batch_size)
        self.schedule = torch.optim.lr_scheduler.CosineAnnealingLR(self.optimizer, config.epochs * batches)
        self.epoch, self.best = 0, _NOTHING
        self._saved = time.monotonic()
        self._begin_epoch()

    def _begin_epoch(self) -> None:
        self.batch, self._total = 0, torch.zeros(len(self.examiner.robots))

    def next_epoch(self, logger: Logger) -> None:
        """Go through the data once, or through what is left of it, and do what is due after it.

        Raises:
            StopRequested: the run is to end; its state is that after some batch.
        """
        start, epoch = time.perf_counter(), self.epoch + 1
        losses = self._learn()
        figures: dict[str, Any] = {"epoch": epoch, "seconds": round(time.perf_counter() - start, 1)}
        figures |= {
            f"{name}_loss": round(float(loss), 4) for name, loss in zip(self.examiner.robots, losses, strict=True)
        }
        if epoch % self.config.validation_interval == 0 or epoch == self.config.epochs:
            self.save()  # examining takes its time
            figures |= self.examiner.examine(self.actors, self._check)
            if figures["score"] >= self.best["score"]:  # of equals the last, which have learned for longer
                self.best = figures
                self._save_best()
        self.epoch = epoch
        self._begin_epoch()
        logger.write(figures)
        logger.advance(self.epoch)
        self.save()

    def _learn(self) -> Tensor:
        self.actors.train()
        devices = [self._device] if self._device.type == "cuda" else []
        with torch.random.fork_rng(devices):
            for batch in self.data.batches(self.config.batch_size, (self.config.seed, self.epoch), self.batch):
                self._check()
                place = np.random.SeedSequence([self.config.seed, self.epoch, self.batch])
                torch.manual_seed(int(place.generate_state(1)[0]))  # dropout is the same after every interruption
                batch = batch.to(self._device)
                losses = loss_of(self.actors, self.config, batch, self.examiner.robots)
                loss = losses.sum() + grounding_of(self.actors, self.config, batch)
                descend({"loss": loss}, self.optimizer, 1.0, self.actors.parameters())
                self.schedule.step()
                self._total += losses.detach().cpu() * batch.mask.sum().cpu()
                self.batch += 1
                if time.monotonic() > self._saved + interrupts.EVERY:
                    self.save()
        check_finite(self.actors)
        return self._total / self.data.lengths.sum()

    def _save_best(self) -> None:
        facts = {"config": asdict(self.config), "figures": self.best, FROZEN: weights_of(self.config)}
        facts |= {CATALOG: self.examiner.env.catalog.content, ROOMS: ",".join(self.examiner.env.rooms)}
        checkpoint.save(self.folder / BEST, KIND, {**facts, "actors": self.actors.state_dict()})

    def save(self) -> None:
        """Write the checkpoint that a run goes on from."""
        parts = {"actors": self.actors, "optimizer": self.optimizer, "schedule": self.schedule}
        state = {name: part.state_dict() for name, part in parts.items()}  # type: ignore[attr-defined]
        place = {"epoch": self.epoch, "batch": self.batch, "total": self._total}
        checkpoint.save(self.folder / LAST, UNFINISHED, {**self._settings(), **place, "best": self.best, **state})
        self._saved = time.monotonic()

    def _settings(self) -> dict[str, Any]:
        """Return what fixes the run's numbers."""
        return {"config": asdict(self.config), "data": self.data.sha256, FROZEN: weights_of(self.config)}

    def restore(self) -> None:
        """Go on from ``last.pt``, if there is one."""
        path = self.folder / LAST
        if not path.is_file():
            return
        content = checkpoint.load(path, UNFINISHED)
        before = {  # older ones have none of these
            "robots": ",".join(TEAM), "word_vectors": False, "graph_pool": "mean", "numbers_past": False,
            "grounding_coef": 0.0, "split": "train",
        }  # fmt: skip
        content["config"] = before | content["config"]
        theirs, own = ({**one, **one["config"], "config": None} for one in (content, self._settings()))
        checkpoint.check_same(theirs, own, path)
        with checkpoint.reading(path):
            checkpoint.fill(self.actors, content["actors"], path)
            self.optimizer.load_state_dict(content["optimizer"])
            self.schedule.load_state_dict(content["schedule"])
            self.epoch = content["epoch"]
            self.best = content["best"] if checkpoint.is_whole(self.folder / BEST) else _NOTHING
            self._begin_epoch()
            if "batch" in content:  # older checkpoints were written between two epochs alone
                self.batch, self._total = content["batch"], content["total"]


def loss_of(actors: nn.ModuleList, config: CloningConfig, batch: DemonstrationBatch, robots: Sequence[str]) -> Tensor:
    """Return the cross-entropy of each robot's labels, (robots), means over the real steps."""
    losses = []
    for group, actor in zip(config.groups(robots), actors, strict=True):
        columns = [robots.index(name) for name in group]
        logits, _ = actor(batch.observation, batch.last[..., columns])
        for column, values in zip(columns, logits, strict=True):
            losses.append(nn.functional.cross_entropy(values[batch.mask], batch.labels[..., column][batch.mask]))
    return torch.stack(losses)


def grounding_of(actors: nn.ModuleList, config: CloningConfig, batch: DemonstrationBatch) -> Tensor:
    """Return the loss that teaches the networks which classes instructions name, times its weight."""
    if not config.grounding_coef:
        return torch.zeros((), device=batch.labels.device)
    losses = [cast(BCActor, actor).encoder.grounding_loss(batch.observation) for actor in actors]
    return config.grounding_coef * torch.stack(losses).sum()


class Examiner:
    """Plays validation tasks, to choose the best epoch; never those of a test split."""

    def __init__(self, config: CloningConfig):
        """Open an environment for a run."""
        self.env = HouseholdEnv(
            observation=config.observation,
            split=config.split,
            messages=config.messages,
            feedback=config.feedback,
            robots=listed(config.robots),
        )
        self.config, self.robots = config, self.env.possible_agents
        self.tasks = {split: spread_tasks(split, config.validation_tasks) for split in VALIDATION[config.split]}

    def examine(self, actors: nn.ModuleList, check: Callable[[], None] = lambda: None) -> dict[str, float]:
        """Return success rate and PLW on each split, and the mean PLW as ``score``; an error of ``check`` ends it."""
        policy = BatchOfOne(BCPolicy(actors.eval(), self.config, self.robots, encoder_of(self.config)))
        figures: dict[str, float] = {}
        for split, tasks in self.tasks.items():
            won, scores = [], []
            for task in tasks:
                check()
                episode = rollout(self.env, policy, episode_seed(task, 0), task)
                won.append(episode.success)
                scores.append(score_now(self.env, episode.success, len(episode)))
            figures[f"{split}_sr"] = round(float(np.mean(won)), 4)
            figures[f"{split}_plw"] = round(float(np.mean(scores)), 4)
        return {"score": round(float(np.mean([figures[f"{split}_plw"] for split in self.tasks])), 4)} | figures

    def close(self) -> None:
        """Disconnect from physics."""
        self.env.close()
