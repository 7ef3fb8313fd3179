"""`python -m training.spread_rules`: what hand-written rules return on simple_spread, to read learners' returns by.

Needs ``pip install mpe2``.
"""

import argparse
from collections.abc import Callable
from functools import partial
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.learning.runs.interrupts import run_command
from training.outside import Spread

_AGENTS = 3
_LEFT, _RIGHT, _DOWN, _UP = 1, 2, 3, 4
_NEAR, _AHEAD = 0.1, 0.3  # where an agent lets itself drift; seconds that it looks ahead
#: Vectors to the landmarks (3, 2) and to the other agents (2, 2), and the agent's number -> its landmark's number.
Rule = Callable[[NDArray[np.float64], NDArray[np.float64], int], int]


def nearest(landmarks: NDArray[np.float64], others: NDArray[np.float64], number: int) -> int:
    """Return the nearest landmark, whoever else goes there."""
    return int(np.linalg.norm(landmarks, axis=1).argmin())


def own(landmarks: NDArray[np.float64], others: NDArray[np.float64], number: int) -> int:
    """Return the landmark of the agent's own number, however far it is."""
    return number


def shared_out(landmarks: NDArray[np.float64], others: NDArray[np.float64], number: int) -> int:
    """Return the agent's landmark if all ways together are to be shortest."""
    places = np.insert(others, number, 0, axis=0)
    ways = np.linalg.norm(landmarks[None] - places[:, None], axis=2)
    best = min(permutations(range(_AGENTS)), key=lambda order: float(sum(ways[range(_AGENTS), order])))
    return best[number]


RULES: dict[str, Rule | None] = {
    "stand still": None, "nearest landmark": nearest, "landmark of one's own": own, "landmarks shared out": shared_out
}  # fmt: skip


def returns(rule: Rule | None, episodes: int) -> NDArray[np.float64]:
    """Return the returns of episodes with the seeds from 0 on."""
    env, found = Spread(), np.zeros(episodes)
    for seed in range(episodes):
        seen, _ = env.reset(seed=seed)
        while env.agents:
            actions = {
                name: 0 if rule is None else _action(rule, seen[name], number)
                for number, name in enumerate(env.possible_agents)
            }
            seen, rewards, *_ = env.step(actions)
            found[seed] += rewards[env.possible_agents[0]]
    env.close()
    return found


def _action(rule: Rule, seen: NDArray[np.float64], number: int) -> int:
    """Return the action that takes an agent to its landmark: its own speed and place, landmarks and agents are seen."""
    landmarks, others = seen[4:10].reshape(3, 2), seen[10:14].reshape(2, 2)
    x, y = landmarks[rule(landmarks, others, number)] - _AHEAD * seen[:2]
    if max(abs(x), abs(y)) < _NEAR:
        return 0
    if abs(x) >= abs(y):
        return _RIGHT if x > 0 else _LEFT
    return _UP if y > 0 else _DOWN


def main() -> int:
    """Print the mean return of each rule, with its standard error."""
    parser = argparse.ArgumentParser(prog="python -m training.spread_rules", description=__doc__)
    parser.add_argument("--episodes", type=int, default=200, help="default: 200")
    episodes = parser.parse_args().episodes
    if episodes < 2:
        parser.error(f"--episodes {episodes}: use at least 2")
    return run_command(partial(_main, episodes))


def _main(episodes: int) -> int:
    for name, rule in RULES.items():
        found = returns(rule, episodes)
        print(f"{name}: {found.mean():.1f} ± {found.std() / episodes**0.5:.1f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
