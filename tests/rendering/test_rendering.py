"""The fast renderer gives the pictures of plain TinyRenderer, bit by bit."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pybullet
import pytest

from chmarl_pb import catalog
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import AssetError
from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.rendering.fast import FastRenderer
from chmarl_pb.rendering.meshes import _read_obj
from chmarl_pb.rendering.registry import RENDERERS
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS, Renderer
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.task import Task
from tests.helpers.playing import play
from tests.helpers.small_homes import SMALL_HOME, home_text

ROBOTS = ("humanoid", "drone")
CYLINDER = """<link name="livingroom/tv_stand_1">
  <inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>
  <visual><geometry><cylinder radius="0.3" length="0.4"/></geometry></visual>
  <collision><geometry><cylinder radius="0.3" length="0.4"/></geometry></collision>
</link>
<joint name="pedestal" type="fixed"><parent link="world"/><child link="livingroom/tv_stand_1"/>
  <origin xyz="1.5 0.5 0.2" rpy="0 0 0.3"/></joint>"""


def assert_same(simulation: Simulation, robot: str, size: int) -> None:
    """Both renderers give the same, bit by bit."""
    plain, fast = plain_of(simulation).picture(robot, size), simulation.renderer.picture(robot, size)
    np.testing.assert_array_equal(fast.segmentation, plain.segmentation)
    np.testing.assert_array_equal(fast.depth, plain.depth)
    np.testing.assert_array_equal(fast.rgb, plain.rgb)
    np.testing.assert_array_equal(simulation.renderer.image(robot, size), plain.rgb)


def plain_of(simulation: Simulation) -> Renderer:
    """The readable renderer of the same world."""
    return RENDERERS["tiny"](simulation.world, simulation.models)


def begin(simulation: Simulation, tasks: list[Task], number: int = 0) -> Task:
    task = [task for task in tasks if task.home == simulation.home.name][number]
    simulation.begin(task)
    return task


def wander(simulation: Simulation, rng: np.random.Generator) -> None:
    """Put both robots anywhere."""
    simulation.oracle.robot.spawn(int(rng.integers(len(simulation.space.lattice.moves))))
    simulation.robots["drone"].spawn(int(rng.integers(len(simulation.space.drone_lattice.points))))


def meet(simulation: Simulation, rng: np.random.Generator) -> None:
    """Put the humanoid anywhere and the drone above it."""
    wander(simulation, rng)
    x, y, _ = simulation.space.lattice.pose(simulation.oracle.robot.pose)
    simulation.robots["drone"].spawn(int(np.hypot(*(simulation.space.drone_lattice.points - (x, y)).T).argmin()))


def take(simulation: Simulation, item: str) -> None:
    """Let the humanoid hold an object where it stands."""
    simulation.oracle.robot.hold(item, 0.5)


@pytest.mark.parametrize("size", [64, 128, 224])
def test_random_views(simulation: Simulation, tasks: list[Task], size: int) -> None:
    rng = np.random.default_rng(size)
    for number in range(2):
        begin(simulation, tasks, number)
        for _ in range(4 if size < 200 else 2):
            wander(simulation, rng)
            for robot in ROBOTS:
                assert_same(simulation, robot, size)


@pytest.mark.parametrize("size", [64, 128, 224])
def test_views_with_a_held_object_and_the_other_robot(simulation: Simulation, tasks: list[Task], size: int) -> None:
    rng = np.random.default_rng(size)
    task = begin(simulation, tasks)
    take(simulation, task.item)
    met = 0
    for _ in range(4 if size < 200 else 2):
        meet(simulation, rng)
        met += "humanoid" in simulation.renderer.visible("drone")
        for robot in ROBOTS:
            assert_same(simulation, robot, size)
    assert met


def test_the_world_after_a_release_is_drawn_with_the_arm_at_rest(simulation: Simulation, tasks: list[Task]) -> None:
    task, rng = begin(simulation, tasks), np.random.default_rng(3)
    take(simulation, task.item)
    simulation.renderer.visible("drone")
    begin(simulation, tasks, 1)
    meet(simulation, rng)
    assert_same(simulation, "drone", 128)


def test_every_object_large_in_the_picture(simulation: Simulation, tasks: list[Task]) -> None:
    """Objects near the camera, at the rim of its view too: none is left out."""
    begin(simulation, tasks)
    rng = np.random.default_rng(4)
    for item in rng.permutation(simulation.world.objects)[:8].tolist():
        stand = simulation.space.stand(simulation.world.grip(item))
        if stand is None:
            continue
        for turn in range(-2, 3):
            simulation.oracle.robot.spawn(stand // HEADINGS * HEADINGS + (stand + turn) % HEADINGS)
            assert_same(simulation, "humanoid", 64)


def test_visible_is_the_pixel_rule_of_the_full_picture(simulation: Simulation, tasks: list[Task]) -> None:
    rng = np.random.default_rng(5)
    begin(simulation, tasks, 2)
    for _ in range(10):
        meet(simulation, rng)
        for robot in ROBOTS:
            assert simulation.renderer.visible(robot) == plain_of(simulation).visible(robot)


def test_counted_pixels_are_those_of_the_picture(simulation: Simulation, tasks: list[Task]) -> None:
    rng = np.random.default_rng(6)
    renderer = simulation.renderer
    assert isinstance(renderer, FastRenderer)
    begin(simulation, tasks)
    for _ in range(10):
        meet(simulation, rng)
        for robot in ROBOTS:
            segmentation = renderer.picture(robot, VISIBILITY_SIZE).segmentation
            counts = np.bincount(segmentation.ravel() + 1, minlength=len(renderer.names) + 1)[1:]
            np.testing.assert_array_equal(renderer.pixels(robot), counts)


def test_visible_is_what_the_counts_of_all_pixels_say(simulation: Simulation, tasks: list[Task]) -> None:
    """Most bodies are not drawn to the end to find out whether they are visible."""
    rng, renderer = np.random.default_rng(9), simulation.renderer
    assert isinstance(renderer, FastRenderer)
    for number in range(3):
        begin(simulation, tasks, number)
        for step in range(40):
            if step == 20:
                item = simulation.world.objects[number]
                simulation.oracle.robot.spawn(simulation.space.stand(simulation.world.grip(item)) or 0)
                simulation.oracle.robot.hold(item)
            (meet if step % 2 else wander)(simulation, rng)
            for robot in ROBOTS:
                counts = dict(zip(renderer.names, renderer.pixels(robot).tolist(), strict=True))
                enough = [name for name in renderer.names if counts[name] >= VISIBLE_PIXELS and name != robot]
                known = [name for name in enough if catalog.class_of(name) in catalog.BENCHMARK.classes]
                assert renderer.visible(robot) == tuple(known)


def test_sight_follows_an_object_that_moved(simulation: Simulation, tasks: list[Task]) -> None:
    """Nothing of a kept picture survives a change of the world at the same camera pose."""
    begin(simulation, tasks)
    item = simulation.world.objects[0]
    simulation.oracle.robot.spawn(simulation.space.stand(simulation.world.grip(item)) or 0)
    assert_same(simulation, "humanoid", 128)
    (x, y, z), quaternion = simulation.world.pose(item)
    simulation.world.place(item, (x + 0.05, y, z + 0.1), quaternion, simulation.world.supports[item].receptacle)
    assert_same(simulation, "humanoid", 128)
    simulation.world.clear()
    assert_same(simulation, "humanoid", 128)


def test_eyes_are_the_cameras_of_the_models(simulation: Simulation, tasks: list[Task]) -> None:
    begin(simulation, tasks)
    rng = np.random.default_rng(7)
    for _ in range(5):
        wander(simulation, rng)
        simulation.world.sync()
        client = simulation.world.client
        for name, robot in simulation.world.robots.items():
            body = simulation.world.bodies[name]
            joints = range(pybullet.getNumJoints(body, physicsClientId=client))
            links = {pybullet.getJointInfo(body, j, physicsClientId=client)[12].decode(): j for j in joints}
            state = pybullet.getLinkState(body, links["camera"], 1, 1, physicsClientId=client)
            position, quaternion = simulation.models[name].eye(simulation.space, robot.pose)
            np.testing.assert_allclose(position, state[4], atol=1e-5)
            assert abs(np.dot(quaternion, state[5])) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("extra", ["", CYLINDER], ids=["boxes", "cylinder"])
def test_a_home_of_any_shapes_is_drawn_as_tinyrenderer_draws_it(write_home: Callable[[str], Path], extra: str) -> None:
    """Boxes and meshes are drawn by our rasteriser, other shapes by TinyRenderer itself."""
    simulation = Simulation(str(write_home(home_text(extra=extra))))
    rng = np.random.default_rng(8)
    for _ in range(5):
        wander(simulation, rng)
        for robot in ROBOTS:
            assert_same(simulation, robot, 64)
    simulation.close()


def test_a_home_of_more_links_than_pybullet_tells_of_is_drawn_by_tinyrenderer(
    write_home: Callable[[str], Path],
) -> None:
    posts = {f"livingroom/wall_{n}": ((0.02, 0.2, 0.1), (-1.6 + 0.02 * n, 0.5, 0.05)) for n in range(140)}
    simulation = Simulation(str(write_home(home_text({**SMALL_HOME, **posts}))))
    wander(simulation, np.random.default_rng(10))
    # Colours only: PyBullet's segmentation numbers no more than 127 links.
    np.testing.assert_array_equal(simulation.renderer.image("drone", 128), plain_of(simulation).image("drone", 128))
    simulation.close()


@pytest.mark.parametrize("size", [32, 128, 224])
def test_a_picture_is_the_callers_own_and_drawn_again_when_what_it_shows_has_moved(
    simulation: Simulation, tasks: list[Task], size: int
) -> None:
    """Pictures of the present objects are kept."""
    rng = np.random.default_rng(size)
    begin(simulation, tasks)
    meet(simulation, rng)
    humanoid, drone = simulation.oracle.robot, simulation.robots["drone"]
    stand, above, far = humanoid.pose, drone.pose, (drone.pose + drone.lattice.count // 2) % drone.lattice.count
    shown = []
    for number, pose in enumerate((above, far, above, above)):
        if number == 3:
            begin(simulation, tasks, 1)
        humanoid.spawn(stand)
        drone.spawn(pose)
        for robot in ROBOTS:
            for _ in range(2):
                image = simulation.renderer.image(robot, size)
                np.testing.assert_array_equal(image, plain_of(simulation).image(robot, size))
                shown.append(image.copy())
                image[:] = rng.integers(256)
    assert not np.array_equal(shown[2], shown[6])


def test_episodes_are_the_same_with_both_renderers() -> None:
    ends = []
    for renderer in RENDERERS:
        env = HouseholdEnv("visual", split="val-unseen", image_size=32, renderer=renderer)
        ends.append(play(env, 5, steps=6))
        env.close()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("execution", ["instant", "simulated"])
def test_observed_pictures_are_full_pictures_in_both_executions(execution: str) -> None:
    env = HouseholdEnv("visual", split="val-unseen", execution=execution, image_size=64)
    observations, _ = env.reset(options={"task": "val-unseen-004"})
    plan, rng = env.simulation.oracle.plan(env.setting.goal), np.random.default_rng(9)
    for action in plan:
        for robot in ROBOTS:
            np.testing.assert_array_equal(observations[robot]["image"], plain_of(env.simulation).image(robot, 64))
        drone = int(rng.integers(len(env.action_names["drone"])))
        observations, *_ = env.step({"humanoid": env.action_names["humanoid"].index(action), "drone": drone})
    assert env.outcome.success
    env.close()


@pytest.mark.parametrize(
    "text",
    [
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 9//1\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -1//1 -2//1 -3//1\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nf 1//1 2//1 3//1\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0 0 1\nf 1//1 2//1 4//1 3//1\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v zero 0 0\n",
    ],
    ids=["materials", "range", "relative", "normal", "polygon", "flat", "word"],
)
def test_meshes_beyond_our_rasteriser_are_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mesh.obj"
    path.write_text(text)
    with pytest.raises(AssetError, match=r"mesh\.obj"):
        _read_obj(path)
