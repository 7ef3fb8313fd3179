"""Pictures on floors and walls, and doorways with a top: they change how a home looks, not how it is played."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals

import chmarl_pb
from chmarl_pb.errors import HomeError
from chmarl_pb.homes.assemble import build_home
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.layout import STARTER, load_layout
from chmarl_pb.homes.textures import textured_box, textures
from chmarl_pb.navigation.free_space import space_of
from tools.assets.textures import write_textures


def build(folder: Path, name: str, *changes: tuple[str, str]) -> Path:
    text = STARTER.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    layout = folder / f"{name}.toml"
    layout.write_text(text)
    return build_home(layout)


PLAIN_KITCHEN = 'floor = "oak", wall = "cream"'
PICTURED = (PLAIN_KITCHEN, f'{PLAIN_KITCHEN}, floor_texture = "planks", wall_texture = "tiles"')
LINTELS = ('name = "my_home"', 'name = "my_home"\ndoor_height = 2.1')


@pytest.fixture(scope="module")
def homes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("looks")
    return build(folder, "plain"), build(folder, "pictured", PICTURED, LINTELS)


def test_the_committed_pictures_are_what_their_script_draws(tmp_path: Path) -> None:
    write_textures(tmp_path)
    for name, file in textures().items():
        drawn = np.asarray(Image.open(tmp_path / f"{name}.png"))
        np.testing.assert_array_equal(np.asarray(Image.open(file)), drawn)


@pytest.mark.parametrize("size", [(3.5, 0.1, 2.5), (4.0, 3.25, 0.1)])
def test_a_pictured_box_is_a_box_on_which_a_metre_is_a_picture(size: tuple[float, ...], tmp_path: Path) -> None:
    files = textured_box(textures()["planks"], size)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    mesh = trimesh.load(tmp_path / list(files)[-1], force="mesh", process=False)
    assert isinstance(mesh, trimesh.Trimesh) and isinstance(mesh.visual, TextureVisuals) and mesh.visual.uv is not None
    np.testing.assert_allclose(mesh.extents, size, atol=1e-6)
    edges = mesh.vertices[mesh.edges[:, 0]] - mesh.vertices[mesh.edges[:, 1]]
    steps = mesh.visual.uv[mesh.edges[:, 0]] - mesh.visual.uv[mesh.edges[:, 1]]
    np.testing.assert_allclose(np.linalg.norm(edges, axis=1), np.linalg.norm(steps, axis=1), atol=1e-5)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    assert np.isclose(mesh.volume, np.prod(size))  # negative if faces looked inward


def test_looks_change_no_motion_and_no_place(homes: tuple[Path, Path]) -> None:
    plain, pictured = (space_of(load_home(home)) for home in homes)
    np.testing.assert_array_equal(plain.lattice.moves, pictured.lattice.moves)
    assert [thing.name for thing in plain.home.things] == [thing.name for thing in pictured.home.things]


def test_doorways_end_where_the_layout_says(homes: tuple[Path, Path]) -> None:
    above = [[solid.bottom for solid in load_home(home).solids if solid.bottom > 2.0] for home in homes]
    assert above[0] == []
    np.testing.assert_allclose(above[1], [2.1] * len(load_layout(homes[1].with_suffix(".toml")).doors))


def test_both_renderers_draw_pictured_homes_alike_and_the_floor_shows_its_boards(homes: tuple[Path, Path]) -> None:
    pictures = []
    for home, renderer in ((homes[1], "fast"), (homes[1], "tiny"), (homes[0], "fast")):
        env = chmarl_pb.parallel_env(observation="visual", home=str(home), image_size=96, renderer=renderer)
        env.reset(seed=3)
        observations, *_ = env.step({"humanoid": 9, "drone": env.action_names["drone"].index("goto_kitchen")})
        pictures.append(observations["drone"]["image"])
        env.close()
    np.testing.assert_array_equal(pictures[0], pictures[1])
    tones = [len(np.unique(picture.reshape(-1, 3), axis=0)) for picture in (pictures[0], pictures[2])]
    assert tones[0] > tones[1] + 5


@pytest.mark.parametrize(
    ("texture", "problem"),
    [
        ("plancks", "must be one of carpet"),
        ("missing.png", "cannot be read"),
        ("broken.png", "cannot be read as a picture"),
    ],
)
def test_pictures_that_cannot_be_used_are_refused(texture: str, problem: str, tmp_path: Path) -> None:
    (tmp_path / "broken.png").write_bytes(b"\x89PNG but not really")
    with pytest.raises(HomeError, match=rf"home\.toml:\d+: room 1: 'floor_texture'.*{problem}"):
        build(tmp_path, "home", (PLAIN_KITCHEN, f'{PLAIN_KITCHEN}, floor_texture = "{texture}"'))


def test_own_pictures_are_taken(tmp_path: Path) -> None:
    Image.fromarray(np.full((8, 8, 3), 200, np.uint8)).save(tmp_path / "own.png")
    home = load_home(build(tmp_path, "home", (PLAIN_KITCHEN, f'{PLAIN_KITCHEN}, floor_texture = "own.png"')))
    assert any(shape.mesh is not None and shape.mesh.texture for link in home.links for shape in link.visuals)
