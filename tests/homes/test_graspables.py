"""The graspable models: complete, well-formed, stable, cheap to draw and reproducible."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pybullet as p
import pytest

from chmarl_pb.catalog import BENCHMARK, graspable_urdf
from tools.assets.graspables import FOLDER, build, models

GRASPABLES = list(BENCHMARK.graspables)
LONGEST = 0.34
TRIANGLES = 300


@pytest.fixture
def client() -> Iterator[int]:
    number = p.connect(p.DIRECT)
    yield number
    p.disconnect(number)


@pytest.fixture
def floor(client: int) -> int:
    shape = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    return int(p.createMultiBody(0, shape, physicsClientId=client))


def load(name: str, client: int) -> int:
    return int(p.loadURDF(str(graspable_urdf(name)), physicsClientId=client))


def corners_of_meshes(name: str) -> np.ndarray:
    files = FOLDER.glob(f"meshes/{name}_*.obj")
    return np.array([line.split()[1:] for f in files for line in f.read_text().splitlines() if line[:2] == "v "], float)


def test_models_are_the_catalogue() -> None:
    assert [model.name for model in models()] == list(GRASPABLES)
    assert {file.stem for file in FOLDER.glob("*.urdf")} == set(GRASPABLES)


@pytest.mark.parametrize("name", GRASPABLES)
def test_one_link_named_base_with_one_box_standing_on_the_origin(name: str, client: int) -> None:
    body = load(name, client)
    assert p.getNumJoints(body, physicsClientId=client) == 0
    assert [part.decode() for part in p.getBodyInfo(body, physicsClientId=client)] == ["base", name]
    (shape,) = p.getCollisionShapeData(body, -1, physicsClientId=client)
    mass, _, inertia, centre = p.getDynamicsInfo(body, -1, physicsClientId=client)[:4]
    x, y, z = shape[3]
    assert shape[2] == p.GEOM_BOX
    assert 0.02 <= z <= LONGEST and max(x, y) <= LONGEST and y <= x + 0.005
    assert centre == pytest.approx((0, 0, z / 2), abs=1e-4)
    assert 0 < mass < 3 and min(inertia) > 0
    low, high = np.array(p.getAABB(body, -1, physicsClientId=client))
    assert low[2] == pytest.approx(0, abs=1e-3) and high[2] == pytest.approx(z, abs=1e-3)


@pytest.mark.parametrize("name", GRASPABLES)
def test_box_encloses_what_is_seen(name: str, client: int) -> None:
    (shape,) = p.getCollisionShapeData(load(name, client), -1, physicsClientId=client)
    x, y, z = shape[3]
    corners = corners_of_meshes(name)
    low, high = corners.min(axis=0), corners.max(axis=0)
    assert np.all(low >= [-x / 2 - 1e-3, -y / 2 - 1e-3, -1e-4]) and np.all(
        high <= [x / 2 + 1e-3, y / 2 + 1e-3, z + 1e-3]
    )
    assert low[2] == pytest.approx(0, abs=1e-4)
    assert np.all(high[:2] - low[:2] >= np.array([x, y]) - 2e-3)


@pytest.mark.parametrize("name", GRASPABLES)
def test_stays_upright_and_still_when_dropped(name: str, client: int, floor: int) -> None:
    body = load(name, client)
    middle = p.getDynamicsInfo(body, -1, physicsClientId=client)[3][2]
    p.resetBasePositionAndOrientation(body, [0, 0, middle + 0.005], [0, 0, 0, 1], physicsClientId=client)
    for _ in range(240):
        p.stepSimulation(physicsClientId=client)
    position, turn = p.getBasePositionAndOrientation(body, physicsClientId=client)
    velocity, spin = p.getBaseVelocity(body, physicsClientId=client)
    up = np.reshape(p.getMatrixFromQuaternion(turn), (3, 3))[2, 2]
    assert np.degrees(np.arccos(min(up, 1.0))) < 3
    assert np.hypot(*position[:2]) < 0.005 and position[2] == pytest.approx(middle, abs=0.002)
    assert np.linalg.norm(velocity) < 0.01 and np.linalg.norm(spin) < 0.05


def test_triangles_stay_cheap() -> None:
    counts = {model.name: sum(len(mesh) for mesh in model.paint.values()) for model in models()}
    assert {name: count for name, count in counts.items() if count > TRIANGLES} == {}


def test_normals_point_outwards() -> None:
    for model in models():
        for colour, mesh in model.paint.items():
            a, b, c = np.moveaxis(mesh.triangles, 1, 0)
            sides = np.einsum("ij,ikj->ik", np.cross(b - a, c - a), mesh.normals)
            assert np.all(sides > 0), f"{model.name}: {colour}"
            assert np.allclose(np.linalg.norm(mesh.normals, axis=2), 1), f"{model.name}: {colour}"


def test_building_again_gives_the_same_bytes(tmp_path: Path) -> None:
    build(tmp_path)
    kept = {file.relative_to(FOLDER): file.read_bytes() for file in FOLDER.rglob("*") if file.is_file()}
    made = {file.relative_to(tmp_path): file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    assert sorted(kept) == sorted(made)
    assert [str(name) for name in kept if kept[name] != made[name]] == []
