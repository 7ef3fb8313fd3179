"""Work through runs, some side by side, each step in a process of its own; interrupted, nothing finished is lost."""

import subprocess
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from os import environ
from statistics import fmean
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn

from training.tables.runs import Run, python
from training.tables.step import GRACE

POLL = 0.5  # seconds between two looks at the processes
NOTE = 10.0  # seconds between two notes of the time spent
LOG = "log.txt"

Launch = Callable[[list[str]], list[str]]


def as_step(command: list[str]) -> list[str]:
    """Return a step's command as it is started: it ends with this process."""
    return python(["training.tables.step", *command])


@dataclass
class Worker:
    """A run at work.

    Attributes:
        run: the run.
        step: that is being done.
        process: that does it; it holds the run's lock, too.
        lock: the locked file.
        bar: its line on the screen.
        since: time of the last note of seconds spent.
    """

    run: Run
    step: str
    process: subprocess.Popen
    lock: Any
    bar: TaskID
    since: float


class Schedule:
    """Runs that wait, that are at work, and that are over.

    Attributes:
        failed: names of runs whose process ended with an error, or that another process works on.
    """

    def __init__(
        self,
        runs: Sequence[Run],
        jobs: int = 2,
        budget: float | None = None,
        finished: Callable[[Run], None] = lambda run: None,
        launch: Launch = as_step,
        poll: float = POLL,
    ):
        """Take runs; those whose result is there already are skipped.

        Args:
            runs: in the order in which they are started.
            jobs: number of processes side by side.
            budget: minutes after which no more runs are started; None: no limit.
            finished: called after a run's result is written; an error in it is shown.
            launch: makes the command line of a step's command.
            poll: seconds between two looks at the processes.
        """
        self.waiting = [run for run in runs if run.next_step() is not None]
        self.total, self.over = len(runs), len(runs) - len(self.waiting)
        self.jobs, self.poll, self.failed = jobs, poll, list[str]()
        self._finished, self._launch = finished, launch
        self._end = time.monotonic() + 60 * budget if budget is not None else float("inf")
        self._workers: list[Worker] = []
        self._seconds: dict[tuple[str, ...], list[float]] = defaultdict(list)
        for run in runs:
            if run.next_step() is None and run.folder.is_dir():
                self._seconds[_kind(run)].append(_spent(run))
        columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
        self._screen = Progress(*columns, console=Console(stderr=True))

    def work(self) -> None:
        """Start and watch processes until all runs are over, or the time is up."""
        with self._screen:
            line = self._screen.add_task("", total=max(self.total, 1))
            try:
                while self._fill():
                    self._show(line)
                    time.sleep(self.poll)
                    for worker in list(self._workers):
                        self._check(worker)
                self._show(line)
            finally:
                self._stop()

    def _fill(self) -> bool:
        """Give work to free places; return whether there is any."""
        while self.waiting and len(self._workers) < self.jobs and time.monotonic() < self._end:
            run = self.waiting.pop(0)
            lock = run.lock()
            if lock is None:
                self._fail(run, f"another process works on it; wait for it, or end it ({run.folder})")
                continue
            step = run.next_step()
            if step is None:  # somebody else has finished it meanwhile
                lock.close()
                self.over += 1
                continue
            bar = self._screen.add_task(run.name, total=1.0)
            self._workers.append(Worker(run, step, self._start(run, step, lock), lock, bar, time.monotonic()))
        return bool(self._workers)

    def _start(self, run: Run, step: str, lock: Any) -> subprocess.Popen:
        run.begin(step)
        with (run.folder / LOG).open("a") as log:
            return subprocess.Popen(
                self._launch(run.command(step)), stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT,
                env={**environ, "OMP_NUM_THREADS": "1"}, start_new_session=True, pass_fds=(lock.fileno(),),
            )  # fmt: skip

    def _check(self, worker: Worker) -> None:
        """Look at a process; go on with the run's next step if it has ended well."""
        code, run = worker.process.poll(), worker.run
        if code is not None or time.monotonic() > worker.since + NOTE:
            _note(worker)
        if code is None:
            return
        try:
            if code != 0:
                raise RuntimeError(f"ended with {code}: {_last_line(run)} (all of it: {run.folder / LOG})")
            run.finish(worker.step)
            step = run.next_step()
        except (RuntimeError, ValueError) as error:
            self._fail(run, f"{worker.step} {error}")
            self._leave(worker)
            return
        if step is not None:
            worker.step, worker.process = step, self._start(run, step, worker.lock)
            return
        self._leave(worker)
        self.over += 1
        self._seconds[_kind(run)].append(_spent(run))
        self._screen.console.print(
            f"{run.name}: finished after {_duration(_spent(run))}, {run.result}", highlight=False
        )
        try:
            self._finished(run)
        except (OSError, ValueError) as error:  # the result is kept: no reason to stop the others
            self._screen.console.print(f"{run.name}: {error}", style="red", highlight=False)

    def _leave(self, worker: Worker) -> None:
        worker.lock.close()
        self._screen.remove_task(worker.bar)
        self._workers.remove(worker)

    def _fail(self, run: Run, reason: str) -> None:
        self.failed.append(run.name)
        self._screen.console.print(f"{run.name}: {reason}", style="red", highlight=False)

    def _stop(self) -> None:
        """Interrupt what is still at work; all of it goes on when the same runs are worked through again."""
        try:
            end(*(worker.process for worker in self._workers))
        finally:
            for worker in self._workers:
                _note(worker)
                worker.lock.close()
            self._workers.clear()

    def _show(self, line: TaskID) -> None:
        for worker in self._workers:
            share = worker.run.progress() if worker.step == "train" else 1.0
            self._screen.update(worker.bar, completed=share, description=f"{worker.run.name}: {worker.step}")
        left = self._left()
        text = f"{self.over} of {self.total} runs" + (f", about {_duration(left)} left" if left is not None else "")
        self._screen.update(line, completed=self.over, description=text)

    def _left(self) -> float | None:
        """Return about how many seconds are left, from runs of the same kind; None as long as nothing is known."""
        known = {kind: list(seconds) for kind, seconds in self._seconds.items()}
        for worker in self._workers:
            share = worker.run.progress()
            if share > 0.05:
                known.setdefault(_kind(worker.run), []).append(worker.run.state()["seconds"]["train"] / share)
        means = {kind: fmean(seconds) for kind, seconds in known.items()}
        if not means:
            return None
        other = fmean(means.values())
        waiting = sum(means.get(_kind(run), other) for run in self.waiting)
        working = [max(means.get(_kind(one.run), other) - _spent(one.run), 0.0) for one in self._workers]
        return max((waiting + sum(working)) / self.jobs, *working, 0.0) if working else waiting / self.jobs


def end(*processes: subprocess.Popen) -> None:
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


def _kind(run: Run) -> tuple[str, ...]:
    """Return what runs that take about equally long have in common."""
    return (run.row.observation, run.row.module, *run.row.options[:2])


def _spent(run: Run) -> float:
    return float(sum(run.state()["seconds"].values()))


def _note(worker: Worker) -> None:
    now = time.monotonic()
    worker.run.spend(worker.step, now - worker.since)
    worker.since = now


def _last_line(run: Run) -> str:
    lines = (run.folder / LOG).read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1] if lines else "nothing was printed"


def _duration(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"
