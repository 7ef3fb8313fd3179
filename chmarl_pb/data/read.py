"""Read data sets from disk; whatever is damaged is refused with the file's name."""

import errno
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from chmarl_pb.data.recipe import NAMESPACE, is_dataset_name
from chmarl_pb.data.record import Arrays
from chmarl_pb.data.store import MAIN_FILE, METADATA_FILE, megabytes
from chmarl_pb.errors import ChmarlError, DatasetError
from chmarl_pb.evaluation.json_file import WRONG, read_object
from chmarl_pb.extras import needs
from chmarl_pb.files import file_hash

with needs("a data set", "data"):
    import h5py


class Dataset:
    """One finished data set on disk.

    Attributes:
        folder: its folder; its name is the end of the data set's id.
        main: the file with its episodes.
        metadata: Minari's metadata, with ``recipe``, ``sha256`` and ``made_with``.
    """

    def __init__(self, folder: Path):
        """Read the metadata.

        Raises:
            DatasetError: it is missing or damaged.
        """
        self.folder = folder
        self.main = folder / "data" / MAIN_FILE
        path = folder / "data" / METADATA_FILE
        try:
            self.metadata: dict[str, Any] = read_object(path)
            self.episodes = int(self.metadata["total_episodes"])
            self.steps = int(self.metadata["total_steps"])
            self.recipe: dict[str, Any] = self.metadata["recipe"]
            self.sha256 = str(self.metadata["sha256"])
            self._megabytes = float(self.metadata["dataset_size"])
        except FileNotFoundError as error:
            raise DatasetError(
                f"{path}: missing; remove the folder, if there is one, and run `chmarl-pb dataset generate`"
            ) from error
        except WRONG as error:
            raise DatasetError(
                f"{path}: damaged ({type(error).__name__}: {str(error)[:200]}); remove its folder, and run "
                "`chmarl-pb dataset generate`"
            ) from error

    @property
    def dataset_id(self) -> str:
        """Name for ``minari.load_dataset``."""
        return f"{NAMESPACE}/{self.folder.name}"

    @cached_property
    def size(self) -> int:
        """Bytes on disk."""
        return sum(path.stat().st_size for path in self.folder.rglob("*") if path.is_file())

    def check(self) -> None:
        """Check that the file of episodes is as it was made, and that the metadata fit it.

        Raises:
            DatasetError: it is missing, no regular file, cut or changed.
        """
        try:
            state = _state(self.main)
            cut = megabytes(self.main) != self._megabytes  # the sum of a file that has grown can take hours
            corrupted = cut or _sha256(*state) != self.sha256
        except FileNotFoundError as error:
            raise DatasetError(
                f"{self.main}: missing; remove the folder, if there is one, and run `chmarl-pb dataset generate`"
            ) from error
        except OSError as error:
            raise DatasetError(
                f"{self.main}: cannot be read ({error.strerror}); make it a regular file that can be read"
            ) from error
        if corrupted:
            raise DatasetError(
                f"{self.main}: corrupted or cut, its {'size' if cut else 'sha256'} has changed; remove its "
                "folder, and run `chmarl-pb dataset generate`"
            )
        if (found := _counts(*state)) != (self.episodes, self.steps):
            raise DatasetError(
                f"{self.main}: has {found[0]} episodes of {found[1]} steps, but its {METADATA_FILE} tells of "
                f"{self.episodes} of {self.steps}; remove its folder, and run `chmarl-pb dataset generate`"
            )

    @contextmanager
    def open(self) -> Iterator["h5py.File"]:
        """Check the file of episodes, and open it for reading.

        Raises:
            DatasetError: it is damaged or cannot be read.
        """
        self.check()
        try:
            with h5py.File(self.main, "r") as file:
                yield file
        except ChmarlError:
            raise
        except (OSError, KeyError) as error:
            raise DatasetError(
                f"{self.main}: cannot be read ({error}); remove its folder, and run `chmarl-pb dataset generate`"
            ) from error

    def episode(self, number: int) -> tuple[Arrays, dict[str, Any]]:
        """Return arrays and metadata of an episode, as :class:`chmarl_pb.data.record.Recording` has them.

        Raises:
            DatasetError: the file is damaged or cannot be read.
        """
        with self.open() as file:
            group = file[f"episode_{number}"]
            return read_group(group), dict(group.attrs)


State = tuple[Path, int, int, int]


def _state(path: Path) -> State:
    """Return what changes when a regular file is written to.

    Raises:
        OSError: it is no regular file, or cannot be looked at.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    return path, status.st_ino, status.st_size, status.st_ctime_ns


@cache
def _sha256(path: Path, *state: int) -> str:
    """Return the sha256 of a file, computed once as long as it is not written to."""
    return file_hash(path)


@cache
def _counts(path: Path, *state: int) -> tuple[int, int]:
    """Return the numbers of episodes and steps in a file, read once as long as it is not written to."""
    with h5py.File(path, "r") as file:
        steps = [int(episode.attrs["total_steps"]) for episode in file.values()]
    return len(steps), sum(steps)


def find_datasets(root: Path) -> list[Dataset]:
    """Return the finished data sets in a folder of Minari data sets, by name.

    Raises:
        DatasetError: one of them is damaged.
    """
    folders = sorted((root / NAMESPACE).glob("*"))
    return [Dataset(folder) for folder in folders if is_dataset_name(folder.name)]


def read_group(group: "h5py.Group", *names: str) -> Arrays:
    """Return the arrays of a group, or of some of its members."""
    members = {name: group[name] for name in names or group}
    return {name: read_group(item) if isinstance(item, h5py.Group) else item[()] for name, item in members.items()}
