"""The ledger: a side file of finished episodes, one line each, so that an interrupted evaluation goes on."""

import json
from pathlib import Path
from typing import Any

from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.result import episode_json, episode_of
from chmarl_pb.files import write_atomically


class Ledger:
    """Finished episodes of one evaluation; the first line holds its settings.

    Attributes:
        path: of the side file, beside the result file.
        episodes: that were finished before.
    """

    def __init__(self, result: Path, settings: dict[str, Any]):
        """Read what is finished, or start anew if the settings differ.

        Args:
            result: the result file.
            settings: of the evaluation.
        """
        self.path = result.with_name(f"{result.name}.partial")
        head = json.dumps(settings, sort_keys=True)
        lines = self.path.read_text(encoding="utf-8").splitlines() if self.path.is_file() else []
        self.episodes = _whole(lines[1:]) if lines[:1] == [head] else []
        rows = [episode_json(episode) for episode in self.episodes]
        write_atomically(self.path, "".join(f"{line}\n" for line in [head, *rows]))

    def add(self, episode: Played) -> None:
        """Write down a finished episode."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(f"{episode_json(episode)}\n")

    def remove(self) -> None:
        """Delete the side file: the result is written."""
        self.path.unlink(missing_ok=True)


def _whole(lines: list[str]) -> list[Played]:
    """Return the episodes up to the first line that was cut."""
    episodes = []
    for line in lines:
        try:
            episodes.append(episode_of(json.loads(line)))
        except (KeyError, TypeError, ValueError):
            break
    return episodes
