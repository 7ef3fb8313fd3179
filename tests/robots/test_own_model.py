"""Robots that a user makes in Python: what robot files refuse is refused here, too."""

import copy
import pickle
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.errors import AssetError, OptionError
from chmarl_pb.evaluation.provenance import robots_hash
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.robots.mobile import MobileRobot
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.motion import Motion, Tick

TEXT: Any = {"fov": "90"}
SHORT: Any = {"position": (0.0, 0.0)}
DRONE, HUMANOID = find_model("drone"), find_model("humanoid")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"class_name": "rover"}, "class_name='rover'; use one of: humanoid, drone"),
        ({"speed": -1.0}, "speed=-1.0; use a number from 0.05 to 10"),
        ({"turn_speed": float("nan")}, "turn_speed=nan; use a number"),
        ({"camera": replace(DRONE.camera, fov=400.0)}, "camera.fov=400.0; use a number from 10 to 150"),
        ({"camera": None}, "camera=None; give a CameraMount"),
        ({"camera": replace(DRONE.camera, **SHORT)}, r"give a CameraMount at \(x, y, z\)"),
        ({"camera": replace(DRONE.camera, **TEXT)}, "camera.fov=90; use a number"),
        ({"urdf": None}, "urdf=None; give the path"),
        ({"make": "Slow"}, "make='Slow' is no function"),
        ({"name": ""}, "robot '': agents get this name; let it be letters and _"),
        ({"name": "humanoid_0"}, "with no digit at its end"),
        ({"name": "kitchen/stove"}, "agents get this name"),
        ({"name": 3}, "robot 3: agents get this name"),
        ({"altitude": -1.0}, "altitude=-1.0; use a number from 2 to 20"),
        ({"flies": False, "altitude": -1.0}, "altitude=-1.0; use a number from 0 to 20"),
        ({"camera": replace(DRONE.camera, pitch=float("nan"))}, "camera.pitch=nan"),
        ({"camera": replace(DRONE.camera, position=(0.0, float("nan"), 0.0))}, "camera.position=nan"),
    ],
)
def test_what_no_robot_can_be_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(AssetError, match=words):
        replace(DRONE, **change)


def test_copies_of_packaged_robots_are_these_robots() -> None:
    for copied in (copy.deepcopy(HUMANOID), pickle.loads(pickle.dumps(HUMANOID))):
        assert copied is HUMANOID
        with closing(chmarl_pb.parallel_env(robots=(copied, "humanoid"))) as env:
            assert env.possible_agents == ["humanoid_0", "humanoid_1"]
    own = pickle.loads(pickle.dumps(replace(DRONE, name="scout")))
    assert own is not DRONE and own.name == "scout" and own.copied_by is None


def test_results_do_not_depend_on_the_workers() -> None:
    given: dict[str, Any] = {"tasks": ["val-unseen-000", "val-unseen-001"], "robots": (HUMANOID, DRONE)}
    here, elsewhere = (chmarl_pb.evaluate("planner", "val-unseen", workers=workers, **given) for workers in (1, 2))
    assert here.episodes == elsewhere.episodes
    assert all(episode.optimum is None for episode in here.episodes), "the tasks tell L* for these robots"


def test_a_path_may_be_a_text() -> None:
    model = replace(DRONE, name="plain", urdf=str(DRONE.urdf))  # type: ignore[arg-type]
    assert model.urdf == Path(DRONE.urdf)
    with closing(chmarl_pb.parallel_env(robots=(HUMANOID, model))) as env:
        assert env.possible_agents == ["humanoid", "plain"]


class Duck:
    """No robot."""

    def __init__(self, *arguments: Any):
        self.lattice = None


def test_what_is_no_robot_is_refused() -> None:
    duck = replace(DRONE, name="duck", make=Duck)
    with (
        pytest.raises(AssetError, match="make gives a Duck without actions, plan"),
        closing(chmarl_pb.parallel_env(robots=(HUMANOID, duck))) as env,
    ):
        env.reset(seed=0)


class Cautious(MobileRobot):
    """A robot with a number of its own."""

    def __init__(self, *arguments: Any, care: float = 1.0):
        super().__init__(*arguments)
        self.care = care


class Named(MobileRobot):
    """A robot whose actions have other names."""

    def __init__(self, *arguments: Any, names: Any = ()):
        super().__init__(*arguments)
        self.actions = names


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("fly", "land"), "'stay' among them"), (("stay", "stay"), "different names"), (["stay"], "use a tuple"),
        (("stay", 3), "different names"),
    ],
)  # fmt: skip
def test_actions_that_robots_cannot_have(names: Any, words: str) -> None:
    named = replace(DRONE, name="named", make=partial(Named, names=names))
    with pytest.raises(AssetError, match=f"robot 'named': actions=.*{words}"):
        chmarl_pb.parallel_env(robots=(HUMANOID, named))


def test_policies_say_which_actions_they_miss() -> None:
    named = replace(DRONE, name="named", make=partial(Named, names=("stay", "move_forward")))
    with closing(chmarl_pb.parallel_env(robots=(HUMANOID, named))) as env:
        with pytest.raises(OptionError, match="policy 'search' needs actions that the robot 'named' has not: goto_"):
            chmarl_pb.make_policy("search", env)
        episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("random", env), seed=0)
        assert episode.steps == env.options.max_steps


class Answering(MobileRobot):
    """A robot that answers what it is told to."""

    def __init__(self, *arguments: Any, answers: dict[str, Any]):
        super().__init__(*arguments)
        self.answers = answers

    def plan(self, *given: Any, **named: Any) -> Any:
        return self.answers["plan"] if "plan" in self.answers else super().plan(*given, **named)

    def finish(self, motion: Motion) -> Any:
        done = super().finish(motion)
        if "then" in self.answers:
            self.answers["then"](self)
        return self.answers.get("finish", done)

    def drive(self, motion: Motion) -> Any:
        return self.answers.get("drive", super().drive(motion))


def answering(**answers: Any) -> tuple[RobotModel, RobotModel]:
    return HUMANOID, replace(DRONE, name="own", make=partial(Answering, answers=answers))


def gone(robot: MobileRobot) -> None:
    """Teleport a robot to a pose that is none."""
    state = robot.world.state
    robot.world.state = replace(state, robots={**state.robots, "own": replace(state.robots["own"], pose=-1)})


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"plan": Motion(-1)}, r"plan\('stay'\) is Motion\(pose=-1, .*\); it is to be None where the action fails, "
         r"or a Motion whose pose is a whole number from 0 to \d+, as its lattice has these poses"),
        ({"plan": Motion(10**9)}, r"plan\('stay'\) is Motion\(pose=1000000000"),
        ({"plan": Motion(2.0)}, r"plan\('stay'\) is Motion\(pose=2.0"),  # type: ignore[arg-type]
        ({"plan": Motion(True)}, r"plan\('stay'\) is Motion\(pose=True"),
        ({"plan": 3}, r"plan\('stay'\) is 3; it is to be None"), ({"plan": True}, r"plan\('stay'\) is True; "),
        ({"plan": (5, None, None, None)}, r"plan\('stay'\) is \(5, None, None, None\); "),
        ({"finish": None}, r"finish\(Motion.*\) is None; it is to be True or False: whether the motion succeeded"),
        ({"finish": "no"}, r"finish\(Motion.*\) is 'no'; "), ({"finish": 2}, r"finish\(Motion.*\) is 2; "),
        ({"then": gone}, r"pose after finish\(Motion.*\) is -1; it is to be a whole number from 0 to \d+, as"),
        ({"drive": None}, r"drive\(Motion.*\) is None; it is to be an iterator of Ticks, see MobileRobot.drive"),
        ({"drive": iter([0.5])}, r"drive\(Motion.*\) is 0.5; it is to be a Tick, or None, for each step"),
    ],
)  # fmt: skip
def test_what_a_robots_class_answers_is_checked(answers: dict[str, Any], words: str) -> None:
    execution = "simulated" if "drive" in answers else "instant"
    with closing(chmarl_pb.parallel_env(robots=answering(**answers), split="val-unseen", execution=execution)) as env:
        env.reset(seed=0)
        stay = {robot: names.index("stay") for robot, names in env.action_names.items()}
        with pytest.raises(OptionError, match=rf"^tests\.robots\.test_own_model:Answering\.{words}"):
            env.step(stay)


def test_what_a_robots_class_may_answer() -> None:
    ticks = iter([Tick(by_motors=False), None])
    for answers, succeeded in (
        ({"plan": Motion(np.int64(5))}, True),  # type: ignore[arg-type]
        ({"plan": None}, False), ({"finish": np.bool_(False)}, False), ({"finish": 0}, False),
        ({"drive": ticks}, True),
    ):  # fmt: skip
        execution = "simulated" if "drive" in answers else "instant"
        team = answering(**answers)
        with closing(chmarl_pb.parallel_env(robots=team, split="val-unseen", execution=execution)) as env:
            env.reset(seed=0)
            infos = env.step({robot: names.index("stay") for robot, names in env.action_names.items()})[-1]
            assert infos["own"]["action_success"] == succeeded
            assert type(env.world.state.robots["own"].pose) is int


def test_a_robots_class_is_checked_in_plans_too() -> None:
    class Grasping(MobileManipulator):
        def plan(self, action: str, *given: Any, **named: Any) -> Any:
            return Motion(-1) if action == "pick" else super().plan(action, *given, **named)

    model = replace(HUMANOID, name="grasping", make=Grasping)
    with closing(chmarl_pb.parallel_env(robots=(model,), split="val-unseen")) as env:
        env.reset(options={"task": "val-unseen-000"})
        policy = chmarl_pb.make_policy("planner", env)
        with pytest.raises(OptionError, match=r"Grasping\.plan\('pick'\) is Motion\(pose=-1"):
            chmarl_pb.rollout(env, policy, seed=0, task="val-unseen-000")


def test_the_planner_flies_robots_with_more_actions() -> None:
    class Beeping(MobileRobot):
        def __init__(self, *arguments: Any):
            super().__init__(*arguments)
            self.actions = ("beep", *self.actions)

        def plan(self, action: str, *given: Any, **named: Any) -> Any:
            assert action != "beep"
            return super().plan(action, *given, **named)

    team = (HUMANOID, replace(DRONE, name="beeping", make=Beeping))
    with closing(chmarl_pb.parallel_env(robots=team, split="val-unseen")) as env:
        episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), seed=0, task="val-unseen-000")
    with closing(chmarl_pb.parallel_env(split="val-unseen")) as env:
        plain = chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), seed=0, task="val-unseen-000")
    assert episode.success and len(episode) == len(plain)
    assert [row["beeping"] - 1 for row in episode.actions] == [row["drone"] for row in plain.actions]


def test_robots_fly_over_the_walls() -> None:
    low = replace(DRONE, name="low", altitude=2.0)
    with pytest.raises(AssetError, match=r"robot 'low': altitude = 2 m is not above the walls of .* end at 2.5 m"):
        chmarl_pb.parallel_env(robots=(HUMANOID, low))


def test_robots_that_are_made_otherwise_have_other_hashes() -> None:
    makes = [None, Cautious, partial(Cautious, care=0.5), partial(Cautious, care=0.7)]
    hashes = [robots_hash([replace(DRONE, make=make)])["drone"] for make in makes]
    assert len(set(hashes)) == len(makes)
    assert robots_hash([replace(DRONE, make=partial(Cautious, care=0.5))])["drone"] == hashes[2]
