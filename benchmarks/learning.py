"""Joint steps a second of whole trainings, playing and learning, of QMIX and of PPO.

    python -m benchmarks.learning                                     # QMIX with messages, and PPO for the humanoid
    python -m benchmarks.learning --only qmix --envs 32 --gradient-steps 1 --workers 2 --overlap

QMIX in one process is timed by the processor, all else by the clock. The first rollouts, which load homes and look
where nobody has looked, are not counted. Random play of QMIX's environment tells what no learner passes there in one
process.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import chmarl_pb
from chmarl_pb.learning import Config, train
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.runs.run import Run
from chmarl_pb.limits import whole_number

WARM_UP = 160  # episodes that are not counted
SHORT = 6  # times as long is the training whose speed is taken


class Parts:
    """Time of the parts of a training, after its warm-up.

    Attributes:
        seconds: part -> seconds of each rollout.
        steps: joint steps that were played in each.
        gradients: gradient steps that were taken.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin with none; seconds are those of a clock."""
        self._clock = clock
        self.seconds: dict[str, list[float]] = {"advance": [], "_play": [], "_learn": []}
        self.steps: list[int] = []
        self.gradients = 0

    def timed(self, part: str, inner: Callable[..., None]) -> Callable[..., None]:
        """Return a method of a run that counts."""

        def method(run: Run, *rest: Any) -> None:
            counted = run.episodes >= WARM_UP
            steps, gradients, start = run._clock["steps"], run.learner.updates, self._clock()
            inner(run, *rest)
            if not counted:
                return
            self.seconds[part].append(self._clock() - start)
            if part == "_play":
                self.steps.append(int(run._clock["steps"] - steps))
            if part == "_learn":
                self.gradients += run.learner.updates - gradients

        return method

    def speed(self, part: str, first: int = 0) -> float:
        """Return the joint steps a second of a part, from a rollout on."""
        return sum(self.steps[first:]) / sum(self.seconds[part][first:])


def random_play(make: Callable[[], Any], episodes: int) -> float:
    """Return the joint steps a second of one environment that is played at random, nothing learned, resets included."""
    rng, steps = np.random.default_rng(0), 0
    with closing(make()) as env:
        for episode in range(2 * episodes):  # the first half to warm up
            if episode == episodes:
                start, steps = time.process_time(), 0
            env.reset(seed=episode)
            while env.agents:
                env.step({name: int(rng.integers(env.action_space(name).n)) for name in env.agents})
                steps += 1
        return steps / (time.process_time() - start)


def qmix(episodes: int, envs: int, gradient_steps: int, workers: int, overlap: bool) -> list[str]:
    """Train QMIX with messages on scene graphs, and return lines on its speed."""
    parts = Parts(time.process_time if workers == 1 and not overlap else time.perf_counter)
    kept = {name: getattr(Run, name) for name in parts.seconds}
    config = Config(
        episodes=episodes + WARM_UP,
        envs=envs,
        gradient_steps=gradient_steps,
        workers=workers,
        overlap=overlap,
        validation_interval=10**9,
    )
    make = partial(chmarl_pb.parallel_env, "scene_graph", messages=True, feedback=True)
    try:
        for name, inner in kept.items():
            setattr(Run, name, parts.timed(name, inner))
        train(make, "qmix", config, validate=lambda collector, agents: {"score": 0.0})
    finally:
        for name, inner in kept.items():
            setattr(Run, name, inner)
    learned = sum(parts.seconds["_learn"])
    when = "beside the next" if overlap else "after each"
    return [
        f"random play of its environment alone, in one process: {random_play(make, WARM_UP):,.0f} joint steps/s",
        f"QMIX, {envs} environments, {workers} processes, {gradient_steps} gradient steps {when} rollout:",
        *([] if overlap else [f"  rollout alone {parts.speed('_play'):,.0f} joint steps/s"]),
        f"  {1000 * learned / parts.gradients:.0f} ms a gradient step of {config.batch_size} episodes",
        f"  rollout and updates {parts.speed('advance'):,.0f} joint steps/s",
        f"  the second half alone {parts.speed('advance', len(parts.steps) // 2):,.0f} joint steps/s",
    ]


def ppo(steps: int, workers: int) -> list[str]:
    """Train PPO for the humanoid by the preset ``goal``, and return lines on its speed.

    A short training, which has the same start and the same validation, is taken off a long one.
    """
    short = _seconds_of_ppo(steps // SHORT, workers)
    spent = _seconds_of_ppo(steps, workers)
    return [
        f"PPO, {steps:,} steps, {workers} processes, with start and last validation: {steps / spent:,.0f} steps/s",
        f"  without these {(steps - steps // SHORT) / (spent - short):,.0f} steps/s",
    ]


def _seconds_of_ppo(steps: int, workers: int) -> float:
    """Return the seconds that a training takes."""
    from chmarl_pb.cli import main as command

    env = "CHMARL/SceneGraphHumanoid-v1"
    options: Sequence[Any] = ("--algo", "ppo", "--env", env, "--interval", 10**9, "--workers", workers)
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        if command(["sb3", *map(str, options), "--steps", str(steps), "--out", str(Path(folder) / "run")]):
            raise SystemExit("the training has failed")
        return time.perf_counter() - start


def main() -> int:
    """Print the speeds."""
    return run_command(_main, ValueError)


def _main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("qmix", "ppo"))
    parser.add_argument("--episodes", type=int, default=480, help="of QMIX that are counted")
    parser.add_argument("--envs", type=int, default=Config.envs)
    parser.add_argument("--gradient-steps", type=int, default=Config.gradient_steps)
    parser.add_argument("--overlap", action="store_true", help="let QMIX learn while other processes play")
    parser.add_argument("--steps", type=int, default=120_000, help="of PPO")
    parser.add_argument("--workers", type=int, default=1, help="processes of the environments")
    options = parser.parse_args()
    for name in ("episodes", "envs", "gradient_steps", "steps", "workers"):
        whole_number(f"--{name.replace('_', '-')}", getattr(options, name), 1)
    of_qmix = options.episodes, options.envs, options.gradient_steps, options.workers, options.overlap
    if options.only != "ppo":
        print("\n".join(qmix(*of_qmix)), flush=True)
    if options.only != "qmix":
        print("\n".join(ppo(options.steps, options.workers)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
