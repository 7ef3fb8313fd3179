"""Checkpoints as policies, for ``chmarl-pb evaluate --policy CHECKPOINT``: entry point ``chmarl_pb.checkpoints``."""

from collections.abc import Callable
from pathlib import Path

from chmarl_pb.learning.policies.cloned import KIND, BCPolicies
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load
from chmarl_pb.policies.policy import Factory

#: Kind of a checkpoint -> what makes the policies of one.
_LOADERS: dict[str, Callable[[Path], Factory]] = {"value": ValuePolicies, KIND: BCPolicies}


def load_policy(path: Path) -> Factory:
    """Return what makes the policy of a checkpoint of any kind.

    Raises:
        CheckpointError: the file is missing, damaged, or holds no policy.
    """
    kind = load(path)["kind"]
    if kind not in _LOADERS:
        raise CheckpointError(
            f"{path}: holds a checkpoint of kind {kind!r}, which is no policy; use best.pt of the run"
        )
    return _LOADERS[kind](path)
