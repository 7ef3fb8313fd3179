"""`python -m training.proofs`: what the algorithms learn of small games, beside what theory says that they can hold.

Every joint action is played equally often (epsilon = 1), so theory gives the table that each algorithm ends in
(:mod:`training.theory`). The two-step game is solved backwards with each algorithm's own tables.
"""

import argparse
import json
import platform
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from rich.console import Console
from rich.table import Table

from chmarl_pb.files import write_atomically
from chmarl_pb.learning.algorithms.losses import unroll
from chmarl_pb.learning.algorithms.qtran import QtranNetworks
from chmarl_pb.learning.algorithms.value import Config, ValueLearner
from chmarl_pb.learning.rollouts.collect import Collector, advance, begin
from chmarl_pb.learning.rollouts.replay_buffer import Episode, ReplayBuffer
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.runs.loop import train
from chmarl_pb.learning.runs.validation import play_greedily
from chmarl_pb.learning.spaces import learner_interface_of
from training.games import MATRIX_GAMES, TWO_STEP, MatrixGame, SmallGame, TwoStepGame
from training.theory import additive_fit, independent_fit, supermodular_fit

#: Algorithm -> the table that it ends in, from the true one and the learned one, whose order counts for QMIX.
FITS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "iql": lambda table, learned: independent_fit(table),
    "vdn": lambda table, learned: additive_fit(table),
    "qmix": supermodular_fit,
    "qtran": lambda table, learned: table,
}
GAMES = (*MATRIX_GAMES, "two-step")
TOLERANCE = 0.5  # of a value; payoffs reach from -12 to 8
CONFIG = Config(
    episodes=8_192, envs=128, horizon=2, gradient_steps=24, batch_size=512, learning_starts=512, buffer_size=8_192,
    learning_rate=1e-3, gamma=0.99, exploration_final_eps=1.0, target_update_interval=100, features=16, hidden=16,
    validation_interval=10**9, log_interval=10**9,
)  # fmt: skip


@dataclass(frozen=True)
class Proof:
    """One algorithm on one game.

    Attributes:
        game: its name.
        algorithm: its name.
        states: state -> {"learned", "theory"}: joint tables, or for IQL both agents' values.
        error: largest difference between them.
        greedy: joint actions that the agents take.
        gain: what they earn.
        best: what could be earned.
        theorem: QTRAN only: the smallest value of Q' - Q_jt + V_jt over all states and joint actions, and its largest
            distance from 0 at the agents' own joint action; both 0 in theory.
    """

    game: str
    algorithm: str
    states: dict[str, dict[str, list[list[float]]]]
    error: float
    greedy: list[list[int]]
    gain: float
    best: float
    theorem: tuple[float, float] | None = None


def prove(game: str, algorithm: str, seed: int = 0, config: Config = CONFIG, folder: Path | None = None) -> Proof:
    """Learn a game and compare with theory.

    Args:
        game: one of ``GAMES``.
        algorithm: one of ``FITS``.
        seed: of the training.
        config: of the training, but for the seed.
        folder: that an interrupted training goes on from; None: nothing is kept.
    """
    env_fn, paths, best = _game(game)
    learner = cast(ValueLearner, train(env_fn, algorithm, replace(config, seed=seed), folder).learner)
    tables = {state: joint_values(learner, env_fn(), path, config.horizon) for state, path in paths.items()}
    learned = {state: table["value"] for state, table in tables.items()}
    theory = _theory(game, algorithm, learned, config.gamma)
    states = {state: {"learned": _rounded(learned[state]), "theory": _rounded(theory[state])} for state in paths}
    error = max(float(np.abs(learned[state] - theory[state]).max()) for state in paths)
    collector = Collector(env_fn, 1)
    episode = play_greedily(collector, learner.agents, [0])[0]
    greedy = [list(actions.values()) for actions in episode.actions]
    return Proof(game, algorithm, states, round(error, 3), greedy, episode.episode_return, best, _theorem(tables))


@torch.no_grad()
def joint_values(
    learner: ValueLearner, env: SmallGame, path: list[tuple[int, int]], horizon: int = CONFIG.horizon
) -> dict[str, np.ndarray]:
    """Return the learned values in a state.

    Args:
        learner: of the game.
        env: the game.
        path: joint actions that lead to the state.
        horizon: most steps of an episode.

    Returns:
        "value": (A, A) joint values, for IQL (2, A) the agents' own; for QTRAN also "gap" (A, A), which is
        Q' - Q_jt + V_jt, and "own" (2, A), the agents' values.
    """
    batch = _history(env, path, horizon)
    online = unroll(learner.agents, batch)
    own = torch.stack([values[0, -1, 0] for values in online.values.values()])  # (2, A), of the one component
    if learner.algorithm == "iql":
        return {"value": own.numpy()}
    pairs = torch.cartesian_prod(*(torch.arange(row.numel()) for row in own))
    state = batch.states[0, -1].expand(len(pairs), -1)
    values = torch.stack([own[agent, pairs[:, agent]] for agent in (0, 1)], dim=-1)
    shape = (own.shape[1], own.shape[1])
    if learner.algorithm != "qtran":
        return {"value": learner.mixer(values, state).view(shape).numpy()}
    histories = [history[0, -1].expand(len(pairs), -1) for history in online.hidden_states.values()]
    acted = [torch.nn.functional.one_hot(pairs[:, agent], shape[0]).float() for agent in (0, 1)]
    networks = cast(QtranNetworks, learner.mixer)
    joint = networks.q_joint(histories, acted, state)
    gap = values.sum(dim=-1, keepdim=True) - joint + networks.v_joint(histories, state)
    return {"value": joint.view(shape).numpy(), "gap": gap.view(shape).numpy(), "own": own.numpy()}


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 if all is as theory says."""
    parser = argparse.ArgumentParser(prog="python -m training.proofs", description=__doc__.split("\n")[0])
    parser.add_argument("--game", choices=GAMES, action="append", help="default: all")
    parser.add_argument("--algo", choices=tuple(FITS), action="append", help="default: all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="JSON file for the tables")
    options = parser.parse_args(arguments)
    if options.out and options.out.is_dir():
        parser.error(f"--out {options.out}: is a folder; name a file in it")
    return run_command(partial(_main, options), ValueError)


def _main(options: argparse.Namespace) -> int:
    console = Console()
    unfinished = options.out.with_suffix(".unfinished") if options.out else None
    proofs = []
    for game in options.game or GAMES:
        for algorithm in options.algo or FITS:
            folder = unfinished / f"{game}-{algorithm}-seed{options.seed}" if unfinished else None
            proofs.append(prove(game, algorithm, options.seed, folder=folder))
            console.print(f"{game} / {algorithm}: largest difference from theory {proofs[-1].error}")
    console.print(_summary(proofs))
    if options.out:
        about: dict[str, Any] = {"command": _command(options), "config": asdict(CONFIG)}
        about |= {"seed": options.seed, "torch": torch.__version__, "python": platform.python_version()}
        text = json.dumps({**about, "proofs": [asdict(proof) for proof in proofs]}, indent=1)
        write_atomically(options.out, text + "\n")
        shutil.rmtree(options.out.with_suffix(".unfinished"))
    return int(any(proof.error > TOLERANCE for proof in proofs))


def _command(options: argparse.Namespace) -> str:
    """Return the command that makes a file anew."""
    given = [f"--{name} {value}" for name in ("game", "algo") for value in getattr(options, name) or ()]
    seed = [f"--seed {options.seed}"] * bool(options.seed)
    return " ".join(["python -m training.proofs", *given, *seed, f"--out {options.out}"])


def _game(name: str) -> tuple[Any, dict[str, list[tuple[int, int]]], float]:
    """Return how to make a game, its states with the joint actions that lead there, and the best return."""
    if name == "two-step":
        return TwoStepGame, {"1": [], "2A": [(0, 0)], "2B": [(1, 0)]}, float(TWO_STEP.max())
    payoff = MATRIX_GAMES[name]
    return partial(MatrixGame, payoff), {"1": []}, float(payoff.max())


def _theory(game: str, algorithm: str, learned: dict[str, np.ndarray], gamma: float) -> dict[str, np.ndarray]:
    """Return the table that each state ends in."""
    if game != "two-step":
        return {"1": FITS[algorithm](MATRIX_GAMES[game], learned["1"])}
    tables = {
        state: FITS[algorithm](table, learned[state]) for state, table in zip(("2A", "2B"), TWO_STEP, strict=True)
    }
    if algorithm == "iql":  # agent 1 knows where its action leads; agent 2's leads to either
        after = gamma * np.array([table.max(axis=1) for table in tables.values()])  # (game, agent)
        return {"1": np.array([after[:, 0], np.full(2, after[:, 1].mean())]), **tables}
    after = gamma * np.array([tables["2A"].max(), tables["2B"].max()])
    return {"1": FITS[algorithm](np.repeat(after[:, None], 2, axis=1), learned["1"]), **tables}


def _theorem(tables: dict[str, dict[str, np.ndarray]]) -> tuple[float, float] | None:
    """Return how well conditions (4a) and (4b) of QTRAN's theorem 1 hold, for QTRAN."""
    if "gap" not in next(iter(tables.values())):
        return None
    smallest = min(float(table["gap"].min()) for table in tables.values())
    own = [abs(float(table["gap"][tuple(table["own"].argmax(axis=1))])) for table in tables.values()]
    return round(smallest, 3), round(max(own), 3)


def _history(env: SmallGame, path: list[tuple[int, int]], horizon: int) -> Any:
    """Return the observations on the way to a state as a batch of one episode."""
    interface = learner_interface_of(env)
    episode = Episode()
    begin(interface, episode, env, env.reset(seed=0))
    for pair in path:
        actions = dict(zip(interface.agents, pair, strict=True))
        advance(interface, episode, env, actions, env.step(actions))
    replay = ReplayBuffer(interface, horizon, 1, 1.0)
    replay.add(episode)
    return replay.sample(1, np.random.default_rng(0))


def _rounded(table: np.ndarray) -> list[list[float]]:
    return [[round(float(value), 3) + 0.0 for value in row] for row in table]  # + 0.0: no -0.0


def _summary(proofs: list[Proof]) -> Table:
    table = Table("game", "algorithm", "error", "greedy joint actions", "return", "best", title="learned beside theory")
    for proof in proofs:
        actions = " ".join("".join("ABC"[action] for action in pair) for pair in proof.greedy)
        table.add_row(proof.game, proof.algorithm, f"{proof.error:.3f}", actions, f"{proof.gain:g}", f"{proof.best:g}")
    return table


if __name__ == "__main__":
    raise SystemExit(main())
