"""Whether a home can be played: the one answer that ``chmarl-pb homes check`` and every environment give."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path

from chmarl_pb import __version__
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import WriteError
from chmarl_pb.files import cache_folder, file_hash, write_atomically
from chmarl_pb.fingerprint import name_of, sha256_of
from chmarl_pb.homes.generate.store import is_generated
from chmarl_pb.homes.home import Home, home_names
from chmarl_pb.homes.problem import Problem, raise_first
from chmarl_pb.navigation.check import HomeReport, check_home
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.plain_robot import robot_hash
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.trial import try_home

#: Part of the hash in the names of kept trials: raise it when a trial may find something else.
TRIAL = 3


def judge(
    name_or_path: str | Path, robots: Sequence[str | Path | RobotModel] = TEAM, known: Catalog = BENCHMARK
) -> HomeReport:
    """Check a home's files and geometry, and if they are good, try it; what a trial found is kept by the files' hash.

    Raises:
        HomeError: there is no such home.
        OptionError: the robots are not known.
        AssetError: a robot cannot be used.
    """
    report, models = check_home(name_or_path, known), team_of(robots)
    if report.errors or report.home is None:
        return report
    return report.with_problems(_trial(report.home, models))


def require_playable(name_or_path: str | Path, models: Mapping[str, RobotModel], known: Catalog) -> None:
    """Raise the first error that :func:`judge` finds; homes of the package and generated ones are good.

    Raises:
        HomeError: the home cannot be played.
    """
    name = str(name_or_path)
    if not is_generated(name) and name not in home_names():
        raise_first(judge(name_or_path, tuple(models.values()), known).errors)


def _trial(home: Home, models: Mapping[str, RobotModel]) -> tuple[Problem, ...]:
    """Return what a trial of a home finds, or has found when the same files were tried before."""
    parts = [
        home.content,
        home.catalog.content,
        __version__,
        str(TRIAL),
        *(f"{name} {_facts(model)}" for name, model in models.items()),
    ]
    key = sha256_of(part.encode() for part in parts)
    problems = _known(key, cache_folder())
    if problems is None:
        simulation = Simulation(str(home.path), models, known=home.catalog)
        try:
            problems = try_home(simulation)
        finally:
            simulation.close()
        _keep(key, cache_folder(), problems)
    return tuple(replace(problem, file=str(home.path)) for problem in problems)


def _facts(model: RobotModel) -> str:
    """Return what is known of a kind of robot, in words that are the same in every process."""
    values = {one.name: getattr(model, one.name) for one in fields(model) if one.name not in ("make", "copied_by")}
    files = [file_hash(model.urdf), robot_hash(model.urdf)]
    return f"{values} {files} {model.make is not None and name_of(model.make)}"


_here: dict[str, tuple[Problem, ...]] = {}


def _known(key: str, folder: Path | None) -> tuple[Problem, ...] | None:
    """Return the problems kept in this process or on disk; None if there are none or they cannot be read."""
    if key not in _here and folder is not None:
        with suppress(OSError, ValueError, TypeError, KeyError):
            rows = json.loads((folder / "trials" / f"{key}.json").read_text(encoding="utf-8"))["problems"]
            _here[key] = tuple(
                Problem(**{**row, "position": row["position"] and tuple(row["position"])}) for row in rows
            )
    return _here.get(key)


def _keep(key: str, folder: Path | None, problems: tuple[Problem, ...]) -> None:
    """Keep problems in this process, and on disk if there is a place."""
    _here[key] = problems
    if folder is not None:
        with suppress(WriteError, OSError):
            text = json.dumps({"problems": [problem.as_dict() for problem in problems]})
            write_atomically(folder / "trials" / f"{key}.json", text)
