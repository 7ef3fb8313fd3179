"""Progress bars that appear with the first progress: what is wrong with the arguments is said before."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from chmarl_pb.signals import let_go

T = TypeVar("T")

_silent: ContextVar[bool] = ContextVar("silent", default=False)


@contextmanager
def silence() -> Iterator[None]:
    """Let bars that are made within never be shown."""
    before = _silent.set(True)
    try:
        yield
    finally:
        _silent.reset(before)


def is_silent() -> bool:
    """Return whether nothing but results is to be shown."""
    return _silent.get()


class _Notes(Console):
    """The standard error; where nobody reads it any more, the work goes on without a bar."""

    def __init__(self) -> None:
        """Show what is printed there."""
        super().__init__(stderr=True)

    def on_broken_pipe(self) -> None:
        """Show no more."""
        self.quiet = True
        let_go(self.file)


class LateProgress(Progress):
    """A progress bar that is not shown before something calls ``update`` or ``advance``; by default on stderr."""

    def __init__(self, *columns: Any, **options: Any):
        """Make a bar; see :class:`rich.progress.Progress`. What is printed meanwhile stays out of a bar on a terminal.

        Results that go to a file or a pipe still go there, and not to the terminal that the bar is on.
        """
        seen = sys.stdout is not None and sys.stdout.isatty()
        settings: dict[str, Any] = {"console": _Notes(), "redirect_stdout": seen}
        super().__init__(*columns, **settings | options)
        self._never = is_silent()

    def __enter__(self) -> "LateProgress":
        """Wait for progress."""
        return self

    def start(self) -> None:
        """Show the bar, unless none is wanted."""
        if not self._never:
            super().start()

    def update(self, task_id: TaskID, **fields: Any) -> None:
        """Show the bar and move it."""
        self.start()
        super().update(task_id, **fields)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """Show the bar and move it on."""
        self.start()
        super().advance(task_id, advance)

    def count(self, values: Iterable[T], total: int, description: str) -> Iterator[T]:
        """Yield values and count them; ``track`` stops counting while the bar is not shown."""
        task = self.add_task(description, total=total)
        for value in values:
            yield value
            self.advance(task)

    def counter(self, description: str) -> Callable[[int, int], None]:
        """Return what moves a new line of the bar: it takes the numbers of what is done and of all."""
        task = self.add_task(description, total=None)
        return lambda done, total: self.update(task, completed=done, total=total)

    def stop(self) -> None:
        """Leave the bar as it is; nothing is printed if it was never shown."""
        if self.live.is_started:
            super().stop()


def progress_bar() -> LateProgress:
    """Return a bar that counts, and estimates the time that is left."""
    return LateProgress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())


def run_bar(quiet: bool = False) -> Progress:
    """Return the bar of a training, on stderr, which is shown from the start unless ``quiet``."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    return Progress(*columns, TimeRemainingColumn(), disable=quiet, console=_Notes())
