"""``chmarl-pb sb3``: train a baseline of Stable-Baselines3; killed at any moment, the same command goes on."""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated

from chmarl_pb.cli.evaluate import evaluate_command
from chmarl_pb.cli.idle_options import idle_in_sb3, refuse_idle
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.registration import options_of
from chmarl_pb.extras import needs
from chmarl_pb.learning.benchmark_env import ObservationName
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.sb3.config import Config, EnvId
from chmarl_pb.learning.sb3.train import BEST, LAST, RESULT, run
from chmarl_pb.robots.registry import TEAM, listed

with needs("chmarl-pb sb3", "train"):
    import tyro


ABOUT = f"""{__doc__.split("``: ")[1].strip()}

example: chmarl-pb sb3 --algo ppo --observation scene_graph --humanoid-only --seed 0"""


@dataclass(frozen=True)
class Command:
    """A training that was asked for.

    Attributes:
        config: everything that fixes the run.
        env: Gymnasium id; or --observation and --humanoid-only, as the tables name it.
        observation: what the robots observe; None: scene_graph.
        humanoid_only: whether the drone follows the belief search; beside the older search policy by --env.
        workers: processes; None: one for each core.
        device: of torch, e.g. cuda.
        out: folder of the run; None: out/sb3/NAME, after its settings.
        quiet: no progress bars, no notes.
    """

    config: Annotated[Config, tyro.conf.arg(name="")]
    env: EnvId | None = None
    observation: ObservationName | None = None
    humanoid_only: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    workers: int | None = None
    device: str = "cpu"
    out: Path | None = None
    quiet: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False

    def __post_init__(self) -> None:
        """Refuse what does not fit together."""
        if self.env is None:
            return
        named = options_of(self.env)["observation"]
        if self.humanoid_only or self.observation not in (None, named):
            raise ValueError(f"--env names observation ({named}) and robots; leave out --observation, --humanoid-only")

    @property
    def folder(self) -> Path:
        """The folder of the run, that of ``out`` or one named after its settings."""
        return self.out or Path("out/sb3") / _name(self.config)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    return run_command(partial(_main, sys.argv[1:] if arguments is None else arguments), ValueError)


def _main(arguments: Sequence[str]) -> int:
    command = parse(arguments)
    config, folder = command.config, command.folder
    if not (folder / LAST).exists():  # what was begun goes on, however it was begun
        refuse_idle(config, Config(config.algo), partial(idle_in_sb3, config=config))
    run(config, folder, command.workers, quiet=command.quiet, device=command.device)
    if command.quiet:
        return 0
    best = json.loads((folder / RESULT).read_text())["best"]
    print(
        f"{folder / BEST}: SR {100 * best['sr']:.1f}, PLW {100 * best['plw']:.1f} on validation tasks. Evaluate it with"
    )
    given = {name: value for name, value in config.env_options.items() if name != "flat_actions"}
    options = Options(config.observation, track=config.track, **given)
    print(evaluate_command(folder / BEST, options, config.robots))
    return 0


def parse(arguments: Sequence[str]) -> Command:
    """Return the training that a command asks for, with the environment in its settings."""
    command = tyro.cli(Command, args=arguments, prog="chmarl-pb sb3", description=ABOUT)
    env_id = command.env or _env_id(command.observation, command.humanoid_only)
    return replace(command, config=replace(command.config, env_id=env_id))


def _env_id(observation: str | None, humanoid_only: bool) -> str:
    """Return the Gymnasium id of a row of the tables."""
    kind = {"scene_graph": "SceneGraph", "visual": "Visual"}[observation or "scene_graph"]
    return f"CHMARL/{kind}{'Humanoid-v1' if humanoid_only else '-v0'}"


def _name(config: Config) -> str:
    """Return the name of a run's folder."""
    parts = [config.algo, config.env_id.removeprefix("CHMARL/").removesuffix("-v0").lower()]
    parts += [word for word in ("messages", "feedback") if config.env_options[word]]
    robots = listed(config.robots)
    parts += [Path(robot).stem for robot in robots] if robots != TEAM else []
    parts += [Path(file).stem for file in (config.home, config.catalog) if file]
    return "-".join([*parts, config.preset, f"seed{config.seed}"])
