"""The cooperative planner: the humanoid acts optimally, the drone finds what it will need next.

Privileged: it knows where everything is. The drone flies the shortest way to where it sees X, if it gets
there before the humanoid sees X itself; then on to where it sees the receptacle that the humanoid
will use, without waiting for the Pick, and hovers there. So both messages are sent as early as possible.

It may be asked in any state, also after actions that it did not choose, and plans anew only in states
that none of its plans has led through.
"""

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.navigation.lattice import DRONE_HEIGHT
from chmarl_pb.policies.policy import Actions, Infos, Observations, PolicyEnv
from chmarl_pb.rendering.camera_poses import CAMERAS
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.order import plan_all
from chmarl_pb.tasks.planner import Oracle, breadth_first
from chmarl_pb.tasks.targets import is_done

_HumanoidState = tuple[int, str | None]  # pose on the lattice, what is held


class CooperativePlanner:
    """Plans for both robots how to reach one goal."""

    def __init__(self, oracle: Oracle, goal: Goal, goals: tuple[Goal, ...]):
        """Plan from where a world is now.

        Args:
            oracle: plans for the humanoid.
            goal: what both robots work for.
            goals: all goals of the task.
        """
        self.oracle, self.goal, self.goals = oracle, goal, goals
        self._found: set[str] = set()
        self._target = goal.receptacles[0]
        self._ways: dict[_HumanoidState, list[str]] = {}
        self._flights: dict[tuple[str, int], list[str] | None] = {}

    def choose(self, seen: dict[str, tuple[str, ...]]) -> dict[str, str]:
        """Return the name of each robot's next action.

        Args:
            seen: robot -> names of the things visible to it now.
        """
        self._found.update(*seen.values())
        way = self._humanoid_way()
        return {"humanoid": way[0] if way else "stay", "drone": self._drone_action(way, seen["drone"])}

    # The humanoid

    def _humanoid_way(self) -> list[str]:
        """Return the humanoid's shortest list of actions from here to success."""
        here = (self.oracle.humanoid.pose, self.oracle.world.held)
        if here not in self._ways:
            self._plan_way(here)
        return self._ways[here]

    def _plan_way(self, state: _HumanoidState) -> None:
        """Plan, and remember what is left to do in every state on the way."""
        way = self.oracle.plan(self.goal, self.goals)
        moving = [name for name in self.oracle.humanoid.actions if name not in ("pick", "place", "stay")]
        moves = self.oracle.space.lattice.moves
        for number, action in enumerate(way):
            self._ways[state] = way[number:]
            pose, held = state
            if action == "pick":
                stand = self.oracle.space.stand(self.oracle.world.grip(self.goal.item))
                assert stand is not None, "the oracle has planned this Pick"
                state = stand, self.goal.item
            elif action != "place":
                state = int(moves[pose, moving.index(action)]), held
        self._ways.setdefault(state, [])
        self._target = self._target_seen_from(state[0])

    def _target_seen_from(self, pose: int) -> str:
        """Return the nearest target receptacle that the humanoid sees where it will place."""
        seen = set(self.oracle.seen_from("humanoid", pose))
        targets = [name for name in self.goal.receptacles if name in seen] or list(self.goal.receptacles)
        x, y, _ = self.oracle.space.lattice.pose(pose)
        return min(targets, key=lambda name: float(np.hypot(*(self.oracle.centre(name)[:2] - (x, y)))))

    # The drone

    def _drone_action(self, way: list[str], seen: tuple[str, ...]) -> str:
        if "pick" in way and self.goal.item not in self._found:
            flight = self._flight(self.goal.item)
            if flight and len(flight) < way.index("pick"):
                return flight[0]
        if self._target in seen:
            return "stay"
        flight = self._flight(self._target)
        return flight[0] if flight else "stay"

    def _flight(self, wanted: str) -> list[str] | None:
        """Return the drone's shortest list of actions to where it sees a thing; None if it sees it from nowhere."""
        here = wanted, self.oracle.drone.pose
        if not self._flights.get(here, []):  # not known, or its end has been reached in vain
            self._plan_flight(wanted)
        return self._flights[here]

    def _plan_flight(self, wanted: str) -> None:
        """Plan, and remember what is left to fly at every position on the way."""
        if (wanted, -1) in self._flights:
            self._flights[wanted, self.oracle.drone.pose] = None
            return
        lattice, names = self.oracle.drone.lattice, self.oracle.drone.actions
        gotos = [np.full(len(lattice.points), pose) for pose in lattice.anchors.values()]
        moves = np.concatenate([np.stack(gotos, axis=1), lattice.moves], axis=1)
        pose = self.oracle.drone.pose
        found = breadth_first(pose, moves, lambda poses: self._drone_sees(poses, wanted))
        if found is None:
            self._flights[wanted, pose] = self._flights[wanted, -1] = None
            return
        flight = [names[number] for number in found]
        for number, move in enumerate(found):
            self._flights[wanted, pose] = flight[number:]
            pose = int(moves[pose, move])
        self._flights.setdefault((wanted, pose), [])

    def _drone_sees(self, poses: NDArray[np.int64], wanted: str) -> NDArray[np.bool_]:
        """Return whether the drone sees a thing from poses; true for the first of them alone."""
        slope = np.tan(np.radians(CAMERAS["drone"].fov) / 2)
        reach = DRONE_HEIGHT * slope + self.oracle.radius(wanted)  # metres along the floor: it surely sees no farther
        away = np.abs(self.oracle.drone.lattice.points[poses] - self.oracle.centre(wanted)[:2]).max(axis=1)
        sees = np.zeros(len(poses), dtype=bool)
        for number in np.flatnonzero(away < reach):
            if wanted in self.oracle.seen_from("drone", int(poses[number])):
                sees[number] = True
                break
        return sees


class PlannerPolicy:
    """Drives both robots by the privileged planner: the humanoid optimally, the drone to where it can tell."""

    def __init__(self, env: PolicyEnv):
        """Plan for the episodes of an environment."""
        self.env = env

    def reset(self, seed: int | None) -> None:
        """Plan the episode that has just begun."""
        goals = self.env.setting.goals
        self._order = goals if len(goals) == 1 else plan_all(self.env.stage.oracle, goals).goals
        self._planner: CooperativePlanner | None = None

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the planner's action of each robot in the present state."""
        goal = self._next_goal()
        if self._planner is None or self._planner.goal != goal:
            self._planner = CooperativePlanner(self.env.stage.oracle, goal, self.env.setting.goals)
        chosen = self._planner.choose({name: info["visible"] for name, info in infos.items()})
        return {name: self.env.action_names[name].index(action) for name, action in chosen.items()}

    def _next_goal(self) -> Goal:
        """Return the goal of what the humanoid holds, or the first in the planned order that is left."""
        state = self.env.stage.world.state
        held = [goal for goal in self._order if goal.item in state.held]
        left = [goal for goal in self._order if not is_done(goal, state)]
        return (held or left or self._order)[0]
