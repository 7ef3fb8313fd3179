"""The one thread that touches a session: all others hand it their work."""

import threading
from collections.abc import Callable
from queue import SimpleQueue

Work = Callable[[], object]


class Worker:
    """Does one piece of work after the other, in a thread of its own."""

    def __init__(self, failed: Callable[[Exception], object]):
        """Start the thread.

        Args:
            failed: is told, in that thread, of what a piece of work raises.
        """
        self._failed = failed
        self._queue: SimpleQueue[Work | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="session", daemon=True)
        self._thread.start()

    @property
    def awaited(self) -> bool:
        """Whether more work waits."""
        return not self._queue.empty()

    def do(self, work: Work) -> None:
        """Hand over a piece of work."""
        self._queue.put(work)

    def stop(self) -> None:
        """Let the work end that has been handed over, and the thread with it."""
        self._queue.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (work := self._queue.get()) is not None:
            try:
                work()
            except Exception as error:
                self._failed(error)
