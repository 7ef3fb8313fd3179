"""One process for a run's folder: a second one would mix its rows and checkpoints with those of the first."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from training.checkpoint import CheckpointError

LOCK = "training.lock"


@contextmanager
def held(folder: Path | None) -> Iterator[None]:
    """Hold a run's folder, which is made if it is missing, as long as the block runs; None: there is none to hold.

    Raises:
        CheckpointError: another process holds it.
    """
    if folder is None:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise CheckpointError(f"{folder}: another process trains here; wait, or use another folder") from error
        yield
