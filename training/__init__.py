"""Learners for the benchmark: encoders, behaviour cloning, value factorisation. Imports chmarl_pb, never the reverse.

Letters for shapes, in all of the package: B batch, T steps of an episode, N agents, A actions, E embedding, H hidden,
S state.
"""

from typing import TYPE_CHECKING, Any

from chmarl_pb.extras import check

if TYPE_CHECKING:
    from training.config import Config as Config
    from training.loop import train as train

__all__ = ["Config", "train"]

check("training", "train", "torch")


def __getattr__(name: str) -> Any:  # loaded at first use, as torch is slow to import
    if name == "Config":
        from training.config import Config

        return Config
    if name == "train":
        from training.loop import train

        return train
    raise AttributeError(f"module 'training' has no attribute {name!r}")
