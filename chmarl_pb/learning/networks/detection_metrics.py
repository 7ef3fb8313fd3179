"""How well classes are recognised in views of homes."""

from typing import TYPE_CHECKING, Any

import numpy as np

from chmarl_pb.learning.networks.detections import LABELS
from chmarl_pb.rendering.renderer import VISIBLE_PIXELS

if TYPE_CHECKING:
    from chmarl_pb.learning.networks.labelled_views import Views  # needs PyBullet

_FEWEST = 5  # views that show a class, for it to count
_SIZES = ((4, 16), (16, 64), (64, 256), (256, 1024), (1024, 16385))  # pixels: from, and below


def recognition_metrics(scores: np.ndarray, centres: np.ndarray, views: "Views") -> dict[str, Any]:
    """Return figures of how well classes are recognised.

    ``mean_average_precision`` is the mean over the classes that are shown at least five times; ``chance`` is that of
    a random order; ``centre_error`` the mean distance of centres, in pictures' half widths.

    Args:
        scores: (V, classes) how sure it is that a view shows each class, of ``LABELS`` or the first of these.
        centres: (V, classes, 2) where, as in :class:`chmarl_pb.learning.networks.labelled_views.Views`.
        views: with labels.
    """
    classes = scores.shape[1]
    present = views.present[:, :classes]
    each = {
        name: average_precision(scores[:, number], present[:, number])
        for number, name in enumerate(LABELS[:classes])
        if present[:, number].sum() >= _FEWEST
    }
    known = [LABELS.index(name) for name in each]
    errors = np.linalg.norm(centres - views.centres[:, :classes], axis=2)[present]
    return {
        "views": len(views),
        "mean_average_precision": round(float(np.mean(list(each.values()))), 4),
        "chance": round(float(present[:, known].mean()), 4),
        "centre_error": round(float(errors.mean()), 4),
        "average_precision": {name: round(value, 4) for name, value in each.items()},
    }


def detection_metrics(found: np.ndarray, views: "Views") -> dict[str, Any]:
    """Return figures of detections: those of ``recognition_metrics``, by size and of colours, too.

    ``by_pixels`` is the mean average precision of things of some sizes: views that show a class in another size are
    left out. ``colour_accuracy`` is the share of those objects whose colour is told among those whose class is seen at
    all, with any confidence, and of which there is one in the view; it is missing where no object has a colour by name.

    Args:
        found: (V, C, 6) detections, see :mod:`chmarl_pb.learning.networks.detections`.
        views: with labels.
    """
    scores = found[..., 0]
    figures = recognition_metrics(scores, found[..., 1:3] / np.maximum(scores[..., None], 1e-3), views)
    pixels = np.stack([np.bincount(label.ravel(), minlength=len(LABELS) + 1)[: len(LABELS)] for label in views.labels])
    by_pixels = {}
    for least, most in _SIZES:
        fits = (pixels >= least) & (pixels < most)
        each = [
            average_precision(scores[rows, number], fits[rows, number])
            for number in range(scores.shape[1])
            if fits[:, number].sum() >= _FEWEST
            for rows in [fits[:, number] | ~views.present[:, number]]
        ]
        by_pixels[f"{least} to {most - 1}"] = round(float(np.mean(each)), 4) if each else None
    figures["by_pixels"] = by_pixels
    told, known = _colours(found[..., 4], views)
    return figures if not known else {**figures, "colour_accuracy": round(told / known, 4), "colours": known}


def _colours(ids: np.ndarray, views: "Views") -> tuple[int, int]:
    """Return how many colours of objects are told, of how many."""
    told = known = 0
    for number in np.flatnonzero(views.colours.any(axis=(1, 2))).tolist():
        both = views.labels[number].astype(int) * 256 + views.colours[number]
        codes, count = np.unique(both[views.colours[number] > 0], return_counts=True)
        kinds, colours = np.divmod(codes, 256)
        for kind, colour, size in zip(kinds.tolist(), colours.tolist(), count.tolist(), strict=True):
            if (kinds == kind).sum() == 1 and size >= VISIBLE_PIXELS and ids[number, kind]:
                known += 1
                told += int(ids[number, kind] == colour)
    return told, known


def average_precision(scores: np.ndarray, present: np.ndarray) -> float:
    """Return the mean, over all views that show a class, of the precision among those that score at least as much."""
    order = np.argsort(-scores, kind="stable")
    hits, sorted_scores = present[order], scores[order]
    ends = np.searchsorted(-sorted_scores, -sorted_scores, side="right")  # views that score at least as much
    return float((np.cumsum(hits)[ends - 1] / ends)[hits].mean())
