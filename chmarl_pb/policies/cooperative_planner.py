"""The cooperative planner: robots that grasp act optimally, those that fly find what will be needed next.

Privileged: it knows where everything is. A robot that flies takes the shortest way to where it sees X, if it gets
there before the robot that grasps sees X itself; then on to where it sees the receptacle that will be used, without
waiting for the Pick, and hovers there. So both messages are sent as early as possible. All others stay.

It may be asked in any state, also after actions that it did not choose, and plans anew only in states
that none of its plans has led through.
"""

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.errors import TaskError
from chmarl_pb.policies.policy import Actions, Infos, Observations, PolicyEnv
from chmarl_pb.robots.asked import planned
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.pointing import cell_of, place_of, verb_of
from chmarl_pb.robots.robot import Robot, taken_cells
from chmarl_pb.tasks.order import plan_team
from chmarl_pb.tasks.planner import Cells, Oracle, breadth_first, free_moves
from chmarl_pb.tasks.targets import is_done

_State = tuple[int, str | None]  # pose on the lattice, what is held


class GraspingPlanner:
    """Plans how one robot reaches one goal.

    Attributes:
        goal: what it works for.
        found: names of the things that any robot has seen since it works for this goal.
        target: the receptacle that it will use.
    """

    def __init__(self, oracle: Oracle, goal: Goal, goals: tuple[Goal, ...]):
        """Plan from where a world is now.

        Args:
            oracle: plans for the robot.
            goal: what it works for.
            goals: all goals of the task.
        """
        self.oracle, self.goal, self._goals = oracle, goal, goals
        self.found: set[str] = set()
        self.target = goal.receptacles[0]
        self._ways: dict[_State, list[str]] = {}
        self._supports = oracle.world.supports

    def way(self) -> list[str]:
        """Return the shortest list of actions from here to the goal.

        Raises:
            TaskError: there is none.
        """
        robot, supports = self.oracle.robot, self.oracle.world.supports
        if self.oracle.pointer is not None and supports is not self._supports:
            self._ways, self._supports = {}, supports  # other objects may have been moved, and may hide what was seen
        here, taken = (robot.pose, robot.held), taken_cells(robot)
        way = self._ways.get(here)
        if way is None or (taken and self._is_blocked(way, taken)) or (way and not self._still_points(way[0], taken)):
            self._plan_way(here, taken)
        return self._ways[here]

    def _still_points(self, action: str, taken: Cells) -> bool:
        """Return whether an action means what was planned: other robots, or what they hold, may have come into view."""
        if cell_of(action) is None or self.oracle.robot.held not in (None, self.goal.item):
            return True
        return action in self.oracle.useful(self.goal, self._goals, taken)

    def _is_blocked(self, way: list[str], taken: Cells) -> bool:
        """Return whether another robot stands where the first action leads."""
        action, robot = way[0] if way else "stay", self.oracle.robot
        return verb_of(action) not in robot.arm_actions and planned(robot, action, taken=taken) is None

    def _plan_way(self, state: _State, taken: Cells) -> None:
        """Plan, and remember what is left to do in every state on the way; others stay where they are."""
        way, robot = self.oracle.plan(self.goal, self._goals), self.oracle.robot
        moving = [name for name in robot.actions if name not in (*robot.arm_actions, "stay")]
        pose, held = state
        moves = free_moves(robot.lattice, taken)
        for number, action in enumerate(way):
            self._ways[pose, held] = way[number:]
            verb = verb_of(action)
            if verb == "place" and number + 1 < len(way):
                break  # what was held by mistake is put down: it will be planned anew
            if verb == "pick":
                stand = robot.stand(self.goal.item, taken)
                assert stand is not None, "the oracle has planned this Pick"
                pose, held = stand, self.goal.item
            elif verb != "place":
                pose = int(moves[pose, moving.index(action)])
        self._ways.setdefault((pose, held), [])
        self.target = self._target_seen_from(pose)

    def _target_seen_from(self, pose: int) -> str:
        """Return the nearest target receptacle that the robot sees where it will place."""
        robot = self.oracle.robot
        seen = set(self.oracle.seen_from(robot.name, pose))
        targets = [name for name in self.goal.receptacles if name in seen] or list(self.goal.receptacles)
        x, y, _ = robot.lattice.pose(pose)
        return min(targets, key=lambda name: float(np.hypot(*(self.oracle.ball(name)[:2] - (x, y)))))


class FlightPlanner:
    """Plans where one robot that flies looks for what a robot that grasps needs."""

    def __init__(self, robot: Robot, oracle: Oracle):
        """Plan for a robot; the oracle tells what it would see."""
        self._robot, self._oracle = robot, oracle
        self._flights: dict[tuple[str, int], list[str] | None] = {}

    def choose(self, plan: GraspingPlanner, way: list[str], seen: tuple[str, ...]) -> str:
        """Return the name of the next action.

        Args:
            plan: of the robot that grasps.
            way: what is left of it.
            seen: names of the things in this robot's view.
        """
        pick = place_of(way, "pick")
        if pick is not None and plan.goal.item not in plan.found:
            flight = self._flight(plan.goal.item)
            if flight and len(flight) < pick:
                return flight[0]
        if plan.target in seen:
            return "stay"
        flight = self._flight(plan.target)
        return flight[0] if flight else "stay"

    def _flight(self, wanted: str) -> list[str] | None:
        """Return the shortest list of actions to where the robot sees a thing; None if it sees it from nowhere."""
        here = wanted, self._robot.pose
        if not self._flights.get(here, []):  # not known, or its end has been reached in vain
            self._plan_flight(wanted)
        return self._flights[here]

    def _plan_flight(self, wanted: str) -> None:
        """Plan, and remember what is left to fly at every position on the way."""
        pose, lattice = self._robot.pose, self._robot.lattice
        if (wanted, -1) in self._flights:
            self._flights[wanted, pose] = None
            return
        found = breadth_first(pose, lattice.moves, lambda poses: self._sees(poses, wanted))
        if found is None:
            self._flights[wanted, pose] = self._flights[wanted, -1] = None
            return
        names = (*(f"goto_{room}" for room in lattice.anchors), *lattice.steps)  # of the moves; robots may have more
        flight = [names[number] for number in found]
        for number, move in enumerate(found):
            self._flights[wanted, pose] = flight[number:]
            pose = int(lattice.moves[pose, move])
        self._flights.setdefault((wanted, pose), [])

    def _sees(self, poses: NDArray[np.int64], wanted: str) -> NDArray[np.bool_]:
        """Return whether the robot sees a thing from poses; true for the first of them alone."""
        model, oracle, ball = self._robot.model, self._oracle, self._oracle.ball(wanted)
        slope = np.tan(np.radians(model.camera.fov) / 2)
        reach = model.altitude * slope + ball[3]  # metres along the floor: it surely sees no farther
        away = np.abs(self._robot.lattice.points[poses] - ball[:2]).max(axis=1)
        sees = np.zeros(len(poses), dtype=bool)
        for number in np.flatnonzero(away < reach):
            if wanted in oracle.seen_from(self._robot.name, int(poses[number])):
                sees[number] = True
                break
        return sees


class PlannerPolicy:
    """Drives all robots by the privileged planner: those that grasp optimally, those that fly to find."""

    def __init__(self, env: PolicyEnv):
        """Plan for the episodes of an environment."""
        self.env = env

    def reset(self, seed: int | None) -> None:
        """Plan the episode that has just begun."""
        simulation, self._goals = self.env.simulation, self.env.setting.goals
        self._orders: dict[str, tuple[Goal, ...]]
        if len(self._goals) == len(simulation.oracles) == 1:
            self._orders = dict.fromkeys(simulation.oracles, self._goals)
        else:
            self._orders = {name: plan.goals for name, plan in plan_team(simulation.oracles, self._goals).plans.items()}
        self._planners: dict[str, GraspingPlanner] = {}
        self._flights: dict[tuple[str, Goal], FlightPlanner] = {}

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the planner's action of each robot in the present state."""
        seen = {name: info["visible"] for name, info in infos.items()}
        ways = {name: self._way(name, seen) for name in self._orders}
        chosen = {name: way[0] if way else "stay" for name, way in ways.items()}
        leaders = [name for name, order in self._orders.items() if order] or list(self._orders)
        fliers = [name for name in seen if self.env.simulation.models[name].flies]
        for number, name in enumerate(fliers):
            chosen[name] = self._flight(name, leaders[number % len(leaders)], ways, seen[name])
        return {name: names.index(chosen.get(name, "stay")) for name, names in self.env.action_names.items()}

    def _way(self, robot: str, seen: dict[str, tuple[str, ...]]) -> list[str]:
        """Return what a robot that grasps has to do for its next goal."""
        goal = self._next_goal(robot)
        if goal is None:
            return []
        planner = self._planners.get(robot)
        if planner is None or planner.goal != goal:
            planner = self._planners[robot] = GraspingPlanner(self.env.simulation.oracles[robot], goal, self._goals)
        planner.found.update(*seen.values())
        try:
            return planner.way()
        except TaskError:
            if len(self._orders) == 1 and self.env.simulation.pointer is None:
                raise
            return []  # another robot is in the way and will move on, or objects were put where they do not belong

    def _flight(self, robot: str, leader: str, ways: dict[str, list[str]], seen: tuple[str, ...]) -> str:
        """Return the action of a robot that flies for one that grasps."""
        planner, simulation = self._planners.get(leader), self.env.simulation
        if planner is None:
            return "stay"
        key = robot, planner.goal
        if key not in self._flights:
            self._flights[key] = FlightPlanner(simulation.robots[robot], simulation.oracles[leader])
        return self._flights[key].choose(planner, ways[leader], seen)

    def _next_goal(self, robot: str) -> Goal | None:
        """Return the goal of what a robot holds, or the first in its order that is left and that nobody holds."""
        state, order = self.env.simulation.world.state, self._orders[robot]
        own = self.env.simulation.robots[robot].held
        held = [goal for goal in self._goals if goal.item == own]
        left = [goal for goal in order if not is_done(goal, state) and goal.item not in state.held]
        return next(iter((*held, *left, *order[:1])), None)
