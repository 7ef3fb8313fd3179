"""Robots with arms of their own."""

import importlib.util
from pathlib import Path

ROVER = Path(__file__).parents[2] / "examples" / "own_robot.py"

#: A lift, four joints that turn, a finger and a wheel, made of boxes.
CRANE = """<robot name="crane">
  <link name="base">
    <inertial><origin xyz="0 0 0.1"/><mass value="20"/>
     <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><origin xyz="0 0 0.15"/><geometry><box size="0.36 0.3 0.3"/></geometry></visual>
    <visual><origin xyz="0.1 0 0.02"/><geometry><cylinder radius="0.1" length="0.04"/></geometry></visual>
    <collision><origin xyz="0 0 0.15"/><geometry><box size="0.36 0.3 0.3"/></geometry></collision>
  </link>
  {joints}
</robot>
"""
JOINTS = (
    # name, kind, parent, child, place, axis, lower, upper, box of the child
    ("lift", "prismatic", "base", "post", "0.05 0 0.3", "0 0 1", 0.0, 0.5, "0.06 0.06 0.1"),
    ("turn", "continuous", "post", "shoulder", "0 0 0.1", "0 0 1", 0.0, 0.0, "0.06 0.06 0.06"),
    ("lower", "revolute", "shoulder", "upper_arm", "0 0 0.05", "0 1 0", -1.5, 2.0, "0.05 0.05 0.05"),
    ("bend", "revolute", "upper_arm", "fore_arm", "0 0 0.45", "0 1 0", -2.6, 2.6, "0.05 0.05 0.05"),
    ("tilt", "revolute", "fore_arm", "claw", "0 0 0.45", "0 1 0", -2.0, 2.0, "0.05 0.05 0.05"),
    ("grip", "prismatic", "claw", "finger", "0 0.05 0.05", "0 1 0", 0.0, 0.04, "0.02 0.01 0.06"),
    ("wheel", "continuous", "base", "wheel", "-0.1 0 0.05", "0 1 0", 0.0, 0.0, "0.05 0.03 0.05"),
)
CRANE_FILE = """
urdf = "crane.urdf"
moves = "drives"
[camera]
fov = 90
position = [0.1, 0.15, 1.4]
pitch = 25
[arm]
joints = ["lift", "turn", "lower", "bend", "tilt", "grip"]
hand = "claw"
grasp = [0.0, 0.0, 0.12]
rest = [0.1, 0.0, -0.4, 2.2, 1.0, 0.0]
carry = [0.2, 0.0, 0.0, 1.8, 0.8, 0.02]
"""


def joint(
    name: str, kind: str, parent: str, child: str, place: str, axis: str, low: float, high: float, box: str
) -> str:
    """Return a joint and its child as URDF."""
    limits = "" if kind == "continuous" else f'lower="{low}" upper="{high}" '
    return f"""<link name="{child}">
    <inertial><mass value="0.5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <visual><geometry><box size="{box}"/></geometry></visual>
    <collision><geometry><box size="{box}"/></geometry></collision>
  </link>
  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{place}"/>
    <axis xyz="{axis}"/><limit {limits}effort="300" velocity="1.5"/></joint>"""


def crane(folder: Path, text: str = CRANE_FILE) -> Path:
    """Write the crane into a folder and return its robot file."""
    (folder / "crane.urdf").write_text(CRANE.format(joints="\n  ".join(joint(*row) for row in JOINTS)))
    (folder / "crane.toml").write_text(text)
    return folder / "crane.toml"


def rover(folder: Path) -> Path:
    """Write the robot of the example into a folder and return its robot file."""
    spec = importlib.util.spec_from_file_location("own_robot", ROVER)
    assert spec and spec.loader
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    built: Path = example.build(folder)
    return built
