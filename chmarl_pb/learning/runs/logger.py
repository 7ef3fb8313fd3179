"""Metrics of a run: one JSON object a line, TensorBoard if it is installed, and a progress bar."""

import warnings
from pathlib import Path
from typing import Any

from chmarl_pb.errors import ResultError
from chmarl_pb.files import append_line, sealed, unsealed_or_plain, write_atomically, writing
from chmarl_pb.progress import run_bar
from chmarl_pb.reading import read_regular

METRICS, BOARD = "metrics.jsonl", "tensorboard"

_MOST_BYTES = 256 * 2**20


class Logger:
    """Writes ``metrics.jsonl`` and TensorBoard events into a run's folder; without a folder it only shows progress."""

    def __init__(self, folder: Path | None, total: int, rows: int = 0, quiet: bool = False, unit: str = "episodes"):
        """Open a logger.

        Args:
            folder: of the run.
            total: number of episodes, or of what the unit says.
            rows: rows of an interrupted run to keep; those after its last checkpoint are dropped.
            quiet: whether no progress is shown.
            unit: of progress, and the key of its number in a row.
        """
        self._unit = unit
        self._path = None if folder is None else folder / METRICS
        self._board: Any = None
        self.rows = rows
        if self._path is not None:
            kept = _lines(self._path)[:rows] if rows else []
            text = "".join(line.decode(errors="replace") for line in kept)  # readers leave damaged rows out
            write_atomically(self._path, text + "\n" * bool(text and text[-1] != "\n"))
        self._progress = run_bar(quiet)
        self._task = self._progress.add_task(unit, total=total)
        self._progress.start()

    def advance(self, done: int) -> None:
        """Show how many episodes are over, or what else is counted."""
        self._progress.update(self._task, completed=done)

    def write(self, row: dict[str, Any]) -> None:
        """Add a row of metrics; nested groups are allowed."""
        self.rows += 1
        if self._path is not None:
            append_line(self._path, sealed(row))
            with writing(self._path.with_name(BOARD), self._path.parent):
                self._show(row)
        if not self._progress.disable:
            self._progress.console.print(_line(row), highlight=False)

    def _show(self, row: dict[str, Any]) -> None:
        """Add a row to TensorBoard's events; they begin here, as their writer has no words for a full disk."""
        if self._board is None and self._path is not None:
            self._board = _tensorboard(self._path.parent)
        for name, value in _flat(row) if self._board else ():
            self._board.add_scalar(name, value, row[self._unit])

    def close(self) -> None:
        """End the progress bar and the files."""
        self._progress.stop()
        if self._board and self._path is not None:
            with writing(self._path.with_name(BOARD), self._path.parent):
                self._board.close()


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file of metrics, which may be growing; a warning tells of those that are damaged."""
    lines = _lines(path)
    rows = [row_of(line) for line in lines]
    if damaged := sum(row is None and line.endswith(b"\n") for row, line in zip(rows, lines, strict=True)):
        warnings.warn(f"{path}: {damaged} of {len(lines)} rows are damaged and left out", RuntimeWarning, stacklevel=2)
    return [row for row in rows if row is not None]


def _lines(path: Path) -> list[bytes]:
    """Return the lines of a file of metrics, none of one that is not there.

    Raises:
        ResultError: it is no regular file, or too large.
    """
    if not path.exists():
        return []
    try:
        return read_regular(path, _MOST_BYTES).splitlines(keepends=True)
    except ValueError as error:
        raise ResultError(f"{path}: {error}") from error


def row_of(line: bytes) -> dict[str, Any] | None:
    """Return a row of metrics, or None if its line is damaged; those of earlier versions have no checksum."""
    try:
        return unsealed_or_plain(line.decode())
    except ValueError:
        return None


def _tensorboard(folder: Path) -> Any:
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter(str(folder / BOARD))


def _flat(row: dict[str, Any], prefix: str = "") -> list[tuple[str, float]]:
    pairs = []
    for name, value in row.items():
        pairs += _flat(value, f"{prefix}{name}/") if isinstance(value, dict) else [(prefix + name, float(value))]
    return pairs


def _line(row: dict[str, Any]) -> str:
    return "  ".join(f"{name} {value:.4g}" for name, value in _flat(row))
