"""Carry out decided motions: set their result at once, or drive through them at 240 Hz first.

Both executions carry out the same decisions and end in the same state, bit by bit: a driven motion is a rehearsal
in physics alone, of which the state knows nothing; its result is then set as in the instant execution. This removes
the millimetres by which motors miss. If they miss by more than ``TOLERANCE``, the action fails.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from chmarl_pb.robots.asked import driven, finished
from chmarl_pb.robots.driven_arm import MissedError
from chmarl_pb.robots.motion import Motion, Tick
from chmarl_pb.robots.robot import Robot, taken_cells
from chmarl_pb.world import Pose, World

TICKS_PER_FRAME = 8  # 30 snapshots a second
DEEP = 0.005  # metres of depth from which on a motion counts as a collision
_STILL = Tick(by_motors=False)


@dataclass(frozen=True)
class Snapshot:
    """The bodies that move, at one moment.

    Attributes:
        bases: robot -> pose of its base.
        joints: robot -> positions of its movable joints.
        items: object -> its pose, for those that are picked, carried or placed.
        depths: robot -> how deep its arm, or what it holds, stands in something until the next snapshot, metres.
    """

    bases: dict[str, Pose]
    joints: dict[str, tuple[float, ...]]
    items: dict[str, Pose]
    depths: dict[str, float]


def execute(
    world: World, robots: Mapping[str, Robot], motions: dict[str, Motion | None], simulated: bool
) -> tuple[dict[str, bool], tuple[Snapshot, ...]]:
    """Carry out one motion of each robot, one robot after the other.

    Args:
        world: the world that they are in.
        robots: all of its robots.
        motions: robot -> its motion; None fails.
        simulated: drive through the motions at 240 Hz before setting their result.

    Returns:
        Robot -> whether its action succeeded, and snapshots of the driven motion at 30 Hz.
    """
    decided = {name: motion for name, motion in motions.items() if motion is not None}
    missed, snapshots = _rehearse(world, robots, decided) if simulated else (set(), ())
    succeeded = dict.fromkeys(motions, False)
    for name, motion in decided.items():
        robot = robots[name]
        free = not robot.neighbours or robot.lattice.cell(motion.pose) not in taken_cells(robot)
        succeeded[name] = free and name not in missed and finished(robot, motion)
    return succeeded, snapshots


def collisions(snapshots: Sequence[Snapshot]) -> int:
    """Return how many robots' driven motions pass through something, as where no free way was found for them."""
    return len({name for snapshot in snapshots for name, depth in snapshot.depths.items() if depth > DEEP})


def _rehearse(
    world: World, robots: Mapping[str, Robot], motions: dict[str, Motion]
) -> tuple[set[str], tuple[Snapshot, ...]]:
    """Drive all robots through their motions together, in physics alone.

    Returns:
        Names of the robots that missed, and snapshots.
    """
    items = (*world.state.held, *(motion.pick for motion in motions.values() if motion.pick))
    world.sync()
    for robot in robots.values():
        robot.get_ready()
    for held in world.state.held:
        world.physics.thaw(held, solid=False)
    running = {name: driven(robots[name], motion) for name, motion in motions.items()}
    missed: set[str] = set()
    snapshots: list[Snapshot] = []
    count = 0
    try:
        while running:
            ticks = {name: _advance(running, name, missed) for name in list(running)}
            if count % TICKS_PER_FRAME == 0:
                snapshots.append(_snapshot(world, items, dict.fromkeys(robots, 0.0)))
            deepest = snapshots[-1].depths
            deepest.update((name, tick.depth) for name, tick in ticks.items() if tick.depth > deepest[name])
            if any(tick.by_motors for tick in ticks.values()):
                world.physics.step()
            count += 1
    finally:
        for item in items:
            world.physics.freeze(item)
        world.moved()
    return missed, tuple(snapshots)


def _advance(running: dict[str, Iterator[Tick | None]], name: str, missed: set[str]) -> Tick:
    """Command one robot for the next step; it no longer runs if its motion has ended."""
    try:
        return next(running[name]) or Tick()
    except MissedError:
        missed.add(name)
    except StopIteration:
        pass
    del running[name]
    return _STILL


def _snapshot(world: World, items: tuple[str, ...], depths: dict[str, float]) -> Snapshot:
    physics = world.physics
    bases = {name: physics.read_base(name) for name in physics.robots}
    joints = {name: physics.read_joints(name) for name in physics.robots}
    return Snapshot(bases, joints, {item: physics.read_object(item) for item in items}, depths)
