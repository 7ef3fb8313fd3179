"""The humanoid's arm reaches what ``REACH`` promises; both robots' URDFs are sound."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet as p
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from chmarl_pb.robots import arm as arm_module
from chmarl_pb.robots.arm import JOINTS, REACH, Arm, Configuration
from chmarl_pb.robots.file import find_model
from chmarl_pb.world import Pose
from tests.helpers.elements import inner
from tests.helpers.small_homes import Triple
from tools.assets.robots import OUT, build

inside = st.tuples(st.floats(*REACH.distance), st.floats(*REACH.height), st.floats(-REACH.bearing, REACH.bearing))
anywhere = st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-np.pi, np.pi))


@pytest.fixture(scope="module")
def client() -> Iterator[int]:
    client = p.connect(p.DIRECT)
    yield client
    p.disconnect(client)


@pytest.fixture(scope="module")
def arm(client: int) -> Arm:
    model = find_model("humanoid")
    return Arm(client, model.load(client), model.urdf)


def move_base(arm: Arm, x: float, y: float, yaw: float) -> None:
    quaternion = p.getQuaternionFromEuler((0, 0, yaw))
    p.resetBasePositionAndOrientation(arm.body, (x, y, 0), quaternion, physicsClientId=arm.client)


def target_of(base: Triple, distance: float, height: float, bearing: float) -> np.ndarray:
    x, y, yaw = base
    return np.array([x + distance * np.cos(yaw + bearing), y + distance * np.sin(yaw + bearing), height])


def link_frame(arm: Arm, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return position and rotation matrix of a link's URDF frame in the world."""
    count = p.getNumJoints(arm.body, physicsClientId=arm.client)
    names = [p.getJointInfo(arm.body, i, physicsClientId=arm.client)[12].decode() for i in range(count)]
    state = p.getLinkState(arm.body, names.index(name), computeForwardKinematics=True, physicsClientId=arm.client)
    return np.array(state[4]), np.reshape(p.getMatrixFromQuaternion(state[5]), (3, 3))


def own_pixels(arm: Arm) -> float:
    """Return the part of the camera's picture that the own body fills."""
    eye, turn = link_frame(arm, "camera")
    view = p.computeViewMatrix(eye, eye + turn[:, 0], turn[:, 2])
    projection = p.computeProjectionMatrixFOV(90, 1, 0.02, 20)
    options = {"renderer": p.ER_TINY_RENDERER, "shadow": 0, "physicsClientId": arm.client}
    mask = p.getCameraImage(128, 128, view, projection, **options)[4]
    return float(np.mean(np.asarray(mask) == arm.body))


def grasp_pose(arm: Arm) -> Pose:
    """The point between the fingertips."""
    state = p.getLinkState(arm.body, arm.grasp_link, computeForwardKinematics=True, physicsClientId=arm.client)
    return state[4], state[5]


def solve(arm: Arm, target: ArrayLike) -> Configuration | None:
    """Solve from where the base is now."""
    return arm.solve(target, p.getBasePositionAndOrientation(arm.body, physicsClientId=arm.client))


def within_limits(arm: Arm, configuration: tuple[float, ...]) -> bool:
    return bool(np.all(arm.lower <= configuration) and np.all(configuration <= arm.upper))


@given(place=inside, base=anywhere)
@settings(max_examples=200, derandomize=True)
def test_reaches_all_that_reach_promises(arm: Arm, place: Triple, base: Triple) -> None:
    target = target_of(base, *place)
    move_base(arm, *base)
    configuration = solve(arm, target)
    assert configuration is not None
    assert within_limits(arm, configuration)
    arm.set(configuration)
    position, quaternion = grasp_pose(arm)
    assert np.linalg.norm(position - target) < 0.005
    down = np.degrees(np.arcsin(-np.reshape(p.getMatrixFromQuaternion(quaternion), (3, 3))[2, 0]))
    assert -1 <= down <= 91


@pytest.mark.parametrize("distance", REACH.distance)
@pytest.mark.parametrize("height", REACH.height)
@pytest.mark.parametrize("bearing", [-REACH.bearing, REACH.bearing])
def test_reaches_the_corners(arm: Arm, distance: float, height: float, bearing: float) -> None:
    move_base(arm, 0, 0, 0)
    assert solve(arm, target_of((0, 0, 0), distance, height, bearing)) is not None


@pytest.mark.parametrize("target", [(1.6, 0, 0.9), (0.6, 0, 2.6), (-0.9, 0.4, 0.6), (0, 0, 0.9), (0.1, 0, 0.1)])
def test_gives_up_out_of_reach(arm: Arm, target: Triple) -> None:
    move_base(arm, 0, 0, 0)
    assert solve(arm, target) is None


@given(place=inside, other=inside, base=anywhere)
@settings(max_examples=30, derandomize=True)
def test_depends_on_base_and_target_alone(arm: Arm, place: Triple, other: Triple, base: Triple) -> None:
    target = target_of(base, *place)
    move_base(arm, *base)
    arm.set(arm.rest)
    first = solve(arm, target)
    assert arm.configuration() == arm.rest
    solve(arm, target_of(base, *other))
    arm.set(arm.carry)
    assert solve(arm, target) == first
    at = p.getBasePositionAndOrientation(arm.body, physicsClientId=arm.client)
    move_base(arm, 0, 0, 0)  # where it is loaded, and measured
    assert Arm(arm.client, arm.body, Path()).solve(target, at) == first
    assert arm.configuration() == arm.carry


def test_contains_is_vectorised() -> None:
    turn = 2 * np.pi
    distance, height = np.array([0.6, 0.39, 0.93, 0.6]), np.array([0.9, 0.9, 0.9, 1.6])
    assert REACH.contains(distance, height, 0.1).tolist() == [True, False, False, False]
    assert REACH.contains(0.6, 0.9, np.radians([19, -19, 21, 180]) + turn).tolist() == [True, True, False, False]


def test_fixed_poses(arm: Arm) -> None:
    move_base(arm, 0, 0, 0)
    for pose in (arm.rest, arm.carry):
        assert len(pose) == len(JOINTS) and within_limits(arm, pose)
    arm.set(arm.carry)
    assert np.allclose(grasp_pose(arm)[0], (0.45, -0.12, 1.0), atol=0.01)
    assert own_pixels(arm) < 0.10
    arm.set(arm.rest)
    assert own_pixels(arm) < 0.03


def test_camera(arm: Arm) -> None:
    move_base(arm, 0, 0, 0)
    arm.set(arm.rest)
    eye, turn = link_frame(arm, "camera")
    assert np.allclose(eye, (0.12, 0, 1.5), atol=1e-6)
    assert np.degrees(np.arcsin(-turn[2, 0])) == pytest.approx(20, abs=1e-3)
    assert turn[1, 0] == pytest.approx(0, abs=1e-6)


def test_motors_follow_a_motion_with_a_load(arm: Arm) -> None:
    move_base(arm, 0, 0, 0)
    p.setGravity(0, 0, -9.81, physicsClientId=arm.client)
    start = solve(arm, (0.8, 0.1, 0.5))
    assert start is not None
    arm.set(start)
    position, quaternion = grasp_pose(arm)
    load = p.createMultiBody(0.5, basePosition=position, baseOrientation=quaternion, physicsClientId=arm.client)
    parts = (arm.body, arm.grasp_link, load, -1, p.JOINT_FIXED, (0, 0, 0), (0, 0, 0), (0, 0, 0))
    p.createConstraint(*parts, physicsClientId=arm.client)
    p.changeDynamics(load, -1, localInertiaDiagonal=(3e-4, 3e-4, 3e-4), physicsClientId=arm.client)
    lag = []
    for part in np.minimum(np.linspace(0, 1.2, 600), 1):
        arm.drive(tuple(np.array(start) + part * (np.array(arm.carry) - start)))
        p.stepSimulation(physicsClientId=arm.client)
        carried = p.getBasePositionAndOrientation(load, physicsClientId=arm.client)[0]
        lag.append(np.linalg.norm(np.subtract(grasp_pose(arm)[0], carried)))
    p.removeBody(load, physicsClientId=arm.client)
    assert max(lag) < 0.005
    assert np.allclose(arm.configuration(), arm.carry, atol=0.03)


@pytest.mark.parametrize("name", ["humanoid", "drone"])
def test_inertias_are_physical(name: str) -> None:
    for inertial in ET.parse(OUT / f"{name}.urdf").iter("inertial"):
        moments = {key: float(value) for key, value in inner(inertial, "inertia").attrib.items()}
        xx, xy, xz, yy, yz, zz = (moments[key] for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
        principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert principal[0] > 0
        assert principal[0] + principal[1] >= principal[2] * (1 - 1e-6)
        assert float(inner(inertial, "mass").attrib["value"]) > 0


@pytest.mark.parametrize(("name", "budget"), [("humanoid", 480), ("drone", 260)])
def test_triangle_budget(name: str, budget: int) -> None:
    meshes = (OUT / mesh.attrib["filename"] for mesh in ET.parse(OUT / f"{name}.urdf").iter("mesh"))
    assert sum(line.startswith("f ") for mesh in meshes for line in mesh.read_text().splitlines()) <= budget


def test_drone_camera_looks_down(client: int) -> None:
    body = p.loadURDF(str(OUT / "drone.urdf"), useFixedBase=True, physicsClientId=client)
    state = p.getLinkState(body, 0, computeForwardKinematics=True, physicsClientId=client)
    turn = np.reshape(p.getMatrixFromQuaternion(state[5]), (3, 3))
    assert np.allclose(turn[:, 0], (0, 0, -1), atol=1e-5)
    assert np.allclose(turn[:, 2], (1, 0, 0), atol=1e-5)
    low, high = np.array(p.getAABB(body, -1, physicsClientId=client))
    assert state[4][2] <= low[2] + 0.01
    assert 0.4 < high[0] - low[0] < 0.6
    p.removeBody(body, physicsClientId=client)


def test_build_reproduces_the_committed_files(tmp_path: Path) -> None:
    build(tmp_path)
    built = {file.relative_to(tmp_path): file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    committed = [file for file in OUT.rglob("*") if file.suffix in (".urdf", ".obj")]
    assert built == {file.relative_to(OUT): file.read_bytes() for file in committed}


@settings(max_examples=30)
@given(base=anywhere, target=inside)
def test_solving_as_far_as_needed_finds_the_best_of_all_choices(
    arm: Arm, base: tuple[float, float, float], target: tuple[float, float, float]
) -> None:
    move_base(arm, *base)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arm_module, "_FLOORS", np.full(len(arm_module._CHOICES), -1.0))
        best_of_all = solve(arm, target_of(base, *target))
    assert solve(arm, target_of(base, *target)) == best_of_all
