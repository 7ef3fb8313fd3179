"""A home as a MuJoCo model: its collision boxes and cylinders, and a camera that can be put anywhere."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

if TYPE_CHECKING:
    from chmarl_pb.envs.parallel import HouseholdEnv

# MuJoCo's cheapest settings: no shadows and one sample a pixel, as in our pictures.
_MODEL = """
<mujoco>
  <compiler angle="radian" eulerseq="XYZ"/>
  <visual><quality shadowsize="0" offsamples="0"/><map znear="0.005" zfar="3"/></visual>
  <worldbody>
    <light pos="5 5 8" dir="0 0 -1" directional="true" castshadow="false"/>
    <body name="eye" mocap="true"><camera name="eye" fovy="{fovy}"/></body>
{bodies}
  </worldbody>
</mujoco>
"""


def mjcf(env: "HouseholdEnv", fovy: float) -> str:
    """Return an environment's home and the boxes of its objects as MJCF.

    Args:
        env: after its reset.
        fovy: opening angle of the camera in degrees.
    """
    bodies = [*_home(env.simulation.home.path), *_objects(env)]
    return _MODEL.format(fovy=fovy, bodies="\n".join(bodies))


def _home(urdf: Path) -> Iterator[str]:
    root = ElementTree.parse(urdf).getroot()
    frames = {next(joint.iter("child")).get("link"): _frame(joint.find("origin")) for joint in root.iter("joint")}
    for number, link in enumerate(root.iter("link")):
        shapes = "".join(_geom(collision, number) for collision in link.iter("collision"))
        if shapes:
            yield f"<body {frames.get(link.get('name'), '')}>{shapes}</body>"


def _frame(origin: ElementTree.Element | None) -> str:
    if origin is None:
        return ""
    return f'pos="{origin.get("xyz", "0 0 0")}" euler="{origin.get("rpy", "0 0 0")}"'


def _geom(collision: ElementTree.Element, number: int) -> str:
    (shape,) = next(collision.iter("geometry"))
    if shape.tag == "box":
        kind, sizes = "box", [float(word) / 2 for word in shape.attrib["size"].split()]
    elif shape.tag == "cylinder":
        kind, sizes = "cylinder", [float(shape.attrib["radius"]), float(shape.attrib["length"]) / 2]
    else:
        raise ValueError(f"a {shape.tag} is neither a box nor a cylinder")
    colour = " ".join(f"{channel:.2f}" for channel in np.random.default_rng(number).uniform(0.3, 0.9, 3))
    size = " ".join(map(str, sizes))
    return f'<geom type="{kind}" size="{size}" {_frame(collision.find("origin"))} rgba="{colour} 1"/>'


def _objects(env: "HouseholdEnv") -> Iterator[str]:
    for name in env.world.objects:
        (x, y, z), _ = env.world.pose(name)
        width, depth, height = env.world.size(name)
        yield (
            f'<body pos="{x} {y} {z + height / 2}"><geom type="box" size="{width / 2} {depth / 2} {height / 2}" '
            'rgba="0.8 0.2 0.2 1"/></body>'
        )
