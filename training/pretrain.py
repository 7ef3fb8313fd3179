"""Train a frozen encoder of pictures on views of the homes of training: which classes are to be seen, and where.

``python -m training.pretrain`` draws views of homes 1 to 5 by both robots' cameras, with labels from the segmentation,
learns from them, and measures on views of home 6. Killed, it goes on from the last whole epoch. Neither the home of the
unseen tests nor any layout of a validation or test task of homes 1 to 5 is used.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor

from chmarl_pb.errors import ChmarlError
from chmarl_pb.files import Lock, open_folder, replacing, write_atomically
from training import checkpoint
from training.encoders.detector import Detector
from training.encoders.frozen import FrozenEncoder, weights_file
from training.encoders.int8 import RANGES, ranges_of
from training.encoders.labeller import Labeller
from training.encoders.residual import folded
from training.seal import seal
from training.views import Views, random_views

KIND = "pretraining"
WEIGHT_DECAY = 0.02
CHECKED = 2_000  # views of home 6
RANGED = 256  # views that the ranges are taken from

#: Name of an encoder -> what is trained for it; beside its ``network``, each has ``loss``, ``weights``, ``features``
#: and ``measure``.
NETWORKS: dict[str, type[Labeller] | type[Detector]] = {"resnet18": Labeller, "detector": Detector}


def batches(count: int, size: int, seed: int, epoch: int) -> Iterator[np.ndarray]:
    """Yield the numbers of all views in shuffled batches; a last small one is left out."""
    order = np.random.default_rng([seed, epoch]).permutation(count)
    for first in range(0, count - size + 1, size):
        yield np.sort(order[first : first + size])


def pretrain(name: str, out: Path, views: Views, checked: Views, epochs: int, seed: int, bar: Progress) -> dict:
    """Train, write the weights, and return the figures.

    Args:
        name: one of ``NETWORKS``.
        out: file of the weights; the state of an unfinished training is kept beside it.
        views: to learn from.
        checked: to measure on.
        epochs: passes over the views.
        seed: of weights and order.
        bar: shows the batches.
    """
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        pupil = NETWORKS[name]().to(memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(pupil.parameters(), pupil.learning_rate, weight_decay=WEIGHT_DECAY)
    per_epoch = len(views) // pupil.batch
    total = epochs * per_epoch
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, pupil.learning_rate, total_steps=total)
    facts = {"network": name, "views": len(views), "epochs": epochs, "seed": seed}
    kept = out.with_suffix(".unfinished")
    parts: dict[str, Any] = {"pupil": pupil, "optimizer": optimizer, "schedule": schedule}
    begun = _restore(kept, facts, parts)
    task = bar.add_task("learn", total=total, completed=begun * per_epoch)
    for epoch in range(begun, epochs):
        pupil.train()
        for rows in batches(len(views), pupil.batch, seed, epoch):
            with torch.autocast("cpu", torch.bfloat16):
                loss = pupil.loss(views, rows, epoch / epochs)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            bar.update(task, advance=1, description=f"learn, loss {loss.item():.3f}")
        state = {key: part.state_dict() for key, part in parts.items()}
        checkpoint.save(kept, KIND, {"facts": facts, "epoch": epoch + 1, **state})
    pupil.eval()
    weights = with_ranges(pupil, views.images)
    with replacing(out) as temporary:
        torch.save(weights, temporary)
        seal(temporary)
    frozen = FrozenEncoder(name, weights)
    measured, exact = pupil.measure(frozen, checked), pupil.measure(pupil.features, checked)
    measured["mean_average_precision_in_float32"] = exact["mean_average_precision"]
    figures = {**facts, "fingerprint": frozen.fingerprint, "home_6": measured}
    kept.unlink(missing_ok=True)
    return figures


@torch.no_grad()
def with_ranges(pupil: Labeller | Detector, images: np.ndarray) -> dict[str, Tensor]:
    """Return the weights that are kept, with the ranges of the network on some pictures."""
    weights = {name: value.clone().contiguous() for name, value in pupil.weights().items()}
    chosen = images[np.linspace(0, len(images), min(RANGED, len(images)), endpoint=False).astype(int)]
    return weights | {RANGES: ranges_of(folded(deepcopy(pupil.network)), torch.from_numpy(chosen))}


def _restore(kept: Path, facts: dict[str, Any], parts: dict[str, Any]) -> int:
    """Load an unfinished training of the same facts, if there is one; return its finished epochs."""
    if not kept.is_file():
        return 0
    content = checkpoint.load(kept, KIND)
    if content["facts"] != facts:
        return 0
    for name, part in parts.items():
        part.load_state_dict(content[name])
    return int(content["epoch"])


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m training.pretrain", description="Train a frozen encoder on views of the homes of training."
    )
    parser.add_argument("--network", choices=NETWORKS, default="resnet18", help="(default %(default)s)")
    parser.add_argument("--views", type=int, help="to learn from (default 20000, detector 60000; 65 kB each on disk)")
    parser.add_argument("--epochs", type=int, help="passes over the views (default 6, detector 4)")
    parser.add_argument("--seed", type=int, default=0, help="of views, weights and order (default 0)")
    parser.add_argument("--workers", type=int, default=2, help="processes that draw views (default 2)")
    parser.add_argument("--out", type=Path, help="file of the weights; default: where they are looked for")
    parser.add_argument("--figures", type=Path, help="JSON file for the figures")
    chosen = parser.parse_args(arguments)
    pupil = NETWORKS[chosen.network]
    chosen.views = pupil.views if chosen.views is None else chosen.views
    chosen.epochs = pupil.epochs if chosen.epochs is None else chosen.epochs
    for name, least in (("views", pupil.batch), ("epochs", 1), ("workers", 1), ("seed", 0)):
        if (value := getattr(chosen, name)) < least:
            parser.error(f"--{name} {value}: use at least {least}")
    for name in ("out", "figures"):
        if (path := getattr(chosen, name)) and path.is_dir():
            parser.error(f"--{name} {path}: is a folder; name a file in it")
    try:
        _make(chosen)
    except (ChmarlError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _make(chosen: argparse.Namespace) -> None:
    """Draw the views, learn from them, and print the figures."""
    out = chosen.out or weights_file(chosen.network)
    folder = open_folder(out.parent) / "labelled_views"
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    start = time.perf_counter()
    with Lock(out), Progress(*columns) as bar:
        views = _drawn(bar, "train", chosen.views, chosen.seed, folder, chosen.workers)
        checked = _drawn(bar, "val-unseen", min(CHECKED, chosen.views), chosen.seed, folder, chosen.workers)
        figures = pretrain(chosen.network, out, views, checked, chosen.epochs, chosen.seed, bar)
    figures["minutes"] = round((time.perf_counter() - start) / 60, 1)
    text = json.dumps(figures, indent=2)
    if chosen.figures:
        write_atomically(chosen.figures, text + "\n")
    print(text, f"weights: {out}", sep="\n")


def _drawn(bar: Progress, split: str, count: int, seed: int, folder: Path, workers: int) -> Views:
    task = bar.add_task(f"draw views of {split}", total=None)
    return random_views(
        split, count, seed, folder, workers, lambda done, all: bar.update(task, completed=done, total=all)
    )


if __name__ == "__main__":
    raise SystemExit(main())
