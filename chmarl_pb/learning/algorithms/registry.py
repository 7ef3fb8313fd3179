"""The algorithms: each is one file with a learner and its settings, and one row here."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor

from chmarl_pb.learning.algorithms.dagger import DAgger, DAggerConfig
from chmarl_pb.learning.algorithms.learner import Learner
from chmarl_pb.learning.algorithms.mappo import Mappo, MappoConfig
from chmarl_pb.learning.algorithms.pqn import Pqn, PqnConfig
from chmarl_pb.learning.algorithms.qtran import Qtran
from chmarl_pb.learning.algorithms.value import Config, ValueLearner
from chmarl_pb.learning.benchmark_env import meaning_in, untold
from chmarl_pb.learning.config import HOME, MEANING, RULES, TRAINED_IN, RunConfig
from chmarl_pb.learning.lookup import look_up
from chmarl_pb.learning.spaces import LearnerInterface
from chmarl_pb.learning.storage.checkpoint import CheckpointError, fill, load, reading


@dataclass(frozen=True)
class Algorithm:
    """One algorithm.

    Attributes:
        learner: makes its learner from its name, the interface of the environment, and its settings.
        config: class of its settings.
        imitates: whether it needs an expert to imitate.
        logits: whether its agents' values are logits of a policy, so that another such learner can begin with them.
    """

    learner: Callable[[str, LearnerInterface, Any], Learner]
    config: type[RunConfig]
    imitates: bool = False
    logits: bool = False


ALGORITHMS: dict[str, Algorithm] = {
    "iql": Algorithm(ValueLearner, Config),
    "vdn": Algorithm(ValueLearner, Config),
    "qmix": Algorithm(ValueLearner, Config),
    "qtran": Algorithm(Qtran, Config),
    "pqn": Algorithm(Pqn, PqnConfig),
    "imitation": Algorithm(DAgger, DAggerConfig, imitates=True, logits=True),
    "mappo": Algorithm(Mappo, MappoConfig, logits=True),
}


def find_algorithm(name: str) -> Algorithm:
    """Return an algorithm by its name, or by ``module:name``.

    Raises:
        ValueError: there is none of this name, or it is something else.
        UntrustedError: a file names it that is being read, see :func:`look_up`.
    """
    row = look_up("algorithm", name, ALGORITHMS)
    if not isinstance(row, Algorithm):
        raise ValueError(f"algorithm={name!r}: is a {type(row).__name__}, not an Algorithm of a learner and settings")
    return row


def make_learner(algorithm: str, interface: LearnerInterface, config: RunConfig, resumed: bool = False) -> Learner:
    """Return the learner of an algorithm, with the weights that its settings say to begin with.

    Args:
        algorithm: one of ``ALGORITHMS``.
        interface: of the environment.
        config: its settings.
        resumed: whether it is restored after this, so that the weights to begin with need not be there any more.

    Raises:
        ValueError: there is no such algorithm, or the settings are those of another.
        CheckpointError: the file of the first weights is damaged, of another architecture, or has no policies.
    """
    row = find_algorithm(algorithm)
    if type(config) is not row.config:
        raise ValueError(f"{algorithm} takes a {row.config.__name__}, not a {type(config).__name__}")
    learner = row.learner(algorithm, interface, config)
    if config.first_weights and not resumed:
        path = Path(config.first_weights)
        fill(learner.agents, _policies(path), path)
    return learner


def check_first_weights(config: RunConfig, setting: dict[str, Any]) -> None:
    """Check that the weights to begin with were learned in the same setting: messages, images, meaning of actions.

    Homes, wording and time limit may be others.

    Raises:
        CheckpointError: they were not, or the file is damaged.
    """
    if not config.first_weights:
        return
    path = Path(config.first_weights)
    with reading(path):
        theirs = dict(load(path, "value")["setting"])
    theirs, own = ({**one, RULES: meaning_in(one)} for one in (theirs, setting))
    theirs = {**untold(theirs, own), **theirs}
    for name in sorted((theirs.keys() | own.keys()) - {HOME, MEANING, TRAINED_IN}):
        if theirs.get(name) != own.get(name):
            raise CheckpointError(
                f"{path}: was trained with {name}={theirs.get(name)!r}, not {own.get(name)!r}; start from another"
            )


def _policies(path: Path) -> dict[str, Tensor]:
    """Return weights of networks whose values are logits."""
    with reading(path):
        content = load(path, "value")
        if not find_algorithm(content["algorithm"]).logits:
            known = [name for name, row in ALGORITHMS.items() if row.logits]
            raise CheckpointError(f"{path}: {content['algorithm']} learns no policy; start from {' or '.join(known)}")
        weights: dict[str, Tensor] = content["agents"]
        return weights
