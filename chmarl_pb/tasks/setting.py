"""Set up a task in a world: where everything lies, and where robots start, drawn from the task's seed alone."""

from dataclasses import dataclass, replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import TaskError
from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.free_space import Space, grip_point
from chmarl_pb.navigation.lattice import AnyLattice
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.lookalike_task import LookalikeTask
from chmarl_pb.tasks.own_places import own_place, put_at_own_place
from chmarl_pb.tasks.sampling import may_stand
from chmarl_pb.tasks.splits import LIMITED_SPLITS, split_of
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.tidy_task import AnyTask
from chmarl_pb.world import Objects, World, yaw_quaternion

DISTRACTORS = 18  # other objects that dress the home in every task
_PLACES, _STARTS, _STATES = 0, 3, 4  # streams of a task's seed; words use 1 and 2
_KEPT = 2048  # layouts of one home, 8 kB each
_TRIES = 40  # places that are drawn for one object before its receptacle counts as full


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


_layouts: WeakKeyDictionary[Space, dict[AnyTask, Layout]] = WeakKeyDictionary()


def set_up(world: World, space: Space, task: AnyTask, moves: tuple[Task, ...]) -> Setting:
    """Clear a world and lay out a task in it: each X on its source, the distractors, the states.

    Args:
        world: the world.
        space: of its home.
        task: the task; its seed alone draws what the moves leave open.
        moves: the objects to be moved.

    Raises:
        TaskError: X does not fit on the source.
    """
    for move in moves:
        move.check(space.home.catalog)
    goals = tuple(_goal(world, space.home, move) for move in moves)
    kept = _layouts.setdefault(space, {})
    drawn = replace(task, optimal_steps=0)  # the planner adds the steps to what it has laid out and solved
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


def _goal(world: World, home: Home, move: Task) -> Goal:
    """Return the goal of a move.

    Raises:
        TaskError: the home has no such receptacle, or there is no such object in the world.
    """
    if move.item not in world.physics.objects:
        raise TaskError(f"task {move.id!r}: there is no {move.item}; tasks with colours need lookalikes=True")
    targets = receptacles_of(home, move.target)
    if isinstance(move, LookalikeTask) and move.room:
        targets = tuple(name for name in targets if catalog.room_of(name) == move.room)
    return Goal(move.item, targets)


def _lay_out(world: World, space: Space, task: AnyTask, moves: tuple[Task, ...], goals: tuple[Goal, ...]) -> Layout:
    """Draw a task's layout, with the objects put into the world one by one."""
    # Streams of their own: a new state in the catalogue moves nothing, a new object no robot.
    things, moods = (np.random.default_rng([task.seed, stream]) for stream in (_PLACES, _STATES))
    world.clear()
    for move in moves:
        if not _put_on_source(world, space, move, things):
            raise TaskError(
                f"task {task.id!r}: no {move.source} of {space.home.name} has a reachable place for a {move.graspable}"
            )
    targets = {name for goal in goals for name in goal.receptacles}
    items = [goal.item for goal in goals]
    if isinstance(task, LookalikeTask):
        items += _add_lookalikes(world, space, task, things)
    _dress(world, space, task, items, targets, things)
    return Layout(world.state.objects, _states(space.home, world.objects, moods))


def _put_on_source(world: World, space: Space, move: Task, rng: np.random.Generator) -> bool:
    """Put the object of a move on its source; False if it does not fit there, or if its own place is elsewhere."""
    if _is_limited(move):
        place = own_place(world, space, move.item)
        on_source = place is not None and catalog.class_of(place.receptacle) == move.source
        return on_source and put_at_own_place(world, space, move.item)
    sources = list(receptacles_of(space.home, move.source))
    rng.shuffle(sources)
    return any(put_somewhere(world, space, move.item, source, rng) for source in sources)


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


def put_somewhere(world: World, space: Space, item: str, receptacle: str, rng: np.random.Generator) -> bool:
    """Put an object on a free place of a receptacle within the arm's reach, uniformly; False if none is found."""
    size = world.size(item)
    places = space.places(receptacle, size)
    free = np.flatnonzero(~world.taken(places, size))
    for number in rng.permutation(free)[:_TRIES].tolist():
        x, y, z, yaw = places[number].tolist()
        if space.stand(grip_point((x, y, z), size)) is not None:
            world.place(item, (x, y, z), yaw_quaternion(yaw), receptacle)
            return True
    return False


def _add_lookalikes(world: World, space: Space, task: LookalikeTask, rng: np.random.Generator) -> list[str]:
    """Put lookalikes of X, and decoys, on receptacles drawn uniformly; return their names.

    Raises:
        TaskError: there is no place for a lookalike of X.
    """
    receptacles, known = list(space.home.receptacles), space.home.catalog
    placed = []
    for item in (*task.lookalikes, *task.decoys):
        order = [
            name for name in rng.permutation(receptacles).tolist()
            if may_stand(known, catalog.class_of(item), catalog.class_of(name))
        ]  # fmt: skip
        if any(put_somewhere(world, space, item, receptacle, rng) for receptacle in order):
            placed.append(item)
        elif item in task.lookalikes:
            raise TaskError(f"task {task.id!r}: no receptacle of {space.home.name} has a reachable place for {item}")
    return placed


def _dress(
    world: World, space: Space, task: AnyTask, items: list[str], targets: set[str], rng: np.random.Generator
) -> None:
    """Put the distractors, each of another class, on receptacles drawn uniformly; fewer where they do not fit.

    What stands beside the objects to be moved counts among them. In a limited layout each stands at its class's place.
    """
    receptacles, known = np.array(list(space.home.receptacles)), space.home.catalog
    # The benchmark's tasks are dressed as ever, whatever objects a user has.
    own = set(map(catalog.class_of, items))
    classes = [name for name in (BENCHMARK if split_of(task.id) else known).graspables if name not in own]
    placed = len(items) - len(task.moves)
    limited = _is_limited(task)
    for item in rng.permutation([_one_of(known, name, rng) for name in classes]).tolist():
        order = [
            name for name in rng.permutation(receptacles)[:6].tolist()
            if may_stand(known, catalog.class_of(item), catalog.class_of(name))
        ]  # fmt: skip
        if limited:
            placed += put_at_own_place(world, space, item)
        else:
            placed += any(put_somewhere(world, space, item, receptacle, rng) for receptacle in order)
        if placed == DISTRACTORS:
            return
    _clear(world, items, targets)


def _one_of(known: Catalog, class_name: str, rng: np.random.Generator) -> str:
    """Return the name of the object of a class, or of any of several."""
    names = [name for name, _ in known.graspables[class_name].objects]
    return names[0] if len(names) == 1 else names[int(rng.integers(len(names)))]


def _clear(world: World, items: list[str], targets: set[str]) -> None:
    """Take every second object, and all on the targets, out of a home that is full: X is to find a place on Y."""
    objects = world.state.objects
    others = [name for name, on in objects.supports.items() if name not in items and on.receptacle not in targets]
    names = [*items, *others[::2]]
    supports = {name: objects.supports[name] for name in names if name in objects.supports}
    world.arrange(Objects({name: objects.poses[name] for name in names}, supports))


def _states(home: Home, objects: list[str], rng: np.random.Generator) -> tuple[str, ...]:
    """Return the symbolic state of every static thing, then of every object, drawn from those of its class."""
    classes = [*(thing.class_name for thing in home.things), *map(catalog.class_of, objects)]
    choices = [_choices(home.catalog, class_name) for class_name in classes]
    numbers = rng.integers([len(states) for states in choices]).tolist()
    return tuple(states[number] for states, number in zip(choices, numbers, strict=True))


def _choices(known: Catalog, class_name: str) -> tuple[str, ...]:
    row = known.classes.get(class_name)
    return ("fixed",) if row is None else row.states
