"""Messages and feedback that cannot be relied on: dials for training and for what a score depends on."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from chmarl_pb.errors import OptionError
from chmarl_pb.limits import real_number, whole_number
from chmarl_pb.robots.pointing import verb_of
from chmarl_pb.tasks.advisers import CRITICS, STYLES, Critic, Goals, SpokenAdviser
from chmarl_pb.tasks.messages import Board, Messages
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.tidy_task import AnyTask

_STREAM = 11  # of random numbers, apart from those that a task's seed is used for elsewhere
_LONGEST = 100


@dataclass(frozen=True)
class NoisyBoard(Board):
    """The paper's board, of which every robot misreads some bits, each time anew.

    >>> env = chmarl_pb.parallel_env(messages=NoisyBoard(flips=1.0), split="val-unseen")
    >>> observations, infos = env.reset(seed=0)
    >>> int(observations["drone"]["messages"].sum()) == 8 - int(env.messages.sum())
    True

    Attributes:
        flips: probability that a bit is misread.
    """

    flips: float = 0.1

    def __post_init__(self) -> None:
        """Check the value.

        Raises:
            OptionError: it is no probability.
        """
        object.__setattr__(self, "flips", real_number("NoisyBoard: flips", self.flips, 0, 1))

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        """Return the board with some bits flipped."""
        return messages ^ (rng.random(messages.shape) < self.flips).astype(np.int8)


@dataclass
class UnreliableAdviser:
    """Feedback in one of the usual styles that is missing, wrong or late at times; a task's seed decides when.

    >>> env = chmarl_pb.parallel_env(feedback=UnreliableAdviser("planner", loss=1.0), split="val-unseen")
    >>> _ = env.reset(options={"task": "val-unseen-000"})
    >>> env.step({"humanoid": 9, "drone": 8})[-1]["humanoid"]["feedback"]
    ''

    Attributes:
        style: "paper" or "planner".
        loss: probability that a sentence is not said.
        wrong: probability that one that is said names some other action as the better one.
        delay: joint steps that sentences come late.
        templates: revision of the sentences; an environment's adviser has that of the environment.
    """

    style: str = STYLES[0]
    loss: float = 0.0
    wrong: float = 0.0
    delay: int = 0
    templates: int = field(default=1, init=False, repr=False)
    _adviser: SpokenAdviser = field(init=False, repr=False, compare=False)
    _late: deque[dict[str, str]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            OptionError: one is out of range.
        """
        if self.style not in STYLES:
            raise OptionError(f"UnreliableAdviser(style={self.style!r}): use one of: {', '.join(STYLES)}")
        self.loss = real_number("UnreliableAdviser: loss", self.loss, 0, 1)
        self.wrong = real_number("UnreliableAdviser: wrong", self.wrong, 0, 1)
        self.delay = whole_number("UnreliableAdviser: delay", self.delay, 0, _LONGEST)

    def begin(self, simulation: Simulation, task: AnyTask, goals: Goals) -> None:
        """Watch an episode that begins in a simulation."""
        rng = np.random.default_rng([task.seed, _STREAM])

        def critic(simulation: Simulation, robot: str, goals: Goals) -> Critic:
            actions = simulation.actions[robot]
            return _Unreliable(CRITICS[self.style](simulation, robot, goals), actions, self.loss, self.wrong, rng)

        self._adviser = SpokenAdviser(critic, self.templates)
        self._adviser.begin(simulation, task, goals)
        self._late = deque({} for _ in range(self.delay))

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        """Take note of the actions, and of what they are taken after."""
        self._adviser.before(actions, outcome)

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return robot -> sentence, of the action that it took ``delay`` steps ago."""
        self._late.append(self._adviser.after(succeeded, step))
        return self._late.popleft()


class _Unreliable:
    """A critic that keeps silent, or names another action, at random."""

    def __init__(self, critic: Critic, actions: tuple[str, ...], loss: float, wrong: float, rng: np.random.Generator):
        self._critic, self._actions, self._loss, self._wrong, self._rng = critic, actions, loss, wrong, rng

    def before(self, action: str, outcome: Outcome) -> None:
        self._done = action
        self._critic.before(action, outcome)

    def after(self, succeeded: bool) -> str | None:
        better = self._critic.after(succeeded)
        lost, wrong = self._rng.random(2) < (self._loss, self._wrong)  # the same draws, whatever becomes of it
        draw = self._rng.random()
        if better is None or lost:
            return None
        # sentences name verbs alone: to pick at another cell would be said like the better action
        said = {verb_of(better), verb_of(self._done)}
        others = [action for action in self._actions if verb_of(action) not in said]
        return others[int(draw * len(others))] if wrong else better
