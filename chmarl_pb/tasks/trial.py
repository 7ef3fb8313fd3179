"""A trial of a home: do objects stand where its shape says, does the drone see the floor, can tasks be solved?

What the check of geometry (:mod:`chmarl_pb.navigation.check`) takes for good is tried with physics, cameras and the
planner, on a few tasks with fixed seeds.
"""

from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from chmarl_pb.errors import TaskError
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.problem import Findings, Problem
from chmarl_pb.navigation.free_space import grip_point
from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.rendering.camera import camera_of
from chmarl_pb.rendering.home_views import home_views
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.tasks.order import plan_all
from chmarl_pb.tasks.planner import HiddenError
from chmarl_pb.tasks.setting import DISTRACTORS, receptacles_of
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import yaw_quaternion

_PROBES = ("mug_1", "wine_bottle_1", "plate_1")  # objects that are set down: small, tall, wide
_SET_DOWNS = 2  # of each on a receptacle
_OFF = 0.01  # metres that a top may lie lower than its shape says
_LOW = 1.9  # metres: what a drone sees below this is floor or furniture
_OPEN = 0.25  # of a drone's pictures over a room that have to show such
_VIEWS = 12  # pictures of a room
_NEAR, _GLANCES = 600, 24  # poses around a receptacle, and how many of them are tried
_MOST_UNSEEN = 4  # receptacles that are found to be hidden before no others are looked at: each takes 72 views
_TRIES = 6  # tasks of a pair of classes, until one can be solved
_HOPELESS = 3  # pairs, the first ones, of which one has to be solved
_FAILED = 0.1  # of the planned tasks that may fail when they are carried out
_SEED = 2024


def try_home(simulation: Simulation) -> tuple[Problem, ...]:
    """Try a home that the check of geometry has found nothing wrong with, and return what does not work.

    Args:
        simulation: of the home; its world is left without objects.
    """
    home = simulation.home
    found = Findings(home.path)
    found.locate(
        {
            thing.name: (*thing.centre.tolist(), max((s.top for s in thing.solids), default=0.0))
            for thing in home.things
        }.get
    )
    _try_tops(simulation, found)
    for model in simulation.models.values():
        if model.flies:
            _look_down(simulation, model, found)
    if simulation.oracles:
        unseen = (name for name in home.receptacles if not _is_seen(simulation, name))
        for name in islice(unseen, _MOST_UNSEEN):
            found.error(
                f"{simulation.oracle.robot.name} does not see what stands on it, from any of {_GLANCES} poses around "
                "it; take away what hides it, and let <visual> and <collision> agree", name,
            )  # fmt: skip
        if not found.errors:
            _try_tasks(simulation, found)
    simulation.world.clear()
    simulation.world.sync()
    return tuple(found.problems)


def _try_tops(simulation: Simulation, found: Findings) -> None:
    """Feel for every surface from above, and set objects down on it."""
    space, physics = simulation.space, simulation.world.physics
    rng = np.random.default_rng(_SEED)
    lower: dict[str, tuple[float, float]] = {}
    for surface in space.surfaces:
        points = surface.points[surface.free > 0]
        below = surface.height - physics.tops(points, surface.height + 0.06)
        if np.mean(below > _OFF) > 0.1:
            lower[surface.receptacle] = surface.height, float(np.median(below[below > _OFF]))
    for name in space.home.receptacles:
        if name in lower:
            height, depth = lower[name]
            found.error(
                f"a ray from above finds nothing at its top at {height:.2f} m, but {depth:.2f} m below; give it "
                "collision shapes that are convex; build it of boxes", name,
            )  # fmt: skip
            continue
        results = [_set_down(simulation, name, item, rng) for item in _PROBES for _ in range(_SET_DOWNS)]
        tried = [result for result in results if result is not None]
        fell = tried.count(False)
        if 3 * fell > len(tried):
            found.error(
                f"{fell} of {len(tried)} objects that were set down on it did not come to rest there; "
                "give it a level top, and nothing that juts into the free height over it", name,
            )  # fmt: skip
        elif not tried:
            found.warning("it is too small for a mug, a bottle and a plate; enlarge its top", name)


def _set_down(simulation: Simulation, receptacle: str, item: str, rng: np.random.Generator) -> bool | None:
    """Return whether an object rests on a free place within reach; None if there is no such place."""
    world, space = simulation.world, simulation.space
    size = world.size(item)
    places = space.places(receptacle, size)
    for x, y, z, yaw in places[rng.permutation(len(places))[:20]].tolist():
        if space.stand(grip_point((x, y, z), size)) is not None:
            world.clear()
            world.sync()
            settled = world.physics.set_down(item, (x, y, z), yaw, receptacle)
            world.physics.move_object(item, None)
            return settled is not None
    return None


def _look_down(simulation: Simulation, model: RobotModel, found: Findings) -> None:
    """Look at every room from above: floor and furniture have to be seen."""
    home, space = simulation.home, simulation.space
    views, lattice = home_views(home), model.lattice(space)
    axis = np.arange(VISIBILITY_SIZE) - (VISIBILITY_SIZE - 1) / 2
    middle = np.hypot(axis[:, None], axis) < VISIBILITY_SIZE / 4  # what lies below, not what is beside
    links = list(simulation.world.links)
    for number, (name, room) in enumerate(home.rooms.items()):
        own = np.flatnonzero(np.asarray([lattice.rooms[lattice.cell(pose)] for pose in range(lattice.count)]) == number)
        low, hiding = 0, np.zeros(len(links), dtype=np.int64)
        for pose in own[:: max(1, len(own) // _VIEWS)].tolist():
            picture = views.look(model, pose, VISIBILITY_SIZE).picture
            height = model.eye(space, pose)[0][2] - camera_of(model).distance(picture.depth)
            shown = middle & (picture.segmentation >= 0)
            low += int(np.count_nonzero(shown & (height <= _LOW)))
            hiding += np.bincount(picture.segmentation[shown & (height > _LOW)], minlength=len(hiding))
        share = low / max(1, low + int(hiding.sum()))
        if len(own) and share < _OPEN:
            link = links[int(hiding.argmax())]
            found.error(
                f"it hides the {name} from the {model.name}, which looks down from {model.altitude:.1f} m: only "
                f"{100 * share:.0f} % of what it sees there lies below {_LOW} m; remove ceilings and "
                "roofs", link, (*room.centre.tolist(), _LOW),
            )  # fmt: skip


def _is_seen(simulation: Simulation, receptacle: str) -> bool:
    """Return whether a mug on a receptacle is seen from a pose near it, each tried farther than the one before."""
    world, space, oracle = simulation.world, simulation.space, simulation.oracle
    item, robot = _PROBES[0], oracle.robot
    places = space.places(receptacle, world.size(item))
    for x, y, z, yaw in places[:: max(1, len(places) // 3)].tolist():
        world.clear()
        world.place(item, (x, y, z), yaw_quaternion(yaw), receptacle)
        ball = np.array([[*oracle.ball(item)[:3], 0.05]])
        poses = np.flatnonzero(oracle.outlook.may_see(np.arange(robot.lattice.count), ball))
        away = np.hypot(*(robot.lattice.points[poses // HEADINGS] - (x, y)).T)
        near = poses[np.argsort(away, kind="stable")][:_NEAR]
        for pose in near[:: max(1, len(near) // _GLANCES)].tolist():
            robot.spawn(pose)
            if item in simulation.renderer.visible(robot.name):
                return True
    return False


def _try_tasks(simulation: Simulation, found: Findings) -> None:
    """Solve and carry out tasks between the classes of receptacles, each the source of some and the target of some."""
    home = simulation.home
    classes = sorted({thing.class_name for thing in home.receptacles.values()})
    rng = np.random.default_rng(_SEED)
    trials: list[_Trial] = []
    for pair in _pairs(classes):
        try:
            trials.append(_try_pair(simulation, *pair, rng))
        except HiddenError as error:  # other tasks would take as long, and so would resets
            found.error(str(error))
            return
        if len(trials) >= _HOPELESS and not any(trial.objects for trial in trials):
            break
    solved = [trial for trial in trials if trial.objects]
    failed = [trial for trial in solved if trial.reason]
    if not solved:
        found.error(f"no task can be solved: {_reason(trials)}; make room on receptacles and before them")
    if solved:
        _warn_of_classes(home, classes, trials, found)
    if len(failed) > _FAILED * len(solved):
        found.error(
            f"{len(failed)} of {len(solved)} tasks fail when they are carried out as planned: {_reason(failed)}; make "
            "collision shapes as what is seen", receptacles_of(home, failed[-1].target)[0],
        )  # fmt: skip
    fewest = min((trial.objects - 1 for trial in solved), default=DISTRACTORS)
    if fewest < DISTRACTORS:
        found.warning(f"at times it has room for only {fewest} of {DISTRACTORS} other objects; enlarge tops")


class _Trial(NamedTuple):
    """How tasks from one class of receptacles to another went.

    Attributes:
        source: class.
        target: class.
        objects: number of objects in the task that could be solved; 0 if none could.
        reason: why the last task could not be solved or carried out; empty if one was.
    """

    source: str
    target: str
    objects: int
    reason: str


def _warn_of_classes(home: Home, classes: list[str], trials: list[_Trial], found: Findings) -> None:
    """Add a warning for each class from which, or to which, no task could be solved."""
    for name in classes:
        ways = {
            "from": [trial for trial in trials if trial.source == name],
            "to": [trial for trial in trials if trial.target == name],
        }
        hopeless = {way: own for way, own in ways.items() if own and not any(trial.objects for trial in own)}
        if hopeless:
            found.warning(
                f"no task {' or '.join(hopeless)} a {name} could be solved: {_reason(*hopeless.values())}; make room "
                "on it and before it, and let cameras see it", receptacles_of(home, name)[0],
            )  # fmt: skip


def _reason(*trials: list[_Trial]) -> str:
    reasons = [trial.reason for each in trials for trial in each if trial.reason]
    return reasons[-1].replace(";", ",") if reasons else "there are too few classes"


def _try_pair(simulation: Simulation, source: str, target: str, rng: np.random.Generator) -> _Trial:
    """Draw tasks until the planner solves one, and let the first robot that can grasp act as planned, with physics."""
    home, oracle, reason = simulation.home, simulation.oracle, ""
    for number in range(_TRIES):
        item = str(rng.choice(list(home.catalog.graspables)))
        task = Task(f"trial of {home.name}", str(home.path), item, source, target, _SEED + number)
        try:
            goals = simulation.begin(task).goals
            objects, actions = len(simulation.world.objects), plan_all(oracle, goals).actions
        except HiddenError:
            raise
        except TaskError as error:
            reason = str(error)
            continue
        try:
            with oracle.acting(actions, goals[0]):
                return _Trial(source, target, objects, "")
        except TaskError as error:
            return _Trial(source, target, objects, str(error))
    return _Trial(source, target, 0, reason)


def _pairs(classes: list[str]) -> Iterator[tuple[str, str]]:
    """Yield pairs of classes in which each is first twice and second twice; of few classes, all pairs."""
    count = len(classes)
    for step in range(1, count if count <= 4 else 3):
        for number, name in enumerate(classes):
            yield name, classes[(number + step) % count]
