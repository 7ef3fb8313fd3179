"""A game: one episode that people and policies play together, step by step, forth and back."""

from collections.abc import Mapping
from dataclasses import replace

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.words import parted
from chmarl_pb.errors import OptionError, ResultError
from chmarl_pb.evaluation.episode_file import EpisodeFile, plain_options
from chmarl_pb.evaluation.play import Setup, episode_seed, policy_seed
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.frames.recording import Moment
from chmarl_pb.policies.policy import Infos, Observations, Policy
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.seats import seated
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.tasks.symbols import SILENT
from chmarl_pb.tasks.task import Task
from chmarl_pb.viewer.record import moment_of, note, recording_of

PERSON = "person"  # who drives a robot that is not handed to a policy

_Row = dict[str, int]


class Game:
    """One episode in an environment of its own; seeds are those of an evaluation with seed 0.

    A robot does what a person has chosen for it, or what its policy answers, or stays. Policies are seated as in
    evaluations: they get observations and action masks, unless they are privileged.

    Attributes:
        recording: all that has happened.
        drivers: robot -> ``PERSON`` or the name of its policy.
    """

    def __init__(self, env: HouseholdEnv, task: Task):
        """Begin.

        Args:
            env: to play in; the game closes it.
            task: the task.

        Raises:
            TaskError: the task cannot be set up, or the planner cannot solve it.
        """
        self.env, self._task, self._seed = env, task, episode_seed(task, 0)
        self.drivers: dict[str, str] = dict.fromkeys(env.possible_agents, PERSON)
        self._policies: dict[str, Policy] = {}
        self._chosen: dict[str, tuple[int, int]] = {}
        self._drove: set[str] = set()
        self._seen: list[tuple[Observations, Infos]] = []  # what was observed at the start and after each step
        self._did: list[tuple[_Row, _Row, float]] = []  # actions, symbols and reward of each step
        self._states: list[str] = []
        self._collided: list[int] = []  # motions of each step that found no free way
        first = self._restart()
        self.recording = recording_of(env, PERSON, (first,))
        self._restart()  # finding out L* may have laid the task out anew
        self._planner = make_policy("planner", env)

    @property
    def over(self) -> bool:
        """Whether the episode has ended."""
        return not self.env.agents

    @property
    def chosen(self) -> dict[str, str]:
        """Robot -> name of the action that a person has chosen for its next step."""
        return {robot: self.env.action_names[robot][number] for robot, (number, _) in self._chosen.items()}

    def hand_over(self, robot: str, driver: str) -> None:
        """Let a policy drive a robot from now on, or a person.

        The policy is shown what its robot has observed so far, and its answers to that are ignored; one that is
        privileged sees the world as it is, and no past.

        Args:
            robot: its name.
            driver: ``PERSON``, or a policy as :func:`chmarl_pb.policies.sources.find_policy` takes it.

        Raises:
            OptionError: there is no such policy, or it cannot play with these observations.
        """
        if driver != PERSON and driver not in self._policies:
            self._policies[driver] = self._make(driver)
        self.drivers[robot] = driver
        self._policies = {name: self._policies[name] for name in self._policies if name in self.drivers.values()}
        self._chosen.pop(robot, None)

    def choose(self, robot: str, action: str, symbol: int = SILENT) -> None:
        """Choose what a robot that a person drives does in the next step.

        Args:
            robot: its name.
            action: name of the action.
            symbol: what it says, where robots have own words.

        Raises:
            OptionError: a policy drives it, or it has no such action.
        """
        if self.drivers[robot] != PERSON:
            raise OptionError(f"the policy {self.drivers[robot]!r} drives {robot}; take it back first")
        if action not in self.env.action_names[robot]:
            raise OptionError(
                f"{robot} has no action {action!r}; use one of: {', '.join(self.env.action_names[robot])}"
            )
        self._chosen[robot] = self.env.action_names[robot].index(action), symbol

    def step(self) -> Moment:
        """Play one joint step; robots of a person for which nothing is chosen stay.

        Raises:
            OptionError: the episode is over, or a policy asked for more than it is given.
        """
        if self.over:
            raise OptionError("the episode is over; step back, or start another one")
        rows = {name: policy.act(*self._seen[-1]) for name, policy in self._policies.items()}
        self._drove |= set(self.drivers.values())
        actions = {robot: self._action(robot, rows) for robot in self.drivers}
        self._chosen.clear()
        before = self.env.collisions
        moment = self._do({robot: pair if self.env.symbols else pair[0] for robot, pair in actions.items()})
        self._collided.append(self.env.collisions - before)
        self._record((*self.recording.moments, moment))
        return moment

    def hint(self) -> dict[str, str]:
        """Return robot -> name of what the planner, which knows everything, would do now.

        Raises:
            OptionError: the episode is over.
            TaskError: the task cannot be solved from here.
        """
        if self.over:
            raise OptionError("the episode is over; there is no next move")
        self._planner.reset(None)
        answer = self._planner.act(*self._seen[-1])
        return {robot: self.env.action_name(robot, action) for robot, action in answer.items()}

    def back(self, steps: int = 1) -> None:
        """Take steps back: the episode is played again from its reset, with the same seed and actions.

        Args:
            steps: how many, at most to the start.
        """
        kept, moments = self._did[: max(0, len(self._did) - steps)], self.recording.moments
        states = self._states
        self._restart()
        options, self.env.options = self.env.options, replace(self.env.options, execution="instant")  # ends the same
        try:
            for row, said, _ in kept:
                self._do({robot: (row[robot], said[robot]) if said else row[robot] for robot in row})
        finally:
            self.env.options = options
        if self._states != states[: len(kept) + 1]:
            raise ResultError("the same actions lead to another state than before; start the episode anew")
        self._policies = {name: self._make(name) for name in self._policies}
        self._chosen.clear()
        del self._collided[len(kept) :]
        self._record(moments[: len(kept) + 1])

    def file(self) -> EpisodeFile:
        """Return the episode so far as an episode file; one that is not over is one with no more steps allowed.

        Raises:
            OptionError: nothing has been done yet, or the environment was given objects.
        """
        if not self._did:
            raise OptionError("nothing has been done yet; play a step before saving")
        options = plain_options(self.env) | ({} if self.over else {"max_steps": len(self._did)})
        return EpisodeFile(
            self._task, self.recording.policy, self._seed, options,
            tuple(tuple(row.values()) for row, _, _ in self._did), tuple(reward for _, _, reward in self._did),
            tuple(self._states), self.recording.success, home_hash(self._task.home),
            tuple(tuple(said.values()) for _, said, _ in self._did if said),
        )  # fmt: skip

    def close(self) -> None:
        """Disconnect from physics."""
        self.env.close()

    def _restart(self) -> Moment:
        observations, infos = self.env.reset(seed=self._seed, options={"task": self._task})
        self._seen, self._did, self._states = [(observations, infos)], [], [state_hash(self.env)]
        return moment_of(self.env, note(self.env), infos, {}, {}, 0.0)

    def _do(self, actions: Mapping[str, int | tuple[int, int]]) -> Moment:
        """Let the environment do a step, and keep what it gave."""
        observations, rewards, _, _, infos = self.env.step(dict(actions))
        row = {robot: action if isinstance(action, int) else action[0] for robot, action in actions.items()}
        said, reward = dict(self.env.said), float(rewards[self.env.possible_agents[0]])
        self._seen.append((observations, infos))
        self._did.append((row, said, reward))
        self._states.append(state_hash(self.env))
        return moment_of(self.env, note(self.env), infos, row, said, reward)

    def _record(self, moments: tuple[Moment, ...]) -> None:
        self.recording = replace(
            self.recording, moments=moments, success=self.env.outcome.success, collisions=sum(self._collided),
            policy="+".join(sorted(self._drove)) or PERSON,
        )  # fmt: skip

    def _action(self, robot: str, rows: Mapping[str, Mapping[str, object]]) -> tuple[int, int]:
        """Return the number of a robot's next action and the symbol that it says."""
        driver = self.drivers[robot]
        if driver == PERSON:
            return self._chosen.get(robot, (self.env.action_names[robot].index("stay"), SILENT))
        action, symbol = parted(robot, rows[driver][robot], self.env.symbols)
        return int(action), symbol

    def _make(self, name: str) -> Policy:
        """Return a policy that has seen the episode so far."""
        source = find_policy(name)
        privileged = Setup(name, self.env.options).privileged
        policy = seated(source.make, self.env, privileged, source.centralized)
        policy.reset(policy_seed(self.env.instruction, 0))
        for seen in () if privileged else self._seen[:-1]:
            policy.act(*seen)
        return policy
