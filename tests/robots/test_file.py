"""Robot files: what they may say, and how they are refused."""

import shutil
from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb.errors import AssetError
from chmarl_pb.navigation.lattice import FOOTPRINT
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.plain_robot import FOLDER, plain_robot

GOOD = """
urdf = "drone.urdf"
moves = "drives"
[camera]
fov = 60
position = [0, 0, 1]
"""


def written(folder: Path, text: str, name: str = "mine.toml") -> Path:
    for file in ("drone.urdf", "humanoid.urdf"):
        shutil.copy(FOLDER / file, folder)
    shutil.copytree(FOLDER / "meshes", folder / "meshes", dirs_exist_ok=True)
    (folder / name).write_text(text)
    return folder / name


def test_the_packages_own_robots() -> None:
    humanoid, drone = find_model("humanoid"), find_model("drone")
    assert (humanoid.reach, humanoid.footprint, humanoid.flies) == (REACH, FOOTPRINT, False)
    assert (drone.reach, drone.altitude, drone.flies) == (None, 3.5, True)


def test_defaults_and_identity(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD)
    model = find_model(path)
    assert (model.name, model.class_name, model.footprint, model.reach) == ("mine", "humanoid", FOOTPRINT, None)
    assert find_model(str(path)) is model, "what is kept of a model serves all who name its file"
    path.write_text(GOOD.replace("60", "70"))
    assert find_model(path).camera.fov == 70


def test_other_meshes_make_another_model(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD.replace("drone.urdf", "humanoid.urdf"))
    model = find_model(path)
    meshes = [*(tmp_path / "meshes").glob("*.obj")]
    for mesh in meshes:
        mesh.write_text(f"{mesh.read_text()}\n# changed\n")
    assert meshes and find_model(path) is not model


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("urdf = 3", "not a text|missing"),
        ("urdf = [", "not TOML"),
        (GOOD.replace('moves = "drives"', 'moves = "rolls"'), "moves = 'rolls'; use one of: drives, flies"),
        (GOOD.replace("drone.urdf", "no.urdf"), "no.urdf.*no such file beside"),
        (GOOD.replace("fov = 60", "fov = 600"), r"\[camera\] fov = 600 is not a number from 10 to 150"),
        (GOOD.replace("fov = 60", "fov = true"), r"\[camera\] fov = True is not a number"),
        (GOOD.replace("[0, 0, 1]", "[0, 0]"), r"\[camera\] position = \[0, 0\] is not 3 numbers"),
        (GOOD.replace("fov", "fow"), r"\[camera\] fov is missing"),
        (GOOD + "zoom = 2\n", r"\[camera\] zoom has no meaning; use some of: fov, pitch, position"),
        ("altitude = 3\n" + GOOD, "altitude has no meaning for a robot that drives"),
        ('class = "mug"\n' + GOOD, "class = 'mug'; use one of: humanoid, drone"),
        (GOOD + "[footprint]\nlow = 0.4\nhigh = 0.3\n", "low = 0.4 is not below"),
        (GOOD + "[arm]\ndistance = [0.9, 0.4]\nheight = [0.2, 1.0]\n", "the lesser number first"),
        (GOOD + "[arm]\n", r"\[arm\] names neither the joints .* nor the distance"),
        (GOOD + "[arm]\nbearing = 30\n", r"\[arm\] names neither the joints .* nor the distance"),
        ("footprint = 3\n" + GOOD, "footprint = 3 is not a table"),
    ],
)
def test_wrong_files_are_refused_with_the_place(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(AssetError, match=message) as caught:
        find_model(path)
    assert str(path.resolve()) in str(caught.value)


def test_other_refusals(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="no robot 'walker'; use one of: drone, humanoid"):
        chmarl_pb.parallel_env(robots=("humanoid", "walker"))
    with pytest.raises(AssetError, match="does not exist"):
        find_model(tmp_path / "nothing.toml")
    with pytest.raises(AssetError, match="no digit at its end"):
        find_model(written(tmp_path, GOOD, "robot2.toml"))
    with pytest.raises(AssetError, match=r"an arm needs the joints .*missing: "):
        reach = "[arm]\ndistance = [0.4, 0.9]\nheight = [0.2, 1.0]\n"
        chmarl_pb.parallel_env(robots=(written(tmp_path, GOOD + reach),))
    (tmp_path / "broken.urdf").write_text("<robot>")
    with pytest.raises(AssetError, match=r"broken\.urdf: not XML"):
        chmarl_pb.parallel_env(robots=("humanoid", written(tmp_path, GOOD.replace("drone.urdf", "broken.urdf"))))


def test_an_empty_footprint_is_the_usual_one(tmp_path: Path) -> None:
    assert find_model(written(tmp_path, GOOD + "[footprint]\n")).footprint == FOOTPRINT


BOX = '<visual><geometry><box size="0.3 0.3 0.3"/></geometry></visual>'
BODY = f'<link name="body">{BOX}</link>'


def seen(geometry: str, more: str = "") -> str:
    return f'<link name="body"><visual>{more}<geometry>{geometry}</geometry></visual></link>'


def joint(kind: str, more: str = "", name: str = "neck", parent: str = "body", child: str = "head") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


HEAD = f'{BODY}<link name="head">{BOX}</link>'


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (seen('<box size="-1 1 1"/>'), "link 'body': visual 1: <box size='-1 1 1'> is not above 0"),
        (seen('<box size="nan 1 1"/>'), "link 'body': visual 1: <box size='nan 1 1'> is not 3 finite numbers"),
        (seen('<box size="1e30 1 1"/>'), "link 'body': visual 1: it reaches farther than 1,000 m"),
        (seen('<sphere radius="0"/>'), "<sphere radius='0'> is not above 0"),
        (seen('<cylinder radius="0.1" length="x"/>'), "<cylinder length='x'> is not 1 finite numbers"),
        (seen('<box size="1 1 1"/>', '<origin xyz="0 0 1e9"/>'), "reaches farther than 1,000 m"),
        (seen('<mesh filename="package://a/b.stl"/>'), "leaves the robot's folder"),
        (seen('<mesh filename="flat.obj" scale="1 1 0"/>'), "scale='1 1 0'> leaves nothing of the mesh"),
        (seen('<capsule radius="1" length="1"/>'), "has one of box, cylinder, mesh, sphere"),
        ("", "it has no links"),
        (HEAD, r"links \['body', 'head'\] have no parent"),
        (HEAD + joint("fixed") + joint("fixed", name="back", parent="head", child="body"), "is its own ancestor"),
        (HEAD + joint("fixed") + joint("fixed"), "stands twice"),
        (HEAD + joint("bends"), "joint 'neck' is 'bends'; use one of: fixed, revolute"),
        (HEAD + joint("revolute"), "joint 'neck': has no <limit>; write <limit"),
        (HEAD + joint("continuous", '<axis xyz="1 2"/>'), "joint 'neck': <axis xyz='1 2'> is not 3 finite numbers"),
        (HEAD + joint("fixed", '<origin xyz="0 0 nan"/>'), "<origin xyz='0 0 nan'> is not 3 finite numbers"),
        (HEAD + joint("fixed", child="tail"), "names the link 'tail', which does not exist"),
        (f'<link name="body"><inertial/>{BOX}</link>', "its <inertial> has no <mass>"),
        (seen('<box size="1 1 1"/>', "<material/>"), "the <material> of a box has no name"),
    ],
)
def test_broken_urdfs_are_refused_as_homes_are_before_pybullet_is_asked(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], parts: str, message: str
) -> None:
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "own.urdf").write_text(f'<robot name="own">\n{parts}\n</robot>'.replace("><", ">\n<"))
    with pytest.raises(AssetError, match=message) as caught:
        plain_robot(tmp_path / "own.urdf")
    assert str(tmp_path / "own.urdf") in str(caught.value) and "home" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_something_else_than_a_urdf(tmp_path: Path) -> None:
    (tmp_path / "own.urdf").write_text("<a/>")
    with pytest.raises(AssetError, match="the root element is <a>, a URDF has <robot>"):
        plain_robot(tmp_path / "own.urdf")


def test_what_other_simulators_read_of_a_urdf_does_not_matter(tmp_path: Path) -> None:
    gazebo = "<gazebo><mass>1</mass><visual><geometry><box><size>-1 1 1</size></box></geometry></visual></gazebo>"
    path = written(tmp_path, GOOD.replace("drone.urdf", "own.urdf"))
    (tmp_path / "own.urdf").write_text(f'<robot name="own">\n{HEAD}\n{joint("continuous")}\n{gazebo}</robot>')
    chmarl_pb.parallel_env(robots=("humanoid", path)).close()


def test_an_arm_that_reaches_less_far_takes_other_poses(tmp_path: Path) -> None:
    text = (FOLDER / "humanoid.toml").read_text().replace("0.92", "0.6")
    env = chmarl_pb.parallel_env(robots=(written(tmp_path, text, "short.toml"), "drone"), split="val-unseen")
    reached = 0
    for seed in range(6):
        env.reset(seed=seed)
        robot, grip = env.simulation.oracle.robot, env.world.grip(env.setting.goal.item)
        stand = robot.stand(env.setting.goal.item)
        if stand is not None:
            x, y, _ = robot.lattice.pose(stand)
            assert (grip[0] - x) ** 2 + (grip[1] - y) ** 2 <= 0.6**2 + 1e-9
            reached += 1
    assert reached
    env.close()
