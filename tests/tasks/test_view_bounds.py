"""What is ruled out before a picture is drawn is never seen: refusals are always right."""

import numpy as np

from chmarl_pb.rendering.fast import FastRenderer
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task


def test_what_is_seen_was_not_ruled_out(simulation: Simulation, tasks: list[Task]) -> None:
    rng = np.random.default_rng(0)
    task = next(task for task in load_tasks("train") + tasks if task.home == simulation.home.name)
    simulation.begin(task)
    world, renderer, oracle = simulation.world, simulation.renderer, simulation.oracle
    assert isinstance(renderer, FastRenderer)
    robot, ruled_out = oracle.robot, 0
    for pose in rng.integers(robot.lattice.count, size=80).tolist():
        robot.spawn(pose)
        seen = renderer.visible(robot.name)
        for item in world.objects:
            may = oracle.outlook.may_see(np.array([pose]), oracle.ball(item)[None])[0]
            could = renderer.could_see(robot.name, item)
            assert item not in seen or (may and could)
            ruled_out += not could
    assert ruled_out > 100
