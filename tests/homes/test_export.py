"""Homes taken elsewhere: the exported URDF is the same home, and the glTF shows it."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy

from chmarl_pb.cli import main
from chmarl_pb.homes.export import export_gltf
from chmarl_pb.homes.home import load_home
from chmarl_pb.rendering.plan_view import draw_plan


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    assert main(["homes", "export", "home_2", "--out", str(folder)]) == 0
    return folder


def test_the_exported_urdf_is_the_same_home(exported: Path) -> None:
    before, after = load_home("home_2"), load_home(exported / "home_2.urdf")
    assert [thing.name for thing in after.things] == [thing.name for thing in before.things]
    for one, other in zip(before.solids, after.solids, strict=True):
        np.testing.assert_allclose([one.low, one.high], [other.low, other.high], atol=1e-6)
    np.testing.assert_array_equal(draw_plan(before, 300, 300).rgb, draw_plan(after, 300, 300).rgb)


def test_the_exported_urdf_needs_nothing_but_its_folder(exported: Path) -> None:
    urdf = yourdfpy.URDF.load(str(exported / "home_2.urdf"))
    names = {
        visual.geometry.mesh.filename for link in urdf.robot.links for visual in link.visuals if visual.geometry.mesh
    }
    assert names and all(name.startswith("meshes/") and (exported / name).is_file() for name in names)


def test_the_gltf_shows_the_home_with_y_up(exported: Path) -> None:
    home = load_home("home_2")
    scene = trimesh.load(exported / "home_2.glb")
    assert isinstance(scene, trimesh.Scene)
    (x0, y0, z0), (x1, y1, z1) = scene.bounds
    low, high = home.bounds
    np.testing.assert_allclose([x0, -z1, x1, -z0], [*low, *high], atol=0.15)  # walls reach over the floors' edges
    assert 2.4 < y1 < 2.6 and -0.2 < y0 <= 0
    assert len(scene.geometry) == sum(len(link.visuals or link.collisions) for link in home.links)


def test_a_home_is_not_exported_over_itself(
    exported: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.read_bytes() for path in exported.rglob("*.*")}
    monkeypatch.chdir(exported)
    assert main(["homes", "export", "home_2.urdf", "--out", "."]) == 2
    said = capsys.readouterr()
    assert said.out == "" and "home_2.urdf: would be written over, but is read here" in said.err
    assert before == {path: path.read_bytes() for path in exported.rglob("*.*")}


def test_textures_travel_with_the_gltf(tmp_path: Path) -> None:
    scene = trimesh.load(export_gltf(load_home("home_1"), tmp_path / "home.glb"))
    assert isinstance(scene, trimesh.Scene)
    textured = [body for body in scene.geometry.values() if body.visual.material.baseColorTexture is not None]
    drawn = [shape for link in load_home("home_1").links for shape in link.visuals if shape.mesh and shape.mesh.texture]
    assert len(textured) == len(drawn)
