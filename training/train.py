"""`python -m training.train`: train one learner on the benchmark; killed at any moment, the same command goes on."""

import argparse
import sys
import types
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import torch

import chmarl_pb
from chmarl_pb.envs.options import MAX_STEPS
from chmarl_pb.errors import ChmarlError
from training.config import ALGORITHMS, Config
from training.features import FeatureEnv
from training.loop import BEST, train
from training.policy import FROZEN
from training.resnet import frozen_resnet18
from training.validation import by_tasks

#: Settings of the configuration that the command takes; all others keep their defaults.
SETTABLE = ("episodes", "envs", "updates", "batch_size", "buffer_size", "memory_gib", "learning_rate", "gamma")


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = _parser().parse_args(arguments)
    torch.set_num_threads(options.threads)
    folder = options.out or Path("out/train") / _name(options)
    try:
        return _clone(options, folder) if options.algo == "bc" else _factorise(options, folder)
    except ChmarlError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def _factorise(options: argparse.Namespace, folder: Path) -> int:
    if options.centralized:
        print("error: --centralized is for --algo bc; value factorisation acts decentralized", file=sys.stderr)
        return 2
    given = {name: getattr(options, name) for name in SETTABLE if getattr(options, name) is not None}
    encoder = options.image_encoder or "resnet18"
    config = replace(Config(seed=options.seed, horizon=MAX_STEPS), image_encoder=encoder, **given)
    env_fn = partial(
        _environment, options.observation, encoder, messages=options.messages, feedback=options.feedback,
        image_size=options.image_size,
    )  # fmt: skip
    frozen = frozen_resnet18().fingerprint if options.observation == "visual" and encoder == "resnet18" else ""
    setting = {"messages": options.messages, "feedback": options.feedback, FROZEN: frozen}
    result = train(env_fn, options.algo, config, folder, by_tasks(), setting, quiet=False)
    print(f"{folder / BEST}: PLW {100 * result.best_score:.1f} on the validation tasks. Evaluate it with")
    print(f"chmarl-pb evaluate --policy {folder / BEST} --split test-unseen --observation {options.observation}")
    return 0


def _environment(observation: str, encoder: str, **options: Any) -> Any:
    env = chmarl_pb.parallel_env(observation, **options)
    return FeatureEnv(env) if observation == "visual" and encoder == "resnet18" else env


def _clone(options: argparse.Namespace, folder: Path) -> int:
    from training.cloning import CloningConfig, clone

    config = CloningConfig(
        options.observation, options.centralized, options.messages, options.feedback, options.noise, options.seed
    )
    if options.image_encoder:
        config = replace(config, image_encoder=options.image_encoder)
    clone(config, folder, options.data)
    print(f"{folder / BEST}: the best weights. Evaluate them with")
    print(f"chmarl-pb evaluate --policy {folder / BEST} --split test-unseen --observation {options.observation}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m training.train", description=__doc__.split("`: ")[1])
    switch = argparse.BooleanOptionalAction
    parser.add_argument("--algo", choices=("bc", *ALGORITHMS), required=True)
    parser.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    parser.add_argument("--messages", action=switch, default=True, help="whether the robots hear each other")
    parser.add_argument("--feedback", action=switch, default=True, help="whether they get language feedback")
    parser.add_argument("--centralized", action="store_true", help="bc only: one network for both robots")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder of the run; default: out/train/NAME")
    parser.add_argument("--image-size", type=int, default=128, help="pixels")
    parser.add_argument("--image-encoder", help="of pictures; default: resnet18, frozen")
    parser.add_argument("--data", type=Path, help="bc only: folder of the data sets; default: Minari's own")
    parser.add_argument("--noise", type=float, default=0.0, help="bc only: share of random actions in the data")
    parser.add_argument("--threads", type=int, default=1, help="of torch")
    kinds = {field.name: type(field.default) for field in fields(Config)}
    defaults = Config()
    for name in SETTABLE:
        parser.add_argument(
            f"--{name.replace('_', '-')}", type=kinds[name], help=f"default: {getattr(defaults, name)}; not for bc"
        )
    return parser


def _name(options: argparse.Namespace) -> str:
    """Return the name of a run's folder: everything that makes a row of the tables."""
    parts = [options.algo, options.observation]
    parts += ["centralized"] if options.centralized else []
    parts += [word for word in ("messages", "feedback") if getattr(options, word)]
    return "-".join([*parts, f"seed{options.seed}"])


class _Callable(types.ModuleType):
    """`training.train` is this module as soon as it is imported, and a function before: both can be called."""

    __call__ = staticmethod(train)


if __name__ == "__main__":
    raise SystemExit(main())
sys.modules[__name__].__class__ = _Callable
