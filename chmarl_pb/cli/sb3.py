"""``chmarl-pb sb3``: train a baseline of Stable-Baselines3; killed at any moment, the same command goes on."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path

from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.learning.networks import GRAPH_POOLS
from chmarl_pb.learning.networks.frozen import ENCODERS, frozen_encoder
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.learning.sb3.config import ALGORITHMS, PRESETS, Config
from chmarl_pb.learning.sb3.train import BEST, RESULT, run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit code."""
    return run_command(partial(_main, sys.argv[1:] if arguments is None else arguments), ValueError)


def _main(arguments: Sequence[str]) -> int:
    config, folder, workers = parse(arguments)
    if config.observation == "visual" and config.image_encoder in ENCODERS and not config.keys:
        config = replace(config, frozen=frozen_encoder(config.image_encoder).fingerprint)
    run(config, folder, workers, quiet=False)
    best = json.loads((folder / RESULT).read_text())["best"]
    print(
        f"{folder / BEST}: SR {100 * best['sr']:.1f}, PLW {100 * best['plw']:.1f} on validation tasks. Evaluate it with"
    )
    goal = " --goal" if PRESETS[config.preset].goal else ""
    print(f"chmarl-pb evaluate --policy {folder / BEST} --split test-unseen --observation {config.observation}{goal}")
    return 0


def parse(arguments: Sequence[str]) -> tuple[Config, Path, int | None]:
    """Return the settings that a command names, the folder of the run, and the number of processes."""
    parser = _parser()
    options = vars(parser.parse_args(arguments))
    workers, out = options.pop("workers"), options.pop("out")
    observation, humanoid_only = options.pop("observation"), options.pop("humanoid_only")
    if options["env_id"] and (observation or humanoid_only):
        parser.error("--env names observation and robots already; leave out --observation and --humanoid-only")
    options["env_id"] = options["env_id"] or _env_id(observation or "scene_graph", humanoid_only)
    return Config(**options), out or Path("out/sb3") / _name(options), workers


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="chmarl-pb sb3", description=__doc__.split("``: ")[1])
    default = {field.name: field.default for field in fields(Config)}
    switch = argparse.BooleanOptionalAction
    parser.add_argument("--algo", choices=tuple(ALGORITHMS), required=True)
    parser.add_argument("--env", choices=ENV_IDS, dest="env_id", help="or --observation, as the tables name it")
    parser.add_argument("--observation", choices=("scene_graph", "visual"), help="default: scene_graph")
    parser.add_argument("--humanoid-only", action="store_true", help="the drone follows the search policy")
    parser.add_argument(
        "--preset", choices=tuple(PRESETS), default=default["preset"],
        help="what the network reads, and how it learns: the goal's few numbers, an encoder's features, too, or these "
        "alone; default: %(default)s",
    )  # fmt: skip
    parser.add_argument("--messages", action=switch, default=True, help="whether the robots hear each other")
    parser.add_argument("--feedback", action=switch, default=True, help="whether they get language feedback")
    parser.add_argument("--image-encoder", choices=("cnn", *ENCODERS), default="cnn", help="all but cnn are frozen")
    texts = {
        "steps": "of all environments", "seed": "of every random stream", "envs": "side by side",
        "image_size": "pixels", "interval": "steps between two validations", "tasks": "of each validation split",
    }  # fmt: skip
    for name, text in texts.items():
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=int, default=default[name], help=f"{text}; default: %(default)s"
        )
    parser.add_argument("--graph-pool", choices=tuple(GRAPH_POOLS), default=default["graph_pool"])
    parser.add_argument("--learning-rate", type=float, help="default: that of the algorithm")
    parser.add_argument("--workers", type=int, help="processes; default: one for each core")
    parser.add_argument("--out", type=Path, help="folder of the run; default: out/sb3/NAME")
    return parser


def _env_id(observation: str, humanoid_only: bool) -> str:
    """Return the Gymnasium id of a row of the tables."""
    kind = {"scene_graph": "SceneGraph", "visual": "Visual"}[observation]
    return f"CHMARL/{kind}{'Humanoid' if humanoid_only else ''}-v0"


def _name(options: dict[str, object]) -> str:
    """Return the name of a run's folder."""
    parts = [options["algo"], str(options["env_id"]).removeprefix("CHMARL/").removesuffix("-v0").lower()]
    parts += [word for word in ("messages", "feedback") if options[word]]
    return "-".join([*map(str, parts), str(options["preset"]), f"seed{options['seed']}"])
