"""Progress bars that appear with the first progress: what is wrong with the arguments is said before."""

from typing import Any

from rich.progress import Progress, TaskID


class LateProgress(Progress):
    """A progress bar that is not shown before something calls ``update`` or ``advance``."""

    def __enter__(self) -> "LateProgress":
        """Wait for progress."""
        return self

    def update(self, task_id: TaskID, **fields: Any) -> None:
        """Show the bar and move it."""
        self.start()
        super().update(task_id, **fields)

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        """Show the bar and move it on."""
        self.start()
        super().advance(task_id, advance)

    def stop(self) -> None:
        """Leave the bar as it is; nothing is printed if it was never shown."""
        if self.live.is_started:
            super().stop()
