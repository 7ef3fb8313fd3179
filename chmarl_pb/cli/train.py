"""``chmarl-pb train``: train one learner on the benchmark; killed at any moment, the same command goes on."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, make_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_type_hints

from chmarl_pb.cli.arguments import add_rules, given_rules
from chmarl_pb.cli.evaluate import evaluate_command
from chmarl_pb.cli.idle_options import idle_in_train, refuse_idle
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.extras import needs
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.algorithms.mappo import MappoConfig
from chmarl_pb.learning.algorithms.registry import ALGORITHMS, find_algorithm
from chmarl_pb.learning.benchmark_env import ObservationName, benchmark, recorded_rules
from chmarl_pb.learning.config import RunConfig, check, count
from chmarl_pb.learning.policies.cloned import CloningConfig
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.runs.loop import train
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.runs.validation import Validate, by_home, by_tasks
from chmarl_pb.policies.registry import make_expert
from chmarl_pb.robots.registry import TEAM, listed
from chmarl_pb.tasks.splits import VALIDATION

with needs("chmarl-pb train", "train"):
    import tyro

ABOUT = f"""{__doc__.split("``: ")[1].strip()}

example: chmarl-pb train --algo qmix --observation scene_graph --messages --seed 0"""

IMITATION = "imitation"  # folder of the first training of dagger-mappo in that of the run

Fixed = tyro.conf.Suppress[tyro.conf.Fixed[str]]  # known before the arguments are read
Flat = tyro.conf.arg(name="")  # flags without the field's name before them


@dataclass(frozen=True)
class Env:
    """The benchmark's environment.

    Attributes:
        observation: what the robots observe.
        goal: whether the classes that the instruction names are observed, with what of them is in view.
        image_size: pixels of an image.
        robots: names and robot files (.toml), with commas between them.
        split: whose tasks are trained on; "generated" has a new home every 100 episodes. None: train, in the track
            grounded generated.
        home: name or path of a home to train in instead of the split's; weights are chosen on tasks drawn for it.
        catalog: catalogue file of own things; None: the one that CHMARL_CATALOG names, if any.
        rules: the track, and what differs from it; read as `chmarl-pb evaluate` does.
    """

    observation: ObservationName = "scene_graph"
    goal: bool = False
    image_size: int = count(128)
    robots: str = ",".join(TEAM)
    split: Literal["train", "generated"] | None = None
    home: str | None = None
    catalog: str | None = None
    rules: tyro.conf.Suppress[tyro.conf.Fixed[dict[str, Any]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse values outside the fields' limits."""
        check(self)

    @property
    def options(self) -> Options:
        """The options of the environment."""
        split: dict[str, Any] = {} if self.split is None else {"split": self.split}
        return Options(
            self.observation, image_size=self.image_size, robots=listed(self.robots), home=self.home,
            catalog=self.catalog, goal=self.goal, **split, **self.rules,
        )  # fmt: skip


@dataclass(frozen=True)
class Place:
    """Where a training happens.

    Attributes:
        out: folder of the run; None: out/train/NAME, after its settings.
        threads: of torch.
        device: of torch, e.g. cuda.
        quiet: no progress bars, no notes.
    """

    out: Path | None = None
    threads: int = count(1)
    device: str = "cpu"
    quiet: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False

    def __post_init__(self) -> None:
        """Refuse values outside the fields' limits."""
        check(self)


@dataclass(frozen=True)
class Play:
    """Learn by playing."""

    algo: Fixed
    config: Annotated[RunConfig, Flat]
    env: Annotated[Env, Flat] = Env()
    place: Annotated[Place, Flat] = Place()

    @property
    def setting(self) -> Env:
        """What the robots are and observe."""
        return self.env

    def run(self, folder: Path) -> None:
        """Train in a folder."""
        _play(self.algo, self.config, self.env, self.place, folder)


#: Settings that both trainings of dagger-mappo have from the second.
_SAME = (
    "seed", "workers", "horizon", "features", "hidden", "layer_norm", "encoder", "image_encoder", "graph_pool",
    "word_vectors", "numbers_past", "cells_past", "history_past", "looks_past", "grounding_coef",
)  # fmt: skip


def _settings_of_imitation() -> Any:
    """Return the class of those settings that the first training of dagger-mappo has by itself."""
    kinds = get_type_hints(DAggerConfig)
    own = [
        (one.name, kinds[one.name], field(default=one.default, metadata=one.metadata))
        for one in fields(DAggerConfig)
        if one.name not in _SAME
    ]
    return make_dataclass("Imitation", own, frozen=True, namespace={"__doc__": DAggerConfig.__doc__})


Imitation = _settings_of_imitation()


@dataclass(frozen=True)
class DaggerMappo(Play):
    """Imitate a search, then learn by MAPPO from there on.

    The search knows no more than the robots see; to imitate it gives a learner that looks around and goes on,
    which the privileged planner, who never searches, teaches less well. MAPPO then improves the imitator by the reward.

    Attributes:
        imitation: settings that the first training has by itself; seed and networks are those of the second.
    """

    config: Annotated[MappoConfig, Flat]
    imitation: Annotated[Any, tyro.conf.arg(constructor=Imitation)] = field(default_factory=Imitation)

    def __post_init__(self) -> None:
        """Refuse a setting that the run would not use."""
        if self.config.start:
            raise ValueError("--start: dagger-mappo begins with its own imitator; use --algo mappo")

    def run(self, folder: Path) -> None:
        """Train twice in a folder; a finished first training is not done again."""
        imitation = DAggerConfig(**asdict(self.imitation), **{name: getattr(self.config, name) for name in _SAME})
        if (folder / IMITATION / BEST).is_file() or not (folder / LAST).exists():  # later its weights may be gone
            _play("imitation", imitation, self.env, self.place, folder / IMITATION)
        mappo = replace(self.config, start=str(folder / IMITATION / BEST))
        _play("mappo", mappo, self.env, self.place, folder)


@dataclass(frozen=True)
class Clone:
    """Learn from stored episodes of the planner, made by `chmarl-pb dataset generate`.

    Attributes:
        data: folder of the data sets; None: Minari's own.
    """

    algo: Fixed
    config: Annotated[CloningConfig, Flat]
    data: Path | None = None
    place: Annotated[Place, Flat] = Place()

    @property
    def setting(self) -> CloningConfig:
        """What the robots are and observe."""
        return self.config

    def run(self, folder: Path) -> None:
        """Train in a folder."""
        from chmarl_pb.learning.cloning.bc import clone  # needs the extra data

        clone(self.config, folder, self.data, self.place.quiet, self.place.threads, self.place.device)


Command = Play | Clone

#: Algorithm -> the command that trains it, with its defaults.
COMMANDS: dict[str, Command] = {
    "bc": Clone("bc", CloningConfig()),
    **{name: Play(name, row.config(image_encoder="resnet18")) for name, row in ALGORITHMS.items()},
    "dagger-mappo": DaggerMappo("dagger-mappo", MappoConfig(image_encoder="detector")),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    return run_command(partial(_run, sys.argv[1:] if arguments is None else arguments), ValueError)


def _run(arguments: Sequence[str]) -> int:
    command = parse(arguments)
    folder = command.place.out or Path("out/train") / run_name(command)
    if not any((place / LAST).exists() for place in (folder, folder / IMITATION)):  # what was begun goes on as it was
        check_used(command)
    command.run(folder)
    if command.place.quiet:
        return 0
    print(f"{folder / BEST}: the weights that were best on the validation tasks. Evaluate them with")
    setting = command.setting
    options = setting.options if isinstance(setting, Env) else Options(setting.observation)
    print(evaluate_command(folder / BEST, options, setting.robots))
    return 0


def parse(arguments: Sequence[str]) -> Command:
    """Return the training that arguments ask for; ``--algo NAME`` may stand anywhere among them, or NAME first.

    Raises:
        ValueError: no algorithm is named, or one that there is not.
    """
    words = _algorithm_first(arguments)
    rules, words = _rules_first(words)
    prog = "chmarl-pb train --algo"
    found: Command
    if ":" in words[0]:
        found = tyro.cli(Play, default=_own(words[0]), args=words[1:], prog=f"{prog} {words[0]}", description=ABOUT)
    else:
        commands = [Annotated[type(one), tyro.conf.subcommand(name, default=one)] for name, one in COMMANDS.items()]
        kinds: Any = Union[tuple(commands)]  # noqa: UP007
        found = tyro.cli(kinds, args=words, prog=prog, description=ABOUT)
    if isinstance(found, Play):
        found = replace(found, env=replace(found.env, rules=rules))
    return found


def check_used(command: Command) -> None:
    """Refuse options that a run would not use.

    Raises:
        ValueError: there is one.
    """
    why_idle = partial(idle_in_train, config=command.config, setting=command.setting)
    kind = COMMANDS.get(command.algo) or _own(command.algo)
    refuse_idle(command.config, kind.config, partial(why_idle, algorithm=command.algo))
    if isinstance(command, DaggerMappo):
        refuse_idle(command.imitation, Imitation(), partial(why_idle, algorithm=IMITATION), f"{IMITATION}.")
    if isinstance(command, Play):
        refuse_idle(command.env, Env(), partial(why_idle, algorithm=command.algo))


def _own(algorithm: str) -> Play:
    """Return the command that trains an algorithm of one's own, with its defaults."""
    return Play(algorithm, find_algorithm(algorithm).config(image_encoder="resnet18"))


def _rules_first(words: Sequence[str]) -> tuple[dict[str, Any], list[str]]:
    """Return the rules that are among arguments, read as `chmarl-pb evaluate` reads them, and what else is there.

    Raises:
        ValueError: clones are to learn by other rules than the paper's.
    """
    if words[0] == "bc":
        if any(word.split("=")[0] == "--track" for word in words):
            raise ValueError("--track: bc learns from stored episodes of the paper's rules; use --algo imitation")
        return {}, list(words)
    parser = argparse.ArgumentParser(
        usage=argparse.SUPPRESS, description="The rules, as in chmarl-pb evaluate:", add_help=False, allow_abbrev=False
    )
    add_rules(parser)
    if "-h" in words or "--help" in words:
        print(parser.format_help())
    given, rest = parser.parse_known_args(words)
    return {name: value for name, value in given_rules(given).items() if (name, value) != ("track", PAPER)}, rest


def _algorithm_first(arguments: Sequence[str]) -> list[str]:
    """Return arguments with the name of the algorithm in front, as tyro wants a choice of commands to be."""
    words = [part for word in arguments for part in (word.split("=", 1) if word.startswith("--algo=") else [word])]
    if "--algo" in words[:-1]:
        place = words.index("--algo")
        words = [words[place + 1], *words[:place], *words[place + 2 :]]
    if words[:1] == ["--algo"]:
        words = []
    if words[:1] not in ([name] for name in (*COMMANDS, "-h", "--help")) and ":" not in "".join(words[:1]):
        raise ValueError(f"--algo {words[0] if words else 'is missing'}: use one of: {', '.join(COMMANDS)}")
    return words


def _play(algorithm: str, config: RunConfig, env: Env, place: Place, folder: Path) -> None:
    options = env.options
    if config.horizon not in (RunConfig.horizon, options.max_steps):
        raise ValueError(
            f"--horizon {config.horizon}: the time limit of episodes is {options.max_steps}; give --max-steps instead"
        )
    config = replace(config, horizon=max(RunConfig.horizon, options.max_steps))
    env_fn, setting = benchmark(
        env.observation, image_encoder=config.image_encoder, image_size=env.image_size, robots=listed(env.robots),
        split=options.split, home=env.home, catalog=env.catalog, goal=env.goal, **env.rules,
    )  # fmt: skip
    imitated = partial(make_expert, config.expert) if isinstance(config, DAggerConfig) else None
    validate = _validation(env)
    train(env_fn, algorithm, config, folder, validate, setting, place.quiet, imitated, place.threads, place.device)


def _validation(env: Env) -> Validate:
    """Return how the best weights are chosen: in homes like those of training."""
    if env.home:
        lookalikes = env.options.lookalikes
        return by_home(env.home, robots=listed(env.robots), catalog=env.catalog, lookalikes=lookalikes)
    return by_tasks(VALIDATION.get(env.options.split, VALIDATION["train"]))


def run_name(command: Command) -> str:
    """Return the name of a run's folder: everything that makes a row of the tables."""
    setting = command.setting
    rules = setting.options if isinstance(setting, Env) else setting
    own = recorded_rules(setting.options) if isinstance(setting, Env) else {}
    words = [own.pop("track")] if "track" in own else []
    words += ["centralized"] if getattr(setting, "centralized", False) else []
    words += [word for word in ("messages", "feedback", "goal") if getattr(rules, word, False)]
    words += [f"{name}-{value}".lower() for name, value in own.items()]
    words += [split for split in (getattr(setting, "split", None),) if split not in (None, "train")]
    words += [Path(file).stem for file in (getattr(setting, name, None) for name in ("home", "catalog")) if file]
    words += [Path(robot).stem for robot in listed(setting.robots)] if listed(setting.robots) != TEAM else []
    size = getattr(setting, "image_size", Env.image_size)
    words += [f"{size}px"] if size != Env.image_size else []
    return "-".join([command.algo.replace(":", "-"), setting.observation, *words, f"seed{command.config.seed}"])
