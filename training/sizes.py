"""`python -m training.sizes`: how large the learners of the tables are, and how much they learn, as Markdown."""

import argparse
from dataclasses import dataclass

from torch import nn

import chmarl_pb
from chmarl_pb.cli.train import Play, parse
from chmarl_pb.learning.algorithms.mappo import MappoConfig
from chmarl_pb.learning.algorithms.on_policy import new_episodes
from chmarl_pb.learning.algorithms.pqn import PqnConfig
from chmarl_pb.learning.algorithms.registry import make_learner
from chmarl_pb.learning.algorithms.value import Config
from chmarl_pb.learning.config import RunConfig
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.spaces import LearnerInterface, learner_interface_of
from training.sizes_of_others import table_of_others
from training.tables.row import Row
from training.tables.rows import TABLES

ROWS = (
    *(f"{name} + messages" for name in ("IQL", "VDN", "QMIX", "QTRAN")),
    *(f"{name} + messages, longer" for name in ("IQL", "VDN", "QMIX", "QTRAN")),
    "PQN + messages",
    "MAPPO + messages",
)
_HEAD = (
    "row", "weights: humanoid", "drone", "mixer, joint networks or critic", "episodes", "environment steps, at most",
    "gradient steps", "updates of the targets", "buffer, episodes", "batch, episodes",
)  # fmt: skip


@dataclass(frozen=True)
class Size:
    """One row.

    Attributes:
        name: of the row.
        agents: weights that learn of each robot's network.
        joint: of all that is no robot's: mixer, joint networks, critic.
        config: settings of the training.
        buffer: episodes that are kept at once.
    """

    name: str
    agents: tuple[int, ...]
    joint: int
    config: RunConfig
    buffer: int


def size_of(row: Row, interface: LearnerInterface) -> Size:
    """Return how large a row's learner is on the benchmark.

    Raises:
        ValueError: another module than ``training.train`` trains it, or it learns from stored episodes.
    """
    command = parse(["--algo", *row.options[1:], "--observation", row.observation, *row.rules])
    if not isinstance(command, Play):
        raise ValueError(f"{row.name}: only rows that learn by playing have a size")
    learner = make_learner(command.algo, interface, command.config)
    joint = getattr(learner, "mixer", None) or getattr(learner, "critic", None)
    config = command.config
    buffer = ReplayBuffer(interface, config.horizon, config.kept, config.memory_gib).capacity
    return Size(
        row.name, tuple(_weights(agent) for agent in learner.agents.values()), _weights(joint) if joint else 0,
        config, buffer,
    )  # fmt: skip


def _weights(network: nn.Module) -> int:
    return sum(weight.numel() for weight in network.parameters() if weight.requires_grad)


def gradient_steps(config: RunConfig) -> int:
    """Return how many gradient steps a whole run takes."""
    played = learned = steps = 0
    while played < config.episodes:
        played += config.envs
        if isinstance(config, MappoConfig | PqnConfig):
            if new := new_episodes(config, played, learned):
                steps, learned = steps + config.n_epochs * -(-new // config.batch_size), played
        elif isinstance(config, Config) and played >= min(config.learning_starts, config.episodes):
            steps += config.gradient_steps
    return steps


def target_updates(config: RunConfig) -> int:
    """Return how often a whole run brings its target networks up to date; 0 without any."""
    return gradient_steps(config) // config.target_update_interval if isinstance(config, Config) else 0


def table() -> str:
    """Return the table of the learners as Markdown, from the settings of their rows."""
    env = chmarl_pb.parallel_env("scene_graph")
    interface = learner_interface_of(env)
    env.close()
    rows = {row.name: row for row in TABLES["scene-graph"]}
    lines = [f"| {' | '.join(_HEAD)} |", "|---|" + "--:|" * (len(_HEAD) - 1)]
    lines += [_line(size_of(rows[name], interface)) for name in ROWS]
    return "\n".join(lines)


def _line(size: Size) -> str:
    config, updates = size.config, target_updates(size.config)
    tau = getattr(config, "tau", 1.0)
    targets = f"{updates:,}{'' if tau == 1 else f', by {tau}'}" if updates else "none"
    numbers = (
        *size.agents, size.joint or "none", config.episodes, config.episodes * config.horizon, gradient_steps(config),
        targets, size.buffer, config.batch_size,
    )  # fmt: skip
    return f"| {size.name} | {' | '.join(f'{one:,}' if isinstance(one, int) else one for one in numbers)} |"


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m training.sizes", description=__doc__.split("`: ")[1])
    parser.parse_args(arguments)
    return run_command(_main)


def _main() -> int:
    print(table(), table_of_others(), sep="\n\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
