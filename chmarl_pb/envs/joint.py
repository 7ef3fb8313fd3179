"""Gymnasium views of the core: one policy for all robots, or for the one that grasps alone."""

from collections.abc import Mapping
from functools import partial
from typing import Any, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces

from chmarl_pb.envs.options import Options, check_one_of, plain_value
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.tracks import GROUNDED, PAPER, TRACKS
from chmarl_pb.envs.words import as_numbers
from chmarl_pb.errors import ActionError, OptionError
from chmarl_pb.limits import whole_number
from chmarl_pb.policies.policy import first_grasper
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.world import World

T = TypeVar("T")
Info = dict[str, Any]
Step = tuple[dict[str, np.ndarray], float, bool, bool, Info]

PARTNERS = ("search", "belief")


class JointActions(spaces.MultiDiscrete):
    """A number for each robot. Learners that know single numbers only, as DQN, show its text when they refuse it."""

    def __repr__(self) -> str:
        """Return the text of the space, and where the one with single numbers is."""
        text = super().__repr__()  # type: ignore[no-untyped-call]
        return f"{text} (make the environment with flat_actions=True for Discrete({self.nvec.prod()}))"


class Viewing:
    """What all views of a :class:`HouseholdEnv`, which is their attribute ``parallel``, have in common."""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 4}  # noqa: RUF012

    parallel: HouseholdEnv

    @property
    def options(self) -> Options:
        """How the environment was made; see :attr:`HouseholdEnv.options`."""
        return self.parallel.options

    @property
    def world(self) -> World:
        """The world of the home that the present episode is played in."""
        return self.parallel.world

    @property
    def episodes_in_a_home(self) -> int:
        """See :attr:`HouseholdEnv.episodes_in_a_home`."""
        return self.parallel.episodes_in_a_home

    def render(self) -> np.ndarray | None:
        """Return or show a frame; see :meth:`HouseholdEnv.render`."""
        return self.parallel.render()

    def close(self) -> None:
        """Disconnect from physics."""
        self.parallel.close()


class JointEnv(Viewing, gymnasium.Env):
    """All robots as one agent.

    Observation: the keys of all robots with the prefixes ``humanoid_`` and ``drone_``. Action:
    ``MultiDiscrete([10, 9])``, or with ``flat_actions`` one number ``humanoid * 9 + drone``. Info:
    ``info["humanoid"]``, ``info["drone"]``, and ``is_success`` as Stable-Baselines3 reads it.

    >>> env = gymnasium.make("CHMARL/SceneGraph-v0", split="val-unseen")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step([9, 8])
    >>> info["humanoid"]["action_success"], info["drone"]["action_success"]
    (True, True)
    >>> env.close()
    """

    def __init__(self, flat_actions: bool = False, **options: Any):
        """Make the view; see :class:`chmarl_pb.envs.parallel.HouseholdEnv` for the options.

        Raises:
            OptionError: an option has a value that it does not know.
        """
        self.flat_actions = plain_value(flat_actions)
        check_one_of("flat_actions", self.flat_actions, (True, False))
        self.parallel = HouseholdEnv(**options)
        self.render_mode = self.parallel.render_mode
        self._robots = tuple(self.parallel.possible_agents)
        own = [self.parallel.symbols] if self.parallel.symbols else []  # after each robot's action its symbol
        counts = [count for names in self.parallel.action_names.values() for count in (len(names), *own)]
        self._counts = counts
        self.action_space = spaces.Discrete(int(np.prod(counts))) if self.flat_actions else JointActions(counts)
        own_spaces = {name: self.parallel.observation_space(name).spaces for name in self._robots}
        joint_spaces = joined(own_spaces)
        if len(joint_spaces) < sum(map(len, own_spaces.values())):
            keys = [f"{name}_{key}" for name, own in own_spaces.items() for key in own]
            twice = next(key for key in keys if keys.count(key) > 1)
            raise OptionError(f"{twice!r} is the key of two observations; name the robot or the sensor's key otherwise")
        self.observation_space = spaces.Dict(joint_spaces)

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew, see :meth:`HouseholdEnv.__reduce__`."""
        make = partial(type(self), flat_actions=self.flat_actions, **vars(self.parallel.options))
        return make, (), {"spec": self.spec}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], Info]:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        super().reset(seed=None if seed is None else whole_number("seed", seed))
        observations, infos = self.parallel.reset(seed=seed, options=options)
        return joined(observations), _info(infos)

    def step(self, action: Any) -> Step:
        """Let all robots act once.

        Raises:
            ActionError: the action does not lie in the action space.
            NotResetError: there is no episode to go on with.
        """
        results = self.parallel.advance(self._split(action), _is_cut_here(self))
        observations, rewards, terminated, truncated, infos = results
        robot = self._robots[0]
        return joined(observations), rewards[robot], terminated[robot], truncated[robot], _info(infos)

    def _split(self, action: Any) -> dict[str, Any]:
        numbers = as_numbers(action, "action")
        if self.flat_actions:
            if numbers.size != 1 or numbers.dtype.kind not in "iu" or not 0 <= numbers.item() < np.prod(self._counts):
                raise ActionError(f"action {action!r} is not a whole number from 0 to {np.prod(self._counts) - 1}")
            numbers = np.array(np.unravel_index(numbers.item(), self._counts))
        if numbers.shape != (len(self._counts),):
            symbols = ", and one for its symbol" if self.parallel.symbols else ""
            raise ActionError(f"action {action!r} is not one number for each of {list(self._robots)}{symbols}")
        if self.parallel.symbols:
            return dict(zip(self._robots, numbers.reshape(-1, 2), strict=True))
        return {name: numbers[index] for index, name in enumerate(self._robots)}


class HumanoidEnv(Viewing, gymnasium.Env):
    """The humanoid, or the first robot that grasps, as the only agent; the others follow a built-in policy.

    Observation: its keys without a prefix. Action: ``Discrete(10)``. Info: its own, with ``is_success``.

    >>> env = gymnasium.make("CHMARL/SceneGraphHumanoid-v0", split="val-unseen")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(9)
    >>> env.close()
    """

    def __init__(self, partner: str = "search", **options: Any):
        """Make the view.

        Args:
            partner: the policy of the others: "search" or "belief".
            **options: see :class:`chmarl_pb.envs.parallel.HouseholdEnv`.

        Raises:
            OptionError: an option has a value that it does not know.
        """
        check_one_of("partner", partner, PARTNERS)
        self.parallel = HouseholdEnv(**options)
        self.render_mode = self.parallel.render_mode
        names = self.parallel.action_names
        self._robot = first_grasper(names)
        self.action_space = self.parallel.action_space(self._robot)
        self.observation_space = self.parallel.observation_space(self._robot)
        self.partner, self._others = partner, make_policy(partner, self.parallel)
        self._other_actions: dict[str, Any] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew, see :meth:`HouseholdEnv.__reduce__`."""
        make = partial(type(self), partner=self.partner, **vars(self.parallel.options))
        return make, (), {"spec": self.spec}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], Info]:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        super().reset(seed=None if seed is None else whole_number("seed", seed))
        observations, infos = self.parallel.reset(seed=seed, options=options)
        self._others.reset(int(self.np_random.integers(2**31)) if seed is None else seed)
        self._choose(observations, infos)
        return observations[self._robot], _alone(infos[self._robot])

    def step(self, action: Any) -> Step:
        """Let the robot act once, and the others by themselves.

        Raises:
            ActionError: the action does not lie in the action space.
            NotResetError: there is no episode to go on with.
        """
        robot = self._robot
        results = self.parallel.advance({**self._other_actions, robot: action}, _is_cut_here(self))
        observations, rewards, terminated, truncated, infos = results
        # Chosen here rather than in the next step, which may refuse its action and be called again.
        self._choose(observations, infos)
        return observations[robot], rewards[robot], terminated[robot], truncated[robot], _alone(infos[robot])

    def _choose(self, observations: dict[str, dict[str, np.ndarray]], infos: dict[str, Info]) -> None:
        """Let the others choose their next actions."""
        others = observations.keys() - {self._robot}
        self._other_actions = self._others.act(
            {name: seen for name, seen in observations.items() if name in others},
            {name: info for name, info in infos.items() if name in others},
        )


class Registered:
    """Makes a view for a registered id, whose episodes Gymnasium's time limit ends; see :func:`_is_cut_here`."""

    def __init__(self, view: type[JointEnv] | type[HumanoidEnv], track: str = PAPER):
        """Make views of this class, in this track if none is given."""
        self.view, self.metadata = view, view.metadata  # Gymnasium reads the render modes from what makes environments
        self._track = track

    def __call__(self, **options: Any) -> JointEnv | HumanoidEnv:
        """Return an environment.

        Raises:
            OptionError: ``max_steps`` is beyond the id's time limit, which would come first.
        """
        steps, most = options.get("max_steps"), TRACKS[self._track]["max_steps"]
        if isinstance(steps, int | np.integer) and steps > most:
            raise OptionError(
                f"max_steps={steps}: gymnasium.make ends these episodes after {most} steps unless it is told "
                f"otherwise; give max_episode_steps={steps} instead"
            )
        return self.view(**{"track": self._track} | options)


make_joint, make_humanoid = Registered(JointEnv), Registered(HumanoidEnv)
make_grounded_joint, make_grounded_humanoid = Registered(JointEnv, GROUNDED), Registered(HumanoidEnv, GROUNDED)


def _is_cut_here(env: JointEnv | HumanoidEnv) -> bool:
    """Return whether episodes are cut off here: Gymnasium cuts those of an id, unless ``max_steps`` was given, too."""
    return env.spec is None or "max_steps" in env.spec.kwargs


def joined(observations: Mapping[str, Mapping[str, T]]) -> dict[str, T]:
    """Return what each robot observes, or its spaces, under one name each: that of the robot, and the key."""
    return {f"{name}_{key}": value for name, observation in observations.items() for key, value in observation.items()}


def _info(infos: dict[str, Info]) -> Info:
    return {**infos, "is_success": next(iter(infos.values()))["success"]}


def _alone(info: Info) -> Info:
    return {**info, "is_success": info["success"]}
