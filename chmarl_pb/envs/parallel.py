"""The core environment: a PettingZoo ParallelEnv of the robots in one home, by default a humanoid and a drone."""

import warnings
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from chmarl_pb.envs.last_step import LastStep
from chmarl_pb.envs.observations import Observation, Observer
from chmarl_pb.envs.of_episode import of_episode
from chmarl_pb.envs.options import Observed, Options
from chmarl_pb.envs.own_parts import checked_kind
from chmarl_pb.envs.state import global_state, state_size
from chmarl_pb.envs.window import close_window, open_display, show
from chmarl_pb.envs.words import action_space, numbers_in, parted
from chmarl_pb.errors import ActionError, NotResetError, OptionError
from chmarl_pb.limits import whole_number
from chmarl_pb.robots.execution import Snapshot, collisions, execute
from chmarl_pb.robots.motion import Motion
from chmarl_pb.robots.pointing import verb_of
from chmarl_pb.robots.robot import decide
from chmarl_pb.sensing.sensors import View
from chmarl_pb.tasks.kinds import speaking_of
from chmarl_pb.tasks.messages import Messages, is_board
from chmarl_pb.tasks.outcome import Outcome, reward
from chmarl_pb.tasks.setting import Setting
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.simulations import MOST_SIMULATIONS, Simulations
from chmarl_pb.tasks.source import TaskSource
from chmarl_pb.tasks.symbols import Talk
from chmarl_pb.tasks.tidy_task import AnyTask
from chmarl_pb.tasks.verdict import require_playable
from chmarl_pb.world import World

if TYPE_CHECKING:
    from chmarl_pb.frames.drawer import FrameDrawer

Results = tuple[
    dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
]  # fmt: skip


class HouseholdEnv(ParallelEnv):  # type: ignore[misc]
    """Robots search a home together, by default a humanoid and a drone; one with an arm brings X to Y.

    **Task**: an instruction names an object X and a receptacle Y ("Put the mug on the desk").
    **Observation**: what each robot sees (scene graph or picture), the instruction, its feedback,
    the messages, and its own room, heading and hand; with ``goal``, what the instruction asks for.
    **Actions**: one number for each robot, see ``action_names``; actions that cannot be done change nothing.
    **Reward**: shared, phi(s') - phi(s), see :func:`chmarl_pb.tasks.outcome.potential`.
    **End**: success terminates all robots, ``max_steps`` truncates all.

    >>> env = chmarl_pb.parallel_env(split="val-unseen")
    >>> observations, infos = env.reset(seed=0)
    >>> while env.agents:
    ...     actions = {robot: env.action_space(robot).sample() for robot in env.agents}
    ...     observations, rewards, terminations, truncations, infos = env.step(actions)
    >>> env.close()

    Attributes:
        catalog: the classes of things: the benchmark's, and the user's own after them.
        task: the task of the present episode.
        outcome: the facts after the last step.
        snapshots: how the last step's motion went at 30 Hz; empty unless ``execution="simulated"``.
        collisions: driven motions of this episode in which an arm, or what it holds, passes through something by more
            than 5 mm, as no free way was found.
        steps: joint steps taken in this episode.
        symbols: how many symbols each robot can choose from in every step; 0 without own words.
        said: robot -> symbol that it said in the last step; empty without own words.
        hears_board: whether the robots hear the message board, or a channel of the user's own that is heard like it.
        physics_follows: whether PyBullet's bodies are brought to where they are in every reset and step. If not, they
            are once ``world.sync()`` is called; nothing else depends on it.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "chmarl_v0",
        "render_modes": ["rgb_array", "human"],
        "render_fps": 4,
        "is_parallelizable": True,
    }

    task: AnyTask = of_episode()
    setting: Setting = of_episode()
    outcome: Outcome = of_episode()
    messages: Messages = of_episode()
    instruction: str = of_episode()

    def __init__(self, observation: Observed = "scene_graph", **options: Any):
        """Make an environment; see :class:`chmarl_pb.envs.options.Options` for the options.

        Raises:
            OptionError: an argument has a value that it does not know.
            HomeError: a home cannot be used.
            AssetError: a robot cannot be used.
        """
        self.options = Options(observation, **options)
        self.render_mode = self.options.render_mode
        if self.render_mode == "human":
            open_display()
        self._models = self.options.models
        self.possible_agents = list(self._models)
        self.agents: list[str] = []
        self.catalog = self.options.things
        kind = speaking_of(self.options.kind, self.catalog, self.options.templates)
        self._kind = checked_kind(kind, self.options)
        self._tasks = TaskSource(self.options.split, self.options.home, self._kind, self.catalog)
        given = self.options
        load = partial(
            Simulation, models=self._models, renderer=given.renderer, known=self.catalog, pointing=given.pointing,
            lookalikes=given.lookalikes,
        )  # fmt: skip
        # The endless split does not come back to a home.
        self._simulations = Simulations(load, 1 if self.episodes_in_a_home > 1 else MOST_SIMULATIONS)
        if self.options.home is not None:
            require_playable(self.options.home, self._models, self.catalog)
        self.simulation = self._simulations.enter(self.options.homes[0])
        self.rooms, self.action_names = self.simulation.rooms, self.simulation.actions
        self._observer = Observer(self.options, self.rooms, self.catalog)
        self._channel, self._adviser = self.options.channel, self.options.adviser
        self._talk = self._channel if isinstance(self._channel, Talk) else None
        self.symbols = self._talk.vocabulary if self._talk else 0
        is_read = bool(self.options.messages) and not self.symbols
        self.hears_board = is_read and is_board(self._observer.space["messages"], self.rooms)
        self._action_spaces = {
            name: action_space(len(names), self.symbols) for name, names in self.action_names.items()
        }
        self.observation_spaces = {name: self.observation_space(name) for name in self.possible_agents}
        self.action_spaces = {name: self.action_space(name) for name in self.possible_agents}
        said = self._channel.begin(self.rooms).size
        self.state_space = spaces.Box(-np.inf, np.inf, (state_size(len(self._models), said, self.catalog),), np.float32)
        self._masks = {name: np.ones(len(names), dtype=np.int8) for name, names in self.action_names.items()}
        self._rng = np.random.default_rng()
        self.snapshots: tuple[Snapshot, ...] = ()
        self.collisions = 0
        self.steps = 0
        self.said: dict[str, int] = {}
        self.physics_follows = True
        self._drawer: FrameDrawer | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew from the options: with physics of their own, and not reset."""
        return partial(type(self), **vars(self.options)), ()

    def observation_space(self, agent: str) -> spaces.Dict:
        """Return an agent's observation space."""
        return self._observer.space

    def action_space(self, agent: str) -> Any:
        """Return an agent's action space: Discrete, or with own words MultiDiscrete, of an action and a symbol."""
        return self._action_spaces[agent]

    @property
    def unwrapped(self) -> "HouseholdEnv":
        """The environment itself."""
        return self

    @property
    def np_random(self) -> np.random.Generator:
        """The random stream of the environment, which ``reset(seed=...)`` begins anew; some wrappers draw from it."""
        return self._rng

    @property
    def episodes_in_a_home(self) -> int:
        """The episodes that are played in a home before the next; seeds from a multiple of it on share their home."""
        return self._tasks.episodes_in_a_home

    @property
    def world(self) -> World:
        """The world of the home that the present episode is played in."""
        return self.simulation.world

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode.

        Args:
            seed: fixes which task is drawn now and by later resets without a seed.
            options: ``{"task": Task, its fields as a dict, or its id}`` plays that task.

        Raises:
            OptionError: the seed is not a whole number from 0 on, or ``options`` is not a dict.
            TaskError: the task is unknown or cannot be set up.
        """
        if seed is not None:
            self._rng = np.random.default_rng(whole_number("seed", seed))
            self._tasks.begin(int(seed))
        self.task = self._choose_task(options or {})
        self.agents = []  # should the task not fit, or an own part fail, there is no episode to go on with
        self.simulation = self._simulations.enter(self.task.home)
        self.setting = self.simulation.begin(self.task, self._kind)
        if self.physics_follows:
            self.world.sync()
        self.outcome = self._look()
        self.messages = self._say(self._channel.begin(self.rooms))
        self.instruction = self._kind.instruction(self.setting.task)
        self._instruction_tokens = self._observer.tokens(self.instruction)
        self._wanted = self._observer.wanted(self.instruction, self.setting) if self.options.goal else None
        self.steps, self.snapshots, self.collisions = 0, (), 0
        self.said = {}
        if self._adviser:
            self._adviser.begin(self.simulation, self.setting.task, self.setting.goals)
        self._last, self._drawer = LastStep({}, {}, {}, 0.0), None
        observations, infos = self._observe({}, dict.fromkeys(self._models, True))
        self.agents = list(self._models)
        if self.render_mode == "human":
            self.render()
        return observations, infos

    def step(self, actions: dict[str, Any]) -> Results:
        """Let all robots act once.

        Args:
            actions: robot -> number of its action, or, with own words, of action and symbol.

        Raises:
            NotResetError: there is no episode to go on with.
            ActionError: an action is missing, not a whole number, or out of range.
        """
        return self.advance(actions)

    def advance(self, actions: dict[str, Any], cut: bool = True) -> Results:
        """Let all robots act once, see :meth:`step`.

        Args:
            actions: as there.
            cut: whether the episode is truncated after ``max_steps``; if not, somebody else counts its steps.
        """
        names = self._check(actions)
        agents, self.agents = self.agents, []  # should an own part fail, there is no episode to go on with
        if self._adviser:
            self._adviser.before(names, self.outcome)
        succeeded, self.snapshots = execute(
            self.world, self.simulation.robots, self._plan(names), self.options.execution == "simulated"
        )
        if self.snapshots:
            self.collisions += collisions(self.snapshots)
        if self.physics_follows:  # who reads poses from world.client finds every body where it is in the state
            self.world.sync()
        previous, self.outcome = self.outcome, self._look()
        self.messages = self._say(self.messages)
        shared_reward = reward(previous, self.outcome)
        if self._talk:
            self.messages = self._talk.say(self.messages, self.said, self._rng)
            shared_reward -= self._talk.cost(self.said)
        feedback = self._adviser.after(succeeded, self.steps) if self._adviser else {}
        self.steps += 1
        terminated = self.outcome.success
        truncated = cut and not terminated and self.steps >= self.options.max_steps
        self._last = LastStep(names, succeeded, feedback, shared_reward)
        observations, infos = self._observe(feedback, succeeded)
        self.agents = [] if terminated or truncated else agents
        if self.render_mode == "human":
            self.render()
        return (
            observations,
            dict.fromkeys(self._models, shared_reward),
            dict.fromkeys(self._models, terminated),
            dict.fromkeys(self._models, truncated),
            infos,
        )

    def instruction_of(self, task: AnyTask) -> str:
        """Return what a task asks for in the words of this environment; with lookalikes this ends the episode.

        What it names besides classes follows there from the home, in which the task is laid out.
        """
        if self.options.lookalikes:
            self.agents = []
            task = self._simulations.enter(task.home).definite(task, self._kind)
        return self._kind.instruction(task)

    def true_graph(self, robot: str) -> Observation:
        """Return the scene graph of a robot's view, also where it observes none, for teachers.

        It is the truth, which the robot itself would have to recognise.
        """
        view = self._view(robot, "", np.zeros(0), True)
        parts = [sensor.observe(view) for sensor in self.options.graph_sensors(self.catalog)]
        return {key: value for part in parts for key, value in part.items() if not isinstance(value, str)}

    def action_name(self, robot: str, action: Any) -> str:
        """Return the name of a robot's action.

        Raises:
            ActionError: it is not a whole number, or out of range.
        """
        names = self.action_names[robot]
        action, _ = parted(robot, action, self.symbols)
        if type(action) is int and 0 <= action < len(names):
            return names[action]
        number = numbers_in(robot, action)
        if number.size != 1 or number.dtype.kind not in "iu" or not 0 <= int(number.item()) < len(names):
            raise ActionError(f"{robot}: action {action!r} is not a whole number from 0 to {len(names) - 1}")
        return names[int(number.item())]

    def state(self) -> np.ndarray:
        """Return the global state for centralized training, see :func:`chmarl_pb.envs.state.global_state`.

        Raises:
            NotResetError: there is no episode yet.
        """
        if not hasattr(self, "outcome"):
            raise NotResetError("state() before reset(); call reset() first")
        elapsed = min(1.0, self.steps / self.options.max_steps)  # who counts the steps of an id may allow more
        return global_state(self.simulation, self.setting, self.outcome, self.messages, elapsed)

    def render(self) -> np.ndarray | None:
        """Return a frame of the demo's film, (720, 1280, 3) uint8; with "human", show it in a window.

        It has the views of the first two robots, the map with all of them, what they did, see and are told, the
        messages and the potential. Nothing of it is worked out before it is asked for.

        Raises:
            OptionError: the environment was made without a render mode.
            NotResetError: there is no episode yet.
        """
        if self.render_mode is None:
            raise OptionError("render() needs render_mode='rgb_array' or 'human'; give it when making the environment")
        if not hasattr(self, "outcome"):
            raise NotResetError("render() before reset(); call reset() first")
        from chmarl_pb.envs.frame import drawer_of, now_of  # not before: it takes fonts and a library for pictures

        if self._drawer is None:
            self._drawer = drawer_of(self)
        picture = self._drawer.draw(now_of(self, self._last))
        if self.render_mode == "rgb_array":
            return picture
        show(picture, self.instruction)
        return None

    def close(self) -> None:
        """Disconnect from physics, and close the window; closing twice is allowed."""
        if self.render_mode == "human":
            close_window()
        self._simulations.close()
        self.agents = []

    def _choose_task(self, options: dict[str, Any]) -> AnyTask:
        if not isinstance(options, dict):
            raise OptionError(f"reset(options={options!r}) is not a dict; give one, e.g. {{'task': 'test-unseen-007'}}")
        unknown = sorted(set(options) - {"task"})
        if unknown:  # a warning, not an error: PettingZoo's own API test passes an option of its making
            warnings.warn(f"reset(options=...) ignores {unknown}; it knows 'task'", stacklevel=3)
        if "task" in options:
            return self._tasks.named(options["task"])
        return self._tasks.draw(self._rng, self._simulations.enter)

    def _check(self, actions: dict[str, Any]) -> dict[str, str]:
        """Return robot -> name of its action."""
        if not self.agents:
            raise NotResetError("step() without a running episode; call reset() first")
        if not isinstance(actions, dict) or actions.keys() != self._models.keys():
            raise ActionError(f"actions {actions!r} are not a dict with one action for each of {self.agents}")
        names = {name: self.action_name(name, actions[name]) for name in self._models}
        if self.symbols:
            self.said = {name: parted(name, actions[name], self.symbols)[1] for name in self._models}
        return names

    def _plan(self, names: dict[str, str]) -> dict[str, Motion | None]:
        seen = self.outcome.seen
        wanted = self.simulation.targets(names, self.setting.goals, seen)
        return decide(self.simulation.robots, {name: verb_of(action) for name, action in names.items()}, wanted, seen)

    def _look(self) -> Outcome:
        seen = {name: self.simulation.renderer.visible(name) for name in self._models}
        return self._kind.outcome(self.world.state, self.setting, seen)

    def _say(self, messages: Messages) -> Messages:
        """Return what has been said when the robots have told each other of the outcome."""
        for goal, part in zip(self.setting.goals, self.outcome.parts or (self.outcome,), strict=True):
            messages = self._channel.update(messages, part, goal, self.rooms, self._rng)
        return messages

    def _view(self, robot: str, advice: str, heard: np.ndarray, succeeded: bool) -> View:
        """Return what a robot's sensors may read."""
        outcome, simulation, state = self.outcome, self.simulation, self.outcome.state
        return View(
            robot, self._models, self.action_names[robot], state, simulation.room_names[state.robots[robot].room],
            simulation.renderer, simulation.graphs, outcome.seen[robot], self.setting.states, self.rooms,
            self.instruction, advice, heard, succeeded, self._rng, self.hears_board,
        )  # fmt: skip

    def _observe(
        self, feedback: dict[str, str], succeeded: dict[str, bool]
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Return the robots' observations and infos."""
        if self.physics_follows:  # an adviser that plans has moved bodies
            self.world.sync()
        outcome, observations, infos = self.outcome, {}, {}
        for name in self._models:
            advice = feedback.get(name, "")
            heard = self._channel.hear(self.messages, name, self._rng)
            view = self._view(name, advice, heard, succeeded[name])
            observations[name], texts = self._observer.observe(
                self.simulation, view, self._instruction_tokens, self._wanted
            )
            infos[name] = {
                "instruction": self.instruction,
                "feedback": advice,
                "action_success": succeeded[name],
                "success": outcome.success,
                "potential": outcome.potential,
                "visible": outcome.seen[name],
                # Every action may be tried: one that cannot be done just changes nothing.
                "action_mask": self._masks[name].copy(),
                "task_id": self.task.id,
                **texts,
            }
        return observations, infos
