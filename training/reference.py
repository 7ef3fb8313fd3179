"""`python -m training.reference`: our learners on games from elsewhere, beside what others have published of theirs.

Published are the maximum returns of Papoudakis et al. 2021 (https://arxiv.org/abs/2006.07869, table 3): mean and half
of the 95 % interval over five seeds; their agents share weights, and learn from 2 million steps with a replay buffer,
or from 20 million on policy. These figures have not been compared with the paper yet: do so before you cite them. A
run's figure is made as theirs: the best of its validations, which ours play greedily.
Needs ``pip install mpe2 lbforaging``.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from chmarl_pb.files import write_atomically
from chmarl_pb.learning.algorithms.registry import find_algorithm
from chmarl_pb.learning.config import RunConfig
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.runs.loop import train
from chmarl_pb.learning.runs.validation import by_return
from training.outside import Foraging, Spread

#: Settings of all runs; those of Papoudakis et al. 2021 where they have a like.
SHARED: dict[str, Any] = {"features": 64, "hidden": 64, "gamma": 0.99, "envs": 16, "batch_size": 32}
REPLAY: dict[str, Any] = {
    "gradient_steps": 8, "buffer_size": 5_000, "td_lambda": 0.6, "tau": 0.01, "target_update_interval": 1,
    "normalize_values": True, "standardize_state": True,
}  # fmt: skip
#: Algorithm -> its settings.
SETTINGS: dict[str, dict[str, Any]] = {
    **{name: SHARED | REPLAY for name in ("iql", "vdn", "qmix")},
    "pqn": SHARED,
    "mappo": SHARED | {"graph_pool": "mean", "buffer_size": 64},
}


@dataclass(frozen=True)
class Game:
    """A game from elsewhere.

    Attributes:
        make: makes it.
        horizon: most steps of an episode.
        random: return of random actions.
        scale: factor of rewards that makes values of about 1, for learners that do not normalize them.
        published: algorithm -> maximum return and half of its interval.
    """

    make: Callable[[], Any]
    horizon: int
    random: float
    scale: float
    published: dict[str, tuple[float, float]]


GAMES = {
    "simple_spread": Game(
        Spread, 25, -234.0, 0.02,
        {"iql": (-132.63, 2.22), "vdn": (-131.03, 1.85), "qmix": (-126.62, 2.96), "mappo": (-133.54, 3.08)},
    ),
    "foraging": Game(
        Foraging, 50, 0.0, 1.0, {"iql": (1.00, 0.00), "vdn": (1.00, 0.00), "qmix": (0.96, 0.07), "mappo": (1.00, 0.00)}
    ),
}  # fmt: skip


def config_of(algorithm: str, game: str, steps: int, seed: int) -> RunConfig:
    """Return the settings of a run of so many joint steps."""
    kind, horizon = find_algorithm(algorithm).config, GAMES[game].horizon
    own: dict[str, Any] = {"reward_scale": GAMES[game].scale} if algorithm == "pqn" else {}
    episodes = max(steps // horizon, 16)
    every = max(episodes // 20, 1)
    return kind(
        seed=seed, episodes=episodes, horizon=horizon, validation_interval=every, log_interval=every,
        checkpoint_interval=every, **SETTINGS[algorithm], **own,
    )  # fmt: skip


def measure(game: str, algorithm: str, steps: int, seed: int, folder: Path | None = None) -> float:
    """Return the best of twenty validations of 100 episodes during a run."""
    config = config_of(algorithm, game, steps, seed)
    return train(GAMES[game].make, algorithm, config, folder, by_return(100), quiet=folder is None).best_score


def main(arguments: list[str] | None = None) -> int:
    """Run the command; interrupted, the same command goes on."""
    parser = argparse.ArgumentParser(prog="python -m training.reference", description=__doc__.split("\n")[0])
    parser.add_argument("--game", choices=tuple(GAMES), action="append", help="default: all")
    parser.add_argument("--algo", choices=tuple(SETTINGS), action="append", help="default: all")
    parser.add_argument("--steps", type=int, default=2_000_000, help="joint steps of a run")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path, default=Path("out/reference"), help="folder of the runs")
    parser.add_argument("--json", type=Path, help="file for the figures")
    return run_command(partial(_main, parser.parse_args(arguments)), ValueError)


def _main(options: argparse.Namespace) -> int:
    rows = []
    for game in options.game or GAMES:
        for algorithm in options.algo or SETTINGS:
            name = f"{game}-{algorithm}"
            runs = [
                measure(game, algorithm, options.steps, seed, options.out / f"{name}-{options.steps}-{seed}")
                for seed in range(options.seeds)
            ]
            rows.append({
                "game": game, "algorithm": algorithm, "steps": options.steps, "returns": runs,
                "random": GAMES[game].random, "published": GAMES[game].published.get(algorithm),
                "config": asdict(config_of(algorithm, game, options.steps, 0)),
            })  # fmt: skip
            Console().print(_table(rows))
    if options.json:
        write_atomically(options.json, json.dumps(rows, indent=1) + "\n")
    return 0


def _table(rows: list[dict[str, Any]]) -> Table:
    table = Table("game", "algorithm", "steps", "random", "ours (seeds)", "published", title="maximum return")
    for row in rows:
        ours = f"{np.mean(row['returns']):.2f} ({', '.join(f'{run:.2f}' for run in row['returns'])})"
        published = "{:.2f} ± {:.2f}".format(*row["published"]) if row["published"] else "-"
        table.add_row(row["game"], row["algorithm"], f"{row['steps']:,}", f"{row['random']:g}", ours, published)
    return table


if __name__ == "__main__":
    raise SystemExit(main())
