"""Imported meshes are brought within the triangles of their kind."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from chmarl_pb.homes.imports import Wish, add_thing, read_file
from chmarl_pb.homes.paint import Part
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


@pytest.mark.parametrize("most", [12, 40])
def test_each_colour_keeps_its_share_and_edges_stay_sharp(most: int) -> None:
    fine = trimesh.creation.box((1, 1, 1)).subdivide().subdivide()
    corners = np.asarray(fine.triangles)
    parts = [Part((1.0, 0.0, 0.0), corners, corners), Part((0.0, 1.0, 0.0), corners + 2, corners)]
    few = simplified(parts, 2 * most)
    assert [part.colour for part in few] == [part.colour for part in parts]
    for part in few:
        assert 12 <= len(part.corners) <= most
        assert (np.abs(part.normals).max(axis=2) > 0.999).all()
    assert simplified(parts, 10_000) == tuple(parts)
