"""How well classes are recognised in views of homes."""

from typing import TYPE_CHECKING, Any

import numpy as np

from chmarl_pb.learning.networks.detections import LABELS

if TYPE_CHECKING:
    from chmarl_pb.learning.networks.labelled_views import Views  # needs PyBullet


def recognition_metrics(scores: np.ndarray, centres: np.ndarray, views: "Views") -> dict[str, Any]:
    """Return figures of how well classes are recognised.

    ``mean_average_precision`` is the mean over the classes that are shown at least five times; ``chance`` is that of
    a random order; ``centre_error`` the mean distance of centres, in pictures' half widths.

    Args:
        scores: (V, C) how sure it is that a view shows a class.
        centres: (V, C, 2) where, as in :class:`chmarl_pb.learning.networks.labelled_views.Views`.
        views: with labels.
    """
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
