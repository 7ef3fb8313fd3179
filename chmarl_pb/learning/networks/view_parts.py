"""What the detector learns from in a batch: whole views, or for a quarter of the time parts of them; half mirrored."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.learning.networks.detections import OBJECTS

if TYPE_CHECKING:
    from chmarl_pb.learning.networks.labelled_views import Views  # needs PyBullet

Pictures = tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]


def batch_of(views: "Views", rows: NDArray[np.integer], rng: np.random.Generator, whole: bool) -> Pictures:
    """Return images, labels and colours of some views, each mirrored or not.

    Args:
        views: with labels.
        rows: numbers of the views.
        rng: decides.
        whole: whether views are whole. Else it is every second row and column of all, for what is around things, or of
            each a window of half the size at an object, for what is small.
    """
    if whole:
        images, labels, colours = views.images[rows], views.labels[rows], views.colours[rows]
    elif rng.random() < 0.5:
        images, labels, colours = (part[rows, ::2, ::2] for part in (views.images, views.labels, views.colours))
    else:
        images, labels, colours = _windows(views, rows, rng)
    mirrored = rng.random(len(rows)) < 0.5
    for part in (images, labels, colours):
        part[mirrored] = part[mirrored][:, :, ::-1]
    return images, labels, colours


def _windows(views: "Views", rows: NDArray[np.integer], rng: np.random.Generator) -> Pictures:
    """Return a window of half the height and width of each view, that shows a pixel of an object if the view does."""
    size = views.labels.shape[1] // 2
    found = []
    for row in rows.tolist():
        objects = np.flatnonzero(views.present[row, :OBJECTS])
        top, left = rng.integers(size + 1, size=2).tolist()
        if len(objects):
            places = np.argwhere(views.labels[row] == rng.choice(objects))
            place = places[rng.integers(len(places))] - rng.integers(size, size=2)
            top, left = place.clip(0, size).tolist()
        window = row, slice(top, top + size), slice(left, left + size)
        found.append((views.images[window], views.labels[window], views.colours[window]))
    images, labels, colours = (np.stack(part) for part in zip(*found, strict=True))
    return images, labels, colours
