"""How deep robots' arms reach into furniture while they are driven: ``python -m benchmarks.collisions --episodes 200``.

The planner plays tasks of all homes with ``execution="simulated"``. At every snapshot (30 Hz) PyBullet's closest points
tell how deep the arm, the hand or what it carries stands in the home or in an object. What is picked or placed does not
count, and neither do fingers near it. The JSON file keeps every episode, so that an interrupted run goes on.
"""

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.files import write_atomically
from chmarl_pb.homes.home import home_names
from chmarl_pb.navigation.free_space import grip_point
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.robots.arm import JOINTS
from chmarl_pb.robots.execution import TICKS_PER_FRAME, Snapshot
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import TIME_STEP, World
from chmarl_pb.world.bullet import pybullet

PHASES = ("drive", "reach", "lift", "place", "withdraw")
LIMIT = 0.005  # metres that count as a penetration
SPLITS = ("train", "val-seen", "val-unseen", "test-seen", "test-unseen")
_ARM = ("shoulder", "upper_arm", "forearm", "wrist", "hand", "left_finger", "right_finger")
_FINGERS = ("left_finger", "right_finger")
_NEAR = 0.12  # metres between fingertips and object
_STILL = 1e-4  # metres a frame below which a base or an object has not moved


@dataclass
class Depths:
    """The deepest penetration of each phase of one motion, metres, and between which bodies it was."""

    deepest: dict[str, float] = field(default_factory=dict)
    where: dict[str, str] = field(default_factory=dict)

    def note(self, phase: str, depth: float, where: str) -> None:
        """Note a depth if it is the phase's greatest."""
        if depth >= self.deepest.setdefault(phase, 0.0):
            self.deepest[phase], self.where[phase] = depth, where


class Probe:
    """A second client with the bodies of a home, in which snapshots are looked at."""

    def __init__(self, env: HouseholdEnv, robot: str):
        """Load the home and a robot of an environment."""
        self.world, self.robot, self.client = World(env.world.home), robot, -1
        self.client, physics = self.world.client, self.world.physics
        self.body = env.simulation.models[robot].load(self.client)
        physics.robots[robot] = type(env.world.physics.robots[robot])(
            self.body, env.world.physics.robots[robot].joints, env.world.physics.robots[robot].grasp_link
        )
        infos = [pybullet.getJointInfo(self.body, i, physicsClientId=self.client) for i in range(self._count())]
        self.arm = {info[12].decode(): info[0] for info in infos if info[12].decode() in _ARM}
        self.parts = {number: name for name, number in physics.links.items()}

    def _count(self) -> int:
        return int(pybullet.getNumJoints(self.body, physicsClientId=self.client))

    def depths(self, env: HouseholdEnv, before: dict[str, Any], item: str | None, carrying: bool) -> Depths:
        """Return how deep the last motion of an environment went."""
        physics, found = self.world.physics, Depths()
        for name in physics.objects:
            physics.move_object(name, before["objects"].get(name))
        for phase, snapshot in phases(env.snapshots, self.robot, item, carrying):
            held = item if phase in ("lift", "place") or (carrying and phase == "drive") else None
            self._show(snapshot)
            for depth, where in self._touched(item, held):
                found.note(phase, depth, where)
            found.deepest.setdefault(phase, 0.0)
        return found

    def _show(self, snapshot: Snapshot) -> None:
        physics = self.world.physics
        physics.move_robot(self.robot, snapshot.bases[self.robot])
        physics.set_joints(self.robot, snapshot.joints[self.robot])
        for name, pose in snapshot.items.items():
            physics.move_object(name, pose)

    def _touched(self, item: str | None, held: str | None) -> Iterator[tuple[float, str]]:
        physics = self.world.physics
        skipped = {self.body} | ({physics.objects[item].body} if item else set())
        near = item is not None and self._gap(item) < _NEAR
        for name, link in self.arm.items():
            if name in _FINGERS and near:
                continue
            for depth, other in self._depth(self.body, link, skipped):
                yield depth, f"{name} in {other}"
        if held is not None:
            body = physics.objects[held].body
            for depth, other in self._depth(body, -1, skipped):
                yield depth, f"object in {other}"

    def _gap(self, item: str) -> float:
        """Return the distance of the fingertips from where an object is gripped, metres."""
        physics = self.world.physics
        (x, y, z), _ = physics.read_object(item)
        grip = grip_point((x, y, z), physics.objects[item].size)
        return float(np.linalg.norm(np.subtract(physics.grasp_pose(self.robot)[0], grip)))

    def _depth(self, body: int, link: int, skipped: set[int]) -> Iterator[tuple[float, str]]:
        low, high = pybullet.getAABB(body, link, physicsClientId=self.client)
        pairs = pybullet.getOverlappingObjects(low, high, physicsClientId=self.client) or ()
        for other, part in sorted(set(pairs)):
            if other in skipped:
                continue
            name = self.parts.get(part, "?") if other == self.world.physics.home else "an object"
            for point in pybullet.getClosestPoints(
                body, other, 0.0, link, part, physicsClientId=self.client
            ):  # fmt: skip
                yield max(0.0, -point[8]), name


def phases(
    snapshots: tuple[Snapshot, ...], robot: str, item: str | None, carrying: bool
) -> Iterator[tuple[str, Snapshot]]:
    """Yield snapshots with what the robot does in them, told by what moves."""
    last = len(snapshots) - 1
    base = [snapshot.bases[robot] for snapshot in snapshots]
    driven = max((i for i in range(last + 1) if _differ(base[i], base[-1])), default=-1)
    moved = [i for i in range(last) if item and _differ(snapshots[i].items[item], snapshots[i + 1].items[item])]
    first, final = (moved[0], moved[-1]) if moved else (last + 1, last + 1)
    for i, snapshot in enumerate(snapshots):
        if i <= driven:
            yield "drive", snapshot
        elif carrying:
            yield ("place" if i <= final else "withdraw") if item and moved and final > driven else "drive", snapshot
        else:
            yield ("reach" if i <= first else "lift") if item else "drive", snapshot


def _differ(one: Any, other: Any) -> bool:
    return any(abs(a - b) > _STILL for a, b in zip((*one[0], *one[1]), (*other[0], *other[1]), strict=True))


def play(env: HouseholdEnv, probe: Probe, task: Task) -> dict[str, Any]:
    """Play an episode of the planner and return what is kept of it."""
    policy, motions, seconds, moved = make_policy("planner", env), [], 0.0, 0.0
    observations, infos = env.reset(options={"task": task})
    policy.reset(0)
    while env.agents:
        actions = policy.act(observations, infos)
        before = {"objects": dict(env.world.state.objects.poses), "held": env.world.held}
        start = time.process_time()
        observations, _, _, _, infos = env.step(actions)
        seconds += time.process_time() - start
        moved += len(env.snapshots) * TICKS_PER_FRAME * TIME_STEP
        item = next(iter(env.snapshots[0].items), None) if env.snapshots else None
        found = probe.depths(env, before, item, before["held"] is not None)
        action = env.action_names[probe.robot][actions[probe.robot]]
        motions.append(
            {"action": action, "depths": found.deepest, "where": found.where, "counted": _counted(env)}
        )  # fmt: skip
    return {
        "home": task.home, "success": env.outcome.success, "seconds": seconds, "moved": moved, "motions": motions,
    }  # fmt: skip


def _counted(env: HouseholdEnv) -> float:
    return max((snapshot.depths["humanoid"] for snapshot in env.snapshots), default=0.0)


def chosen(episodes: int, homes: list[str]) -> list[Task]:
    """Return tasks that are spread evenly over splits and homes."""
    tasks: list[Task] = []
    for home in homes:
        own = [task for split in SPLITS for task in load_tasks(split) if task.home == home]
        count = -(-episodes // len(homes))
        tasks += own[:: max(1, len(own) // count)][:count]
    return tasks


def table(kept: dict[str, Any]) -> Table:
    """Return the share of motions that go deeper than the limit, by home and phase."""
    shown = Table("home", "episodes", "solved", *PHASES, "deepest mm", "motions", "times real time")
    homes = sorted({episode["home"] for episode in kept.values()})
    for home in [*homes, "all"]:
        rows = [episode for episode in kept.values() if home in (episode["home"], "all")]
        motions = [motion for episode in rows for motion in episode["motions"]]
        cells = []
        for phase in PHASES:
            depths = [motion["depths"][phase] for motion in motions if phase in motion["depths"]]
            cells.append(f"{sum(depth > LIMIT for depth in depths)} of {len(depths)}")
        worst = [max(motion["depths"].values(), default=0.0) for motion in motions]
        speed = sum(row["moved"] for row in rows) / max(1e-9, sum(row["seconds"] for row in rows))
        shown.add_row(
            home, str(len(rows)), str(sum(row["success"] for row in rows)), *cells, f"{1000 * max(worst):.0f}",
            f"{sum(depth > LIMIT for depth in worst)} of {len(worst)}", f"{speed:.1f}",
        )  # fmt: skip
    return shown


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=70)
    parser.add_argument("--home", action="append", help="a home of the benchmark; may be given several times")
    parser.add_argument("--json", type=Path, default=Path("out/collisions.json"))
    options = parser.parse_args()
    kept: dict[str, Any] = json.loads(options.json.read_text()) if options.json.exists() else {}
    env, probe = None, None
    for task in chosen(options.episodes, options.home or home_names()):
        if task.id in kept:
            continue
        if env is None or probe is None or env.world.home.name != task.home:
            env = HouseholdEnv(home=task.home, execution="simulated")
            env.reset(options={"task": task})
            probe = Probe(env, "humanoid")
        kept[task.id] = play(env, probe, task)
        options.json.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(options.json, json.dumps(kept))
    Console(width=160).print(table(kept))


if __name__ == "__main__":
    assert len(JOINTS) > 0
    main()
