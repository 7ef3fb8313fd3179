"""Train a frozen encoder of pictures on views of the homes of training: which classes are to be seen, and where.

``python -m training.pretrain`` draws views by both robots' cameras, with labels from the segmentation: of homes 1 to 5,
for the detector also of generated homes of the endless split. It learns from them, and measures on views of home 6 and
of the generated homes of validation. Interrupted, it goes on where it was. Neither a home of the unseen tests nor any
layout of a validation or test task of homes 1 to 5 is used.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from rich.progress import Progress

from chmarl_pb.files import Lock, open_folder, remove_leftovers, replacing, write_atomically
from chmarl_pb.learning.algorithms.gradient import check_finite
from chmarl_pb.learning.networks.classifier import Classifier
from chmarl_pb.learning.networks.detector import Detector
from chmarl_pb.learning.networks.frozen import FrozenEncoder, own_file, read_weights, weights_file, weights_hash
from chmarl_pb.learning.networks.labelled_views import Views, drawn_views, read_views
from chmarl_pb.learning.runs import interrupts
from chmarl_pb.learning.runs.device import find_device
from chmarl_pb.learning.runs.interrupts import Signals, StopRequested, run_command
from chmarl_pb.learning.storage import checkpoint
from chmarl_pb.learning.storage.seal import seal
from chmarl_pb.learning.threads import threads
from chmarl_pb.progress import progress_bar
from training.onnx_file import read_detector, write_onnx

KIND = "pretraining"
WEIGHT_DECAY = 0.02
CHECKED = 2_000  # views of each kind that it is measured on
RANGED = 256  # views that the ranges are taken from

CPU = torch.device("cpu")
#: Whether the processor computes in bfloat16; where it has to be imitated, it is ten times as slow as float32.
_HALF: bool = torch.ops.mkldnn._is_mkldnn_bf16_supported()

#: Name of an encoder -> what is trained for it; each has ``loss``, ``weights``, ``features`` and ``measure``.
NETWORKS: dict[str, type[Classifier] | type[Detector]] = {"resnet18": Classifier, "detector": Detector}


def batches(count: int, size: int, seed: int, epoch: int, skip: int = 0) -> Iterator[np.ndarray]:
    """Yield the numbers of all views in shuffled batches, without some of the first; a last small one is left out."""
    order = np.random.default_rng([seed, epoch]).permutation(count)
    for first in range(skip * size, count - size + 1, size):
        yield np.sort(order[first : first + size])


@threads(1)  # the order of sums, and so the weights, depends on the number
def pretrain(
    name: str,
    out: Path,
    views: Views,
    checked: dict[str, Views],
    epochs: int,
    seed: int,
    bar: Progress,
    start: Path | None = None,
    device: torch.device = CPU,
) -> dict[str, Any]:
    """Train, write the weights, and return the figures.

    Args:
        name: one of ``NETWORKS``.
        out: file of the weights; the state of an unfinished training is kept beside it.
        views: to learn from.
        checked: name -> what to measure on.
        epochs: passes over the views.
        seed: of weights and order.
        bar: shows the batches.
        start: a trained detector, of which only the colours are counted anew; None: all is trained.
        device: to learn on; weights differ between devices.

    Raises:
        Interrupted: a signal asked the training to end; it was saved.
        CheckpointError: there is no detector to start from, or the state is damaged.
    """
    facts: dict[str, Any] = {"network": name, "views": len(views)}
    if start is None:
        facts |= {"epochs": epochs, "seed": seed, "device": device.type}
    unfinished = _unfinished(out)
    model = read_detector(start) if start else _learned(_Training(facts, views, unfinished, device), bar).to(CPU)
    model.eval().finish(views)
    weights = model.weights(ranged(views.images))
    with replacing(out) as temporary:
        with temporary.open("wb") as file:  # torch writes the name of a path into the file
            torch.save(weights, file)
        seal(temporary)
    frozen = FrozenEncoder(name, weights)
    figures = {**facts, "fingerprint": frozen.fingerprint}
    if start is not None:
        figures["start"] = weights_hash(read_weights(start, name))
    figures |= measured(model, frozen, checked)
    if start is None:
        unfinished.unlink(missing_ok=True)
    return figures


def _unfinished(out: Path) -> Path:
    """Return the file of the state of a training that has not ended."""
    return out.with_suffix(".unfinished")


def measured(
    model: Classifier | Detector, frozen: FrozenEncoder, checked: Mapping[str, Views]
) -> dict[str, dict[str, Any]]:
    """Return the figures of a trained network on each of some views: as it is used, in whole numbers, and in floats."""
    figures = {}
    for kind, views in checked.items():
        figures[kind], exact = model.measure(frozen, views), model.measure(model.features, views)
        figures[kind]["mean_average_precision_in_float32"] = exact["mean_average_precision"]
    return figures


def _learned(training: "_Training", bar: Progress) -> Classifier | Detector:
    """Go on with a training to its end, and return what was trained."""
    training.restore()
    task, signals = bar.add_task("learn", total=training.total, completed=training.done), Signals()
    with signals:
        try:
            for loss in training.losses():
                bar.update(task, advance=1, description=f"learn, loss {loss:.3f}")
                signals.check()
        except StopRequested:
            training.save()
            raise signals.interrupted(f"{training.done} of {training.total} batches", training.kept) from None
    return training.model


class _Training:
    """A training in progress; it can be saved after every batch.

    Attributes:
        model: what is trained.
        done: batches that were learned from, of ``total``.
        facts: what fixes the numbers.
        kept: file of its state.
    """

    def __init__(self, facts: dict[str, Any], views: Views, kept: Path, device: torch.device):
        """Begin."""
        self.facts = facts
        with torch.random.fork_rng():
            torch.manual_seed(facts["seed"])
            model = NETWORKS[facts["network"]]().to(device).to(memory_format=torch.channels_last)
        optimizer = torch.optim.AdamW(model.parameters(), model.learning_rate, weight_decay=WEIGHT_DECAY)
        self._per_epoch = len(views) // model.batch
        self.done, self.total = 0, facts["epochs"] * self._per_epoch
        schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, model.learning_rate, total_steps=self.total)
        self.model, self._optimizer, self._schedule = model, optimizer, schedule
        self._parts: dict[str, Any] = {"model": model, "optimizer": optimizer, "schedule": schedule}
        self._views, self.kept, self._saved, self._device = views, kept, time.monotonic(), device

    def losses(self) -> Iterator[float]:
        """Learn from all batches that are left, and yield the loss of each."""
        while self.done < self.total:
            epoch, begun = divmod(self.done, self._per_epoch)
            self.model.train()
            for rows in batches(len(self._views), self.model.batch, self.facts["seed"], epoch, begun):
                with torch.autocast(self._device.type, torch.bfloat16, enabled=_HALF or self._device != CPU):
                    loss = self.model.loss(self._views, rows, epoch / self.facts["epochs"])
                self._optimizer.zero_grad()
                loss.backward()
                self._optimizer.step()
                self._schedule.step()
                self.done += 1
                if self.done % self._per_epoch == 0 or time.monotonic() > self._saved + interrupts.EVERY:
                    self.save()
                yield loss.item()

    def save(self) -> None:
        """Write the state, so that the same command goes on from it.

        Raises:
            DivergedError: some weights are no numbers.
        """
        check_finite(self.model)
        state = {key: part.state_dict() for key, part in self._parts.items()}
        checkpoint.save(self.kept, KIND, {"facts": self.facts, "done": self.done, **state})
        self._saved = time.monotonic()

    def restore(self) -> None:
        """Go on from an unfinished training, if there is one.

        Raises:
            CheckpointError: its file is damaged, or of a training of other facts.
        """
        if not self.kept.is_file():
            return
        content = checkpoint.load(self.kept, KIND)
        with checkpoint.reading(self.kept):
            checkpoint.check_same(content["facts"], self.facts, self.kept)
            for name, part in self._parts.items():
                part.load_state_dict(content[name])
            self.done = content["done"]


def ranged(images: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the pictures that the ranges of a network are taken from: some of all."""
    chosen = np.linspace(0, len(images), min(RANGED, len(images)), endpoint=False).astype(int)
    some: NDArray[np.uint8] = images[chosen]
    return some


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m training.pretrain", description="Train a frozen encoder on views of the homes of training."
    )
    parser.add_argument("--network", choices=NETWORKS, default="resnet18", help="(default %(default)s)")
    parser.add_argument("--views", type=int, help="to learn from (default 20000, detector 96000; 82 kB each on disk)")
    parser.add_argument("--epochs", type=int, help="passes over the views (default 6, detector 8)")
    parser.add_argument("--seed", type=int, default=0, help="of views, weights and order (default 0)")
    parser.add_argument("--workers", type=int, default=2, help="processes that draw views (default 2)")
    parser.add_argument("--device", help="of torch, e.g. cuda (default cpu)")
    parser.add_argument("--out", type=Path, help="file of the weights (default: where yours are looked for)")
    parser.add_argument("--figures", type=Path, help="JSON file for the figures")
    parser.add_argument("--start", type=Path, help="a trained detector: only the colours of its table are counted anew")
    parser.add_argument("--measure", action="store_true", help="measure the trained detector; nothing is trained")
    parser.add_argument("--onnx", type=Path, help="ONNX file to write the trained detector to; nothing is trained")
    chosen = parser.parse_args(arguments)
    _check_together(chosen, parser)
    model = NETWORKS[chosen.network]
    chosen.device = chosen.device or "cpu"
    chosen.views = model.views if chosen.views is None else chosen.views
    chosen.epochs = model.epochs if chosen.epochs is None else chosen.epochs
    for name, least in (("views", model.batch), ("epochs", 1), ("workers", 1), ("seed", 0)):
        if (value := getattr(chosen, name)) < least:
            parser.error(f"--{name} {value}: use at least {least}")
    for name in ("out", "figures", "onnx"):
        if (path := getattr(chosen, name)) and path.is_dir():
            parser.error(f"--{name} {path}: is a folder; name a file in it")
    return run_command(partial(_export if chosen.onnx else _measure if chosen.measure else _make, chosen))


def _check_together(chosen: argparse.Namespace, parser: argparse.ArgumentParser) -> None:
    """Refuse options that exclude each other, or that would not be used."""
    kinds = [name for name in ("onnx", "start", "measure") if getattr(chosen, name)]
    if kinds and chosen.network != "detector":
        parser.error(f"--{kinds[0]}: goes with --network detector")
    if len(kinds) > 1:
        parser.error("--onnx, --start and --measure exclude each other")
    idle = dict.fromkeys(("epochs", "device"), "nothing is trained") if kinds else {}
    if chosen.onnx:
        idle |= dict.fromkeys(("figures", "views", "seed", "workers"), "no views are drawn for --onnx")
    for name, why in idle.items():
        if getattr(chosen, name) != parser.get_default(name):
            parser.error(f"--{name}: {why}; leave it out")


def _export(chosen: argparse.Namespace) -> int:
    """Write trained weights to an ONNX file."""
    source = chosen.out or weights_file("detector")
    write_onnx(read_detector(source), chosen.onnx)
    print(f"{chosen.onnx}: the detector of {source}")
    return 0


@threads(1)
def _measure(chosen: argparse.Namespace) -> int:
    """Draw the views that are checked, and print the figures of trained weights."""
    source = chosen.out or weights_file("detector")
    model, frozen = read_detector(source), FrozenEncoder("detector", read_weights(source, "detector"))
    folder = open_folder(own_file("detector").parent) / "labelled_views"
    with progress_bar() as bar:
        figures = measured(model, frozen, _checked(chosen, partial(_drawn, bar, chosen.seed, folder, chosen.workers)))
    return _tell({"network": "detector", "fingerprint": frozen.fingerprint, **figures}, source, chosen.figures)


def _make(chosen: argparse.Namespace) -> int:
    """Draw the views, learn from them, and print the figures."""
    out, device = chosen.out or own_file(chosen.network), find_device(chosen.device)
    if chosen.start:
        read_detector(chosen.start)  # refused before all views are drawn
    folder = open_folder(out.parent) / "labelled_views"
    start = time.perf_counter()
    with Lock(out), progress_bar() as bar:
        for written in (out, _unfinished(out)):
            remove_leftovers(written)
        draw = partial(_drawn, bar, chosen.seed, folder, chosen.workers)
        sources = NETWORKS[chosen.network].sources.items()
        files = [draw(round(share * chosen.views), *source) for source, share in sources]
        views, checked = read_views([file for part in files for file in part]), _checked(chosen, draw)
        figures = pretrain(chosen.network, out, views, checked, chosen.epochs, chosen.seed, bar, chosen.start, device)
    return _tell({**figures, "minutes": round((time.perf_counter() - start) / 60, 1)}, out, chosen.figures)


def _checked(chosen: argparse.Namespace, draw: Callable[..., list[Path]]) -> dict[str, Views]:
    """Return the views that a network is measured on."""
    few = min(CHECKED, chosen.views)
    return {kind: read_views(draw(few, *source)) for kind, source in NETWORKS[chosen.network].checks.items()}


def _tell(figures: dict[str, Any], weights: Path, file: Path | None) -> int:
    """Print figures, and write them to a file if there is one."""
    text = json.dumps(figures, indent=2)
    if file:
        write_atomically(file, text + "\n")
    print(text, f"weights: {weights}", sep="\n")
    return 0


def _drawn(
    bar: Progress, seed: int, folder: Path, workers: int, count: int, split: str, lookalikes: bool
) -> list[Path]:
    task = bar.add_task(f"draw views of {split}", total=None)
    return drawn_views(
        split, count, seed, folder, workers, lambda done, all: bar.update(task, completed=done, total=all), lookalikes
    )


if __name__ == "__main__":
    raise SystemExit(main())
