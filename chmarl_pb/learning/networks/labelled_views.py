"""Random views of homes with free labels: which classes each shows, and where, read from the segmentation."""

import zipfile
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.errors import ChmarlError
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.files import replacing
from chmarl_pb.homes.content import sha256_of
from chmarl_pb.learning.networks.detections import LABELS
from chmarl_pb.processes import in_processes
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import load_tasks

GRID = 4  # cells along each side of a picture
LAYOUT_VIEWS = 20  # views of one layout of objects, equally many by each robot of the benchmark

#: Called with the numbers of finished and of all layouts.
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Views:
    """Pictures with labels; V is their number, C that of ``LABELS``.

    Attributes:
        images: (V, VISIBILITY_SIZE, VISIBILITY_SIZE, 3) uint8.
        labels: (V, VISIBILITY_SIZE, VISIBILITY_SIZE) uint8 number of the class in each pixel; C for none.
        cells: (V, C, GRID, GRID) bool: whether the class has ``VISIBLE_PIXELS`` pixels in the cell.
        present: (V, C) bool: whether it has as many in the picture.
        centres: (V, C, 2) float16: mean column and row of its pixels in [-1, 1]; 0 if it is not present.
    """

    images: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    cells: NDArray[np.bool_]
    present: NDArray[np.bool_]
    centres: NDArray[np.float16]

    def __len__(self) -> int:
        """Return the number of pictures."""
        return len(self.images)


@dataclass(frozen=True)
class Job:
    """Views of one layout.

    Attributes:
        split: its tasks lay out the objects.
        task: number of the task in its split.
        seed: of the poses.
    """

    split: str
    task: int
    seed: int


def random_views(split: str, count: int, seed: int, folder: Path, workers: int, progress: Progress) -> Views:
    """Return views of the homes of a split, drawn once and then kept in a folder.

    Args:
        split: its tasks say what lies where; every home has about its share.
        count: number of views, rounded up to whole layouts.
        seed: of the choice of tasks and poses.
        folder: keeps one file for each layout, so that an interrupted call goes on where it was.
        workers: number of processes.
        progress: called after each layout.
    """
    layouts = -(-count // LAYOUT_VIEWS)
    total = len(load_tasks(split))
    tasks = np.random.default_rng([seed, total]).permutation(np.resize(np.arange(total), max(total, layouts)))[:layouts]
    jobs = [Job(split, int(task), seed + number) for number, task in enumerate(sorted(tasks.tolist()))]
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{job.split}-{job.task}-{job.seed}-{_content(job)}.npz" for job in jobs]
    missing = [(job, file) for job, file in zip(jobs, files, strict=True) if not file.is_file()]
    for number, _ in enumerate(in_processes(_draw, missing, workers), start=1):
        progress(layouts - len(missing) + number, layouts)
    return _read(files)


def _content(job: Job) -> str:
    """Return a hash of what the views show."""
    task = load_tasks(job.split)[job.task]
    return sha256_of([home_hash(task.home).encode(), repr(task).encode()])[:12]


def _draw(work: tuple[Job, Path]) -> None:
    job, file = work
    views = layout_views(job)
    with replacing(file) as temporary, temporary.open("wb") as out:
        np.savez(out, **vars(views))


def _read(files: list[Path]) -> Views:
    """Return the views of all files, which have equally many."""
    whole: dict[str, NDArray[Any]] = {}
    for number, file in enumerate(files):
        for name, part in _arrays(file).items():
            rows = whole.setdefault(name, np.empty((len(files) * len(part), *part.shape[1:]), part.dtype))
            rows[number * len(part) : (number + 1) * len(part)] = part
    return Views(**whole)


def _arrays(file: Path) -> dict[str, NDArray[Any]]:
    """Return what one file keeps; numpy compares the checksums of its arrays.

    Raises:
        ChmarlError: it is damaged.
    """
    try:
        with np.load(file) as kept:
            return {field.name: kept[field.name] for field in fields(Views)}
    except (OSError, ValueError, LookupError, EOFError, zipfile.BadZipFile) as error:
        raise ChmarlError(f"{file}: views that are damaged; remove it, and they are drawn again") from error


def layout_views(job: Job) -> Views:
    """Return the views of one layout: the robots look around from random poses."""
    rng = np.random.default_rng([job.seed, job.task])
    task = load_tasks(job.split)[job.task]
    simulation = _simulation(task.home)
    simulation.begin(task)
    classes = np.array([_label(name) for name in simulation.renderer.names])
    rows = []
    for _ in range(LAYOUT_VIEWS // len(simulation.robots)):
        for robot in simulation.robots.values():
            robot.spawn(int(rng.integers(robot.lattice.count)))
        for name in simulation.robots:
            picture = simulation.renderer.picture(name, VISIBILITY_SIZE)
            # The last entry stands for no thing and for no label.
            labels = np.append(classes, len(LABELS))[picture.segmentation]
            rows.append((picture.rgb, labels.astype(np.uint8), *labels_of(labels)))
    return Views(*(np.stack(column) for column in zip(*rows, strict=True)))


def labels_of(
    segmentation: NDArray[np.integer],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float16]]:
    """Return cells, presence and centres of one picture, as in :class:`Views`.

    Args:
        segmentation: (size, size) number of the label in each pixel, ``len(LABELS)`` for none.
    """
    size, count = len(segmentation), len(LABELS)
    row, column = np.indices(segmentation.shape)
    cell = (row * GRID // size) * GRID + column * GRID // size
    pixels = np.bincount((segmentation * GRID**2 + cell).ravel(), minlength=(count + 1) * GRID**2)[: count * GRID**2]
    cells = pixels.reshape(count, GRID, GRID)
    total = cells.sum(axis=(1, 2))
    present = total >= VISIBLE_PIXELS
    places = np.stack([column, row], axis=-1).reshape(-1, 2) * 2 / (size - 1) - 1
    sums = [np.bincount(segmentation.ravel(), weights=axis, minlength=count + 1)[:count] for axis in places.T]
    centres = np.stack(sums, axis=-1) / np.maximum(total, 1)[:, None] * present[:, None]
    return cells >= VISIBLE_PIXELS, present, centres.astype(np.float16)


@lru_cache(maxsize=5)
def _simulation(home: str) -> Simulation:
    return Simulation(home)


def _label(name: str) -> int:
    kind = catalog.class_of(name)
    return LABELS.index(kind) if kind in LABELS else len(LABELS)
