"""The ledger: a side file of finished episodes, one line each, so that an interrupted evaluation goes on."""

import json
import os
import warnings
from collections.abc import Sequence
from itertools import chain, count
from pathlib import Path
from typing import Any

from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.play import Job
from chmarl_pb.evaluation.result import episode_of, episode_row
from chmarl_pb.files import append_line, sealed, unsealed, write_atomically


class Ledger:
    """Finished episodes of one evaluation; the first line holds its settings.

    Each line has a checksum that also covers the settings, so no line counts in another evaluation.

    Attributes:
        path: of the side file, beside the result file; it is there once there is an episode.
        episodes: that were finished before, at most one for each job.
    """

    def __init__(self, result: Path, settings: dict[str, Any], jobs: Sequence[Job]):
        """Read what is finished; the caller holds the lock of the result file.

        Args:
            result: the result file.
            settings: of the evaluation.
            jobs: all that it plays.

        Raises:
            WriteError: the side file cannot be written.
        """
        self.path = result.with_name(f"{result.name}.partial")
        self._head = json.dumps(settings, sort_keys=True)
        lines = self.path.read_bytes().splitlines() if self.path.is_file() else []
        if lines and lines[0] != self._head.encode():
            kept = _free(self.path.with_suffix(".old"))
            self.path.replace(kept)
            warnings.warn(f"{self.path}: is of another evaluation; it is kept as {kept}", RuntimeWarning, stacklevel=2)
            lines = []
        self.episodes = self._read(lines[1:], jobs)
        if dropped := max(len(lines) - 1, 0) - len(self.episodes):
            warnings.warn(
                f"{self.path}: {dropped} of {len(lines) - 1} lines are damaged or repeated; "
                "what is missing is played again",
                RuntimeWarning,
                stacklevel=2,
            )
        if self.episodes:
            self._write(self.episodes)
        else:
            self.remove()

    def _write(self, episodes: Sequence[Played]) -> None:
        write_atomically(self.path, "".join(f"{line}\n" for line in [self._head, *map(self._line, episodes)]))

    def _read(self, lines: Sequence[bytes], jobs: Sequence[Job]) -> list[Played]:
        """Return the first episode of each job that the lines hold."""
        found: dict[Job, Played] = {}
        known = set(jobs)
        for line in lines:
            try:
                episode = episode_of(unsealed(line.decode(), self._head))
            except (KeyError, TypeError, ValueError):
                continue
            if episode.job in known:
                found.setdefault(episode.job, episode)
        return list(found.values())

    def _line(self, episode: Played) -> str:
        return sealed(episode_row(episode), self._head)

    def add(self, episode: Played) -> None:
        """Write down a finished episode.

        Raises:
            WriteError: the disk is full.
        """
        if self.path.is_file():
            append_line(self.path, self._line(episode))
        else:
            self._write([episode])

    def remove(self) -> None:
        """Delete the side file: the result is written, or nothing is finished."""
        self.path.unlink(missing_ok=True)


def _free(path: Path) -> Path:
    """Return a path that nothing is at: the one that is given, or one with a number after it."""
    names = chain([path.name], (f"{path.name}{number}" for number in count(2)))
    return next(free for name in names if not os.path.lexists(free := path.with_name(name)))
