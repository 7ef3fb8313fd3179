"""What drives the robots: a Policy sees observations and infos and answers with actions."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.errors import OptionError
from chmarl_pb.fingerprint import name_of
from chmarl_pb.robots.pointing import place_of

Observations = dict[str, dict[str, np.ndarray]]
Infos = dict[str, dict[str, Any]]
Actions = dict[str, int]


class Policy(Protocol):
    """Anything that drives the robots through an episode: random, planned, searched, learned, a person.

    In an evaluation each robot has an object of its own, which gets nothing but that robot's observation and action
    mask; see :mod:`chmarl_pb.policies.seats`.

    >>> class Stay:
    ...     def reset(self, seed):
    ...         pass
    ...
    ...     def act(self, observations, infos):
    ...         return {robot: len(info["action_mask"]) - 1 for robot, info in infos.items()}
    >>> env = chmarl_pb.parallel_env(split="val-unseen", max_steps=3)
    >>> chmarl_pb.rollout(env, Stay(), seed=0).steps
    3
    """

    def reset(self, seed: int | None) -> None:
        """Forget the last episode; called after the environment's reset."""

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action, for each robot that is observed.

        With own words it is a pair of it and a symbol, see ``Symbols``.
        """


class RandomPolicy:
    """Chooses uniformly among all actions."""

    def __init__(self, counts: dict[str, int]):
        """Remember how many actions each robot has."""
        self.counts = counts
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Start the random streams anew, one for each robot."""
        seeds = np.random.SeedSequence(seed).spawn(len(self.counts))
        self._rngs = dict(zip(self.counts, map(np.random.default_rng, seeds), strict=True))

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return a random action of each robot."""
        return {robot: int(self._rngs[robot].integers(self.counts[robot])) for robot in observations}


@runtime_checkable
class PolicyEnv(Protocol):
    """What policies may ask of the ParallelEnv that they drive; ``simulation`` and ``setting`` are the planner's.

    Attributes:
        action_names: robot -> names of its actions, in the order of their numbers.
        rooms: rooms of the home, in the order of the messages.
        catalog: the classes of things.
        options: of the environment.
    """

    action_names: dict[str, tuple[str, ...]]
    rooms: tuple[str, ...]
    catalog: Catalog
    options: Any
    simulation: Any
    setting: Any


def grasps(actions: Sequence[str]) -> bool:
    """Return whether a robot with these actions can grasp."""
    return place_of(actions, "pick") is not None


def first_grasper(action_names: Mapping[str, Sequence[str]]) -> str:
    """Return the first robot that can grasp; it is the one that learns, or acts, where one does alone."""
    return next(name for name, actions in action_names.items() if grasps(actions))


def symbols_of(env: Any) -> int:
    """Return how many symbols robots choose from in every step; 0 where they have no words of their own."""
    return int(getattr(env, "symbols", 0))


#: Makes the policy that drives an environment.
Factory = Callable[[Any], Policy]


def require_policy(given: Any) -> Policy:
    """Return a policy as it is.

    Raises:
        OptionError: it is none.
    """
    missing = [name for name in ("reset", "act") if not callable(getattr(given, name, None))]
    if isinstance(given, type):
        raise OptionError(f"{given.__qualname__} is a class, not a policy; make an object of it")
    if missing:
        raise OptionError(f"{given!r} is no policy: it has no method {' nor '.join(missing)}; see chmarl_pb.Policy")
    policy: Policy = given
    return policy


def called(make: Callable[..., Any], takes: str, *arguments: Any, **named: Any) -> Any:
    """Return what a callable of the user's makes.

    Args:
        make: the callable.
        takes: what it is to take, for messages.
        *arguments: for it.
        **named: for it.

    Raises:
        OptionError: it does not take them.
    """
    try:
        return make(*arguments, **named)
    except TypeError as error:
        if error.__traceback__ is None or error.__traceback__.tb_next is not None:  # from within
            raise
        raise OptionError(f"{name_of(make)} cannot be called with {takes} ({error}); name what takes it") from error


def core_of(env: Any) -> Any:
    """Return the ParallelEnv behind an environment or a view of it.

    Raises:
        OptionError: it is none of this package's.
    """
    inner = env.unwrapped
    inner = getattr(inner, "parallel", inner)
    if not hasattr(inner, "action_names"):
        raise OptionError(f"{type(env).__name__} is not an environment of chmarl_pb; make one by parallel_env()")
    return inner
