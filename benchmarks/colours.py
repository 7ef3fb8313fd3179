"""How well the colours of lookalikes are told apart in pictures: ``python -m benchmarks.colours``.

Tasks are laid out among lookalikes, and both robots look from random poses. Of each object in view (4 pixels or more)
the mean colour is taken, and its name is that of the nearest of the named colours in CIE Lab, lightness counted half as
much as hue, because sides of an object are lit differently.
"""

import argparse
from collections.abc import Iterator
from contextlib import closing

import numpy as np
from numpy.typing import NDArray

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.catalog import COLOURS
from chmarl_pb.homes.object_looks import RGB
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS

_POSES = 25  # of each robot in each task
_LIGHTNESS = 0.5
_TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
_WHITE = np.array([0.9505, 1.0, 1.089])


def main() -> None:
    """Print the shares of right names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", type=int, default=40, metavar="N", help="tasks of each split (default: 40)")
    parser.add_argument("--splits", nargs="+", default=["train", "generated-val"], metavar="S")
    options = parser.parse_args()
    palette = _lab(np.array([RGB[name] for name in COLOURS]))
    for split in options.splits:
        rows = list(_objects(split, options.tasks))
        right = {robot: np.array([_judge(*row[1:], palette) for row in rows if row[0] == robot]) for robot in _ROBOTS}
        for robot, shares in right.items():
            all_names, own_names = 100 * shares.mean(axis=0)
            print(f"{split}, {robot}: {len(shares)} objects, {all_names:.1f} % right of {len(COLOURS)} colours, "
                  f"{own_names:.1f} % of the colours that its class has")  # fmt: skip


_ROBOTS = ("humanoid", "drone")


def _objects(split: str, count: int) -> Iterator[tuple[str, NDArray[np.float64], int, list[int]]]:
    """Yield robot, mean colour, id of the colour, and ids of the colours of its class, for objects in view."""
    with closing(chmarl_pb.parallel_env("visual", split=split, lookalikes=True)) as env:
        tasks = chmarl_pb.load_tasks(split)
        for task in tasks[:: max(1, len(tasks) // count)][:count]:
            env.reset(options={"task": task})
            simulation, rng = env.simulation, np.random.default_rng(task.seed)
            for robot in _ROBOTS:
                body = simulation.robots[robot]
                for pose in rng.integers(body.lattice.count, size=_POSES).tolist():
                    body.spawn(pose)
                    picture = simulation.renderer.picture(robot, VISIBILITY_SIZE)
                    for name in env.world.objects:
                        pixels = picture.rgb[picture.segmentation == simulation.renderer.names.index(name)]
                        if len(pixels) >= VISIBLE_PIXELS:
                            looks = simulation.home.catalog.classes[catalog.class_of(name)].looks
                            own = [catalog.COLOUR_IDS[colour] for colour, _ in looks]
                            yield robot, pixels.mean(axis=0) / 255, catalog.colour_of(name), own


def _judge(mean: NDArray[np.float64], colour: int, own: list[int], palette: NDArray[np.float64]) -> tuple[bool, bool]:
    """Return whether a colour is named rightly, of all names and of those of the class."""
    away = ((_lab(mean) - palette) ** 2 * (_LIGHTNESS, 1, 1)).sum(axis=1)
    return bool(away.argmin() + 1 == colour), min(own, key=lambda number: away[number - 1]) == colour


def _lab(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return colours (..., 3) in CIE Lab from sRGB in [0, 1]."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    share = linear @ _TO_XYZ.T / _WHITE
    x, y, z = np.moveaxis(np.where(share > 0.008856, np.cbrt(share), 7.787 * share + 16 / 116), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


if __name__ == "__main__":
    main()
