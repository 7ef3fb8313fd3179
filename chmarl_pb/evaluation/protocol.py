"""The protocol: every task of a split, once for each seed, with one policy."""

import os
import shlex
import sys
import time
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

from chmarl_pb.envs.options import Observed, Options
from chmarl_pb.envs.own_parts import checked_kind
from chmarl_pb.envs.rollout import core_of_parallel
from chmarl_pb.envs.tracks import HEADLINE_SPLITS, OF_TRACK, PAPER
from chmarl_pb.errors import OptionError, ResultError, TaskError
from chmarl_pb.evaluation.json_file import check_replaceable
from chmarl_pb.evaluation.labels import label_fault
from chmarl_pb.evaluation.ledger import Ledger
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.play import EnvFn, Job, Setup, play
from chmarl_pb.evaluation.provenance import (
    home_hashes,
    is_told,
    machine,
    packaged_things_hash,
    robots_hash,
    source_hash,
    tasks_hash,
    versions,
)
from chmarl_pb.evaluation.result import FORMAT, SEATS_APART, Report, in_order, load_result
from chmarl_pb.evaluation.rules import rules_with
from chmarl_pb.evaluation.sample import sample_of
from chmarl_pb.evaluation.seats_apart import some_of, what_is_shared
from chmarl_pb.executors import Executor, executor_of
from chmarl_pb.files import Lock
from chmarl_pb.fingerprint import fingerprint, name_of
from chmarl_pb.limits import whole_number
from chmarl_pb.policies.policy import Factory, Policy
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.policies.sources import Source, find_policy
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.tasks.kinds import named_task
from chmarl_pb.tasks.splits import GENERATED_HOMES, SPLITS, STREAM
from chmarl_pb.tasks.tidy_task import AnyTask

SEEDS = (0, 1, 2)

_UNKNOWN = "unknown-"  # begins what stands in settings for the sha256 of what nothing tells apart

#: Called after each finished episode with the numbers of finished and of all episodes.
Progress = Callable[[int, int], None]

#: Plays jobs and yields the episodes, in any order.
Plays = Callable[[Setup, Sequence[Job]], Iterator[Played]]


def evaluate(
    policy: str | os.PathLike[str] | Factory | Policy,
    split: str = OF_TRACK,
    observation: Observed | None = None,
    seeds: Sequence[int] = SEEDS,
    workers: int = 2,
    tasks: Sequence[AnyTask | str] | None = None,
    out: Path | str | None = None,
    label: str | None = None,
    reuse: bool = False,
    progress: Progress = lambda finished, total: None,
    plays: Plays | None = None,
    env_fn: str | EnvFn | None = None,
    executor: Executor | None = None,
    check_seats: bool = False,
    **options: Any,
) -> Report:
    """Evaluate a policy; its numbers do not depend on who plays, nor on how many.

    >>> report = chmarl_pb.evaluate("planner", "val-unseen", workers=1, tasks=["val-unseen-000"])
    >>> report.success_rate, report.plw
    (1.0, 1.0)

    Args:
        policy: a built-in name or that of published weights, ``module:callable`` (callable(env) -> Policy), a
            checkpoint's path, such a callable, or a policy; see :func:`chmarl_pb.policies.sources.find_policy`.
        split: all its tasks are played; of those for training, the first 250. If none is given, it is "test-unseen", in
            the grounded track "generated-test".
        observation: see ``options``; None: that of published weights, else "scene_graph".
        seeds: each plays every task once; a deterministic policy plays the first only, unless ``messages`` is an
            object, or another part of the environment is your own: these may draw random numbers.
        workers: number of processes.
        tasks: tasks or their ids, instead of the split's.
        out: JSON file for the result; finished episodes are kept beside it, so that the same call goes
            on after an interruption. One process at a time may write it.
        label: name of the row in reports; the policy's name if None.
        reuse: whether a result that ``out`` holds already is returned, if its settings are the same.
        progress: called after each episode.
        plays: how episodes are played, e.g. several at once; None: each by itself, in ``workers`` processes.
        env_fn: makes the environment, as ``module:callable`` or itself: it takes the keyword arguments of
            :func:`chmarl_pb.parallel_env` and returns that environment, in wrappers of its own. The result names it,
            its wrappers, and the options that it leaves the environment with.
        executor: where the work is done, e.g. a :class:`chmarl_pb.ray_executor.RayExecutor`; None: in ``workers``
            processes of this machine.
        check_seats: whether to look first whether policies share what their robots observe, see
            :mod:`chmarl_pb.evaluation.seats_apart`; ``run`` then says of how many episodes.
        **options: of the environment, see :class:`chmarl_pb.envs.options.Options`; tasks name their homes. A
            checkpoint plays by the rules that it was trained with where no option says otherwise.

    Raises:
        OptionError: the policy, the environment or an option is unknown, the label cannot name a row, ``out`` is a
            folder or a file that is no result, or policies share what their robots observe.
        TaskError: a task is unknown, of another split, or cannot be solved by the planner, which tells L*.
        BusyError: another process writes ``out``.
        WorkerError: a process died; finished episodes are kept.
        WriteError: ``out`` cannot be written.
    """
    if "home" in options:
        raise OptionError(f"evaluate(home={options['home']!r}): tasks name their homes; choose by tasks=...")
    tasks = _listed(tasks)
    _check_label(label)
    source = find_policy(policy)
    observation = observation or source.observation or "scene_graph"
    options = rules_with(source.rules, options)
    split = HEADLINE_SPLITS.get(options.get("track", PAPER), "") if split is OF_TRACK else split
    setup = Setup(policy, Options(observation, split, **options), env_fn)
    if check_seats:
        _check_has_seats(source, setup)
    if tasks is None and split == STREAM:
        raise TaskError(f"the split {split!r} is endless; use {' or '.join(GENERATED_HOMES)}, or give tasks=[...]")
    chosen = _chosen(setup.options, tasks)
    setup = _at_home(setup, chosen)
    fixed = source.deterministic and not _may_draw(setup)
    seeds = _seeds(seeds)[: 1 if fixed else None]
    executor = executor_of(executor, workers)
    file = None if out is None else Path(out)
    if file is not None and file.is_dir():
        raise OptionError(f"{out} is a folder; name a file in it for the result")
    if file is not None:
        check_replaceable(file, FORMAT, "a result of an evaluation")
    settings = _settings(source, setup, chosen, seeds)
    if file is not None:
        _warn_of_unknown(settings)
    known = partial(_kept, file, settings, reuse)
    kept = known()
    if kept and label in (None, kept.run.get("label")) and not (check_seats and SEATS_APART not in kept.run):
        return kept
    homes = list(dict.fromkeys(task.home for task in chosen))
    jobs = sorted(((task, seed) for seed in seeds for task in chosen), key=lambda job: homes.index(job[0].home))
    start = time.perf_counter()
    with nullcontext() if file is None else Lock(file):
        kept = known()  # another process may just have written it
        looks = check_seats and not (kept and SEATS_APART in kept.run)
        apart = _seats_apart(setup, jobs) if looks else {}
        if kept and file is not None:
            return _noted(kept, apart if label is None else apart | {"label": label}, file)
        ledger = None if file is None else Ledger(file, settings, jobs)
        episodes = _played(setup, jobs, plays or partial(play, executor=executor), ledger, progress)
        run = _run(label, executor.workers, time.perf_counter() - start, fixed) | apart
        report = Report(settings, run, in_order(episodes, chosen))
        if file is not None and ledger is not None:
            report.save(file)
            ledger.remove()
    return report


def _kept(file: Path | None, settings: dict[str, Any], reuse: bool) -> Report | None:
    """Return the result that a file holds already, if it is to be used and was made with the same settings."""
    if file is None or not reuse or not file.is_file():
        return None
    kept = load_result(file)
    return kept if kept.settings == settings else None


def _check_has_seats(source: Source, setup: Setup) -> None:
    if source.centralized or setup.privileged:
        kind = "is one policy for all robots" if source.centralized else "is told more than its robots observe"
        raise OptionError(f"check_seats=True: {source.name} {kind}, so there are no seats to look at; leave it out")


def _seats_apart(setup: Setup, jobs: Sequence[Job]) -> dict[str, int]:
    """Return what a result says of seats that share nothing: of how many episodes.

    Raises:
        OptionError: they share something.
    """
    chosen = some_of(jobs)
    if shared := what_is_shared(setup, chosen):
        raise OptionError(shared)
    return {SEATS_APART: len(chosen)}


def _noted(kept: Report, notes: Mapping[str, Any], file: Path) -> Report:
    """Return a kept result with notes in its ``run``, as the label that it is to be shown by, in its file, too."""
    if notes.items() <= kept.run.items():
        return kept
    noted = replace(kept, run={**kept.run, **notes})
    noted.save(file)
    return noted


def _chosen(options: Options, tasks: Sequence[AnyTask | str] | None) -> list[AnyTask]:
    split, kind = options.split, checked_kind(options.kind, options)
    if tasks is None:
        if not (chosen := sample_of(split, kind.tasks(split))):
            raise TaskError(f"tasks: the splits have none for task={options.task!r}; give tasks=[...]")
        return chosen
    chosen = [named_task(kind, split, task) if isinstance(task, str) else task for task in tasks]
    if len(set(chosen)) < len(chosen) or not chosen:
        raise TaskError("tasks: name at least one task, and none twice")
    for task in chosen:
        if (own := task.id.rpartition("-")[0]) in SPLITS and own != split:
            raise TaskError(f"task {task.id!r} is of the split {own!r}, not {split!r}; evaluate it there")
    return chosen


def _listed(tasks: Iterable[AnyTask | str] | None) -> list[AnyTask | str] | None:
    """Return tasks that were given in a row, each by itself or by its id."""
    if tasks is None:
        return None
    if isinstance(tasks, str) or not isinstance(tasks, Iterable):
        raise TaskError(f"tasks={tasks!r}: give several in a row, as tasks=['test-unseen-007']")
    listed = list(tasks)
    for task in listed:
        if not isinstance(task, AnyTask | str):
            raise TaskError(f"tasks: {task!r} is neither a task nor the id of one; ids read like 'test-unseen-007'")
    return listed


def _at_home(setup: Setup, tasks: Sequence[AnyTask]) -> Setup:
    """Return the setup of one home of the user's, whose rooms may be others than those of the split's homes."""
    homes = {task.home for task in tasks}
    if len(homes) > 1 or not homes.isdisjoint(setup.options.homes):
        return setup
    return replace(setup, options=replace(setup.options, home=homes.pop()))


def _check_label(label: str | None) -> None:
    if fault := label_fault(label or ""):
        raise OptionError(f"label={label!r} {fault}; name the row otherwise")


def _may_draw(setup: Setup) -> bool:
    """Return whether an episode may depend on its seed whatever the policy does.

    A channel's object may draw random numbers, and so may all that is the user's own: sensors, advisers, kinds of
    tasks, robots' classes, and what makes the environment.
    """
    options = setup.options
    own_robots = any(model.make is not None for model in options.models.values())
    return not isinstance(options.messages, bool | str) or own_robots or bool(options.own() or setup.env_fn)


def _seeds(seeds: Sequence[int]) -> list[int]:
    if not isinstance(seeds, Iterable):
        raise OptionError(f"seeds={seeds!r}: give several in a row, e.g. range({seeds!r})")
    checked = [whole_number("seed", seed) for seed in seeds]
    if not checked or len(set(checked)) < len(checked):
        raise OptionError(f"seeds={checked}: give one or more different whole numbers from 0 on")
    return checked


def _played(setup: Setup, jobs: Sequence[Job], plays: Plays, ledger: Ledger | None, progress: Progress) -> list[Played]:
    """Play what the ledger does not have; return exactly one episode for each job."""
    episodes = [] if ledger is None else list(ledger.episodes)
    finished = {episode.job for episode in episodes}
    missing = {job: None for job in jobs if job not in finished}
    playing = plays(setup, list(missing))
    progress(len(episodes), len(jobs))
    for episode in playing:
        if episode.job not in missing:
            raise ResultError(f"{episode.task.id}, seed {episode.seed}: was played twice, or nobody asked for it")
        del missing[episode.job]
        episodes.append(episode)
        if ledger is not None:
            ledger.add(episode)
        progress(len(episodes), len(jobs))
    if missing:
        raise ResultError(f"{len(missing)} of {len(jobs)} episodes have not been played")
    return episodes


def _settings(source: Source, setup: Setup, tasks: Sequence[AnyTask], seeds: Sequence[int]) -> dict[str, Any]:
    """Return what fixes the numbers."""
    options, changes = (setup.options, {}) if setup.env_fn is None else _changed(setup)
    values = options.recorded()
    given = {"privileged": setup.privileged, "centralized": source.centralized}
    is_built_in = isinstance(setup.policy, str) and setup.policy in BUILT_IN
    changes = {**changes, **{name: True for name, is_so in given.items() if is_so}}  # older results have neither
    if own := options.own():
        changes = {**changes, "own_sha256": {name: _or_unknown(fingerprint(one)) for name, one in own.items()}}
    return {
        "policy": source.name,
        "policy_sha256": None if is_built_in else _or_unknown(source.sha256),  # whose code source_sha256 tells
        "split": values.pop("split"),
        "observation": values.pop("observation"),
        "options": values,
        "seeds": list(seeds),
        "tasks": len(tasks),
        "tasks_sha256": tasks_hash(tasks),
        "homes_sha256": home_hashes(tasks),
        "robots_sha256": _robots(options.models.values()),
        "catalog_sha256": options.things.content or packaged_things_hash(),
        "source_sha256": source_hash(),
        **changes,
    }


def _robots(models: Collection[RobotModel]) -> dict[str, str]:
    """Return kind of robot -> its hash; where nothing tells its class apart, what no other evaluation has."""
    untold = {model.name for model in models if not is_told(model)}
    return {name: _or_unknown("" if name in untold else sha256) for name, sha256 in robots_hash(models).items()}


def _or_unknown(sha256: str | None) -> str:
    """Return what tells an object of the user's apart; where nothing does, what no other evaluation has."""
    return sha256 or f"{_UNKNOWN}{uuid4()}"


def _warn_of_unknown(settings: dict[str, Any]) -> None:
    """Warn if nothing tells whether another evaluation has the same settings."""
    told = {"policy": settings["policy_sha256"], "env_fn": settings.get("env", {}).get("sha256")}
    told |= settings.get("own_sha256", {})
    told |= {f"robots ({name})": sha256 for name, sha256 in settings["robots_sha256"].items()}
    if names := [name for name, sha256 in told.items() if sha256 and sha256.startswith(_UNKNOWN)]:
        warnings.warn(
            f"{', '.join(names)}: holds what cannot be pickled, or has no file, so nothing tells whether another "
            "evaluation had the same; the result is not reused, and an interrupted evaluation begins anew",
            stacklevel=3,
        )


def _changed(setup: Setup) -> tuple[Options, dict[str, Any]]:
    """Return the options that the environment really has, and what it is made by and wrapped in."""
    env, wrappers = setup.make_env(), []
    try:
        core, inner = core_of_parallel(env), env
        while inner is not core:
            wrappers.append(name_of(inner))
            inner = getattr(inner, "env", core)
    finally:
        env.close()
    make = setup.maker
    name = setup.env_fn if isinstance(setup.env_fn, str) else name_of(make)
    return core.options, {"env": {"name": name, "sha256": _or_unknown(fingerprint(make)), "wrappers": wrappers}}


def _run(label: str | None, workers: int, seconds: float, deterministic: bool) -> dict[str, Any]:
    """Return how the numbers came about."""
    command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    date = datetime.now(timezone.utc).isoformat(timespec="seconds")
    return {
        "label": label, "command": command, "date": date, "seconds": round(seconds, 1), "workers": workers,
        "deterministic": deterministic, "versions": versions(), "machine": machine(),
    }  # fmt: skip
