"""Whether anything grows or is left behind in long use: ``python -m benchmarks.soak``, ``--steps N`` or ``--hours H``.

Rounds of everything that users do in one process: random play in environments that stay (graphs, pictures, both tracks,
homes that change), in a vector with a worker that stays, and in environments and vectors that are made and closed in
every round. After each round memory, file handles, threads, child processes, shared memory and PyBullet clients are
counted. One line of the JSON file is a round. The tasks of the environments that stay are few, and 16 MB of views are
kept in place of 384 (``CHMARL_VIEW_MEMORY``), so that all that is kept to a bound is there after the warm-up, and what
grows then grows for ever. Memory is anonymous memory of this process and its children: files that
are mapped are given back by the system. Linux alone tells all this.
"""

import argparse
import gc
import json
import os
import re
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import MultiDiscrete

import chmarl_pb
from chmarl_pb.files import append_line
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.world.bullet import pybullet

WARM_UP = 0.25  # share of the joint steps after which growth is counted
MOST_GROWTH = 0.02  # of the memory, over a million joint steps
_SEEDED = 0.05  # of the resets; in the stream of generated homes each leads into a new home
_MB = 1024  # kilobytes in it
_VIEWS = "16"  # MB of them that are kept
_CLIENTS = 1024  # PyBullet has no more


@dataclass(frozen=True)
class Round:
    """What was counted after a round.

    Attributes:
        steps: joint steps so far.
        seconds: since the start.
        mb: anonymous memory of this process and its children.
        handles: open files, sockets and pipes.
        threads: of this process.
        children: processes that it has started and that still run.
        shared: blocks of shared memory on this machine.
        clients: PyBullet clients that are connected.
        objects: that Python's collector of garbage knows.
    """

    steps: int
    seconds: float
    mb: float
    handles: int
    threads: int
    children: int
    shared: int
    clients: int
    objects: int


class Soak:
    """Environments that stay, and rounds of play in them and in others."""

    def __init__(self, steps: int):
        """Make the environments that stay.

        Args:
            steps: joint steps of a round in each of them.
        """
        self.steps = steps
        self._rng = np.random.default_rng(0)
        make = chmarl_pb.parallel_env
        self._envs = [
            make(split="val-seen"),
            make(observation="visual", split="val-seen"),
            make(split="generated"),
            make(track="grounded", split="generated"),
        ]
        self._vector = chmarl_pb.vector_env(4, workers=2, split="val-seen")
        self._fresh: tuple[Callable[[], Any], ...] = (
            partial(make, split="val-unseen"),
            partial(make, observation=("depth", "text"), split="val-unseen"),
            partial(make, execution="simulated", split="val-unseen"),
        )
        self._vector.reset(seed=0)

    def play(self) -> int:
        """Play a round, and return how many joint steps that were."""
        for env in self._envs:
            self._play(env, self.steps)
        count = self._play_vector(self._vector, self.steps)
        for make in self._fresh:
            env = make()
            self._play(env, 40)
            env.close()
        envs = chmarl_pb.vector_env(2, workers=2, split="val-unseen")
        envs.reset(seed=1)
        count += self._play_vector(envs, 20)
        envs.close()
        return len(self._envs) * self.steps + count + 40 * len(self._fresh)

    def close(self) -> None:
        """Close all environments."""
        for env in self._envs:
            env.close()
        self._vector.close()

    def _play(self, env: Any, steps: int) -> None:
        policy = make_policy("random", env)
        policy.reset(int(self._rng.integers(2**31)))
        for _ in range(steps):
            if not env.agents:
                seeded = self._rng.random() < _SEEDED
                env.reset(seed=int(self._rng.integers(2**31)) if seeded else None)
            env.step(policy.act({robot: {} for robot in env.agents}, {}))

    def _play_vector(self, envs: Any, steps: int) -> int:
        space = envs.single_action_space
        assert isinstance(space, MultiDiscrete)
        for _ in range(steps // envs.num_envs):
            envs.step(self._rng.integers(space.nvec, size=(envs.num_envs, len(space.nvec))))
        return steps // int(envs.num_envs) * int(envs.num_envs)


def count(steps: int, seconds: float) -> Round:
    """Count what this process has now."""
    gc.collect()
    children = _children(os.getpid())
    return Round(
        steps,
        round(seconds, 1),
        round(sum(_anonymous(process) for process in (os.getpid(), *children)) / _MB, 1),
        len(os.listdir("/proc/self/fd")),
        threading.active_count(),
        len(children),
        len(os.listdir("/dev/shm")),
        sum(pybullet.isConnected(client) for client in range(_CLIENTS)),
        len(gc.get_objects()),
    )


def _children(process: int) -> list[int]:
    """Return the processes that a process has started, directly or not."""
    found = []
    for task in Path(f"/proc/{process}/task").iterdir():
        for child in (task / "children").read_text().split():
            found += [int(child), *_children(int(child))]
    return found


def _anonymous(process: int) -> int:
    """Return the anonymous memory of a process in kilobytes."""
    found = re.search(r"^RssAnon:\s+(\d+)", Path(f"/proc/{process}/status").read_text(), re.MULTILINE)
    return int(found[1]) if found else 0


def growth(rounds: Sequence[Round]) -> float:
    """Return the share by which memory grows in a million joint steps, by a line through the rounds after warm-up."""
    late = [one for one in rounds if one.steps >= WARM_UP * rounds[-1].steps]
    if len(late) < 2:
        return 0.0
    slope, _ = np.polyfit([one.steps / 1e6 for one in late], [one.mb for one in late], 1)
    return float(slope / late[0].mb)


def left_behind(rounds: Sequence[Round]) -> list[str]:
    """Return what there is more of after the last round than after that in which the warm-up ended."""
    first = next(one for one in rounds if one.steps >= WARM_UP * rounds[-1].steps)
    before, after = asdict(first), asdict(rounds[-1])
    names = ("handles", "threads", "children", "shared", "clients")
    return [f"{name}: {before[name]} -> {after[name]}" for name in names if after[name] > before[name]]


def main() -> int:
    """Play rounds, print and write what was counted, and return 1 if something grew."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=__doc__)
    parser.add_argument("--steps", type=int, default=2_000_000, help="joint steps in all (default: 2,000,000)")
    parser.add_argument("--hours", type=float, help="play so long instead")
    parser.add_argument(
        "--round", type=int, default=2_000, help="joint steps of a round in each environment that stays"
    )
    parser.add_argument("--json", type=Path, default=Path("out/soak.jsonl"))
    options = parser.parse_args()
    if options.steps < 1 or options.round < 1 or (options.hours is not None and options.hours <= 0):
        parser.error("--steps, --round and --hours: use more than 0")
    if options.json.is_dir():
        parser.error(f"--json {options.json}: is a folder; name a file")
    rows = options.json.with_name(f"{options.json.name}.partial")  # what is there stays until all is played
    rows.unlink(missing_ok=True)
    os.environ.setdefault("CHMARL_VIEW_MEMORY", _VIEWS)
    start, steps, rounds = time.monotonic(), 0, list[Round]()
    soak = Soak(options.round)
    try:
        while (time.monotonic() - start < 3600 * options.hours) if options.hours else (steps < options.steps):
            steps += soak.play()
            rounds.append(count(steps, time.monotonic() - start))
            append_line(rows, json.dumps(asdict(rounds[-1])))
            print(rounds[-1], flush=True)
    finally:
        soak.close()
    rows.replace(options.json)
    grown, left = growth(rounds), left_behind(rounds)
    print(
        f"after warm-up memory grew by {100 * grown:+.2f} % in a million joint steps; left behind: {left or 'nothing'}"
    )
    return int(grown > MOST_GROWTH or bool(left))


if __name__ == "__main__":
    raise SystemExit(main())
