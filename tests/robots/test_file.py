"""Robot files: what they may say, and how they are refused."""

import shutil
from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb.errors import AssetError
from chmarl_pb.navigation.lattice import FOOTPRINT
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.robots.file import FOLDER, find_model

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
