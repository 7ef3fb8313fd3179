"""Train ResNet-18 on views of the homes of training: which classes are to be seen, and where.

``python -m training.pretrain`` draws views of homes 1 to 5 by both robots' cameras, with labels from the segmentation,
learns from them, and measures on views of home 6. Killed, it goes on from the last whole epoch. Neither the home of the
unseen tests nor any layout of a validation or test task of homes 1 to 5 is used.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor, nn

from training import checkpoint
from training.int8 import ranges_of
from training.residual import FEATURES, ResNet18, folded
from training.resnet import RANGES, FrozenResNet18, weights_file
from training.views import LABELS, Views, random_views

KIND = "pretraining"
BATCH = 64
LEARNING_RATE = 2e-3
WEIGHT_DECAY = 0.02
CHECKED = 2_000  # views of home 6
SMALL = 0.6  # share of the epochs with pictures of half the size, which take a quarter of the time
RANGED = 256  # views that the ranges are taken from


class Labeller(nn.Module):
    """ResNet-18 with three linear heads, which are thrown away afterwards."""

    def __init__(self) -> None:
        """Make the layers."""
        super().__init__()
        self.network = ResNet18()
        self.cells = nn.Conv2d(FEATURES, len(LABELS), 1)
        self.present = nn.Linear(FEATURES, len(LABELS))
        self.centres = nn.Linear(FEATURES, 2 * len(LABELS))

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return logits of cells (B, C, GRID, GRID) and of presence (B, C), and centres (B, C, 2)."""
        maps = self.network.maps(images)
        features = maps.mean(dim=(2, 3))
        return self.cells(maps), self.present(features), self.centres(features).unflatten(1, (-1, 2))


def loss_of(labeller: Labeller, views: Views, rows: np.ndarray, every: int = 1) -> Tensor:
    """Return the sum of the three losses on some views: two cross-entropies and, of what is present, a distance.

    Args:
        labeller: that learns.
        views: with labels.
        rows: numbers of the views.
        every: 2 leaves out every second row and column of the pictures.
    """
    images = torch.from_numpy(views.images[rows, ::every, ::every])
    cells, present, centres = (
        torch.from_numpy(part[rows]).float() for part in (views.cells, views.present, views.centres)
    )
    told_cells, told_present, told_centres = labeller(images)
    shown = nn.functional.binary_cross_entropy_with_logits(told_present, present)
    told_cells = nn.functional.interpolate(told_cells, cells.shape[-1])  # small pictures have fewer
    placed = nn.functional.binary_cross_entropy_with_logits(told_cells, cells)
    far = ((told_centres - centres).abs().sum(dim=2) * present).sum() / present.sum().clamp(min=1)
    return 10 * shown + 10 * placed + 0.3 * far  # about equal at the start


def batches(count: int, seed: int, epoch: int) -> Iterator[np.ndarray]:
    """Yield the numbers of all views in shuffled batches; a last small one is left out."""
    order = np.random.default_rng([seed, epoch]).permutation(count)
    for first in range(0, count - BATCH + 1, BATCH):
        yield np.sort(order[first : first + BATCH])


@torch.no_grad()
def measure(labeller: Labeller, encode: Callable[[Tensor], Tensor], views: Views) -> dict[str, Any]:
    """Return figures of how well classes are recognised.

    ``mean_average_precision`` is the mean over the classes that are shown at least five times; ``chance`` is that of
    a random order; ``centre_error`` the mean distance of centres, in pictures' half widths.

    Args:
        labeller: its heads are used.
        encode: returns features of pictures.
        views: to measure on.
    """
    labeller.eval()
    parts = [encode(torch.from_numpy(views.images[first : first + 128])) for first in range(0, len(views), 128)]
    features = torch.cat(parts).float()
    scores, centres = labeller.present(features).numpy(), labeller.centres(features).unflatten(1, (-1, 2)).numpy()
    each = {
        name: average_precision(scores[:, number], views.present[:, number])
        for number, name in enumerate(LABELS)
        if views.present[:, number].sum() >= 5
    }
    known = [LABELS.index(name) for name in each]
    errors = np.linalg.norm(centres - views.centres, axis=2)[views.present]
    return {
        "views": len(views),
        "mean_average_precision": round(float(np.mean(list(each.values()))), 4),
        "chance": round(float(views.present[:, known].mean()), 4),
        "centre_error": round(float(errors.mean()), 4),
        "average_precision": {name: round(value, 4) for name, value in each.items()},
    }


def average_precision(scores: np.ndarray, present: np.ndarray) -> float:
    """Return the mean, over all views that show a class, of the precision among those that score at least as much."""
    hits = present[np.argsort(-scores, kind="stable")]
    precision = np.cumsum(hits) / np.arange(1, len(hits) + 1)
    return float(precision[hits].mean())


def pretrain(out: Path, views: Views, checked: Views, epochs: int, seed: int, bar: Progress) -> dict[str, Any]:
    """Train, write the weights, and return the figures.

    Args:
        out: file of the weights; the state of an unfinished training is kept beside it.
        views: to learn from.
        checked: to measure on.
        epochs: passes over the views.
        seed: of weights and order.
        bar: shows the batches.
    """
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        labeller = Labeller().to(memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(labeller.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    per_epoch = len(views) // BATCH
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, LEARNING_RATE, total_steps=epochs * per_epoch)
    facts = {"views": len(views), "epochs": epochs, "small": SMALL, "seed": seed}
    kept = out.with_suffix(".unfinished")
    parts: dict[str, Any] = {"labeller": labeller, "optimizer": optimizer, "schedule": schedule}
    begun = _restore(kept, facts, parts)
    task = bar.add_task("learn", total=epochs * per_epoch, completed=begun * per_epoch)
    for epoch in range(begun, epochs):
        labeller.train()
        every = 2 if epoch < epochs * SMALL else 1
        for rows in batches(len(views), seed, epoch):
            with torch.autocast("cpu", torch.bfloat16):
                loss = loss_of(labeller, views, rows, every)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            bar.update(task, advance=1, description=f"learn, loss {loss.item():.2f}")
        state = {name: part.state_dict() for name, part in parts.items()}
        checkpoint.save(kept, KIND, {"facts": facts, "epoch": epoch + 1, **state})
    weights = with_ranges(labeller.network.eval().state_dict(), views.images)
    temporary = out.with_suffix(".tmp")
    torch.save(weights, temporary)
    temporary.replace(out)
    frozen = FrozenResNet18(weights)
    measured = measure(labeller, frozen, checked)
    exact = measure(labeller, labeller.network, checked)
    measured["mean_average_precision_in_float32"] = exact["mean_average_precision"]
    figures = {**facts, "fingerprint": frozen.fingerprint, "home_6": measured}
    kept.unlink(missing_ok=True)
    return figures


@torch.no_grad()
def with_ranges(weights: dict[str, Tensor], images: np.ndarray) -> dict[str, Tensor]:
    """Return weights with the ranges on some pictures; :class:`training.resnet.FrozenResNet18` is fast with them."""
    network = ResNet18()
    network.load_state_dict(weights)
    chosen = images[np.linspace(0, len(images), min(RANGED, len(images)), endpoint=False).astype(int)]
    ranges = ranges_of(folded(network.eval()), torch.from_numpy(chosen))
    return {name: value.contiguous() for name, value in weights.items()} | {RANGES: ranges}


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


def main(arguments: list[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description="Train ResNet-18 on views of the homes of training.")
    parser.add_argument("--views", type=int, default=20_000, help="to learn from (default 20000; about 1 GB of disk)")
    parser.add_argument("--epochs", type=int, default=6, help="passes over the views (default 6)")
    parser.add_argument("--seed", type=int, default=0, help="of views, weights and order (default 0)")
    parser.add_argument("--workers", type=int, default=2, help="processes that draw views (default 2)")
    parser.add_argument("--out", type=Path, default=weights_file(), help="file of the weights (default %(default)s)")
    parser.add_argument("--figures", type=Path, help="JSON file for the figures")
    chosen = parser.parse_args(arguments)
    chosen.out.parent.mkdir(parents=True, exist_ok=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    start = time.perf_counter()
    with Progress(*columns) as bar:
        folder = chosen.out.parent / "views_to_label"
        views = _drawn(bar, "train", chosen.views, chosen.seed, folder, chosen.workers)
        checked = _drawn(bar, "val-unseen", min(CHECKED, chosen.views), chosen.seed, folder, chosen.workers)
        figures = pretrain(chosen.out, views, checked, chosen.epochs, chosen.seed, bar)
    figures["minutes"] = round((time.perf_counter() - start) / 60, 1)
    text = json.dumps(figures, indent=2)
    if chosen.figures:
        chosen.figures.write_text(text + "\n", encoding="utf-8")
    print(text, f"weights: {chosen.out}", sep="\n")


def _drawn(bar: Progress, split: str, count: int, seed: int, folder: Path, workers: int) -> Views:
    task = bar.add_task(f"draw views of {split}", total=None)
    return random_views(
        split, count, seed, folder, workers, lambda done, all: bar.update(task, completed=done, total=all)
    )


if __name__ == "__main__":
    main()
