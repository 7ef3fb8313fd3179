"""Learners: networks, algorithms, runs, and policies of trained weights. The only package that needs torch.

Letters for shapes, in all of the package: B batch, T steps of an episode, N agents, A actions, E embedding, H hidden,
S state.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from chmarl_pb.extras import check

if TYPE_CHECKING:
    from chmarl_pb.learning.algorithms.value import Config as Config
    from chmarl_pb.learning.runs.loop import train as train

check("chmarl_pb.learning", "train", "torch")

#: What the package offers -> its module, which is loaded at first use, as torch is slow to import.
_MODULES = {"Config": "algorithms.value", "train": "runs.loop"}

__all__ = ["Config", "train"]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'chmarl_pb.learning' has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
