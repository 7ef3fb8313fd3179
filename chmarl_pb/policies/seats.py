"""Seats: what an evaluated policy is given, and no more.

Before an episode it may know the names and spaces of its environment, an :class:`Interface`. In each step it gets its
own robot's observation and action mask. So each robot has a policy object of its own; all of them share a process, see
:mod:`chmarl_pb.evaluation.seats_apart`. A policy that needs more says so by attributes of what makes it (the class, or
a function), and results say it, too:

- ``centralized = True``: one object drives all robots, and gets the observations of all;
- ``privileged = True``: it is given the environment itself and whole infos.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gymnasium import spaces

from chmarl_pb.catalog import Catalog
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.policy import Actions, Factory, Infos, Observations, Policy, called, core_of, require_policy


@dataclass(frozen=True)
class Interface:
    """What a policy may know of its environment before an episode; it stands in for the environment.

    Attributes:
        possible_agents: the robots.
        action_names: robot -> names of its actions, in the order of their numbers.
        rooms: rooms of the home, in the order of the messages.
        catalog: the classes of things.
        options: of the environment.
        symbols: how many symbols robots choose from in every step; 0 without words of their own.
        observation_spaces: robot -> its observation space.
        action_spaces: robot -> its action space.
    """

    possible_agents: Sequence[str]
    action_names: Mapping[str, tuple[str, ...]]
    rooms: tuple[str, ...]
    catalog: Catalog
    options: Any
    symbols: int
    observation_spaces: Mapping[str, spaces.Space[Any]]
    action_spaces: Mapping[str, spaces.Space[Any]]

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return a robot's observation space."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return a robot's action space."""
        return self.action_spaces[agent]

    @property
    def unwrapped(self) -> "Interface":
        """The interface itself: there is nothing behind it."""
        return self


def interface_of(env: Any) -> Interface:
    """Return what a policy may know of a ParallelEnv of this package, in wrappers or not."""
    core, robots = core_of(env), list(env.possible_agents)
    return Interface(
        robots, core.action_names, core.rooms, core.catalog, core.options, core.symbols,
        {name: env.observation_space(name) for name in robots}, {name: env.action_space(name) for name in robots},
    )  # fmt: skip


def masks_of(infos: Infos) -> Infos:
    """Return infos with nothing but the action masks."""
    return {name: {"action_mask": info["action_mask"]} for name, info in infos.items()}


class Seats:
    """Policies in their seats, as one policy.

    Attributes:
        policies: robot -> what drives it.
    """

    def __init__(self, policies: Mapping[str, Policy]):
        """Take one policy for each robot."""
        self.policies = policies

    def reset(self, seed: int | None) -> None:
        """Forget the last episode; all get one seed, so that they can agree without a word."""
        for policy in self.policies.values():
            policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action, each chosen by its own policy from its own observation and mask."""
        masks = masks_of(infos)
        return {name: self._choose(name, policy, observations, masks) for name, policy in self.policies.items()}

    def _choose(self, robot: str, policy: Policy, observations: Observations, masks: Infos) -> Any:
        try:
            answer: Any = policy.act({robot: observations[robot]}, {robot: masks[robot]})
        except KeyError as error:
            raise beyond_its_seat(error, robot, observations) from error
        if not isinstance(answer, Mapping) or robot not in answer:
            raise OptionError(
                f"the policy of {robot!r} answered {answer!r}; act() is to return a dict with the number of its "
                f"action, e.g. {{{robot!r}: 0}}"
            )
        return answer[robot]


class CommonSeat:
    """One policy for all robots, which gets their observations and action masks."""

    def __init__(self, policy: Policy):
        """Take a policy."""
        self.policy = policy

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action."""
        try:
            return self.policy.act(observations, masks_of(infos))
        except KeyError as error:
            raise beyond_its_seat(error, "", observations) from error


def beyond_its_seat(error: KeyError, robot: str, observations: Observations) -> Exception:
    """Return an error that says what a policy asked for and was not given; another KeyError as it is."""
    key = error.args[0] if error.args else ""
    if key in observations and key != robot:
        return OptionError(
            f"the policy of {robot!r} asked for the observation of {key!r}; a policy that needs those of all robots "
            "declares it by the attribute centralized = True"
        )
    if key in ("instruction", "feedback", "action_success", "success", "potential", "visible", "task_id"):
        return OptionError(
            f"the policy asked for infos[...][{key!r}]; evaluated policies get observations and action masks. Read the "
            "observation, or let what makes the policy declare privileged = True"
        )
    return error


def seated(make: Factory, env: Any, privileged: bool = False, centralized: bool = False) -> Policy:
    """Return the policy for an environment, with all robots in their seats.

    Args:
        make: makes the policy.
        env: a ParallelEnv of this package, in wrappers or not.
        privileged: whether the policy is given the environment and whole infos.
        centralized: whether one object drives all robots.

    Raises:
        OptionError: what it makes is no policy, or it takes no environment.
    """
    if privileged:
        return _made(make, env)
    known = interface_of(env)
    if centralized:
        return CommonSeat(_made(make, known))
    return Seats({name: _made(make, known) for name in known.possible_agents})


def _made(make: Factory, env: Any) -> Policy:
    return require_policy(called(make, "an environment", env))
