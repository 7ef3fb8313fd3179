"""Imported meshes are brought within the triangles of their kind."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from chmarl_pb.errors import AssetError
from chmarl_pb.homes.imports import Wish, add_thing, read_file
from chmarl_pb.homes.paint import ColouredTriangles
from chmarl_pb.homes.simplify import simplified
from chmarl_pb.homes.things import MOST_TRIANGLES


def test_a_thing_with_many_triangles_is_simplified(tmp_path: Path) -> None:
    body = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    assert len(body.faces) == 20_480
    body.export(tmp_path / "ball.stl")
    _, thing = add_thing(tmp_path / "ball.stl", Wish("marble_ball"), tmp_path / "my_things.toml")
    (part,) = thing.parts
    assert MOST_TRIANGLES // 2 < len(part.corners) <= MOST_TRIANGLES
    np.testing.assert_allclose(thing.size, 0.2, atol=0.002)
    distance = np.linalg.norm(part.corners - (0, 0, 0.1), axis=2)
    np.testing.assert_allclose(distance, 0.1, atol=0.002)
    outward = (part.normals * (part.corners - (0, 0, 0.1)) / 0.1).sum(axis=2)
    assert np.mean(outward > 0.95) > 0.9
    again, _ = read_file(tmp_path / "ball.stl", Wish("marble_ball"))
    np.testing.assert_array_equal(again.parts[0].corners, part.corners)


def test_furniture_may_have_more(tmp_path: Path) -> None:
    trimesh.creation.icosphere(subdivisions=5, radius=0.4).export(tmp_path / "ball.stl")
    thing, pieces = read_file(tmp_path / "ball.stl", Wish("pouffe", "receptacle"))
    assert MOST_TRIANGLES < len(thing.parts[0].corners) <= 4 * MOST_TRIANGLES
    assert len(pieces[0]) == 3 * 20_480, "what is solid is that of the file"


def test_furniture_in_millimetres_is_refused(tmp_path: Path) -> None:
    trimesh.creation.box((0.006, 0.01, 0.007)).export(tmp_path / "desk.stl")
    with pytest.raises(AssetError, match=r"measures 0\.006 x 0\.01 x 0\.007 m; furniture has at least"):
        read_file(tmp_path / "desk.stl", Wish("tiny_desk", "receptacle"))


def test_an_axis_that_a_file_names_is_asked_for(tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "box.dae")
    text = (tmp_path / "box.dae").read_text()
    axis = "<up_axis>Y_UP</up_axis>"
    text = (
        re.sub("<up_axis>.*?</up_axis>", axis, text)
        if "<up_axis>" in text
        else text.replace("<asset>", "<asset>" + axis)
    )
    (tmp_path / "box.dae").write_text(text)
    with pytest.raises(AssetError, match="say which one is: --up y"):
        read_file(tmp_path / "box.dae", Wish("parcel"))
    sizes = [read_file(tmp_path / "box.dae", Wish("parcel", up=up))[0].size for up in ("y", "z")]
    np.testing.assert_allclose(sizes, [(0.1, 0.3, 0.2), (0.1, 0.2, 0.3)], atol=1e-6)


@pytest.mark.parametrize("most", [12, 40])
def test_each_colour_keeps_its_share_and_edges_stay_sharp(most: int) -> None:
    fine = trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
    corners = np.asarray(fine.triangles)
    parts = [
        ColouredTriangles((1.0, 0.0, 0.0), corners, corners),
        ColouredTriangles((0.0, 1.0, 0.0), corners + 2, corners),
    ]
    few = simplified(parts, 2 * most)
    assert [part.colour for part in few] == [part.colour for part in parts]
    for part in few:
        assert 12 <= len(part.corners) <= most
        assert (np.abs(part.normals).max(axis=2) > 0.999).all()
    assert simplified(parts, 10_000) == tuple(parts)
