"""Set up a task in a world: where everything lies, and where robots start, drawn from the task's seed alone."""

from dataclasses import dataclass, replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import TaskError
from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import AnyLattice
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.arrangement import Arrangement
from chmarl_pb.tasks.lookalike_task import LookalikeTask
from chmarl_pb.tasks.own_places import own_place
from chmarl_pb.tasks.sampling import may_stand
from chmarl_pb.tasks.splits import LIMITED_SPLITS, split_of
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.tidy_task import AnyTask
from chmarl_pb.world import Objects, World

DISTRACTORS = 18  # other objects that dress the home in every task
_PLACES, _STARTS, _STATES = 0, 3, 4  # streams of a task's seed; words use 1 and 2
_KEPT = 2048  # layouts of one home, 8 kB each
_RECEPTACLES_TRIED = 6  # for each of the distractors


@dataclass(frozen=True)
class Setting:
    """What a task's seed has fixed beside the places of the objects.

    Attributes:
        task: the task, with all that its instruction names.
        goals: what Pick and Place act on, one goal for each object, in the order of the instruction.
        states: name of a static thing or an object -> its symbolic state.
        graspers: the robots that can grasp.
        rooms: names of the home's rooms, in the order of a robot's ``room``.
    """

    task: AnyTask
    goals: tuple[Goal, ...]
    states: dict[str, str]
    graspers: tuple[str, ...]
    rooms: tuple[str, ...]

    @property
    def goal(self) -> Goal:
        """The first goal, which in most tasks is the only one."""
        return self.goals[0]


@dataclass(frozen=True, eq=False)
class Layout:
    """What a task's seed draws for a home.

    Attributes:
        objects: where the objects are.
        states: of the home's things, then of the objects.
    """

    objects: Objects
    states: tuple[str, ...]


#: By the task and its moves: kinds of tasks of one's own may move other things in the same task.
_layouts: WeakKeyDictionary[Space, dict[tuple[AnyTask, ...], Layout]] = WeakKeyDictionary()


def set_up(world: World, space: Space, task: AnyTask, moves: tuple[Task, ...]) -> Setting:
    """Clear a world and lay out a task in it: each X on its source, the distractors, the states.

    Args:
        world: the world.
        space: of its home.
        task: the task; its seed alone draws what the moves leave open.
        moves: the objects to be moved.

    Raises:
        TaskError: X does not fit on the source, or nowhere where it is to go.
    """
    for move in moves:
        move.check(space.home.catalog)
    goals = tuple(_goal(world, space, move) for move in moves)
    kept = _layouts.setdefault(space, {})
    # the planner adds the steps to what it has laid out and solved
    drawn = tuple(replace(part, optimal_steps=0) for part in (task, *moves))
    layout = kept.get(drawn)
    if layout is None:
        layout = _lay_out(world, space, task, moves, goals)
        if len(kept) == _KEPT:
            del kept[next(iter(kept))]
        kept[drawn] = layout
    world.arrange(layout.objects)
    names = (*(thing.name for thing in space.home.things), *world.objects)
    states = dict(zip(names, layout.states, strict=True))
    return Setting(task, goals, states, world.graspers, tuple(space.home.rooms))


def _goal(world: World, space: Space, move: Task) -> Goal:
    """Return the goal of a move.

    Raises:
        TaskError: the home has no such receptacle, none is large enough, or there is no such object in the world.
    """
    if move.item not in world.physics.objects:
        raise TaskError(f"task {move.id!r}: there is no {move.item}; tasks with colours need lookalikes=True")
    targets = receptacles_of(space.home, move.target)
    if isinstance(move, LookalikeTask) and move.room:
        targets = tuple(name for name in targets if catalog.room_of(name) == move.room)
    size = world.size(move.item)
    if not any(len(space.places(name, size)) for name in targets):
        where = " and ".join(targets)
        raise TaskError(f"task {move.id!r}: {move.item} is too large for {where}; choose another target")
    return Goal(move.item, targets)


def _lay_out(world: World, space: Space, task: AnyTask, moves: tuple[Task, ...], goals: tuple[Goal, ...]) -> Layout:
    """Draw a task's layout; nothing changes in the world."""
    # Streams of their own: a new state in the catalogue moves nothing, a new object no robot.
    things, moods = (np.random.default_rng([task.seed, stream]) for stream in (_PLACES, _STATES))
    laid = Arrangement(world, space, things)
    for move in moves:
        if not _put_on_source(laid, move, things):
            raise TaskError(
                f"task {task.id!r}: no {move.source} of {space.home.name} has a reachable place for a {move.graspable}"
            )
    targets = {name for goal in goals for name in goal.receptacles}
    items = [goal.item for goal in goals]
    if isinstance(task, LookalikeTask):
        items += _add_lookalikes(laid, space.home, task, things)
    _dress(laid, space.home, task, items, targets, things)
    objects = [name for name in world.physics.objects if name in laid.objects.poses]
    return Layout(laid.objects, _states(space.home, objects, moods))


def _put_on_source(laid: Arrangement, move: Task, rng: np.random.Generator) -> bool:
    """Put the object of a move on its source; False if it does not fit there, or if its own place is elsewhere."""
    if _is_limited(move):
        place = own_place(laid.world, laid.space, move.item)
        on_source = place is not None and catalog.class_of(place.receptacle) == move.source
        return on_source and _put_at_own_place(laid, move.item)
    sources = list(receptacles_of(laid.space.home, move.source))
    rng.shuffle(sources)
    return any(laid.put(move.item, source) for source in sources)


def _put_at_own_place(laid: Arrangement, item: str) -> bool:
    """Put an object at its place; False if something else stands there, or if it has none."""
    place = own_place(laid.world, laid.space, item)
    return place is not None and laid.put_at(item, place.receptacle, (*place.position, place.yaw))


def _is_limited(task: AnyTask) -> bool:
    """Return whether each class of object has one place, see :mod:`chmarl_pb.tasks.own_places`."""
    return split_of(task.id) in LIMITED_SPLITS


@lru_cache(maxsize=_KEPT)
def draw_starts(seed: int, lattices: tuple[AnyLattice, ...]) -> tuple[int, ...]:
    """Return the pose that each robot starts from: uniform, but never in a cell where one before it stands.

    Args:
        seed: of the task.
        lattices: where each robot can be, in the order of the robots.
    """
    rng = np.random.default_rng([seed, _STARTS])
    starts: list[int] = []
    for place, lattice in enumerate(lattices):
        taken = {lattice.cell(pose) for pose, other in zip(starts, lattices[:place], strict=True) if other is lattice}
        pose = int(rng.integers(lattice.count))
        starts.append(lattice.nearest(pose, taken) if lattice.cell(pose) in taken else pose)
    return tuple(starts)


def receptacles_of(home: Home, class_name: str) -> tuple[str, ...]:
    """Return the names of a home's receptacles of a class.

    Raises:
        TaskError: the home has none.
    """
    names = tuple(name for name, thing in home.receptacles.items() if thing.class_name == class_name)
    if not names:
        raise TaskError(f"{home.name} has no {class_name}; choose a receptacle class that stands in the home")
    return names


def _add_lookalikes(laid: Arrangement, home: Home, task: LookalikeTask, rng: np.random.Generator) -> list[str]:
    """Put lookalikes of X, and decoys, on receptacles drawn uniformly; return their names.

    Raises:
        TaskError: there is no place for a lookalike of X.
    """
    placed = []
    for item in (*task.lookalikes, *task.decoys):
        if _put_on_any(laid, item, _in_random_order(home, rng), home.catalog):
            placed.append(item)
        elif item in task.lookalikes:
            raise TaskError(f"task {task.id!r}: no receptacle of {home.name} has a reachable place for {item}")
    return placed


def _dress(
    laid: Arrangement, home: Home, task: AnyTask, items: list[str], targets: set[str], rng: np.random.Generator
) -> None:
    """Put the distractors, each of another class, on receptacles drawn uniformly; fewer where they do not fit.

    What stands beside the objects to be moved counts among them. In a limited layout each stands at its class's place.
    """
    known = home.catalog
    # The benchmark's tasks are dressed as ever, whatever objects a user has.
    own = set(map(catalog.class_of, items))
    classes = [name for name in (BENCHMARK if split_of(task.id) else known).graspables if name not in own]
    placed = len(items) - len(task.moves)
    limited = _is_limited(task)
    for item in rng.permutation([_one_of(known, name, rng) for name in classes]).tolist():
        tried = _in_random_order(home, rng)[:_RECEPTACLES_TRIED]
        placed += _put_at_own_place(laid, item) if limited else _put_on_any(laid, item, tried, known)
        if placed == DISTRACTORS:
            return
    laid.keep(_left_when_full(laid.objects, items, targets))


def _in_random_order(home: Home, rng: np.random.Generator) -> list[str]:
    """Return the names of a home's receptacles in a random order."""
    names = list(home.receptacles)
    return [names[number] for number in rng.permutation(len(names)).tolist()]


def _put_on_any(laid: Arrangement, item: str, receptacles: list[str], known: Catalog) -> bool:
    """Put an object on the first of some receptacles that may have it and has a place; False if none has."""
    kind = catalog.class_of(item)
    return any(may_stand(known, kind, catalog.class_of(name)) and laid.put(item, name) for name in receptacles)


def _one_of(known: Catalog, class_name: str, rng: np.random.Generator) -> str:
    """Return the name of the object of a class, or of any of several."""
    names = [name for name, _ in known.graspables[class_name].objects]
    return names[0] if len(names) == 1 else names[int(rng.integers(len(names)))]


def _left_when_full(objects: Objects, items: list[str], targets: set[str]) -> list[str]:
    """Return what stays of the objects of a home that is full, so that X finds a place on Y.

    All others on the targets are taken out, and every second of the rest.
    """
    others = [name for name, on in objects.supports.items() if name not in items and on.receptacle not in targets]
    return [*items, *others[::2]]


def _states(home: Home, objects: list[str], rng: np.random.Generator) -> tuple[str, ...]:
    """Return the symbolic state of every static thing, then of every object, drawn from those of its class."""
    classes = [*(thing.class_name for thing in home.things), *map(catalog.class_of, objects)]
    choices = [_choices(home.catalog, class_name) for class_name in classes]
    numbers = rng.integers([len(states) for states in choices]).tolist()
    return tuple(states[number] for states, number in zip(choices, numbers, strict=True))


def _choices(known: Catalog, class_name: str) -> tuple[str, ...]:
    row = known.classes.get(class_name)
    return ("fixed",) if row is None else row.states
