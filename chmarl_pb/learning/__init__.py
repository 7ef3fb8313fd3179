"""Learners: networks, algorithms, runs, and policies of trained weights. The only package that needs torch.

Letters for shapes, in all of the package: B batch, T steps of an episode, N agents, A actions, E embedding, H hidden,
S state.
"""

from typing import TYPE_CHECKING, Any

from chmarl_pb.extras import check

if TYPE_CHECKING:
    from chmarl_pb.learning.config import Config as Config
    from chmarl_pb.learning.runs.loop import train as train

__all__ = ["Config", "train"]

check("chmarl_pb.learning", "train", "torch")


def __getattr__(name: str) -> Any:  # loaded at first use, as torch is slow to import
    if name == "Config":
        from chmarl_pb.learning.config import Config

        return Config
    if name == "train":
        from chmarl_pb.learning.runs.loop import train

        return train
    raise AttributeError(f"module 'chmarl_pb.learning' has no attribute {name!r}")
