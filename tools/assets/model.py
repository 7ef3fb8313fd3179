"""A graspable model: coloured meshes, one collision box, mass; written as a URDF file with OBJ meshes."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tools.assets.colours import COLOURS
from tools.assets.meshes import Array, Mesh, join, write_obj

#: Colour name to the mesh of that colour.
Paint = dict[str, Mesh]

#: Lowest collision box, in metres: thinner ones fall through or jitter in physics.
LEAST_HEIGHT = 0.02

LINK = """\
<?xml version="1.0"?>
<robot name="{name}">
  <link name="base">
    <contact>
      <lateral_friction value="0.8"/>
      <spinning_friction value="0.01"/>
    </contact>
    <inertial>
      <origin xyz="0 0 {middle}"/>
      <mass value="{mass}"/>
      <inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/>
    </inertial>
    <collision>
      <origin xyz="0 0 {middle}"/>
      <geometry><box size="{size}"/></geometry>
    </collision>
{visuals}
  </link>
</robot>
"""

VISUAL = """\
    <visual>
      <geometry><mesh filename="meshes/{mesh}"/></geometry>
      <material name="{colour}"><color rgba="{rgb} 1"/></material>
    </visual>"""


@dataclass(frozen=True)
class Model:
    """One graspable class.

    Attributes:
        name: class name, and the URDF's robot name.
        mass: kilograms.
        paint: what is seen.
    """

    name: str
    mass: float
    paint: Paint

    def centred(self) -> "Model":
        """Return the model with its bounds standing on z = 0, centred on the z axis."""
        low, high = join(*self.paint.values()).bounds
        x, y = -(low + high)[:2] / 2
        return Model(self.name, self.mass, {name: mesh.moved(x, y, -low[2]) for name, mesh in self.paint.items()})

    @property
    def size(self) -> Array:
        """Size of the collision box: the visible bounds, but no flatter than ``LEAST_HEIGHT``."""
        low, high = join(*self.paint.values()).bounds
        size: Array = np.maximum(high - low, [0.0, 0.0, LEAST_HEIGHT])
        return size


def write_model(model: Model, folder: Path) -> Path:
    """Write ``<name>.urdf`` and ``meshes/<name>_<colour>.obj`` into a folder and return the URDF's path."""
    model = model.centred()
    visuals = []
    for colour, mesh in model.paint.items():
        file = f"{model.name}_{colour}.obj"
        write_obj(mesh, folder / "meshes" / file)
        visuals.append(VISUAL.format(mesh=file, colour=colour, rgb=" ".join(f"{c:g}" for c in COLOURS[colour])))
    path = folder / f"{model.name}.urdf"
    path.write_text(_urdf(model, "\n".join(visuals)), encoding="ascii", newline="\n")
    return path


def _urdf(model: Model, visuals: str) -> str:
    """Return the URDF text of a centred model."""
    x, y, z = size = np.round(model.size, 4)
    ixx, iyy, izz = model.mass / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    return LINK.format(
        name=model.name,
        middle=f"{z / 2:.4f}",
        mass=f"{model.mass:g}",
        ixx=f"{ixx:.3e}",
        iyy=f"{iyy:.3e}",
        izz=f"{izz:.3e}",
        size=" ".join(f"{side:.4f}" for side in size),
        visuals=visuals,
    )
