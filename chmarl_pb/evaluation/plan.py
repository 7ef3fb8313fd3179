"""What an evaluation plays: which tasks, how often, and in what order."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.own_parts import checked_kind
from chmarl_pb.errors import OptionError, TaskError
from chmarl_pb.evaluation.play import Job, Setup
from chmarl_pb.evaluation.sample import sample_of
from chmarl_pb.limits import whole_number
from chmarl_pb.policies.sources import Source
from chmarl_pb.tasks.kinds import named_task
from chmarl_pb.tasks.splits import GENERATED_HOMES, SPLITS, STREAM
from chmarl_pb.tasks.tidy_task import AnyTask


@dataclass(frozen=True)
class Plan:
    """What is played by whom.

    Attributes:
        source: the policy's.
        setup: what all episodes share.
        tasks: to be played.
        seeds: each plays every task once.
        deterministic: whether nothing of it can draw random numbers, so that one seed is enough.
    """

    source: Source
    setup: Setup
    tasks: list[AnyTask]
    seeds: list[int]
    deterministic: bool

    @property
    def jobs(self) -> list[Job]:
        """All episodes, those of a home in a row."""
        homes = list(dict.fromkeys(task.home for task in self.tasks))
        jobs = ((task, seed) for seed in self.seeds for task in self.tasks)
        return sorted(jobs, key=lambda job: homes.index(job[0].home))


def plan_of(source: Source, setup: Setup, tasks: Iterable[AnyTask | str] | None, seeds: Sequence[int]) -> Plan:
    """Return what an evaluation plays.

    Args:
        source: the policy's.
        setup: of the split's homes.
        tasks: tasks or their ids; None: those of the split.
        seeds: a policy that cannot draw random numbers plays the first only.

    Raises:
        OptionError: a seed is none, or given twice.
        TaskError: a task is unknown, given twice, or of another split, or there are none.
    """
    chosen = _chosen(setup.options, _listed(tasks))
    setup = _at_home(setup, chosen)
    deterministic = source.deterministic and not _may_draw(setup)
    return Plan(source, setup, chosen, _seeds(seeds)[: 1 if deterministic else None], deterministic)


def _chosen(options: Options, tasks: Sequence[AnyTask | str] | None) -> list[AnyTask]:
    split, kind = options.split, checked_kind(options.kind, options)
    if tasks is None and split == STREAM:
        raise TaskError(f"the split {split!r} is endless; use {' or '.join(GENERATED_HOMES)}, or give tasks=[...]")
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
