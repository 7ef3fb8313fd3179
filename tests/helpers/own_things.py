"""A catalogue file of own things, made on the spot: a striped crate, a squat post and a workbench."""

from pathlib import Path

CATALOG = """
[[graspable]]
class = "striped_crate"
urdf = "crate.urdf"
names = ["wooden crate"]
held_out = ["slatted crate"]
states = ["sealed", "open"]

[[graspable]]
class = "post"
urdf = "post.urdf"
places = ["desk", "workbench", "sofa"]

[[receptacle]]
class = "workbench"
models = ["workbench_oak.urdf"]
names = ["carpentry bench"]

[[scenery]]
class = "easel"
"""

_COLOURS = {"red": "0.8 0.1 0.1 1", "white": "0.9 0.9 0.9 1"}


def shape(geometry: str, at: str = "0 0 0", colour: str = "") -> str:
    """Return the inside of a <visual> or <collision>."""
    material = f'<material name="{colour}"><color rgba="{_COLOURS[colour]}"/></material>' if colour else ""
    return f'<origin xyz="{at}"/><geometry>{geometry}</geometry>{material}'


def urdf(visuals: list[str], collisions: list[str], mass: str | None = "0.4") -> str:
    """Return a URDF of one link."""
    inertial = "" if mass is None else f'<inertial><mass value="{mass}"/></inertial>'
    parts = [f"<visual>{part}</visual>" for part in visuals] + [f"<collision>{part}</collision>" for part in collisions]
    lines = ['<robot name="thing"><link name="base">', inertial, *parts, "</link></robot>"]
    return '<?xml version="1.0"?>\n' + "\n".join(lines) + "\n"


BOX = '<box size="0.12 0.1 0.08"/>'
CRATE = urdf(
    [shape(BOX, "0.3 0 0.5", "red"), shape('<box size="0.121 0.03 0.081"/>', "0.3 0 0.5", "white")],
    [shape(BOX, "0.3 0 0.5")],
)
POST = urdf(
    [shape('<cylinder radius="0.03" length="0.15"/>', colour="white"), shape('<sphere radius="0.04"/>', colour="red")],
    [shape('<cylinder radius="0.03" length="0.15"/>')],
)
WORKBENCH = urdf(
    [shape('<box size="1.2 0.6 0.8"/>', "0 0 0.4", "red")], [shape('<box size="1.2 0.6 0.8"/>', "0 0 0.4")], None
)


def write_things(folder: Path, text: str = CATALOG) -> Path:
    """Write the catalogue file and its models; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in (("crate", CRATE), ("post", POST), ("workbench_oak", WORKBENCH)):
        (folder / f"{name}.urdf").write_text(content)
    path = folder / "my_things.toml"
    path.write_text(text)
    return path
