"""Furniture models: they load, follow the conventions, and offer flat tops where they are drawn."""

import filecmp
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pybullet as p
import pytest
import trimesh

from chmarl_pb import catalog
from chmarl_pb.assets import URDF_DIR
from tests.helpers.elements import inner
from tools.assets.furniture import build

FOLDER = URDF_DIR / "furniture"
MODELS = sorted(file.stem for file in FOLDER.glob("*.urdf"))
KNOWN = {**catalog.BENCHMARK.receptacles, **catalog.BENCHMARK.scenery}
SEVERAL = ("bathroom_counter bed bench bookshelf cabinet chair coffee_table desk dresser kitchen_counter kitchen_table "
           "nightstand sofa stove towel_rack tv_stand fridge picture plant rug wardrobe").split()  # fmt: skip
#: Flat on a floor: drawn only, nothing collides with them.
FLAT = "rug"


def class_of(model: str) -> str:
    """The longest known class that the model's name starts with."""
    return max((name for name in KNOWN if model.startswith(f"{name}_")), key=len, default="")


RECEPTACLES = [model for model in MODELS if class_of(model) in catalog.BENCHMARK.receptacles]


@dataclass(frozen=True)
class Part:
    """Axis-aligned bounds of a visual or a collision shape, and its area seen from above."""

    low: np.ndarray
    high: np.ndarray
    area: float
    triangles: int

    @property
    def is_top(self) -> bool:
        """Whether things can stand on it: wider than an armrest, higher than a foot."""
        return self.area >= 0.06 and min(self.high[:2] - self.low[:2]) >= 0.25 and self.high[2] >= 0.25


def link_of(model: str) -> ElementTree.Element:
    return inner(ElementTree.parse(FOLDER / f"{model}.urdf").getroot(), "link")


def numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.split()])


def parts(model: str, tag: str) -> list[Part]:
    return [part(element) for element in link_of(model).findall(tag)]


def part(element: ElementTree.Element) -> Part:
    origin = inner(element, "origin")
    assert origin.get("rpy") is None, "parts are not rotated"
    centre = numbers(origin.attrib["xyz"])
    shape = inner(element, "geometry")[0]
    if shape.tag == "mesh":
        mesh = trimesh.load(FOLDER / shape.attrib["filename"], process=False)
        assert isinstance(mesh, trimesh.Trimesh)
        return Part(mesh.bounds[0] + centre, mesh.bounds[1] + centre, 0.0, len(mesh.faces))
    if shape.tag == "box":
        half = numbers(shape.attrib["size"]) / 2
        return Part(centre - half, centre + half, 4 * half[0] * half[1], 12)
    assert (shape.tag, element.tag) == ("cylinder", "collision"), "visual cylinders have too many triangles"
    radius, length = float(shape.attrib["radius"]), float(shape.attrib["length"])
    half = np.array([radius, radius, length / 2])
    return Part(centre - half, centre + half, np.pi * radius**2, 0)


def bounds(shapes: list[Part]) -> tuple[np.ndarray, np.ndarray]:
    return np.min([shape.low for shape in shapes], axis=0), np.max([shape.high for shape in shapes], axis=0)


@pytest.fixture
def client() -> Iterator[int]:
    client = p.connect(p.DIRECT)
    yield client
    p.disconnect(client)


def test_every_class_has_models() -> None:
    assert len(MODELS) >= 45
    classes = [class_of(model) for model in MODELS]
    assert set(classes) == set(KNOWN)
    assert [name for name in SEVERAL if classes.count(name) < 2] == []


@pytest.mark.parametrize("model", MODELS)
def test_loads_as_one_fixed_link(model: str, client: int) -> None:
    body = p.loadURDF(str(FOLDER / f"{model}.urdf"), physicsClientId=client)
    base, robot = p.getBodyInfo(body, physicsClientId=client)
    assert (base.decode(), robot.decode()) == ("base", model)
    assert p.getNumJoints(body, physicsClientId=client) == 0
    assert p.getDynamicsInfo(body, -1, physicsClientId=client)[0] == 0
    assert len(p.getVisualShapeData(body, physicsClientId=client)) == len(link_of(model).findall("visual"))


@pytest.mark.parametrize("model", MODELS)
def test_stands_centred_on_the_floor(model: str) -> None:
    visuals, solids = parts(model, "visual"), parts(model, "collision")
    assert bool(solids) == (class_of(model) != FLAT)
    for shapes in filter(None, (visuals, solids)):
        low, high = bounds(shapes)
        assert low[2] == pytest.approx(0, abs=1e-3)
        assert (low + high)[:2] / 2 == pytest.approx([0, 0], abs=0.02)


@pytest.mark.parametrize("model", [model for model in MODELS if class_of(model) != FLAT])
def test_solids_fit_what_is_drawn(model: str) -> None:
    drawn, solid = bounds(parts(model, "visual")), bounds(parts(model, "collision"))
    assert np.array(drawn) == pytest.approx(np.array(solid), abs=0.035)


@pytest.mark.parametrize("model", MODELS)
def test_is_cheap_to_draw(model: str) -> None:
    visuals = parts(model, "visual")
    assert len(visuals) <= 25
    assert sum(visual.triangles for visual in visuals) <= 400


@pytest.mark.parametrize("model", MODELS)
def test_can_be_recoloured(model: str) -> None:
    materials = [material.get("name") for material in link_of(model).iter("material")]
    assert "primary" in materials
    assert all(materials)


@pytest.mark.parametrize("model", RECEPTACLES)
def test_receptacle_has_a_flat_top_in_reach(model: str) -> None:
    assert any(solid.is_top and solid.high[2] <= 1.5 for solid in parts(model, "collision"))


@pytest.mark.parametrize("model", RECEPTACLES)
def test_things_stand_where_the_tops_are_drawn(model: str, client: int) -> None:
    """Seen from above, drawn and solid heights agree within 1 cm on nearly all of the tops."""
    body = p.loadURDF(str(FOLDER / f"{model}.urdf"), physicsClientId=client)
    shapes = parts(model, "collision")
    low, high = bounds(shapes)
    drawn = drawn_heights(low, high, client)
    grid = [(x, y) for y in centres(low[1], high[1]) for x in centres(low[0], high[0])]
    hits = p.rayTestBatch([(x, y, 3) for x, y in grid], [(x, y, 0) for x, y in grid], physicsClientId=client)
    solid = np.array([hit[3][2] if hit[0] == body else 0 for hit in hits]).reshape(drawn.shape)
    tops = [shape.high[2] for shape in shapes if shape.is_top]
    on_top = np.isclose(solid[..., None], tops, atol=1e-3).any(axis=-1)
    assert on_top.mean() > 0.4
    assert (np.abs(drawn - solid)[on_top] < 0.01).mean() > 0.9


#: Pixels along each side of the view from above.
PIXELS = 64


def centres(low: float, high: float) -> np.ndarray:
    return low + (np.arange(PIXELS) + 0.5) / PIXELS * (high - low)


def drawn_heights(low: np.ndarray, high: np.ndarray, client: int) -> np.ndarray:
    """Heights (y, x) of what is drawn within bounds, from a camera that looks straight down from far away."""
    above, near, far = 200.0, 197.0, 200.5
    middle, half = (low + high) / 2, (high - low) / 2
    view = p.computeViewMatrix([middle[0], middle[1], above], [middle[0], middle[1], 0], [0, 1, 0])
    x, y = half[:2] * near / above
    lens = p.computeProjectionMatrix(-x, x, -y, y, near, far)
    image = p.getCameraImage(PIXELS, PIXELS, view, lens, shadow=0, renderer=p.ER_TINY_RENDERER, physicsClientId=client)
    depth = np.reshape(image[3], (PIXELS, PIXELS))[::-1]
    return above - far * near / (far - (far - near) * depth)


def test_rebuilding_gives_the_same_files(tmp_path: Path) -> None:
    build(tmp_path)
    files = {file.relative_to(tmp_path) for file in tmp_path.rglob("*.*")}
    kept = {file.relative_to(FOLDER) for file in FOLDER.rglob("*.*")}
    assert files == kept
    assert [file for file in sorted(files) if not filecmp.cmp(tmp_path / file, FOLDER / file, shallow=False)] == []
