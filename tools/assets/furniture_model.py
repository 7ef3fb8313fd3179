"""A furniture model under construction, and the URDF written from it.

A model stands on z = 0 with its footprint centred on the origin; its front, the side a person uses, faces +x.
Lengths are metres, angles radians. ``at`` is always the centre of a part's bottom face. Colours are names: of the
palette, or ``primary`` and ``secondary``, which a home may recolour.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from tools.assets.meshes import Mesh, box, extrude, join, loft, rectangle, write_obj

Vector = tuple[float, float, float]

ROUND = 12  # corners of what is round

#: A box as (size, centre of its bottom face).
Block = tuple[Vector, Vector]

#: Colour name to red, green, blue in 0..1.
PALETTE: dict[str, Vector] = {
    "oak": (0.74, 0.56, 0.36),
    "walnut": (0.45, 0.30, 0.20),
    "mahogany": (0.36, 0.19, 0.13),
    "pine": (0.87, 0.72, 0.50),
    "birch": (0.89, 0.80, 0.65),
    "white": (0.95, 0.94, 0.92),
    "ceramic": (0.97, 0.97, 0.96),
    "cream": (0.93, 0.88, 0.77),
    "linen": (0.86, 0.81, 0.72),
    "grey": (0.62, 0.62, 0.61),
    "stone": (0.60, 0.57, 0.53),
    "dark_stone": (0.42, 0.40, 0.38),
    "marble": (0.88, 0.87, 0.85),
    "granite": (0.33, 0.33, 0.35),
    "charcoal": (0.22, 0.23, 0.25),
    "black": (0.07, 0.07, 0.08),
    "gap": (0.16, 0.13, 0.11),
    "steel": (0.74, 0.76, 0.78),
    "dark_steel": (0.48, 0.50, 0.53),
    "brass": (0.80, 0.65, 0.33),
    "glass": (0.68, 0.83, 0.88),
    "water": (0.55, 0.75, 0.85),
    "mirror": (0.76, 0.85, 0.89),
    "sky": (0.60, 0.80, 0.93),
    "screen": (0.06, 0.08, 0.12),
    "navy": (0.17, 0.25, 0.42),
    "blue": (0.25, 0.45, 0.70),
    "teal": (0.18, 0.47, 0.49),
    "sage": (0.55, 0.64, 0.51),
    "leaf": (0.24, 0.50, 0.22),
    "dark_leaf": (0.14, 0.36, 0.17),
    "mustard": (0.88, 0.68, 0.24),
    "yellow": (0.98, 0.85, 0.35),
    "orange": (0.91, 0.52, 0.20),
    "terracotta": (0.74, 0.41, 0.29),
    "red": (0.74, 0.20, 0.18),
    "burgundy": (0.48, 0.15, 0.20),
    "rose": (0.84, 0.60, 0.60),
    "soil": (0.22, 0.15, 0.10),
    "lampshade": (0.98, 0.91, 0.72),
    "fire": (0.98, 0.62, 0.15),
}


@dataclass
class Model:
    """One piece of furniture.

    Attributes:
        name: model name, ``<class>_<variant>``.
        primary: palette name of the main colour.
        secondary: palette name of the second colour.
        visuals: ``<visual>`` elements in order.
        collisions: ``<collision>`` elements in order.
        meshes: file stem to mesh.
    """

    name: str
    primary: str = "oak"
    secondary: str = "linen"
    visuals: list[str] = field(default_factory=list)
    collisions: list[str] = field(default_factory=list)
    meshes: dict[str, Mesh] = field(default_factory=dict)

    def block(self, colour: str, size: Vector, at: Vector = (0, 0, 0), solid: bool = True) -> None:
        """Add a box, by default also to the collision geometry."""
        self._visual(_box(size), _raised(at, size[2]), colour)
        if solid:
            self.solid(size, at)

    def shape(self, part: str, colour: str, *meshes: Mesh) -> None:
        """Add meshes, in the model's frame, as one visual."""
        stem = f"{self.name}_{part}"
        if stem in self.meshes:
            raise ValueError(f"{self.name}: two parts named {part}")
        self.meshes[stem] = join(*meshes)
        self._visual(f'<mesh filename="meshes/{stem}.obj"/>', (0, 0, 0), colour)

    def blocks(self, part: str, colour: str, blocks: Iterable[Block], solid: bool = False) -> None:
        """Add boxes of one colour as one visual."""
        blocks = list(blocks)
        self.shape(part, colour, *(box(*size).moved(*at) for size, at in blocks))
        if solid:
            for size, at in blocks:
                self.solid(size, at)

    def solid(self, size: Vector, at: Vector = (0, 0, 0)) -> None:
        """Add a box to the collision geometry only."""
        self._collision(_box(size), _raised(at, size[2]))

    def solid_round(self, radius: float, height: float, at: Vector = (0, 0, 0)) -> None:
        """Add an upright cylinder to the collision geometry only."""
        self._collision(f'<cylinder radius="{_text(radius)}" length="{_text(height)}"/>', _raised(at, height))

    def write(self, folder: Path) -> None:
        """Write ``<name>.urdf`` and its meshes into a folder."""
        for stem, mesh in self.meshes.items():
            write_obj(mesh, folder / "meshes" / f"{stem}.obj")
        inertial = [
            "    <inertial>",
            '      <mass value="0"/>',
            '      <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>',
            "    </inertial>",
        ]
        body = ['  <link name="base">', *inertial, *self.visuals, *self.collisions, "  </link>"]
        lines = ['<?xml version="1.0"?>', f'<robot name="{self.name}">', *body, "</robot>", ""]
        (folder / f"{self.name}.urdf").write_text("\n".join(lines), encoding="utf-8", newline="\n")

    def _visual(self, geometry: str, centre: Vector, colour: str) -> None:
        rgb = PALETTE[{"primary": self.primary, "secondary": self.secondary}.get(colour, colour)]
        material = f'<material name="{colour}"><color rgba="{_text(*rgb)} 1"/></material>'
        self.visuals.append(_element("visual", centre, geometry, material))

    def _collision(self, geometry: str, centre: Vector) -> None:
        self.collisions.append(_element("collision", centre, geometry))


def facing(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
    """Turn a mesh's up to +x, its x to +y and its y to +z, then move it: for knobs, doors and paintings."""
    return mesh.turned("x", np.pi / 2).turned("z", np.pi / 2).moved(x, y, z)


def panel(corners: ArrayLike, x: float, thickness: float) -> Mesh:
    """Return a flat shape of (y, z) corners, counterclockwise seen from the front, with its back at ``x``."""
    return facing(extrude(corners, thickness), x)


def tray(outer: ArrayLike, inner: ArrayLike, height: float, floor: float, floor_scale: float = 0.85) -> Mesh:
    """Return an open vessel: a tub, a basin or a bowl.

    Args:
        outer: (x, y) corners of the outside, counterclockwise.
        inner: as many corners of the opening.
        height: of the rim.
        floor: height of the inside's floor.
        floor_scale: size of the floor, of the opening's.
    """
    inner = np.asarray(inner, dtype=float)
    outlines = [(np.asarray(outer, dtype=float), 0.0), (outer, height), (inner, height), (inner * floor_scale, floor)]
    return loft([np.column_stack([outline, np.full(len(inner), z)]) for outline, z in outlines])


def ellipse(x: float, y: float) -> np.ndarray:
    """Return ``ROUND`` corners (x, y) of a centred ellipse of full size (x, y), counterclockwise."""
    angles = np.arange(ROUND) * (2 * np.pi / ROUND)
    return np.column_stack([x / 2 * np.cos(angles), y / 2 * np.sin(angles)])


def leg(foot: tuple[float, float], head: tuple[float, float], z: tuple[float, float], width: float) -> Mesh:
    """Return a slanted square leg from (x, y) at the lower height to (x, y) at the upper one, cut level at both."""
    square = rectangle(width, width)
    ends = [np.column_stack([square + end, np.full(4, height)]) for end, height in zip((foot, head), z, strict=True)]
    return loft(ends)


def soft_box(x: float, y: float, z: float, bevel: float = 0.03) -> Mesh:
    """Return a box whose upper edges are bevelled, for upholstery."""
    wide, narrow = rectangle(x, y), rectangle(x - 2 * bevel, y - 2 * bevel)
    levels = [(wide, 0.0), (wide, z - bevel), (narrow, z)]
    return loft([np.column_stack([outline, np.full(4, height)]) for outline, height in levels])


def corners_of(x: float, y: float, size: float, inset: float = 0.0) -> list[tuple[float, float]]:
    """Return the centres (x, y) of four square legs of width ``size`` under a top of size (x, y)."""
    half_x, half_y = x / 2 - size / 2 - inset, y / 2 - size / 2 - inset
    return [(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)]


def _box(size: Vector) -> str:
    return f'<box size="{_text(*size)}"/>'


def _element(tag: str, centre: Vector, geometry: str, *extra: str) -> str:
    parts = [f'<origin xyz="{_text(*centre)}"/>', f"<geometry>{geometry}</geometry>", *extra]
    return "\n".join([f"    <{tag}>", *(f"      {part}" for part in parts), f"    </{tag}>"])


def _raised(at: Vector, height: float) -> Vector:
    return at[0], at[1], at[2] + height / 2


def _text(*numbers: float) -> str:
    return " ".join(f"{round(number, 5) + 0.0:g}" for number in numbers)
