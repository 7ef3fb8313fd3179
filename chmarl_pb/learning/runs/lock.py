"""One process for a run's folder: a second one would mix its rows and checkpoints with those of the first."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from chmarl_pb.errors import BusyError
from chmarl_pb.files import Lock, remove_leftovers
from chmarl_pb.learning.storage.checkpoint import CheckpointError, check_begun


@contextmanager
def run_lock(folder: Path | None, last: str, best: str) -> Iterator[None]:
    """Hold a run's folder as long as the block runs; None: there is none to hold.

    It is made if it is missing, and removed again if nothing was written into it. What killed processes left of writing
    its checkpoints is removed.

    Args:
        folder: of the run.
        last: name of the file that the run goes on from.
        best: name of that of its best weights.

    Raises:
        CheckpointError: another process holds it, or it has best weights of a run that cannot go on.
        WriteError: nothing can be written there.
    """
    if folder is None:
        yield
        return
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        lock = Lock(folder / "training")
    except BusyError as error:
        raise CheckpointError(f"{folder}: another process trains here; wait, or use another folder") from error
    try:
        with lock:
            for name in (last, best):
                remove_leftovers(folder / name)
            check_begun(folder / last, folder / best)
            yield
    finally:
        with suppress(OSError):  # of those that something was written into
            for place in made:
                place.rmdir()
