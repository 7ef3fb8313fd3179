"""An episode as people see it: its task, and what happened in each step."""

from dataclasses import dataclass

import numpy as np

from chmarl_pb.frames.motion_player import Scene
from chmarl_pb.homes.home import Home
from chmarl_pb.rendering.movables import Team
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.sensing.scene_graph import SceneGraph
from chmarl_pb.tasks.messages import Messages
from chmarl_pb.tasks.task import Optimum
from chmarl_pb.tasks.tidy_task import AnyTask


@dataclass(frozen=True)
class Moment:
    """The state after one step, and the step itself; the first moment is the start, without actions.

    Attributes:
        actions: robot -> name of its action.
        succeeded: robot -> whether its action did.
        reward: shared reward of the step.
        potential: phi after the step.
        messages: (2, rooms) rooms in which X (row 0) and Y (row 1) have been seen; None without the message board.
        feedback: robot -> what it was told.
        visible: robot -> names of the things that it sees.
        motion: scenes of the driven step at 30 Hz.
        rest: the scene after the step.
        said: robot -> symbol that it said in the step; empty without own words.
        graphs: robot -> scene graph of what it sees.
        carriers: object -> the receptacle that it stands on, or the robot that holds it.
    """

    actions: dict[str, str]
    succeeded: dict[str, bool]
    reward: float
    potential: float
    messages: Messages | None
    feedback: dict[str, str]
    visible: dict[str, tuple[str, ...]]
    motion: tuple[Scene, ...]
    rest: Scene
    said: dict[str, int]
    graphs: dict[str, SceneGraph]
    carriers: dict[str, str]


@dataclass(frozen=True)
class Recording:
    """One episode, ready to be shown.

    Attributes:
        task: the task.
        home: where it was played.
        team: the robots.
        optimum: the fewest steps in which they can solve it; None: they are not known.
        instruction: in plain English.
        policy: name of the policy that drove the robots.
        observation: what the policy observed, "visual" or "scene_graph".
        rooms: rooms that have a message bit, in order.
        item: name of the object X.
        targets: names of the receptacles Y.
        moments: the start and every step.
        success: whether X stands on Y at the end.
        collisions: driven motions in which an arm, or what it holds, passes through something.
        states: thing or object -> its symbolic state.
        highest: the potential of the solved task.
    """

    task: AnyTask
    home: Home
    team: Team
    optimum: Optimum | None
    instruction: str
    policy: str
    observation: str
    rooms: tuple[str, ...]
    item: str
    targets: tuple[str, ...]
    moments: tuple[Moment, ...]
    success: bool
    collisions: int
    states: dict[str, str]
    highest: float = 10.0

    @property
    def steps(self) -> int:
        """Number of joint steps."""
        return len(self.moments) - 1

    @property
    def has_board(self) -> bool:
        """Whether the robots hear a message board."""
        return any(moment.messages is not None for moment in self.moments)

    @property
    def models(self) -> dict[str, RobotModel]:
        """Robot -> what is known of its kind."""
        return {name: model for name, model, _ in self.team}


def board_of(messages: Messages, rooms: tuple[str, ...], heard: bool) -> Messages | None:
    """Return (2, rooms) in which X and Y have been seen by the message board; None if there is none.

    Args:
        messages: what has been said; a channel that is heard as a board may keep something else.
        rooms: in the order of their bits.
        heard: whether robots hear a board, see :attr:`chmarl_pb.envs.parallel.HouseholdEnv.hears_board`.
    """
    kept = heard and messages.shape == (2, len(rooms)) and np.isin(messages, (0, 1)).all()
    return messages.copy() if kept else None
