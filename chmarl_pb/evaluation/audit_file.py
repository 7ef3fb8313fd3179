"""What an audit has found, and its JSON file; those of the benchmark's splits come with the package."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.json_file import WRONG, read_object
from chmarl_pb.evaluation.metrics import Figure
from chmarl_pb.evaluation.provenance import tasks_hash
from chmarl_pb.evaluation.result import Report
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.files import write_atomically

FORMAT = "chmarl-pb audit 1"
FOLDER = Path(__file__).parent / "audits"

#: Settings of a result that all rows of an audit share.
_SHARED = ("split", "observation", "tasks", "tasks_sha256", "homes_sha256", "source_sha256")


@dataclass(frozen=True)
class Line:
    """The scores of one row of an audit.

    Attributes:
        name: of the policy, and what was taken from it.
        uses: the parts of what a robot is given that its choices depend on: eyes, instruction, messages, feedback,
            partner.
        blind: whether it counts among the policies that do not see: what it is given is no more than the setting has.
        success_rate: over tasks and seeds.
        plw: the same.
        steps: joint steps if solved.
        seeds: how many were played.
    """

    name: str
    uses: tuple[str, ...]
    blind: bool
    success_rate: Figure
    plw: Figure
    steps: Figure
    seeds: int

    @property
    def eyes(self) -> bool:
        """Whether a robot of the team reads its picture or graph."""
        return "eyes" in self.uses


@dataclass(frozen=True)
class Audit:
    """What an audit has found.

    Attributes:
        settings: track, split, observation, options of the setting, and the hashes of tasks, homes and source code.
        lines: in the order of the table.
        blind_plw: task's id -> PLW of the best blind policy, the mean of its seeds.
    """

    settings: dict[str, Any]
    lines: tuple[Line, ...]
    blind_plw: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, lines: Sequence[Line], track: str, reports: Sequence[Report]) -> "Audit":
        """Return the audit of rows and their results; the first row plays with the options of the setting."""
        shared = {name: reports[0].settings[name] for name in _SHARED}
        found = cls({"track": track, **shared, "options": reports[0].settings["options"]}, tuple(lines))
        best = reports[found.lines.index(found.best_blind)]
        return replace(found, blind_plw={task.id: round(plw, 6) for task, plw in best.plw_of_tasks.items()})

    @property
    def best_blind(self) -> Line:
        """The blind policy with the greatest PLW."""
        return max((line for line in self.lines if line.blind), key=lambda line: line.plw.mean or 0.0)

    @property
    def facts(self) -> dict[str, Any]:
        """All of it, as plain data."""
        return {
            "format": FORMAT, "settings": self.settings, "best_blind": self.best_blind.name,
            "rows": list(map(asdict, self.lines)), "blind_plw": self.blind_plw,
        }  # fmt: skip

    def save(self, path: Path) -> None:
        """Write the audit as JSON, whole or not at all; what the blind policy has of each task is one line."""
        facts = self.facts
        tasks = json.dumps(facts.pop("blind_plw"))
        text = json.dumps(facts, indent=1)[: -len("\n}")]
        write_atomically(path, f'{text},\n "blind_plw": {tasks}\n}}\n')


def load_audit(path: Path | str) -> Audit:
    """Read an audit.

    Raises:
        ResultError: the file is missing, damaged, or of another kind.
    """
    try:
        data = read_object(path)
        if data["format"] != FORMAT:
            raise ValueError(f"its format is {data['format']!r}, not {FORMAT!r}")
        return Audit(data["settings"], tuple(map(_line, data["rows"])), data.get("blind_plw", {}))
    except FileNotFoundError as error:
        raise ResultError(f"{path}: no such file; `chmarl-pb audit --out` writes audits") from error
    except WRONG as error:
        raise ResultError(f"{path}: not a whole audit: {repr(error)[:300]}; remove it and audit again") from error


def _line(row: dict[str, Any]) -> Line:
    figures = {name: Figure(**row[name]) for name in ("success_rate", "plw", "steps")}
    return Line(**{**row, **figures, "uses": tuple(row["uses"])})


@cache
def published_audit(split: str, track: str = PAPER) -> Audit | None:
    """Return the audit of a split that comes with the package; None if there is none of its present tasks."""
    path = FOLDER / f"{track}-{split}.json"
    if not path.is_file():
        return None
    found = load_audit(path)
    return found if found.settings["tasks_sha256"] == tasks_hash(evaluated_tasks(split)) else None
