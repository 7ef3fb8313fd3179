"""Figures that each need a process of their own: ``python -m chmarl_pb.bench.fresh NAME [ARGUMENT ...]``.

Each function here prints one sample, unit -> value, as JSON. Nothing but the standard library is imported
before it is called, so that the time of the first reset holds all imports but that of ``chmarl_pb`` itself.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from itertools import cycle
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.rendering.camera import Picture

SPLIT = "test-unseen"
_IMPORT = """
import time
start = time.perf_counter()
import chmarl_pb
import json, sys
assert "torch" not in sys.modules, "chmarl_pb imports torch"
print(json.dumps({"s": time.perf_counter() - start}))
"""


def samples(name: str, *arguments: object, keep: bool = False) -> Generator[dict[str, float], None, None]:
    """Yield what a function of this module measures, each time in a fresh process.

    Args:
        name: the function's; "importing" measures the import of the package.
        *arguments: for it.
        keep: whether the view store on disk is kept from one sample to the next; if not, it is empty each time.
    """
    script = ["-c", _IMPORT] if name == "importing" else ["-m", __name__, name, *map(str, arguments)]
    with tempfile.TemporaryDirectory() as kept:
        if keep:
            _run(script, kept)
        while True:
            with tempfile.TemporaryDirectory() as empty:
                yield _run(script, kept if keep else empty)


def _run(script: list[str], cache: str) -> dict[str, float]:
    pipe, command, env = subprocess.PIPE, [sys.executable, *script], {**os.environ, "CHMARL_CACHE": cache}
    with subprocess.Popen(command, env=env, stdin=pipe, stdout=pipe, text=True) as process:
        output = process.stdout.read() if process.stdout else ""
    if process.returncode:
        raise RuntimeError(f"`{' '.join([sys.executable, *script])}` failed, see above")
    sample: dict[str, float] = json.loads(output.splitlines()[-1])
    return sample


def first_reset() -> dict[str, float]:
    """Measure the seconds from after the import of the package to after the first reset of a home."""
    import chmarl_pb

    start = time.perf_counter()
    env = chmarl_pb.parallel_env(split=SPLIT)
    env.reset(seed=0)
    taken = time.perf_counter() - start
    env.close()
    return {"s": taken}


def first_visits(size: str, count: str) -> dict[str, float]:
    """Measure views from poses that no camera has been at, beside plain TinyRenderer pictures of the same.

    Args:
        size: width and height of the pictures in pixels.
        count: how many poses of each robot.
    """
    import numpy as np

    from chmarl_pb.envs.parallel import HouseholdEnv

    env = HouseholdEnv("visual", split=SPLIT, image_size=int(size))
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    ours = plain = 0.0
    views = 0
    for name, robot in env.simulation.robots.items():
        for pose in rng.permutation(robot.lattice.count)[: int(count)].tolist():
            robot.spawn(pose)
            start = time.perf_counter()
            env.simulation.renderer.picture(name, int(size))
            middle = time.perf_counter()
            plain_picture(env, name, int(size))
            ours, plain, views = ours + middle - start, plain + time.perf_counter() - middle, views + 1
    env.close()
    return {
        "ms a view": 1000 * ours / views,
        "ms a view, plain TinyRenderer": 1000 * plain / views,
        "times plain TinyRenderer": ours / plain,
    }


def plain_picture(env: "HouseholdEnv", robot: str, size: int) -> "Picture":
    """Draw everything in an environment's world with TinyRenderer, as a robot's camera sees it, and keep nothing."""
    from chmarl_pb.rendering.camera import camera_of, render, view_matrix

    env.world.sync()
    model = env.simulation.models[robot]
    view = view_matrix(model.eye(env.simulation.space, env.world.robots[robot].pose))
    return render(env.world.client, camera_of(model), view, size)


def memory(observation: str, more: str = "5") -> dict[str, float]:
    """Measure the resident memory that an environment adds to a process that has one already; nan off Linux.

    Args:
        observation: "scene_graph" or "visual".
        more: how many are added.
    """
    from chmarl_pb.envs.parallel import HouseholdEnv

    first = HouseholdEnv(observation, split=SPLIT)
    first.reset(seed=0)
    before = _resident()
    others = [HouseholdEnv(observation, split=SPLIT) for _ in range(int(more))]
    for number, env in enumerate(others):
        env.reset(seed=number)
    return {"MB": (_resident() - before) / len(others)}


def _resident() -> float:
    statistics = Path("/proc/self/statm")
    if not statistics.is_file():
        return float("nan")
    return int(statistics.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


def loads(episodes: str) -> dict[str, float]:
    """Count the URDF files that are loaded in episodes after each home of a split has been entered once.

    Args:
        episodes: how many.
    """
    import numpy as np

    from chmarl_pb.bench.playing import play
    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.tasks.splits import homes_of, load_tasks
    from chmarl_pb.world import bullet

    split, load, count = "test-seen", bullet.pybullet.loadURDF, 0

    def counted(*arguments: object, **options: object) -> int:
        nonlocal count
        count += 1
        return int(load(*arguments, **options))

    bullet.pybullet.loadURDF = counted
    env = HouseholdEnv(split=split)
    for home in homes_of(split):
        env.reset(options={"task": next(task for task in load_tasks(split) if task.home == home)})
    needed, rng = count, np.random.default_rng(0)
    for number in range(int(episodes)):
        env.reset(seed=number)
        play(env, rng, 10, cycle(load_tasks(split)))
    env.close()
    return {"files": count - needed}


def new_homes(homes: str, episodes: str) -> dict[str, float]:
    """Measure what new homes cost: generated ones, each with some episodes of a random policy, one after the other.

    Args:
        homes: how many, after one that all is imported and compiled with.
        episodes: in each of them.
    """
    import numpy as np

    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.homes.generate.store import generate_home

    made = entered = played = 0.0
    steps, rng = 0, np.random.default_rng(0)
    for seed in range(int(homes) + 1):
        if seed == 1:
            made = entered = played = 0.0
            steps = 0
        start = time.perf_counter()
        path = generate_home(seed)
        middle = time.perf_counter()
        env = HouseholdEnv(home=path)
        env.reset(seed=seed)
        made, entered = made + middle - start, entered + time.perf_counter() - middle
        for _ in range(int(episodes)):
            env.reset()
            while env.agents:
                env.step({name: int(rng.integers(len(names))) for name, names in env.action_names.items()})
                steps += 1
        env.close()
        played += time.perf_counter() - start
    return {
        "s to make one": made / int(homes),
        "s to its first reset": entered / int(homes),
        "joint steps/s": steps / played,
    }


def _end_with_parent() -> None:
    os.read(0, 1)  # a pipe that nobody writes to: it closes when the parent is gone
    os._exit(1)


if __name__ == "__main__":
    Thread(target=_end_with_parent, daemon=True).start()
    print(json.dumps(globals()[sys.argv[1]](*sys.argv[2:])))
