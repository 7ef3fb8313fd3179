"""What PyBullet gets of a home: a plain copy of what was read, equal to it, and gone when it has been loaded."""

import io
import math
import os
import tempfile
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from chmarl_pb.errors import HomeError
from chmarl_pb.homes import plain
from chmarl_pb.homes.dae import read_dae
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.mesh import Mesh, checked, read_stl
from chmarl_pb.homes.plain import plain_copy
from chmarl_pb.homes.shape import Origin
from chmarl_pb.homes.source import Source
from chmarl_pb.homes.wavefront import read_obj
from chmarl_pb.world import World, quiet
from chmarl_pb.world.bullet import pybullet as p
from tests.helpers.hostile_homes import CUBE, ascii_stl, dae, link, shape, stl, with_mesh, write
from tests.helpers.small_homes import HOMES, home_text

HERE = Path("mesh.obj")


def facts(client: int, body: int) -> list[object]:
    """Return all that PyBullet knows of a body's links, without the paths of meshes and the robot's name."""
    links = range(-1, p.getNumJoints(body, physicsClientId=client))
    known: list[object] = [p.getJointInfo(body, link, physicsClientId=client)[2:] for link in links[1:]]
    for number in links:
        known.append(p.getDynamicsInfo(body, number, physicsClientId=client))
        known.append(p.getAABB(body, number, physicsClientId=client))
        known += [row[2:4] + row[5:] for row in p.getCollisionShapeData(body, number, physicsClientId=client)]
    flags = p.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS
    visuals = p.getVisualShapeData(body, flags, physicsClientId=client)
    return known + [(row[1:4], Path(row[4].decode()).name, row[5:8]) for row in visuals]


@pytest.mark.parametrize("name", HOMES)
def test_pybullet_gets_a_benchmark_home_as_its_file_says(name: str) -> None:
    home = load_home(name)
    world, client = World(home), p.connect(p.DIRECT)
    with quiet():
        body = p.loadURDF(str(home.path), useFixedBase=True, physicsClientId=client)
    try:
        assert facts(world.client, world.bodies["home"]) == facts(client, body)
    finally:
        p.disconnect(client)
        world.close()


def test_the_copy_is_there_while_it_is_loaded_and_then_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    plain._folder.cache_clear()
    write(tmp_path / "home", with_mesh("mesh.stl", stl(4)))
    links = load_home(tmp_path / "home/home.urdf").links
    paths = []
    for _ in range(2):
        with plain_copy(links) as urdf:
            assert sorted(path.suffix for path in urdf.parent.iterdir()) == [".obj", ".urdf"]
            assert str(tmp_path / "home") not in urdf.read_text()
            paths.append(urdf)
        assert [path.name for path in tmp_path.iterdir()] == ["home"]
    assert paths[0] == paths[1]
    plain._folder.cache_clear()


def test_where_no_copy_can_be_written_is_said(
    tmp_path: Path, write_home: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    plain._folder.cache_clear()
    with pytest.raises(HomeError, match=r"none.*TMPDIR"):
        World(load_home(write_home(home_text())))
    plain._folder.cache_clear()


def test_meshes_of_the_working_directory_are_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "home", with_mesh("mesh.obj", CUBE, "collision"))
    (tmp_path / "mesh.obj").write_text(CUBE.replace("0.4", "0.8"))
    monkeypatch.chdir(tmp_path)
    world = World(load_home("home/home.urdf"))
    low, high = p.getAABB(world.bodies["home"], world.links["livingroom/box_1"], physicsClientId=world.client)
    np.testing.assert_allclose(np.subtract(high, low), 0.4, atol=0.01)
    world.close()


def test_furniture_may_be_the_root(write_home: Callable[..., Path]) -> None:
    inside = shape('<box size="4 4 0.1"/>', "collision", "0 0 -0.05")
    world = World(load_home(write_home(f'<robot name="r"><link name="livingroom/floor_1">{inside}</link></robot>')))
    assert world.links == {"livingroom/floor_1": 0}
    world.close()


def test_a_thing_at_the_end_of_a_chain_is_where_the_chain_ends(write_home: Callable[..., Path]) -> None:
    turned = '<origin xyz="0.5 0 0" rpy="0 0 1.5707963267948966"/>'
    frame = link("", "frame").replace("</joint>", f"{turned}</joint>")
    thing = link(shape('<box size="0.1 0.1 0.1"/>', "collision", "0 0 0.05"), "livingroom/lamp_1")
    thing = thing.replace('link="world"', 'link="frame"').replace("</joint>", f"{turned}</joint>")
    world = World(load_home(write_home(home_text(extra=frame + thing))))
    low, high = p.getAABB(world.bodies["home"], world.links["livingroom/lamp_1"], physicsClientId=world.client)
    np.testing.assert_allclose(np.add(high, low) / 2, (0.5, 0.5, 0.05), atol=1e-6)
    world.close()


@pytest.mark.parametrize("rpy", [*product((0, 1.2, -3), (0, -1.5, math.pi / 2, -math.pi / 2), (0, 2.5, -0.7))])
def test_an_origin_comes_back_from_its_frame(rpy: tuple[float, float, float]) -> None:
    frame = Origin((1, 2, 3), rpy).frame
    np.testing.assert_allclose(Origin.of(frame).frame, frame, atol=1e-9)


def obj(text: str | bytes) -> Mesh:
    """Return the mesh of an OBJ text."""
    content = text if isinstance(text, bytes) else text.encode()
    return checked(read_obj(content, HERE, Source(HERE)))


def triangles(mesh: Mesh) -> np.ndarray:
    """Return the corners (n, 3, 3) of a mesh's triangles."""
    return mesh.vertices[mesh.corners[..., 0]]


def test_obj_is_read_as_the_format_says() -> None:
    mesh = obj(CUBE)
    assert len(mesh.corners) == 12 and mesh.file is None and not len(mesh.normals)
    other = CUBE.replace("f 1 2 4 3", "f -8 -7 \\\n-5 -6 # a face").replace("\n", "\r\n")
    np.testing.assert_array_equal(triangles(obj(f"# caf\u00e9\no cube\ns off\n{other}")), triangles(mesh))
    again = obj(mesh.solid[next(iter(mesh.solid))])
    np.testing.assert_array_equal(triangles(again), triangles(mesh))
    assert list(again.drawn) == list(mesh.drawn)  # equal content has an equal name


def test_an_obj_that_is_plain_already_is_not_copied() -> None:
    text = "v 0 0 0\nv 0.25 0 0\nv 0 0.125 0\nvn 0 0 1\nf 1//1 2//1 3//1\n"
    mesh, other = obj(text), obj(text + "# written by hand\n")
    assert mesh.file == HERE and other.file is None
    np.testing.assert_array_equal(mesh.corners, other.corners)
    np.testing.assert_array_equal(mesh.normals, other.normals)
    assert obj(text.replace("vn 0 0 1", "vn 0 0 0")).file is None
    assert obj(text.replace("0.25", "2.5e-1")).file is None


def test_stl_is_read_in_both_forms() -> None:
    binary, text = (checked(read_stl(content)) for content in (stl(4), ascii_stl().encode()))
    assert len(binary.corners) == 4 and len(text.corners) == 3
    named_solid = b"solid".ljust(80) + stl(4)[80:]
    np.testing.assert_array_equal(triangles(checked(read_stl(named_solid))), triangles(binary))


def test_collada_is_placed_by_its_nodes_in_metres() -> None:
    node = '<translate>0 0 100</translate><rotate>0 0 1 90</rotate><scale>1 2 1</scale><instance_geometry url="#g"/>'
    mesh = checked(read_dae(dae(node=node, asset='<asset><unit meter="0.01"/></asset>').encode()))
    np.testing.assert_allclose(mesh.vertices, [(0, 0, 1), (0, 0.004, 1), (-0.008, 0, 1), (0, 0, 1.004)], atol=1e-9)
    corners = '<input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>0 1 2 3</p>'
    polygon = f'<polylist count="1">{corners}</polylist>'
    assert len(checked(read_dae(dae(primitive=polygon).encode())).corners) == 2


def test_a_texture_is_drawn(tmp_path: Path) -> None:
    picture = io.BytesIO()
    Image.new("RGB", (4, 4), (200, 20, 20)).save(picture, "PNG")
    material = "newmtl m\nmap_Kd t.png\n"
    cube = "mtllib a.mtl\nusemtl m\n" + CUBE.replace("0.4", "1.0")
    write(tmp_path / "home", with_mesh("mesh.obj", cube, a__mtl=material, t__png=picture.getvalue()))
    world = World(load_home(tmp_path / "home/home.urdf"))
    view = p.computeViewMatrix((1.5, 1.5, 4), (1.5, 1.5, 0), (0, 1, 0))
    lens = p.computeProjectionMatrixFOV(20, 1, 0.1, 10)
    shot = p.getCameraImage(8, 8, view, lens, shadow=0, renderer=p.ER_TINY_RENDERER, physicsClientId=world.client)
    red, green, blue = np.reshape(shot[2], (8, 8, 4))[4, 4, :3].astype(int)
    assert red > 4 * max(green, blue)
    world.close()


def test_a_file_that_changes_is_seen_only_by_who_reads_anew(tmp_path: Path) -> None:
    write(tmp_path / "home", with_mesh("mesh.stl", stl(4)))
    home = load_home(tmp_path / "home/home.urdf")
    (tmp_path / "home/mesh.stl").write_bytes(b"")
    world = World(home)  # of what was read
    assert "livingroom/box_1" in world.links
    world.close()
    os.utime(home.path, (0, 0))
    with pytest.raises(HomeError, match=r"mesh\.stl"):
        load_home(home.path)
