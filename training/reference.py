"""`python -m training.reference`: our learners on games that others play, beside what they have published.

Published are the maximum returns of Papoudakis et al. 2021 (https://arxiv.org/abs/2006.07869, table 3): mean and half
of the 95 % interval over five seeds; their agents share weights, and learn from 2 million steps with a replay buffer,
or from 20 million on policy. Only figures that a second public source quotes stand here: those of simple_spread agree
with a public comparison whose author took them from the paper (``docs/training_findings.md``); we have not seen the
paper's table itself. For foraging we found no such source, so there is none here.

A run's greatest return is made as theirs: the best of its validations, which play greedily. A best of several noisy
means is a little too high, so the last validation stands beside it. The same command goes on with what is missing.
Needs ``pip install mpe2 lbforaging``, but for the game ``household``: this benchmark as EPyMARL plays it.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

import chmarl_pb
from chmarl_pb.files import Lock, write_atomically
from chmarl_pb.learning.algorithms.registry import find_algorithm
from chmarl_pb.learning.config import RunConfig
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.runs.logger import METRICS, read_rows
from chmarl_pb.learning.runs.loop import train
from chmarl_pb.learning.runs.validation import by_return
from chmarl_pb.reading import read_regular
from training.outside import Foraging, Spread

VALIDATED = 64  # episodes of a validation
LEAST = 16  # episodes of a run

#: Settings of all runs; those of Papoudakis et al. 2021 where they have a like.
SHARED: dict[str, Any] = {"features": 64, "hidden": 64, "gamma": 0.99, "envs": LEAST, "batch_size": 32}
REPLAY: dict[str, Any] = {
    "gradient_steps": 8, "buffer_size": 5_000, "td_lambda": 0.6, "tau": 0.01, "target_update_interval": 1,
    "standardize_rewards": True, "standardize_state": True,
}  # fmt: skip
#: What is trained -> its settings. The last two are QMIX with normal values in the place of rewards, and with neither.
SETTINGS: dict[str, dict[str, Any]] = {
    **{name: SHARED | REPLAY for name in ("iql", "vdn", "qmix")},
    "pqn": SHARED,
    "mappo": SHARED | {"graph_pool": "mean", "buffer_size": 64},
    "qmix-normal": SHARED | REPLAY | {"standardize_rewards": False, "normalize_values": True},
    "qmix-plain": SHARED | REPLAY | {"standardize_rewards": False},
}

#: Those that learn by the settings of a game, too; the last two show what went wrong without.
_REPLAYING = ("iql", "vdn", "qmix")
#: What the table needs of a run.
_FACTS = {"game", "algorithm", "steps", "seed", "best", "last"}


@dataclass(frozen=True)
class Game:
    """A game from elsewhere.

    Attributes:
        make: makes it.
        horizon: most steps of an episode.
        random: return of random actions.
        scale: factor of rewards for learners that do not normalize them; as episodes that are cut off are bootstrapped,
            values of simple_spread are about -19 by it.
        published: algorithm -> maximum return and half of its interval.
        replay: settings of learners with a replay buffer, where others are better than those that all games share.
    """

    make: Callable[[], Any]
    horizon: int
    random: float
    scale: float
    published: dict[str, tuple[float, float]]
    replay: dict[str, Any] = field(default_factory=dict)


GAMES = {
    "simple_spread": Game(
        Spread, 25, -234.0, 0.02,
        {"iql": (-132.63, 2.22), "vdn": (-131.03, 1.85), "qmix": (-126.62, 2.96), "mappo": (-133.54, 3.08)},
        # what is far ahead only adds noise to values that are bootstrapped where an episode is cut off
        {"gamma": 0.9, "td_lambda": 0.0, "learning_rate": 0.002, "exploration_fraction": 0.1},
    ),
    "foraging": Game(Foraging, 50, 0.0, 1.0, {}),
    # This benchmark as EPyMARL plays it in examples/epymarl_env.py; a solved task ends, so rewards keep their mean.
    "household": Game(
        partial(chmarl_pb.flat_env, goal=True, keys=("goal", "messages", "self")), 28, 0.9, 1.0, {},
        {"gamma": 0.97, "standardize_rewards": False},
    ),
}  # fmt: skip


def config_of(learner: str, game: str, steps: int, seed: int, validations: int = 20) -> RunConfig:
    """Return the settings of a run of so many joint steps, if every episode lasts as long as it may."""
    kind, horizon = find_algorithm(algorithm_of(learner)).config, GAMES[game].horizon
    own: dict[str, Any] = {"reward_scale": GAMES[game].scale} if learner == "pqn" else {}
    episodes = steps // horizon
    every = max(episodes // validations, 1)
    settings = SETTINGS[learner] | (GAMES[game].replay if learner in _REPLAYING else {})
    return kind(
        seed=seed, episodes=episodes, horizon=horizon, validation_interval=every, log_interval=every,
        checkpoint_interval=every, **settings, **own,
    )  # fmt: skip


def algorithm_of(learner: str) -> str:
    """Return the name of the algorithm of one of ``SETTINGS``."""
    return learner.partition("-")[0]


def measure(game: str, learner: str, steps: int, seed: int, validations: int, folder: Path) -> dict[str, Any]:
    """Train, and return what came of it: settings, greatest and last return, and the learning curve between."""
    config = config_of(learner, game, steps, seed, validations)
    train(GAMES[game].make, algorithm_of(learner), config, folder, by_return(VALIDATED), quiet=False)
    rows = [row for row in read_rows(folder / METRICS) if "validation" in row]
    returns = [round(float(row["validation"]["score"]), 3) for row in rows]
    settings = {name: value for name, value in asdict(config).items() if value != getattr(type(config), name, None)}
    return {
        "game": game, "algorithm": learner, "seed": seed, "steps": steps, "random": GAMES[game].random,
        "best": max(returns), "last": returns[-1], "settings": settings,
        "curve": {"steps": [row["episodes"] * config.horizon for row in rows], "return": returns},
    }  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Run the command; interrupted, the same command goes on."""
    parser = argparse.ArgumentParser(prog="python -m training.reference", description=__doc__.split("\n")[0])
    parser.add_argument("--game", choices=tuple(GAMES), action="append", help="default: all")
    parser.add_argument("--algo", choices=tuple(SETTINGS), action="append", help="default: all")
    parser.add_argument("--steps", type=int, default=2_000_000, help="joint steps of a run")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--validations", type=int, default=20, help="in a run")
    parser.add_argument("--out", type=Path, default=Path("out/reference"), help="folder of the runs")
    parser.add_argument(
        "--json", type=Path, default=Path("out/reference.json"), help="file of the figures; runs in it are not repeated"
    )
    return run_command(partial(_main, parser.parse_args(arguments)), ValueError)


def _main(options: argparse.Namespace) -> int:
    for name in ("steps", "seeds", "validations"):
        if (value := getattr(options, name)) < 1:
            raise ValueError(f"--{name} {value}: use at least 1")
    for game in options.game or GAMES:
        if options.steps < (least := LEAST * GAMES[game].horizon):
            raise ValueError(
                f"--steps {options.steps}: {game} needs at least {least}, as {LEAST} episodes are played at once"
            )
    done = {(run["game"], run["algorithm"], run["steps"], run["seed"]) for run in _read(options.json)}
    wanted = [
        (game, learner, options.steps, seed)
        for game in options.game or GAMES
        for seed in range(options.seeds)
        for learner in options.algo or SETTINGS
    ]
    for key in wanted:
        if key in done:
            continue
        game, learner, steps, seed = key
        folder = options.out / f"{game}-{learner}-{steps}-{seed}"
        _keep(options.json, measure(game, learner, steps, seed, options.validations, folder))
        _print(options.json)
    if done.issuperset(wanted):
        _print(options.json)
    return 0


def _keep(path: Path, run: dict[str, Any]) -> None:
    """Add a run to a file, to which other commands may have added theirs meanwhile."""
    with Lock(path, wait=True):
        write_atomically(path, json.dumps([*_read(path), run], indent=1) + "\n")


def _print(path: Path) -> None:
    Console().print("\n".join(table(_read(path))), soft_wrap=True, markup=False, highlight=False)


def _read(path: Path) -> list[dict[str, Any]]:
    """Return the runs that a file holds; none if there is no file.

    Raises:
        ValueError: it holds something else.
    """
    if not path.exists():
        return []
    try:
        runs: list[dict[str, Any]] = json.loads(read_regular(path).decode("utf-8"))
        if not isinstance(runs, list):
            raise ValueError("no list of runs")
        for run in runs:
            if missing := _FACTS - set(run):
                raise ValueError(f"a run without {', '.join(sorted(missing))}")
            if run["game"] not in GAMES:
                raise ValueError(f"a run of the game {run['game']!r}")
        table(runs)
        return runs
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"{path}: not a file of runs ({error}); name another by --json") from error


def table(runs: list[dict[str, Any]]) -> list[str]:
    """Return the lines of a Markdown table of runs, a row for each game, learner and number of steps."""
    rows: dict[tuple[str, str, int], list[dict[str, Any]]] = {}
    for run in runs:
        rows.setdefault((run["game"], run["algorithm"], run["steps"]), []).append(run)
    lines = [
        "| game | learner | steps | seeds | random | last validation | greatest validation | published |",
        "|---|---|--:|--:|--:|--:|--:|--:|",
    ]
    for (game, learner, steps), group in rows.items():
        found = GAMES[game].published.get(learner)
        published = f"{found[0]:.2f} ± {found[1]:.2f}" if found else ""
        cells = [game, learner, f"{steps:,}", str(len(group)), f"{GAMES[game].random:g}"]
        lines.append(f"| {' | '.join(cells)} | {_mean(group, 'last')} | {_mean(group, 'best')} | {published} |")
    return lines


def _mean(runs: list[dict[str, Any]], name: str) -> str:
    """Return the mean over seeds, with the least and the greatest."""
    values = [run[name] for run in runs]
    digits = 1 if max(map(abs, values)) >= 10 else 2
    mean, least, most = (f"{value:.{digits}f}" for value in (np.mean(values), min(values), max(values)))
    return mean if len(values) == 1 else f"{mean} ({least} to {most})"


if __name__ == "__main__":
    raise SystemExit(main())
