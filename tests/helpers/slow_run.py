"""`python -m tests.helpers.slow_run ALGORITHM FOLDER [SECONDS]`: a small training whose environment takes its time."""

import sys
import time
from pathlib import Path
from typing import Any

from chmarl_pb.learning import train
from chmarl_pb.learning.runs import interrupts
from tests.helpers.small_runs import CONFIGS, EXPERT
from tests.helpers.uneven_env import UnevenEnv


class SlowEnv(UnevenEnv):
    """Takes some milliseconds for a step."""

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        time.sleep(0.004)
        return super().step(actions)


def main(algorithm: str, folder: str, every: str = "60") -> int:
    interrupts.EVERY = float(every)
    train(SlowEnv, algorithm, CONFIGS[algorithm], Path(folder), expert=EXPERT)
    return 0


if __name__ == "__main__":
    raise SystemExit(interrupts.run_command(lambda: main(*sys.argv[1:])))
