"""Measure the statistics of the belief search: ``python -m tools.build_belief``.

They are of the homes of training, 1 to 5, and of generated homes, which are in no split: from each room's anchor, and
from above, which receptacles and which objects are in view. Objects lie where tasks with fixed seeds put them.
"""

import argparse
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from chmarl_pb import catalog
from chmarl_pb.errors import TaskError
from chmarl_pb.files import write_atomically
from chmarl_pb.navigation.lattice import HEADINGS, DroneLattice
from chmarl_pb.policies.belief.statistics import FILE, FLIGHT_NUMBERS
from chmarl_pb.robots.robot import Robot
from chmarl_pb.tasks.generated_homes import fits
from chmarl_pb.tasks.sampling import sample_task
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import homes_of

_SEEDS = filter(fits, range(50_000, 60_000))  # of generated homes with the rooms of the benchmark's

#: Homes that are measured -> layouts of objects in each.
HOMES = {
    **dict.fromkeys(homes_of("train"), 20),
    **{f"generated-{seed}": 5 for seed in islice(_SEEDS, 120)},
}

Masks = dict[tuple[str, str], int]  # thing and room -> bit for each view at the room's anchor that shows the thing
Room = list[dict[str, Any]]


def measure(home: str, layouts: int) -> dict[str, Room]:
    """Return room -> its receptacles: how probable a thing is there, and which views show them and objects."""
    simulation, rng = Simulation(home), np.random.default_rng(0)
    try:
        objects: dict[str, Counter[tuple[int, int]]] = defaultdict(Counter)
        for _ in range(layouts):
            _lay_out(simulation, home, rng)
            near, above = _masks(simulation, False), _masks(simulation, True)
            for name, support in simulation.world.supports.items():
                key = name, catalog.room_of(support.receptacle)
                objects[support.receptacle][near.get(key, 0), above.get(key, 0)] += 1
        return _rooms(simulation, objects, near, above)
    finally:
        simulation.close()


def _lay_out(simulation: Simulation, home: str, rng: np.random.Generator) -> None:
    """Lay out the next task that the home can hold."""
    while True:
        try:
            simulation.begin(sample_task(simulation.space, home, rng))
            return
        except TaskError:
            continue


def _masks(simulation: Simulation, flies: bool) -> Masks:
    """Return from where a robot that drives, or flies, at each room's anchor sees what."""
    name, robot = next((name, robot) for name, robot in simulation.robots.items() if robot.model.flies == flies)
    masks: Masks = defaultdict(int)
    for room in simulation.rooms:
        for bit, pose in _poses(robot, room):
            for thing in simulation.oracle.seen_from(name, pose):
                masks[thing, room] |= 1 << bit
    return masks


def _poses(robot: Robot, room: str) -> Iterator[tuple[int, int]]:
    """Yield the number and the pose of each view at a room's anchor."""
    lattice = robot.lattice
    anchor = lattice.anchors[room]
    if not isinstance(lattice, DroneLattice):
        cell, heading = divmod(anchor, HEADINGS)
        yield from ((turn, cell * HEADINGS + (heading + turn) % HEADINGS) for turn in range(HEADINGS))
        return
    offsets = np.round(lattice.points - lattice.points[anchor]).astype(int)  # moves are of 1 m
    on_way = (np.abs(lattice.points - lattice.points[anchor] - offsets) < 1e-6).all(axis=1)
    for pose in np.flatnonzero(on_way).tolist():
        number = FLIGHT_NUMBERS.get(tuple(offsets[pose].tolist()))
        if number is not None:
            yield number, pose


def _rooms(
    simulation: Simulation, objects: dict[str, Counter[tuple[int, int]]], near: Masks, above: Masks
) -> dict[str, Room]:
    receptacles = simulation.home.receptacles
    counts = Counter(thing.class_name for thing in receptacles.values())
    rooms: dict[str, Room] = defaultdict(list)
    for name, thing in receptacles.items():
        rooms[thing.room].append({
            "class": thing.class_name,
            "weight": round(1 / len(counts) / counts[thing.class_name], 6),
            "near": near.get((name, thing.room), 0),
            "above": above.get((name, thing.room), 0),
            "objects": [[*masks, count] for masks, count in sorted(objects[name].items())],
        })  # fmt: skip
    return dict(rooms)


def text_of(homes: Sequence[dict[str, Room]]) -> str:
    """Return the text of the file: one line for each receptacle."""
    return json.dumps(homes, separators=(",", ":")).replace('{"class"', '\n{"class"') + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the statistics."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=FILE, metavar="FILE.json", help="default: %(default)s")
    options = parser.parse_args(arguments)
    homes = [measure(home, layouts) for home, layouts in track(HOMES.items(), "homes")]
    write_atomically(options.out, text_of(homes))
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
