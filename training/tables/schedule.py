"""Work through runs, some side by side, each step in a process of its own; interrupted, nothing finished is lost."""

import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from os import environ
from threading import Lock as Mutex

from chmarl_pb.files import Lock
from training.tables.runs import Run, python
from training.tables.step import GRACE

NOTE = 10.0  # seconds between two notes of the time spent
LOG = "log.txt"

Launch = Callable[[list[str]], list[str]]


def as_step(command: list[str]) -> list[str]:
    """Return a step's command as it is started: it ends with this process."""
    return python(["training.tables.step", *command])


def on_ray(address: str, command: list[str]) -> list[str]:
    """Return a step's command as it is started to run on a Ray cluster."""
    return as_step(["training.tables.on_ray", address, *command])


class Schedule:
    """Runs that wait, that are at work, and that are over.

    Attributes:
        waiting: runs that have not been started.
        over: number of runs whose result is there.
        failed: names of runs whose process ended with an error, or that another process works on.
    """

    def __init__(
        self,
        runs: Sequence[Run],
        jobs: int = 2,
        budget: float | None = None,
        finished: Callable[[Run], None] = lambda run: None,
        launch: Launch = as_step,
    ):
        """Take runs; those whose result is there already are skipped.

        Args:
            runs: in the order in which they are started.
            jobs: number of processes side by side.
            budget: minutes after which no more runs are started; None: no limit.
            finished: called after a run's result is written; an error in it is shown.
            launch: makes the command line of a step's command.
        """
        self.waiting = [run for run in runs if run.next_step() is not None]
        self.total, self.over = len(runs), len(runs) - len(self.waiting)
        self.failed: list[str] = []
        self._jobs, self._finished, self._launch = jobs, finished, launch
        self._end = time.monotonic() + 60 * budget if budget is not None else float("inf")
        self._mutex, self._stopped = Mutex(), False
        self._processes: list[subprocess.Popen[bytes]] = []

    def work(self) -> None:
        """Work until all runs are over or the time is up; what is interrupted goes on another time."""
        with ThreadPoolExecutor(self._jobs) as pool:
            try:
                for thread in [pool.submit(self._work) for _ in range(self._jobs)]:
                    thread.result()
            finally:
                with self._mutex:
                    self._stopped = True
                end(*self._processes)

    def fail(self, runs: Mapping[Run, str]) -> None:
        """Leave out runs that wait and cannot be done, and say why."""
        for run, why in runs.items():
            self.waiting.remove(run)
            self.failed.append(run.name)
            self._say(run, why)

    def _work(self) -> None:
        """Do one run after another."""
        while (run := self._next()) is not None:
            try:
                self._do(run)
            except (RuntimeError, ValueError) as error:
                self.failed.append(run.name)
                self._say(run, str(error))

    def _next(self) -> Run | None:
        with self._mutex:
            late = self._stopped or time.monotonic() >= self._end
            return self.waiting.pop(0) if self.waiting and not late else None

    def _do(self, run: Run) -> None:
        """Do the steps of a run that are left.

        Raises:
            RuntimeError: a step has failed.
            ValueError: another process works on the run, or one of its files is damaged.
        """
        with run.lock() as lock:
            while (step := run.next_step()) is not None:
                self._say(run, step)
                code = self._run(run, step, lock)
                if self._stopped:
                    return
                if code:
                    raise RuntimeError(f"{step} ended with {code}: {_last_line(run)} (all of it: {run.folder / LOG})")
                run.finish(step)
        with self._mutex:
            self.over += 1
            minutes = sum(run.state()["seconds"].values()) / 60
            self._say(run, f"finished after {minutes:.0f} min, {run.result} ({self.over} of {self.total} runs)")
            try:
                self._finished(run)
            except (OSError, ValueError) as error:  # the result is kept: no reason to stop the others
                self._say(run, str(error))

    def _run(self, run: Run, step: str, lock: Lock) -> int | None:
        """Let a process do a step, and return its exit code; None if there is to be no more of them."""
        run.begin(step)
        with self._mutex, (run.folder / LOG).open("a") as log:
            if self._stopped:
                return None
            process = subprocess.Popen(
                self._launch(run.command(step)), stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT,
                env={**environ, "OMP_NUM_THREADS": "1"}, start_new_session=True, pass_fds=(lock.fileno(),),
            )  # fmt: skip
            self._processes.append(process)
        code = None
        while code is None:
            begun = time.monotonic()
            with suppress(subprocess.TimeoutExpired):
                code = process.wait(NOTE)
            run.spend(step, time.monotonic() - begun)
        return code

    def _say(self, run: Run, text: str) -> None:
        print(f"{run.name}: {text}", file=sys.stderr, flush=True)


def end(*processes: subprocess.Popen[bytes]) -> None:
    """Ask processes that are not over to end, and give them time to save what they have."""
    deadline = time.monotonic() + GRACE
    try:
        for process in processes:
            process.terminate()  # jobs in the background of a shell may ignore SIGINT
        for process in processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(deadline - time.monotonic(), 0))
    finally:  # at once, if this is interrupted, too
        for process in processes:
            process.kill()
            process.wait()


def _last_line(run: Run) -> str:
    lines = (run.folder / LOG).read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1] if lines else "nothing was printed"
