"""What is wrong with a home, as data, and the list that all checks of one home add to."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from chmarl_pb.errors import AssetError, HomeError

Severity = Literal["error", "warning"]
Position = tuple[float, ...]


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a home.

    Attributes:
        severity: with an error the home cannot be played.
        file: the URDF.
        link: name of the link; empty if it is about the whole home.
        position: x, y, z in metres, where that is known.
        measured: what was found.
        fix: what to do about it.
    """

    severity: Severity
    file: str
    link: str
    position: Position | None
    measured: str
    fix: str

    def __str__(self) -> str:
        """Return all of it as one sentence."""
        where = "" if self.position is None else " at ({})".format(", ".join(f"{x:.2f}" for x in self.position))
        about = f" link {self.link!r}{where}:" if self.link else ""
        return f"{self.file}:{about} {self.measured}" + (f"; {self.fix}" if self.fix else "")

    def as_dict(self) -> dict[str, Any]:
        """Return its fields, as JSON writes them."""
        return asdict(self)


class Refused(Exception):
    """A home of which nothing more is to be read; its arguments are those of :meth:`Findings.error`."""


class Findings:
    """The problems of one home; a message says what is wrong and, after its last semicolon, what to do about it."""

    def __init__(self, file: Path):
        """Begin with none."""
        self._known: dict[Problem, None] = {}
        self._file = str(file)
        self._place_of: Callable[[str], Position | None] = lambda _: None

    def copy(self) -> "Findings":
        """Return findings of the same problems, to add others to."""
        copy = Findings(Path(self._file))
        copy._known, copy._place_of = dict(self._known), self._place_of
        return copy

    @property
    def problems(self) -> list[Problem]:
        """All of them, in the order in which they were found."""
        return list(self._known)

    @property
    def errors(self) -> list[Problem]:
        """Those with which the home cannot be played."""
        return [problem for problem in self.problems if problem.severity == "error"]

    def error(self, message: str, link: str = "", position: Position | None = None) -> None:
        """Add an error; the position is that of the link if none is given."""
        self._add("error", message, link, position)

    def warning(self, message: str, link: str = "") -> None:
        """Add a warning, where the link is."""
        self._add("warning", message, link, None)

    def listing(self, link: str = "", label: str = "") -> "_Listing":
        """Return a context that adds a ``ValueError`` which ends it as an error, its message after a label."""
        return _Listing(self, link, label)

    def locate(self, place_of: Callable[[str], Position | None]) -> None:
        """Tell where the links of problems found before and after are: it is asked for those alone."""
        self._place_of = place_of
        self._known = {
            replace(problem, position=_rounded(place_of(problem.link))) if problem.position is None else problem: None
            for problem in self._known
        }

    def _add(self, severity: Severity, message: str, link: str, position: Position | None) -> None:
        measured, _, fix = message.rpartition("; ")
        at = _rounded(position or self._place_of(link))
        self._known[Problem(severity, self._file, link, at, measured or fix, fix if measured else "")] = None


class _Listing:
    """See :meth:`Findings.listing`; a home has thousands, and a generator would take three times as long."""

    __slots__ = ("_found", "_label", "_link")

    def __init__(self, found: Findings, link: str, label: str):
        self._found, self._link, self._label = found, link, label

    def __enter__(self) -> None:
        pass

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> bool:
        listed = isinstance(error, ValueError)
        if listed:
            self._found.error(f"{self._label}{error}", self._link)
        return listed


def _rounded(position: Position | None) -> Position | None:
    return None if position is None else tuple(round(float(x), 3) + 0.0 for x in position)


def raise_first(problems: list[Problem], whole: str = "home") -> None:
    """Raise the first of some problems of a home, thing or robot, if there is one.

    Raises:
        HomeError: it and the number of the others, in one line.
        AssetError: the same, of a thing or robot.
    """
    if problems:
        others, error = len(problems) - 1, HomeError if whole == "home" else AssetError
        lister = "; `chmarl-pb homes check` lists all" if whole == "home" else ""
        raise error(f"{problems[0]}" + (f" (and {others} more{lister})" if others else ""))
