"""Fill the view store before a long training, which would otherwise draw the views of its homes as it comes by them."""

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from chmarl_pb.errors import OptionError
from chmarl_pb.executors import Executor
from chmarl_pb.homes.home import load_home
from chmarl_pb.rendering.home_views import HomeViews, home_views
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE
from chmarl_pb.rendering.view_file import ViewFile
from chmarl_pb.rendering.view_store import ViewStore, view_store
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.registry import TEAM

MB = 2**20
_AT_ONCE = 64  # views that a process draws before it answers


@dataclass(frozen=True)
class Job:
    """Some views to draw.

    Attributes:
        home: name or path of the home.
        robot: name of a robot of the package, whose camera it is.
        size: width and height in pixels.
        poses: lattice poses.
    """

    home: str
    robot: str
    size: int
    poses: tuple[int, ...]


class Filling:
    """All views of some homes, and which of them are still to be drawn.

    Attributes:
        bytes: disk space of all these views.
    """

    def __init__(self, homes: Sequence[str], size: int):
        """Look up what the store lacks.

        Args:
            homes: names or paths.
            size: of the pictures; the views in which visibility is decided are filled as well.

        Raises:
            HomeError: a home cannot be read.
            OptionError: there is no store, or it has no room for these views.
        """
        store = view_store()
        if store is None:
            raise OptionError("no pictures are stored on disk; set CHMARL_CACHE to a folder")
        self._files: dict[tuple[str, str, int], ViewFile] = {}
        for home in dict.fromkeys(homes):
            views = HomeViews(load_home(home))
            for robot in TEAM:
                for pixels in sorted({VISIBILITY_SIZE, size}):
                    self._files[home, robot, pixels] = _file_of(store, views, robot, pixels)
        self.bytes = sum(file.length for file in self._files.values())
        self._check_room(store)

    @property
    def missing(self) -> int:
        """Number of views that the store lacks."""
        return sum(len(file.gaps()) for file in self._files.values())

    def jobs(self, elsewhere: bool = False) -> list[Job]:
        """Return what is to be drawn: what this store lacks, or all views, for machines with stores of their own."""
        found = []
        for key, file in self._files.items():
            gaps = list(range(file.poses)) if elsewhere else file.gaps()
            found += [Job(*key, tuple(gaps[first : first + _AT_ONCE])) for first in range(0, len(gaps), _AT_ONCE)]
        return found

    def _check_room(self, store: ViewStore) -> None:
        needed = -(-self.bytes // MB)
        if self.bytes > store.limit:
            raise OptionError(
                f"all views of these homes take {needed:,} MB, but the store may have {store.limit // MB:,} MB; "
                f"set CHMARL_CACHE_LIMIT={needed} or more, or fill fewer homes"
            )
        lacking = sum(len(file.gaps()) * file.slot for file in self._files.values())
        free = shutil.disk_usage(store.folder).free
        if lacking > free:
            raise OptionError(
                f"{store.folder}: the views that are missing take {lacking // MB:,} MB, but the disk has "
                f"{free // MB:,} MB left; make room, or set CHMARL_CACHE to a folder on another disk"
            )


def draw(jobs: Sequence[Job], executor: Executor) -> Iterator[int]:
    """Draw views into the store of each machine, with one worker in this process; yield how many more are done.

    Raises:
        WorkerError: a process died.
    """
    return map(_draw, jobs) if executor.alone else executor.everywhere(_draw, jobs)


def missing(homes: Sequence[str], size: int, executor: Executor) -> int:
    """Return the number of views that the stores of all machines lack."""
    return sum(executor.everywhere(_missing, [(tuple(homes), size)]))


def _missing(wanted: tuple[tuple[str, ...], int]) -> int:
    return Filling(*wanted).missing


def _draw(job: Job) -> int:
    views = home_views(load_home(job.home))
    for pose in job.poses:
        views.look(find_model(job.robot), pose, job.size)
    return len(job.poses)


def _file_of(store: ViewStore, views: HomeViews, robot: str, size: int) -> ViewFile:
    """Return the file in which a robot's views of a home are stored."""
    before = set(store.files)
    views.look(find_model(robot), 0, size)  # opens it
    for file in set(store.files) - before:
        return file
    raise OptionError(f"{store.folder}: cannot be used; set CHMARL_CACHE to a folder that can be written")
