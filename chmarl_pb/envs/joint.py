"""Gymnasium views of the core: one policy for both robots, or for the humanoid alone."""

from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from chmarl_pb.envs.limits import MAX_STEPS
from chmarl_pb.envs.options import checked_seed
from chmarl_pb.envs.parallel import AGENTS, HouseholdEnv
from chmarl_pb.errors import ActionError, OptionError
from chmarl_pb.policies.search import DroneSearch
from chmarl_pb.world import World

Info = dict[str, Any]
Step = tuple[dict[str, np.ndarray], float, bool, bool, Info]


class PairOfActions(spaces.MultiDiscrete):
    """A number for each robot. Learners that know single numbers only, as DQN, show its text when they refuse it."""

    def __repr__(self) -> str:
        """Return the text of the space, and where the one with single numbers is."""
        text = super().__repr__()  # type: ignore[no-untyped-call]
        return f"{text} (make the environment with flat_actions=True for Discrete({self.nvec.prod()}))"


class JointEnv(gymnasium.Env):
    """Both robots as one agent.

    Observation: the keys of both robots with the prefixes ``humanoid_`` and ``drone_``. Action:
    ``MultiDiscrete([10, 9])``, or with ``flat_actions`` one number ``humanoid * 9 + drone``. Info:
    ``info["humanoid"]``, ``info["drone"]``, and ``is_success`` as Stable-Baselines3 reads it.

    >>> env = gymnasium.make("CHMARL/SceneGraph-v0", split="val-unseen")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step([9, 8])
    >>> info["humanoid"]["action_success"], info["drone"]["action_success"]
    (True, True)
    >>> env.close()
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 4}  # noqa: RUF012

    def __init__(self, flat_actions: bool = False, **options: Any):
        """Make the view; see :class:`chmarl_pb.envs.parallel.HouseholdEnv` for the options.

        Raises:
            OptionError: an option has a value that it does not know.
        """
        if not isinstance(flat_actions, bool):
            raise OptionError(f"flat_actions={flat_actions!r} is not known; use one of: True, False")
        self.parallel = HouseholdEnv(**options)
        self.render_mode = self.parallel.render_mode
        self.flat_actions = flat_actions
        counts = [len(self.parallel.action_names[name]) for name in AGENTS]
        self._counts = counts
        self.action_space = spaces.Discrete(counts[0] * counts[1]) if flat_actions else PairOfActions(counts)
        self.observation_space = spaces.Dict(
            {
                f"{name}_{key}": space
                for name in AGENTS
                for key, space in self.parallel.observation_space(name).spaces.items()
            }
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew, see :meth:`HouseholdEnv.__reduce__`."""
        make = partial(type(self), flat_actions=self.flat_actions, **vars(self.parallel.options))
        return make, (), {"spec": self.spec}

    @property
    def world(self) -> World:
        """The world of the home that the present episode is played in."""
        return self.parallel.world

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], Info]:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        super().reset(seed=None if seed is None else checked_seed(seed))
        observations, infos = self.parallel.reset(seed=seed, options=options)
        return _joined(observations), _info(infos)

    def step(self, action: Any) -> Step:
        """Let both robots act once.

        Raises:
            ActionError: the action does not lie in the action space.
            NotResetError: there is no episode to go on with.
        """
        observations, rewards, terminated, truncated, infos = self.parallel.step(self._split(action))
        robot = AGENTS[0]
        cut = _truncated(self, truncated[robot])
        return _joined(observations), rewards[robot], terminated[robot], cut, _info(infos)

    def _split(self, action: Any) -> dict[str, int]:
        try:
            numbers = np.asarray(action)
        except ValueError as error:
            raise ActionError(f"action {action!r} is not an array of numbers") from error
        if self.flat_actions:
            if numbers.size != 1 or numbers.dtype.kind not in "iu" or not 0 <= numbers.item() < np.prod(self._counts):
                raise ActionError(f"action {action!r} is not a whole number from 0 to {np.prod(self._counts) - 1}")
            return dict(zip(AGENTS, (int(n) for n in divmod(numbers.item(), self._counts[1])), strict=True))
        if numbers.shape != (2,):
            raise ActionError(f"action {action!r} is not a pair of numbers, one for each of {list(AGENTS)}")
        return {name: numbers[index] for index, name in enumerate(AGENTS)}

    def render(self) -> np.ndarray | None:
        """Return or show both robots' pictures; see :meth:`HouseholdEnv.render`."""
        return self.parallel.render()

    def close(self) -> None:
        """Disconnect from physics."""
        self.parallel.close()


class HumanoidEnv(gymnasium.Env):
    """The humanoid as the only agent; the drone follows the search policy.

    Observation: the humanoid's keys without a prefix. Action: ``Discrete(10)``. Info: the
    humanoid's, with ``is_success``.

    >>> env = gymnasium.make("CHMARL/SceneGraphHumanoid-v0", split="val-unseen")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(9)
    >>> env.close()
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 4}  # noqa: RUF012

    def __init__(self, **options: Any):
        """Make the view; see :class:`chmarl_pb.envs.parallel.HouseholdEnv` for the options."""
        self.parallel = HouseholdEnv(**options)
        self.render_mode = self.parallel.render_mode
        self.action_space = self.parallel.action_space("humanoid")
        self.observation_space = self.parallel.observation_space("humanoid")
        self._drone = DroneSearch(self.parallel.action_names["drone"], self.parallel.rooms)
        self._drone_action = 0

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew, see :meth:`HouseholdEnv.__reduce__`."""
        return partial(type(self), **vars(self.parallel.options)), (), {"spec": self.spec}

    @property
    def world(self) -> World:
        """The world of the home that the present episode is played in."""
        return self.parallel.world

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], Info]:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        super().reset(seed=None if seed is None else checked_seed(seed))
        observations, infos = self.parallel.reset(seed=seed, options=options)
        self._drone.reset(seed)
        self._drone_action = self._drone.act(observations["drone"], infos["drone"])
        return observations["humanoid"], _alone(infos)

    def step(self, action: Any) -> Step:
        """Let the humanoid act once, and the drone by itself.

        Raises:
            ActionError: the action does not lie in the action space.
            NotResetError: there is no episode to go on with.
        """
        results = self.parallel.step({"humanoid": action, "drone": self._drone_action})
        observations, rewards, terminated, truncated, infos = results
        # Chosen here rather than in the next step, which may refuse its action and be called again.
        self._drone_action = self._drone.act(observations["drone"], infos["drone"])
        robot = "humanoid"
        cut = _truncated(self, truncated[robot])
        return observations[robot], rewards[robot], terminated[robot], cut, _alone(infos)

    def render(self) -> np.ndarray | None:
        """Return or show both robots' pictures; see :meth:`HouseholdEnv.render`."""
        return self.parallel.render()

    def close(self) -> None:
        """Disconnect from physics."""
        self.parallel.close()


class Registered:
    """Makes a view for a registered id, whose episodes Gymnasium's time limit ends; see :func:`_truncated`."""

    def __init__(self, view: type[JointEnv] | type[HumanoidEnv]):
        """Make views of this class."""
        self.view, self.metadata = view, view.metadata  # Gymnasium reads the render modes from what makes environments

    def __call__(self, **options: Any) -> JointEnv | HumanoidEnv:
        """Return an environment.

        Raises:
            OptionError: ``max_steps`` is beyond the id's time limit, which would come first.
        """
        steps = options.get("max_steps")
        if isinstance(steps, int) and steps > MAX_STEPS:
            raise OptionError(
                f"max_steps={steps}: gymnasium.make ends these episodes after {MAX_STEPS} steps unless it is told "
                f"otherwise; give max_episode_steps={steps} instead"
            )
        return self.view(**options)


make_joint, make_humanoid = Registered(JointEnv), Registered(HumanoidEnv)


def _truncated(env: JointEnv | HumanoidEnv, truncated: bool) -> bool:
    """Return whether an episode is cut off here: that of an id is by Gymnasium, unless ``max_steps`` was given, too."""
    if not truncated or env.spec is None or "max_steps" in env.spec.kwargs:
        return truncated
    env.parallel.go_on()
    return False


def _joined(observations: dict[str, dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {f"{name}_{key}": value for name in AGENTS for key, value in observations[name].items()}


def _info(infos: dict[str, Info]) -> Info:
    return {**infos, "is_success": infos[AGENTS[0]]["success"]}


def _alone(infos: dict[str, Info]) -> Info:
    return {**infos["humanoid"], "is_success": infos["humanoid"]["success"]}
