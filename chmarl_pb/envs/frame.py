"""What ``render()`` shows: the last step of an environment as a frame of the demo's film."""

from typing import TYPE_CHECKING

from chmarl_pb.envs.last_step import LastStep
from chmarl_pb.envs.optimum import says_optimum
from chmarl_pb.frames.drawer import FrameDrawer, Now
from chmarl_pb.frames.motion_player import scene_of
from chmarl_pb.frames.recording import Moment, Recording, board_of
from chmarl_pb.rendering.movables import team_in
from chmarl_pb.tasks.task import Optimum

if TYPE_CHECKING:
    from chmarl_pb.envs.parallel import HouseholdEnv


def drawer_of(env: "HouseholdEnv") -> FrameDrawer:
    """Return what draws the frames of the episode that an environment is in."""
    return FrameDrawer(now_of(env, LastStep({}, {}, {}, 0.0)).recording)


def now_of(env: "HouseholdEnv", last: LastStep) -> Now:
    """Return how the episode of an environment stands; of several goals the first that is not reached is shown."""
    setting, outcome, robots = env.setting, env.outcome, env.possible_agents
    parts = outcome.parts or (outcome,)
    goal = next((goal for goal, part in zip(setting.goals, parts, strict=False) if not part.success), setting.goal)
    board = board_of(env.messages, env.rooms, env.hears_board)
    moment = Moment(
        last.actions, last.succeeded, last.reward, outcome.potential, board,
        {name: last.feedback.get(name, "") for name in robots}, outcome.seen, (), scene_of(env.world), env.said,
        {}, {},
    )  # fmt: skip
    best = Optimum(env.task.optimal_steps) if says_optimum(env, env.task) else None
    recording = Recording(
        env.task, env.simulation.home, team_in(env.world, env.simulation.models), best, env.instruction, "",
        env.options.observation_name, env.rooms, goal.item, goal.receptacles, (moment,), outcome.success,
        env.collisions, setting.states, 10.0 * len(setting.goals),
    )  # fmt: skip
    return Now(recording, moment, env.steps, env.options.max_steps, not env.agents)
