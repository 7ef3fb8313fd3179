"""A stage: one home with its world, its robots and what draws their views, kept for all episodes played in it."""

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.check import limits
from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.rendering.registry import RENDERERS
from chmarl_pb.robots.drone import Drone
from chmarl_pb.robots.humanoid import Humanoid
from chmarl_pb.sensing.scene_graph import SceneGraphs
from chmarl_pb.tasks.kinds import REARRANGE, TaskKind
from chmarl_pb.tasks.order import plan_all
from chmarl_pb.tasks.planner import Oracle
from chmarl_pb.tasks.setting import Setting
from chmarl_pb.tasks.tidy_task import AnyTask
from chmarl_pb.world import Uncopied, World


class Stage(Uncopied):
    """One home, ready to play.

    Attributes:
        space: what the home offers.
        world: the physics.
        humanoid: the humanoid.
        drone: the drone.
        robots: name -> robot.
        renderer: draws what they see.
        graphs: the scene graphs of what they see.
        oracle: the privileged planner of this world.
    """

    def __init__(self, home: str, renderer: str = "fast"):
        """Load a home.

        Args:
            home: its name or path.
            renderer: one of :data:`chmarl_pb.rendering.registry.RENDERERS`.

        Raises:
            HomeError: the home cannot be used.
        """
        self.home = load_home(home)
        for problem in limits(self.home):
            raise HomeError(f"{self.home.path}: {problem}")
        self.space = space_of(self.home)
        # Derive lattice and surfaces first: a home that robots cannot move in is refused before physics loads it.
        self.rooms, _ = tuple(self.space.lattice.anchors), self.space.surfaces
        self.room_names = tuple(self.home.rooms)
        # Where each room of the home stands in ``rooms``; after the last if it is none of them.
        self.room_numbers = [
            self.rooms.index(room) if room in self.rooms else len(self.rooms) for room in self.home.rooms
        ]
        self.world = World(self.home)
        try:
            self.humanoid = Humanoid(self.world, self.space)
            self.drone = Drone(self.world, self.space)
            self.robots: dict[str, Humanoid | Drone] = {"humanoid": self.humanoid, "drone": self.drone}
            self.renderer = RENDERERS[renderer](self.world)
            self.graphs = SceneGraphs(self.space, self.world.links, self.renderer.names)
            self.oracle = Oracle(self.humanoid, self.drone, self.renderer)
        except BaseException:
            self.close()
            raise

    @property
    def actions(self) -> dict[str, tuple[str, ...]]:
        """Robot -> names of its actions, in the order of their numbers."""
        return {name: robot.actions for name, robot in self.robots.items()}

    def begin(self, task: AnyTask, kind: TaskKind = REARRANGE) -> Setting:
        """Lay out a task of a kind and put the robots at their starts.

        Raises:
            TaskError: the home cannot hold the task.
        """
        setting = kind.set_up(self.world, self.space, task)
        self.humanoid.spawn(setting.humanoid)
        self.drone.spawn(setting.drone)
        return setting

    def solve(self, task: AnyTask, kind: TaskKind = REARRANGE) -> list[str]:
        """Begin a task and return the planner's actions of the humanoid.

        Raises:
            TaskError: the task cannot be solved.
        """
        return plan_all(self.oracle, self.begin(task, kind).goals).actions

    def close(self) -> None:
        """Disconnect from physics."""
        self.world.close()
