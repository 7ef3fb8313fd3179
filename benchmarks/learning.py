"""Where the time of learning goes: ``python -m benchmarks.learning`` trains QMIX for a while and times its parts.

Prints joint steps per second of rollout, learned steps per second of updates, and the share of each part in the whole.
"""

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from chmarl_pb.extras import needs

with needs("benchmarks.learning", "train", script=True):
    import torch

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.files import write_atomically
from chmarl_pb.learning.algorithms import value
from chmarl_pb.learning.algorithms.value import Config, ValueLearner
from chmarl_pb.learning.benchmark_env import benchmark
from chmarl_pb.learning.runs import collect
from chmarl_pb.learning.runs.loop import Run
from chmarl_pb.learning.runs.replay_buffer import ReplayBuffer
from chmarl_pb.learning.runs.validation import by_return

Seconds = dict[str, float]


def timed(function: Callable[..., Any], name: str, seconds: Seconds) -> Callable[..., Any]:
    """Return a function that adds the time of its calls to ``seconds[name]``."""

    def call(*arguments: Any, **options: Any) -> Any:
        start = time.perf_counter()
        try:
            return function(*arguments, **options)
        finally:
            seconds[name] += time.perf_counter() - start

    return call


def watch(run: Run, seconds: Seconds) -> None:
    """Time the parts of a run from now on."""
    for owner, attribute, name in (
        (collect.Collector, "play", "rollout"), (HouseholdEnv, "reset", "env.reset"),
        (HouseholdEnv, "step", "env.step"), (collect.Player, "values", "agents act"), (ReplayBuffer, "sample", "batch"),
        (ValueLearner, "update", "update"), (value, "unroll", "unroll"), (value, "td_loss", "loss"),
        (torch.Tensor, "backward", "backward"),
    ):  # fmt: skip
        setattr(owner, attribute, timed(getattr(owner, attribute), name, seconds))
    optimizer = run.learner._optimizer  # type: ignore[attr-defined]
    optimizer.step = timed(optimizer.step, "optimizer", seconds)


def measure(observation: str, warm: int, episodes: int) -> dict[str, Any]:
    """Return speeds and shares after a number of episodes that are not counted."""
    torch.set_num_threads(1)
    env_fn, setting = benchmark(observation)
    config = replace(Config(), episodes=warm + episodes)
    collector = collect.Collector(env_fn, config.envs)
    try:
        run = Run(collector, "qmix", config, None, by_return(), setting)
        while run.episodes < warm:
            run._play()
        seconds: Seconds = defaultdict(float)
        watch(run, seconds)
        steps, gradients, start = collector.steps, run.learner.updates, time.perf_counter()
        while run.episodes < warm + episodes:
            run._play()
            run._learn()
        learned = int(run._clock["transitions"])
        whole = time.perf_counter() - start
    finally:
        collector.close()
    shares = {name: round(value / whole, 3) for name, value in seconds.items()}
    return {
        "observation": observation, "episodes": episodes, "seconds": round(whole, 1),
        "rollout_steps_per_s": round((collector.steps - steps) / seconds["rollout"], 1),
        "learned_steps_per_s": round(learned / seconds["update"], 1),
        "updates_per_s": round((run.learner.updates - gradients) / seconds["update"], 2), "shares": shares,
    }  # fmt: skip


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.learning", description=__doc__)
    parser.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    parser.add_argument("--warm", type=int, default=400, help="episodes before (default %(default)s)")
    parser.add_argument("--episodes", type=int, default=200, help="that are timed (default %(default)s)")
    parser.add_argument("--json", type=Path, help="file for the figures")
    chosen = parser.parse_args()
    figures = measure(chosen.observation, chosen.warm, chosen.episodes)
    text = json.dumps(figures, indent=1)
    if chosen.json:
        write_atomically(chosen.json, text + "\n")
    print(text)


if __name__ == "__main__":
    main()
