"""Robots with an arm of their own: what they reach, hold and show, and how wrong files are refused."""

import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np
import pybullet as p
import pytest

import chmarl_pb
from chmarl_pb.errors import AssetError
from chmarl_pb.robots.chain import Tree, chain_to
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.inverse import place
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.own_arm import OwnArm
from chmarl_pb.world import Client, yaw_quaternion
from tests.helpers.own_robots import CRANE_FILE, crane, rover

SPLIT = "val-unseen"


@pytest.fixture(scope="module", params=["rover", "crane"])
def robot(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return {"rover": rover, "crane": crane}[request.param](tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def model(robot: Path) -> RobotModel:
    return find_model(robot)


@pytest.fixture(scope="module")
def arm(model: RobotModel) -> Iterator[OwnArm]:
    connection = Client()
    assert model.arm is not None
    yield OwnArm(connection.number, model.load(connection.number), model.arm)
    connection.close()


def grasp_point(arm: OwnArm) -> np.ndarray:
    state = p.getLinkState(arm.body, arm.grasp_link, computeForwardKinematics=True, physicsClientId=arm.client)
    return np.array(p.multiplyTransforms(state[0], state[1], *arm.grasp)[0])


def targets(model: RobotModel, count: int) -> np.ndarray:
    """Return points (count, 3) all over what an arm reaches, in the frame of its base."""
    assert model.reach is not None
    rng, bands = np.random.default_rng(0), model.reach.bands
    low, high, near, far = np.array(bands)[rng.integers(len(bands), size=count)].T
    bearing = rng.uniform(-model.reach.bearing, model.reach.bearing, count)
    distance = rng.uniform(near, far)
    return np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), rng.uniform(low, high)])


def test_the_chain_is_where_pybullet_has_it(arm: OwnArm, model: RobotModel) -> None:
    assert model.arm is not None
    links, count = model.arm.chain.links, model.arm.moving
    points, pointing = np.empty((count + 1, 3)), np.empty(3)
    for configuration in np.random.default_rng(1).uniform(arm.lower, arm.upper, (20, len(arm.lower))):
        arm.set(configuration.tolist())
        place(links, configuration[:count], np.empty((count, 3)), points, pointing)
        np.testing.assert_allclose(points[-1], grasp_point(arm), atol=1e-5)
        assert np.linalg.norm(pointing) == pytest.approx(1)


def test_reaches_all_that_was_measured(arm: OwnArm, model: RobotModel) -> None:
    base = (0.4, -1.3, 0.0), yaw_quaternion(0.7)
    p.resetBasePositionAndOrientation(arm.body, *base, physicsClientId=arm.client)
    for target in targets(model, 150).tolist():
        point, _ = p.multiplyTransforms(*base, target, (0, 0, 0, 1))
        configuration = arm.solve(point, base)
        assert configuration is not None
        assert (np.array(configuration) >= arm.lower).all() and (np.array(configuration) <= arm.upper).all()
        arm.set(configuration)
        np.testing.assert_allclose(grasp_point(arm), point, atol=5e-4)
    above = arm.above(arm.solutions(point, base), 0.1)
    arm.set(tuple(above[0].tolist()))
    assert grasp_point(arm)[2] > point[2] + 0.02
    assert arm.solve((9.0, 0.0, 0.5), base) is None and not len(arm.solutions((9.0, 0.0, 0.5), base))
    p.resetBasePositionAndOrientation(arm.body, (0, 0, 0), (0, 0, 0, 1), physicsClientId=arm.client)


def test_the_same_bits_in_any_process(robot: Path, model: RobotModel) -> None:
    script = (
        "import sys, numpy; from chmarl_pb.robots.file import find_model; space = find_model(sys.argv[1]).arm.space;"
        "print(space.nodes.tobytes().hex(), [space.solve(numpy.array((0.6, y, 0.8))).tobytes().hex() for y in (0, .1)])"
    )
    found = subprocess.run([sys.executable, "-c", script, str(robot)], capture_output=True, text=True, check=True)
    assert model.arm is not None
    space = model.arm.space
    near = [space.solve(np.array((0.6, y, 0.8))).tobytes().hex() for y in (0, 0.1)]
    assert found.stdout.strip() == f"{space.nodes.tobytes().hex()} {near}"


def test_plays_alone_and_what_it_holds_is_at_its_hand(robot: Path) -> None:
    ends = []
    for execution in ("instant", "simulated"):
        env = chmarl_pb.parallel_env(robots=(robot,), split=SPLIT, execution=execution)
        policy = chmarl_pb.make_policy("planner", env)
        observations, infos = env.reset(seed=0)
        policy.reset(0)
        mine = env.simulation.robots[robot.stem]
        assert isinstance(mine, MobileManipulator) and isinstance(mine.arm, OwnArm)
        held = 0
        while env.agents:
            observations, _, _, _, infos = env.step(policy.act(observations, infos))
            if mine.held:
                grip = env.world.grip(mine.held)
                np.testing.assert_allclose(env.world.physics.grasp_pose(mine.name)[0], grip, atol=1e-6)
                assert env.world.state.robots[mine.name].joints == mine.arm.carry
                held += 1
        assert held and infos[mine.name]["success"]
        ends.append(env.world.state)
        env.close()
    assert ends[0] == ends[1]


def test_plays_beside_others_and_both_renderers_agree(robot: Path) -> None:
    team = ("humanoid", "drone", robot)
    envs = [chmarl_pb.parallel_env(robots=team, split=SPLIT, renderer=renderer) for renderer in ("fast", "tiny")]
    rng = np.random.default_rng(4)
    for env in envs:
        env.reset(seed=7)
    for _ in range(3):
        actions = {name: int(rng.integers(envs[0].action_space(name).n)) for name in envs[0].agents}
        for env in envs:
            env.step(actions)
        for name, part in product(envs[0].possible_agents, ("colour", "depth", "segmentation")):
            fast, tiny = (getattr(env.simulation.renderer.picture(name, 48), part) for env in envs)
            np.testing.assert_array_equal(fast, tiny)
    assert chmarl_pb.rollout(envs[0], chmarl_pb.make_policy("planner", envs[0]), seed=1).success
    for env in envs:
        env.close()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"turn", ', '"spin", ', r"\[arm\] joints names 'spin', which the URDF has not; its joints are lift, turn"),
        ('"turn", ', "", r"\[arm\] joints = lift, lower.*no chain to the hand; .*: lift, turn, lower, bend, tilt"),
        ('"lift", "turn"', '"turn", "lift"', "no chain to the hand"),
        ('"grip"]', '"wheel"]', "joints names 'wheel', which is neither on the way to the hand nor a finger"),
        ('joints = ["lift"', 'joints = [3, "lift"', "is not a list of names"),
        ("rest = [0.1, 0.0, ", "rest = [0.1, ", r"\[arm\] rest has 5 numbers; give 6, one for each of lift, turn"),
        ("1.8, 0.8", "1.8, 3.8", r"\[arm\] carry has 3.8 for tilt, which goes from -2 to 2"),
        ('"claw"', '"hand"', r"\[arm\] hand no link is named 'hand'; the links are base, post"),
        ('"claw"', '"base"', r"\[arm\] hand no joint moves the link 'base'"),
        ("grasp =", "speeds = [1, 1]\ngrasp =", r"\[arm\] speeds has 2 numbers; give 6"),
        ("grasp =", "open = [1.0]\ngrasp =", r"\[arm\] open has 1 for grip, which goes from 0 to 0.04"),
        ("grasp =", "distance = [0.4, 0.9]\ngrasp =", r"\[arm\] distance has no meaning for an arm that names its"),
        ("[arm]", "[footprint]\nradius = 1.0\n[arm]", r"\[arm\] reaches nothing"),
    ],
)  # fmt: skip
def test_wrong_arms_are_refused_with_the_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in CRANE_FILE
    path = crane(tmp_path, CRANE_FILE.replace(old, new, 1))
    with pytest.raises(AssetError, match=message) as caught:
        find_model(path)
    assert str(path.resolve()) in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="continuous"', 'type="floating"', "joint 'turn' is of the type 'floating'; use one of: fixed, revolute"),
        ('joint name="turn"', 'joint name="lift"', "two joints are named 'lift'; rename one"),
        ('<parent link="post"/>', '<parent link="nobody"/>', "joint 'turn' names the link 'nobody', which is not"),
        ('<parent link="post"/>', '<parent link="claw"/>', "go in a circle; a robot is a tree"),
        ('upper="0.5"', 'upper="0.0"', "joint 'lift' has no range to move in; write <limit"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 up 1"/>', "joint 'lift': xyz='0 up 1' is not three numbers"),
        ("<robot", "<!DOCTYPE robot><robot", "document types and entities are refused"),
    ],
)  # fmt: skip
def test_wrong_urdfs_are_refused_with_the_place(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = crane(tmp_path)
    urdf = path.with_suffix(".urdf")
    urdf.write_text(urdf.read_text().replace(old, new, 1))
    with pytest.raises(AssetError, match=message) as caught:
        find_model(path)
    assert str(urdf.resolve()) in str(caught.value)


def test_a_changed_urdf_is_read_anew(tmp_path: Path) -> None:
    path = crane(tmp_path)
    before = find_model(path)
    assert find_model(path) is before
    urdf = path.with_suffix(".urdf")
    urdf.write_text(urdf.read_text().replace("0 0 0.45", "0 0 0.4"))
    after = find_model(path)
    assert before.reach and after.reach and after.reach.distance[1] < before.reach.distance[1]


def test_a_broken_mesh_is_refused(tmp_path: Path) -> None:
    path = crane(tmp_path)
    urdf = path.with_suffix(".urdf")
    (tmp_path / "claw.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    box = '<visual><geometry><box size="0.02 0.01 0.06"/>'
    urdf.write_text(urdf.read_text().replace(box, '<visual><geometry><mesh filename="claw.obj"/>'))
    with pytest.raises(AssetError, match=r"crane\.urdf: link 'finger': visual 1: mesh 'claw.obj': a face names"):
        chmarl_pb.parallel_env(robots=(path,), split=SPLIT)


def test_a_hand_without_a_grasp_point_points_anywhere(tmp_path: Path) -> None:
    path = crane(tmp_path)
    chain = chain_to(Tree(path.with_suffix(".urdf")), "claw", (0, 0, 0))
    assert not chain.pointing.any()
    bare = find_model(crane(tmp_path, CRANE_FILE.replace("grasp = [0.0, 0.0, 0.12]\n", "")))
    assert bare.reach is not None and bare.arm is not None
    assert len(bare.arm.space.solve(np.array((0.6, 0.0, 0.8))))
