"""Colours of OBJ material files: drawn by PyBullet and by our own rasteriser alike, in homes and of things."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.homes.imports import Wish, add_thing
from chmarl_pb.homes.mesh import MOST_COLOURS
from chmarl_pb.navigation.check import check_home
from chmarl_pb.rendering.renderer import Renderer
from chmarl_pb.tasks.simulation import Simulation
from tests.helpers.small_homes import home_text

CUBE = """mtllib cube.mtl
v 0 0 0
v 0.2 0 0
v 0.2 0.2 0
v 0 0.2 0
v 0 0 0.2
v 0.2 0 0.2
v 0.2 0.2 0.2
v 0 0.2 0.2
vn 0 0 -1
vn 0 0 1
vn 0 -1 0
vn 1 0 0
vn 0 1 0
vn -1 0 0
usemtl red
f 1//1 4//1 3//1 2//1
f 5//2 6//2 7//2 8//2
usemtl blue
f 1//3 2//3 6//3 5//3
f 2//4 3//4 7//4 6//4
usemtl plain
f 3//5 4//5 8//5 7//5
f 4//6 1//6 5//6 8//6
"""
MATERIALS = "newmtl red\nKd 0.8 0.1 0.1 # strong\nnewmtl blue\nKa 1 1 1\nKd 0.1 0.2 0.9\nnewmtl plain\n{}\n"
PARROT = """<link name="livingroom/plant_1"><visual><origin xyz="1 0.5 0"/><geometry>
<mesh filename="cube.obj" scale="1 1 4"/></geometry>{}</visual></link>
<joint name="to_plant" type="fixed"><parent link="world"/><child link="livingroom/plant_1"/></joint>
"""


def written(folder: Path, last: str = "Kd 1 1 0", material: str = "", mesh: str = CUBE) -> Path:
    """Write a home with a cube of three materials."""
    (folder / "cube.obj").write_text(mesh)
    (folder / "cube.mtl").write_text(MATERIALS.format(last))
    path = folder / "home.urdf"
    path.write_text(home_text(extra=PARROT.format(material)))
    return path


def colours(home: Home) -> set[tuple[float, ...] | None]:
    link = next(link for link in home.links if link.name == "livingroom/plant_1")
    return {shape.colour for shape in link.visuals}


def warnings(path: Path) -> list[str]:
    return [str(problem) for problem in check_home(path).warnings if "colours" in str(problem)]


def test_a_home_has_the_colours_of_material_files(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert colours(load_home(path)) == {(0.8, 0.1, 0.1, 1.0), (0.1, 0.2, 0.9, 1.0), (1.0, 1.0, 0.0, 1.0)}
    assert not warnings(path)


def test_both_renderers_show_them_alike(tmp_path: Path) -> None:
    pictures = []
    for renderer in ("fast", "tiny"):
        simulation = Simulation(str(written(tmp_path)), renderer=renderer)
        robot, drawn = simulation.robots["humanoid"], simulation.renderer
        pictures.append([seen(drawn, robot.spawn, pose) for pose in range(0, robot.lattice.count, 29)])
        simulation.close()
    fast, tiny = map(np.stack, pictures)
    np.testing.assert_array_equal(fast, tiny)
    pixels = fast.reshape(-1, 3).astype(int)
    assert ((pixels[:, 2] > 2 * pixels[:, 0]) & (pixels[:, 2] > 60)).any(), "the blue sides are blue"


def seen(renderer: Renderer, spawn: Callable[[int], None], pose: int) -> np.ndarray:
    spawn(pose)
    return renderer.image("humanoid", 48)


def test_a_colour_of_the_urdf_is_that_of_all(tmp_path: Path) -> None:
    path = written(tmp_path, material='<material name="own"><color rgba="0 1 0 1"/></material>')
    assert colours(load_home(path)) == {(0.0, 1.0, 0.0, 1.0)}


@pytest.mark.parametrize("last", ["", "Kd 255 0 0", "Kd spectral file.rfl", "Kd 1 1"])
def test_a_material_without_a_colour_is_white_and_warned_of(tmp_path: Path, last: str) -> None:
    path = written(tmp_path, last)
    assert colours(load_home(path)) == {(0.8, 0.1, 0.1, 1.0), (0.1, 0.2, 0.9, 1.0), None}
    assert warnings(path) and "give it a <material>" in warnings(path)[0]


def test_too_many_colours_are_warned_of(tmp_path: Path) -> None:
    faces = [f"usemtl m{number}\nf 1//1 4//1 3//1\n" for number in range(MOST_COLOURS + 1)]
    path = written(tmp_path, mesh=CUBE + "".join(faces))
    (tmp_path / "cube.mtl").write_text("".join(f"newmtl m{n}\nKd 0 0 {n / 99}\n" for n in range(MOST_COLOURS + 1)))
    assert colours(load_home(path)) == {None} and warnings(path)


def test_an_imported_thing_has_them(tmp_path: Path) -> None:
    written(tmp_path)
    _, thing = add_thing(tmp_path / "cube.obj", Wish("parrot"), tmp_path / "things" / "my_things.toml")
    assert {part.colour for part in thing.parts} == {(0.8, 0.1, 0.1), (0.1, 0.2, 0.9), (1.0, 1.0, 0.0)}
    assert sum(len(part.corners) for part in thing.parts) == 12
