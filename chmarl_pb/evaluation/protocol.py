"""The protocol: every task of a split is played once for each seed, by one policy, and the result kept."""

import os
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from functools import partial
from pathlib import Path
from typing import Any

from chmarl_pb.envs.options import Observed, Options
from chmarl_pb.envs.tracks import OF_TRACK, PAPER, split_or_headline
from chmarl_pb.errors import OptionError, ResultError
from chmarl_pb.evaluation.json_file import check_replaceable
from chmarl_pb.evaluation.labels import label_fault
from chmarl_pb.evaluation.ledger import Ledger
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.plan import Plan, plan_of
from chmarl_pb.evaluation.play import EnvFn, Job, Setup, play
from chmarl_pb.evaluation.provenance import machine, versions
from chmarl_pb.evaluation.result import FORMAT, SEATS_APART, Report, in_order, load_result
from chmarl_pb.evaluation.rules import rules_with
from chmarl_pb.evaluation.seats_apart import some_of, what_is_shared
from chmarl_pb.evaluation.settings import settings_of, warn_of_unknown
from chmarl_pb.executors import Executor, executor_of
from chmarl_pb.files import Lock
from chmarl_pb.policies.policy import Factory, Policy
from chmarl_pb.policies.sources import Source, find_policy
from chmarl_pb.tasks.tidy_task import AnyTask

SEEDS = (0, 1, 2)

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
            folder or a file that is no result, policies share what their robots observe, or the policy has changed
            meanwhile.
        TaskError: a task is unknown, of another split, or cannot be solved by the planner, which tells L*.
        BusyError: another process writes ``out``.
        WorkerError: a process died; finished episodes are kept.
        WriteError: ``out`` cannot be written.
    """
    if "home" in options:
        raise OptionError(f"evaluate(home={options['home']!r}): tasks name their homes; choose by tasks=...")
    if fault := label_fault(label or ""):
        raise OptionError(f"label={label!r} {fault}; name the row otherwise")
    source = find_policy(policy)
    options = rules_with(source.rules, options)
    split = split_or_headline(split, options.get("track", PAPER))
    observed = Options(observation or source.observation or "scene_graph", split, **options)
    setup = Setup(policy, observed, env_fn, source.sha256 if source.told else None)
    if check_seats:
        _check_has_seats(source, setup)
    plan = plan_of(source, setup, tasks, seeds)
    executor = executor_of(executor, workers)
    file = None if out is None else check_out(Path(out))
    settings = settings_of(plan)
    if file is not None:
        warn_of_unknown(settings)
    run = partial(_run, plan, settings, plays or partial(play, executor=executor), progress, executor.workers)
    if file is None:
        return run(label, _seats_apart(plan) if check_seats else {})
    return _written(file, plan, settings, run, label, reuse, check_seats)


def check_out(file: Path) -> Path:
    """Return where a result is to be written, if it may be.

    Raises:
        OptionError: a folder is there, or a file that is no result.
    """
    if file.is_dir():
        raise OptionError(f"{file} is a folder; name a file in it for the result")
    check_replaceable(file, FORMAT, "a result of an evaluation")
    return file


def _written(
    file: Path, plan: Plan, settings: dict[str, Any], run: Callable[..., Report], label: str | None, reuse: bool,
    check_seats: bool,
) -> Report:  # fmt: skip
    """Return the result that a file holds already, or play, and write it there."""
    notes: dict[str, Any] = {} if label is None else {"label": label}
    kept = _kept(file, settings, reuse)
    if kept and notes.items() <= kept.run.items() and (SEATS_APART in kept.run or not check_seats):
        return kept
    with Lock(file):
        kept = _kept(file, settings, reuse)  # another process may just have written it
        apart = _seats_apart(plan) if check_seats and not (kept and SEATS_APART in kept.run) else {}
        if kept:
            return _noted(kept, notes | apart, file)
        ledger = Ledger(file, settings, plan.jobs)
        report = run(label, apart, ledger)
        report.save(file)
        ledger.remove()
    return report


def _kept(file: Path, settings: dict[str, Any], reuse: bool) -> Report | None:
    """Return the result that a file holds already, if it is to be used and was made with the same settings."""
    if not reuse or not file.is_file():
        return None
    kept = load_result(file)
    return kept if kept.settings == settings else None


def _noted(kept: Report, notes: Mapping[str, Any], file: Path) -> Report:
    """Return a kept result with notes in its ``run``, as the label that it is to be shown by, in its file, too."""
    if notes.items() <= kept.run.items():
        return kept
    noted = replace(kept, run={**kept.run, **notes})
    noted.save(file)
    return noted


def _check_has_seats(source: Source, setup: Setup) -> None:
    if source.centralized or setup.privileged:
        kind = "is one policy for all robots" if source.centralized else "is told more than its robots observe"
        raise OptionError(f"check_seats=True: {source.name} {kind}, so there are no seats to look at; leave it out")


def _seats_apart(plan: Plan) -> dict[str, int]:
    """Return what a result says of seats that share nothing: of how many episodes.

    Raises:
        OptionError: they share something.
    """
    chosen = some_of(plan.jobs)
    if shared := what_is_shared(plan.setup, chosen):
        raise OptionError(shared)
    return {SEATS_APART: len(chosen)}


def _run(
    plan: Plan, settings: dict[str, Any], plays: Plays, progress: Progress, workers: int, label: str | None,
    apart: Mapping[str, int], ledger: Ledger | None = None,
) -> Report:  # fmt: skip
    """Play; return the result, with how its numbers came about."""
    start = time.perf_counter()
    episodes = _played(plan, plays, ledger, progress)
    plan.source.check()
    run = {
        "label": label,
        "command": shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "seconds": round(time.perf_counter() - start, 1),
        "workers": workers,
        "deterministic": plan.deterministic,
        "versions": versions(),
        "machine": machine(),
        **apart,
    }
    return Report(settings, run, in_order(episodes, plan.tasks))


def _played(plan: Plan, plays: Plays, ledger: Ledger | None, progress: Progress) -> list[Played]:
    """Play what the ledger does not have; return exactly one episode for each job."""
    jobs = plan.jobs
    episodes = [] if ledger is None else list(ledger.episodes)
    finished = {episode.job for episode in episodes}
    missing = {job: None for job in jobs if job not in finished}
    playing = plays(plan.setup, list(missing))
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
