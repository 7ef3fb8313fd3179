"""Geometry of convex solids against brute force: dense sampling instead of algebra."""

from random import Random

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from chmarl_pb.homes.solids import Outlines, inside, segments_hit, solid_from_vertices

coordinate = st.floats(-3, 3, allow_nan=False)
point = st.tuples(coordinate, coordinate)
SAMPLES = np.linspace(0, 1, 2001)[:, None]
RESOLUTION = 0.01  # metres: sampling cannot decide nearer cases


@st.composite
def polygons(draw: st.DrawFn) -> np.ndarray:
    """A convex polygon: points on an ellipse, counter-clockwise."""
    count = draw(st.integers(3, 9))
    gaps = np.array(draw(st.lists(st.floats(0.3, 1.0), min_size=count, max_size=count)))
    angles = np.cumsum(gaps) / gaps.sum() * 2 * np.pi
    radii = draw(st.floats(0.2, 1.5)), draw(st.floats(0.2, 1.5))
    return np.column_stack([radii[0] * np.cos(angles), radii[1] * np.sin(angles)]) + draw(point)


def depth_in(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how deep points lie in a polygon (metres, negative outside), edge by edge."""
    following = np.roll(polygon, -1, axis=0)
    depths = []
    for a, b in zip(polygon, following, strict=True):
        left = np.array([-(b - a)[1], (b - a)[0]]) / np.linalg.norm(b - a)
        depths.append((points - a) @ left)
    nearest: np.ndarray = np.min(depths, axis=0)
    return nearest


def distance_to(polygon: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the distance of points to a filled polygon, by sampling its outline."""
    outline = np.concatenate(
        [a + np.linspace(0, 1, 200)[:, None] * (b - a) for a, b in zip(polygon, np.roll(polygon, -1, 0), strict=True)]
    )
    far = np.linalg.norm(points[:, None] - outline, axis=-1).min(axis=1)
    return np.where(depth_in(polygon, points) >= 0, 0.0, far)


@given(polygons(), point)
def test_inside(polygon: np.ndarray, where: tuple[float, float]) -> None:
    depth = depth_in(polygon, np.array([where]))[0]
    assume(abs(depth) > 1e-6)
    assert inside(polygon, np.array(where)) == (depth > 0)


@given(polygons(), point, st.floats(0, 0.5))
def test_inside_with_a_margin_widens_every_edge(polygon: np.ndarray, where: tuple[float, float], margin: float) -> None:
    depth = depth_in(polygon, np.array([where]))[0]
    assume(abs(depth + margin) > 1e-6)
    assert inside(polygon, np.array(where), margin) == (depth > -margin)


@given(st.lists(polygons(), min_size=1, max_size=4), point, point)
def test_crossed(shapes: list[np.ndarray], start: tuple[float, float], end: tuple[float, float]) -> None:
    along = np.array(start) + SAMPLES * np.subtract(end, start)
    depths = np.array([depth_in(shape, along).max() for shape in shapes])
    assume((np.abs(depths) > RESOLUTION).all())
    found = Outlines(shapes).crossed(np.array([start]), np.array([end]))
    assert found.tolist() == [(depths > 0).tolist()]


@given(polygons(), point)
def test_a_segment_without_length_crosses_what_it_lies_in(polygon: np.ndarray, where: tuple[float, float]) -> None:
    depth = depth_in(polygon, np.array([where]))[0]
    assume(abs(depth) > 1e-6)
    assert Outlines([polygon]).crossed(np.array([where]), np.array([where]))[0, 0] == (depth > 0)


def test_no_outlines_are_never_crossed() -> None:
    assert Outlines([]).crossed(np.zeros((3, 2)), np.ones((3, 2))).shape == (3, 0)


@settings(max_examples=60)
@given(polygons(), point, point, st.floats(0.05, 0.6))
def test_segments_hit(polygon: np.ndarray, start: tuple[float, float], end: tuple[float, float], radius: float) -> None:
    along = np.array(start) + np.linspace(0, 1, 400)[:, None] * np.subtract(end, start)
    nearest = distance_to(polygon, along).min()
    assume(abs(nearest - radius) > 0.02)
    assert segments_hit(polygon, np.array([start]), np.array([end]), radius)[0] == (nearest < radius)


@given(polygons(), st.floats(-1, 1), st.floats(0.05, 2), st.randoms(use_true_random=False))
def test_prism(polygon: np.ndarray, bottom: float, height: float, random: Random) -> None:
    corners = [(*corner, z) for corner in polygon.tolist() for z in (bottom, bottom + height)]
    random.shuffle(corners)
    solid = solid_from_vertices(np.array(corners))
    assert [solid.bottom, solid.top] == pytest.approx([bottom, bottom + height])
    assert {tuple(corner) for corner in solid.polygon.round(9).tolist()} <= {
        tuple(corner) for corner in polygon.round(9).tolist()
    }
    assert solid.facet is not None
    centre = np.append(polygon.mean(axis=0), bottom + height / 2)
    assert (solid.planes[:, :3] @ centre + solid.planes[:, 3] < 0).all()
    assert solid.spans(bottom - 1, bottom + height / 2) and not solid.spans(bottom + height, bottom + height + 1)


@pytest.mark.parametrize("corners", [[(0, 0, 0)], [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]])
def test_flat_points_are_no_solid(corners: list[tuple[float, float, float]]) -> None:
    with pytest.raises(ValueError, match="no volume"):
        solid_from_vertices(np.array(corners, dtype=float))


def test_wedge_has_no_level_top() -> None:
    wedge = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (0, 1, 1)]
    assert solid_from_vertices(np.array(wedge, dtype=float)).facet is None
