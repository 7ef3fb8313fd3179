"""Random views of homes with free labels: which classes each shows, and where, read from the segmentation."""

import zipfile
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.errors import ChmarlError, HomeError, TaskError
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.files import replacing
from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.homes.generate.draws import VERSION
from chmarl_pb.learning.networks.detections import LABELS
from chmarl_pb.processes import in_processes
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS, classes_of
from chmarl_pb.tasks.generated_homes import numbered_homes
from chmarl_pb.tasks.lookalike_task import draw_lookalikes
from chmarl_pb.tasks.sampling import sample_task
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.simulations import Simulations
from chmarl_pb.tasks.splits import STREAM, load_tasks
from chmarl_pb.tasks.task import Task

GRID = 4  # cells along each side of a picture
LAYOUT_VIEWS = 20  # views of one layout of objects, equally many by each robot of the benchmark
HOME_LAYOUTS = 2  # of the endless split, whose homes take long to enter

_HOMES, _DRAWS = 5, 100  # homes that are tried for a layout of the endless split, and draws of lookalikes in each
_MOST_LAYOUTS = 10**6  # of one seed in the endless split

#: Called with the numbers of finished and of all layouts.
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Views:
    """Pictures with labels; V is their number, C that of ``LABELS``. A robot's own body has none.

    Attributes:
        images: (V, VISIBILITY_SIZE, VISIBILITY_SIZE, 3) uint8.
        labels: (V, VISIBILITY_SIZE, VISIBILITY_SIZE) uint8 number of the class in each pixel; C for none.
        cells: (V, C, GRID, GRID) bool: whether the class has ``VISIBLE_PIXELS`` pixels in the cell.
        present: (V, C) bool: whether it has as many in the picture.
        centres: (V, C, 2) float16: mean column and row of its pixels in [-1, 1]; 0 if it is not present.
        colours: (V, VISIBILITY_SIZE, VISIBILITY_SIZE) uint8 id of the colour of the object in each pixel; 0 for none,
            and where there are no lookalikes: objects have no colour by name there.
    """

    images: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    cells: NDArray[np.bool_]
    present: NDArray[np.bool_]
    centres: NDArray[np.float16]
    colours: NDArray[np.uint8]

    def __len__(self) -> int:
        """Return the number of pictures."""
        return len(self.images)


@dataclass(frozen=True)
class Job:
    """Views of one layout.

    Attributes:
        split: its tasks lay out the objects; those of the endless one are drawn, ``HOME_LAYOUTS`` in each home.
        task: number of the task in its split.
        seed: of the poses, and in the endless split of the task.
        lookalikes: whether several objects of a class stand there, in other colours.
    """

    split: str
    task: int
    seed: int
    lookalikes: bool = False


def drawn_views(
    split: str, count: int, seed: int, folder: Path, workers: int, progress: Progress, lookalikes: bool = False
) -> list[Path]:
    """Return the files of views of the homes of a split, drawn once and then kept in a folder.

    Args:
        split: its tasks say what lies where; every home has about its share. The endless one has ever new
            homes, with ``HOME_LAYOUTS`` layouts each.
        count: number of views, rounded up to whole layouts.
        seed: of the choice of tasks and poses.
        folder: keeps one file for each layout, so that an interrupted call goes on where it was.
        workers: number of processes.
        progress: called after each layout.
        lookalikes: whether there are lookalikes, whose colours are labels, too.
    """
    layouts = -(-count // LAYOUT_VIEWS)
    jobs = [
        Job(split, task, seed + number, lookalikes) for number, task in enumerate(_chosen_tasks(split, layouts, seed))
    ]
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{job.split}-{job.task}-{job.seed}-{_content(job)}.npz" for job in jobs]
    missing = [(job, file) for job, file in zip(jobs, files, strict=True) if not file.is_file()]
    for number, _ in enumerate(in_processes(_draw, missing, workers), start=1):
        progress(layouts - len(missing) + number, layouts)
    return files


def _chosen_tasks(split: str, layouts: int, seed: int) -> list[int]:
    """Return the numbers of as many tasks of a split as there are to be layouts."""
    if split == STREAM:
        return list(range(seed * _MOST_LAYOUTS, seed * _MOST_LAYOUTS + layouts))
    total = len(load_tasks(split))
    tasks = np.random.default_rng([seed, total]).permutation(np.resize(np.arange(total), max(total, layouts)))
    return sorted(tasks[:layouts].tolist())


def _content(job: Job) -> str:
    """Return a hash of what the views show."""
    among = ["lookalikes"] if job.lookalikes else []
    if job.split == STREAM:
        shown = [f"generator {VERSION}"]
    else:
        task = load_tasks(job.split)[job.task]
        shown = [home_hash(task.home), repr(task)]
    return sha256_of(part.encode() for part in (*shown, *among, "colours", "robots"))[:12]


def _draw(work: tuple[Job, Path]) -> None:
    job, file = work
    views = layout_views(job)
    with replacing(file) as temporary, temporary.open("wb") as out:
        np.savez(out, **vars(views))


def read_views(files: list[Path]) -> Views:
    """Return the views of all files, which have equally many.

    Raises:
        ChmarlError: one is damaged.
    """
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
        if not file.is_file():
            raise ValueError("no file")
        with zipfile.ZipFile(file) as parts:
            if sum(part.file_size for part in parts.infolist()) > file.stat().st_size:
                raise ValueError("a compressed zip, which it was not written as")
        with np.load(file) as kept:
            found = {field.name: kept[field.name] for field in fields(Views)}
        if not all(isinstance(part, np.ndarray) and part.ndim for part in found.values()):
            raise ValueError("a part is no array")
        return found
    except Exception as error:  # zipfile and numpy raise nearly anything on what they have not written
        raise ChmarlError(f"{file}: views that are damaged; remove it, and they are drawn again") from error


def layout_views(job: Job) -> Views:
    """Return the views of one layout: the robots look around from random poses.

    Raises:
        ChmarlError: none of the homes that were tried offers a layout.
    """
    rng = np.random.default_rng([job.seed, job.task])
    simulation = _laid_out(job, rng)
    names = simulation.renderer.names
    # The last entry stands for no thing and for no label.
    models = {name: robot.model for name, robot in simulation.robots.items()}
    classes = np.array([*map(_label, classes_of(names, models)), len(LABELS)], np.uint8)
    colours = np.array([*(catalog.colour_of(name) if job.lookalikes else 0 for name in names), 0], np.uint8)
    rows = []
    for _ in range(LAYOUT_VIEWS // len(simulation.robots)):
        for robot in simulation.robots.values():
            robot.spawn(int(rng.integers(robot.lattice.count)))
        for name in simulation.robots:
            picture = simulation.renderer.picture(name, VISIBILITY_SIZE)
            labels = classes[picture.segmentation]
            labels[picture.segmentation == names.index(name)] = len(LABELS)
            rows.append((picture.rgb, labels, *labels_of(labels.astype(np.int64)), colours[picture.segmentation]))
    return Views(*(np.stack(column) for column in zip(*rows, strict=True)))


def _laid_out(job: Job, rng: np.random.Generator) -> Simulation:
    """Return the simulation of a job's home, with a layout of its objects."""
    simulations = _simulations(job.lookalikes)
    if job.split != STREAM:
        task = load_tasks(job.split)[job.task]
        simulation = simulations.enter(task.home)
        _lay_out(simulation, task, job.lookalikes)
        return simulation
    for home in islice(numbered_homes(job.task // HOME_LAYOUTS), _HOMES):
        try:
            simulation = simulations.enter(home)
            _lay_out(simulation, sample_task(simulation.space, home, rng), job.lookalikes)
            return simulation
        except (HomeError, TaskError) as error:
            reason = error
    raise ChmarlError(f"no layout for view {job}: {reason}")


def _lay_out(simulation: Simulation, task: Task, lookalikes: bool) -> None:
    """Put the objects of a task into a home; among lookalikes the first that there is room for.

    Raises:
        TaskError: the home cannot hold them.
    """
    if not lookalikes:
        simulation.begin(task)
        return
    *others, last = islice(draw_lookalikes(task, simulation.home), _DRAWS)
    for drawn in others:
        try:
            simulation.begin(drawn)
            return
        except TaskError:
            continue
    simulation.begin(last)


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


@cache
def _simulations(lookalikes: bool) -> Simulations:
    return Simulations(partial(Simulation, lookalikes=lookalikes), 5)


def _label(kind: str) -> int:
    return LABELS.index(kind) if kind in LABELS else len(LABELS)
