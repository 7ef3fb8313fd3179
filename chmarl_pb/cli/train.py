"""``chmarl-pb train``: train one learner on the benchmark; killed at any moment, the same command goes on."""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from chmarl_pb.cli.flags import add_flags
from chmarl_pb.envs.options import MAX_STEPS
from chmarl_pb.learning.algorithms.mappo import check_start
from chmarl_pb.learning.benchmark_env import benchmark
from chmarl_pb.learning.config import CONFIGS, MappoConfig
from chmarl_pb.learning.networks.frozen import ENCODERS
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.policies.cloned import CloningConfig
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.runs.loop import BEST, train
from chmarl_pb.learning.runs.validation import by_tasks
from chmarl_pb.policies.registry import make_policy

#: Settings that all learners share or that the command fixes; all others are flags of their own.
_SHARED = ("observation", "messages", "feedback", "centralized", "seed", "image_encoder", "horizon")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options, settings = parse(sys.argv[1:] if arguments is None else arguments)
    if options.centralized and options.algo != "bc":
        print("error: --centralized is for --algo bc; all others act decentralized", file=sys.stderr)
        return 2
    return run_command(partial(_train, options, settings), ValueError)


def _train(options: argparse.Namespace, settings: dict[str, Any]) -> int:
    folder = options.out or Path("out/train") / _name(options)
    (_clone if options.algo == "bc" else _learn)(options, settings, folder)
    print(f"{folder / BEST}: the weights that were best on the validation tasks. Evaluate them with")
    print(f"chmarl-pb evaluate --policy {folder / BEST} --split test-unseen --observation {options.observation}")
    return 0


def _learn(options: argparse.Namespace, settings: dict[str, Any], folder: Path) -> None:
    encoder = options.image_encoder
    config = CONFIGS[options.algo](seed=options.seed, horizon=MAX_STEPS, image_encoder=encoder, **settings)
    env_fn, setting = benchmark(
        options.observation, options.messages, options.feedback, encoder, image_size=options.image_size
    )
    if isinstance(config, MappoConfig) and config.start:
        check_start(Path(config.start), setting)
    teacher = partial(make_policy, "search") if options.algo == "imitation" else None
    train(env_fn, options.algo, config, folder, by_tasks(), setting, False, teacher, options.threads)


def _clone(options: argparse.Namespace, settings: dict[str, Any], folder: Path) -> None:
    from chmarl_pb.learning.algorithms.bc import clone

    names = ("observation", "centralized", "messages", "feedback", "seed", "image_encoder")
    shared = {name: getattr(options, name) for name in names}
    clone(CloningConfig(**shared, **settings), folder, options.data, quiet=False, threads=options.threads)


def parse(arguments: Sequence[str]) -> tuple[argparse.Namespace, dict[str, Any]]:
    """Return the options of the command, and the learner's own settings among them."""
    early = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    early.add_argument("--algo")
    try:
        algo = early.parse_known_args(arguments)[0].algo
    except argparse.ArgumentError:  # the parser of all options says what is wrong
        algo = None
    parser = _parser()
    kind: type[Any] | None = CloningConfig if algo == "bc" else CONFIGS.get(algo)
    names = add_flags(parser, kind, _SHARED) if kind else []
    options = parser.parse_args(arguments)
    if options.threads < 1:
        parser.error(f"--threads {options.threads}: use at least 1")
    return options, {name: getattr(options, name) for name in names}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="chmarl-pb train", description=__doc__.split("``: ")[1],
        epilog="With --algo, --help lists all settings of that learner.", allow_abbrev=False,
    )  # fmt: skip
    switch = argparse.BooleanOptionalAction
    parser.add_argument("--algo", choices=("bc", *CONFIGS), required=True)
    parser.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    parser.add_argument("--messages", action=switch, default=True, help="whether the robots hear each other")
    parser.add_argument("--feedback", action=switch, default=True, help="whether they get language feedback")
    parser.add_argument("--centralized", action="store_true", help="bc only: one network for both robots")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder of the run; default: out/train/NAME")
    parser.add_argument("--image-size", type=int, default=128, help="pixels; not for bc")
    encoders = tuple(dict.fromkeys((*IMAGE_ENCODERS, *ENCODERS)))
    parser.add_argument("--image-encoder", choices=encoders, default="resnet18", help="all but cnn are frozen")
    parser.add_argument("--data", type=Path, help="bc only: folder of the data sets; default: Minari's own")
    parser.add_argument("--threads", type=int, default=1, help="of torch")
    return parser


def _name(options: argparse.Namespace) -> str:
    """Return the name of a run's folder: everything that makes a row of the tables."""
    parts = [options.algo, options.observation]
    parts += ["centralized"] if options.centralized else []
    parts += [word for word in ("messages", "feedback") if getattr(options, word)]
    return "-".join([*parts, f"seed{options.seed}"])
