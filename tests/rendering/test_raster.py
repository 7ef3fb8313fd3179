"""The rasteriser, triangle by triangle: which pixels are covered and at which depth, worked out again by casting rays.

A failure names the first pixel that is wrong and says what it should show.
"""

from random import Random

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from chmarl_pb.rendering.bounds import TILE, Sight, extent, farthest, may_show
from chmarl_pb.rendering.canvas import Canvas, clean_canvas, pack
from chmarl_pb.rendering.placing import Models, Stage, lens_of, put
from chmarl_pb.rendering.raster import draw, paint
from chmarl_pb.rendering.shading import Light
from chmarl_pb.rendering.triangles import Lens, depth_of
from chmarl_pb.rendering.visible_pixels import count, count_pixels

SIZE, NEAR, FAR = 32, 0.1, 10.0
UPRIGHT = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]  # position and quaternion of the frame of the world

Corners = list[tuple[float, float, float]]

#: Triangles, counter-clockwise as the camera sees them; it stands at the origin and looks along -z, 90 degrees wide.
TRIANGLES: dict[str, Corners] = {
    "in the middle": [(-1.0, -1.0, -2.0), (1.1, -0.9, -2.0), (0.1, 1.2, -2.0)],
    "slanted": [(-1.0, -1.0, -1.5), (1.3, -0.7, -4.0), (0.1, 1.2, -2.5)],
    "over the left and the upper edge": [(-3.1, -0.3, -2.0), (0.3, 0.4, -2.0), (-0.7, 3.3, -2.0)],
    "over all edges": [(-9.0, -9.1, -3.0), (9.2, -9.0, -3.0), (0.1, 9.3, -3.0)],
    "one corner behind the camera": [(-1.0, -1.0, -3.0), (1.0, -1.0, -3.0), (0.1, 1.1, 1.0)],
    "two corners behind the camera": [(-1.1, -0.5, 1.0), (1.0, -0.6, 1.0), (0.05, -0.3, -3.0)],
    "nearer than the near plane in part": [(-0.2, -0.1, -0.3), (0.21, -0.1, -0.3), (0.01, 0.04, -0.05)],
    "beyond the far plane in part": [(-8.0, -3.0, -4.0), (8.1, -3.0, -4.0), (0.2, 9.1, -16.0)],
    "smaller than a pixel": [(0.02, 0.02, -2.0), (0.05, 0.02, -2.0), (0.03, 0.05, -2.0)],
}


def camera() -> Lens:
    """The camera at the origin that looks along -z, with a field of view of 90 degrees."""
    projection = np.zeros((4, 4), np.float32)
    projection[0, 0] = projection[1, 1] = 1.0
    projection[2, 2:] = -(FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
    projection[3, 2] = -1.0
    return lens_of(np.eye(4, dtype=np.float32), projection)


def scene(*triangles: Corners) -> Stage:
    """Bodies of one triangle each, where their corners are."""
    n = len(triangles)
    steps = np.arange(n + 1, dtype=np.int32)
    corners = np.array([[3 * i, 3 * i + 1, 3 * i + 2, i, i, i] for i in range(n)], np.int32)
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (n, 1))
    colour = np.tile(np.array([200, 100, 50], np.uint8), (n, 1))
    vertices = np.array(triangles, np.float32).reshape(-1, 3)
    models = Models(steps, steps[:-1], steps, 3 * steps, colour, vertices, normals, corners, steps[:-1], steps[:-1])
    stage = Stage(models, n)
    for body in range(n):
        put(body, body, np.array([UPRIGHT]), stage.words)
    return stage


def drawn(*triangles: Corners, home: NDArray[np.float32] | None = None) -> Canvas:
    """A canvas on which triangles are drawn, one after the other."""
    canvas = clean_canvas(SIZE)
    draw_on(canvas, scene(*triangles), list(range(len(triangles))), home)
    return canvas


def draw_on(canvas: Canvas, stage: Stage, bodies: list[int], home: NDArray[np.float32] | None = None) -> None:
    """Draw bodies before a home, or before nothing."""
    depth = np.ones((SIZE, SIZE), np.float32) if home is None else home
    scratch = np.empty((len(stage.models.vertices), 6), np.float32)
    draw(np.array(bodies), stage.models, stage.placed, camera(), depth, farthest(depth), canvas, scratch)


def buffer_depth(distance: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """The depth in [0, 1] of what is at a distance along the camera's axis, metres."""
    distance = np.asarray(distance)
    return FAR * (distance - NEAR) / ((FAR - NEAR) * distance)


def cast(triangle: Corners) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Distance at which the ray through each pixel meets a triangle (else NaN), and where rounding decides about it."""
    a, b, c = np.array(triangle)
    steps = (np.arange(SIZE) - SIZE / 2) / (SIZE / 2)
    x, y = np.meshgrid(steps, ((SIZE - 1 - np.arange(SIZE)) - SIZE / 2) / (SIZE / 2))
    rays = np.stack([x, y, -np.ones_like(x)], axis=-1)
    # ray * distance = a + u * (b - a) + v * (c - a)
    matrix = np.stack([rays, np.broadcast_to(a - b, rays.shape), np.broadcast_to(a - c, rays.shape)], axis=-1)
    solved = np.linalg.solve(matrix, np.broadcast_to(a[:, None], (*rays.shape, 1)))[..., 0]
    distance, u, v = np.moveaxis(solved, -1, 0)
    inmost = np.minimum(np.minimum(u, v), np.minimum(1 - u - v, np.minimum(distance - NEAR, FAR - distance)))
    return np.where(inmost >= 0, distance, np.nan), np.abs(inmost) < 1e-4


def check(canvas: Canvas, triangle: Corners) -> None:
    """Compare a canvas with the triangle that ray casting finds."""
    distance, unsure = cast(triangle)
    for row, column in np.argwhere(~unsure):
        hit, covered = not np.isnan(distance[row, column]), canvas.face[row, column] >= 0
        where = f"row {row}, column {column}"
        assert covered == hit, f"{where}: {'covered, but the triangle is not there' if covered else 'left out'}"
        if covered:
            depth = depth_of(canvas.raw[row, column], np.float32(NEAR), np.float32(FAR))
            assert depth == pytest.approx(buffer_depth(distance[row, column]), abs=1e-4), f"{where}: wrong depth"


@pytest.mark.parametrize("name", TRIANGLES)
def test_a_triangle_covers_the_pixels_whose_rays_meet_it_at_their_distance(name: str) -> None:
    check(drawn(TRIANGLES[name]), TRIANGLES[name])


def test_the_triangles_are_the_cases_that_their_names_say() -> None:
    covered = {name: int((~np.isnan(cast(triangle)[0])).sum()) for name, triangle in TRIANGLES.items()}
    assert covered.pop("smaller than a pixel") == 0, "a pixel's ray meets it"
    assert min(covered.values()) > 10, f"hardly a pixel is covered: {covered}"
    assert covered["over all edges"] == SIZE * SIZE, "it leaves pixels out"


def test_a_corner_of_the_picture_is_row_0_column_0_and_y_points_upwards() -> None:
    canvas = drawn([(-9.0, 0.5, -3.0), (-0.5, 0.5, -3.0), (-9.0, 30.0, -3.0)])
    assert canvas.face[0, 0] == 0, "what lies above on the left is not drawn there"
    assert (canvas.face[SIZE // 2 :] < 0).all(), "the lower half shows what lies above"
    assert (canvas.face[:, SIZE // 2 :] < 0).all(), "the right half shows what lies on the left"


def test_a_triangle_that_turns_its_back_is_not_drawn() -> None:
    assert (drawn(TRIANGLES["in the middle"][::-1]).face < 0).all(), "its back is seen"


def test_what_is_behind_the_camera_is_not_drawn() -> None:
    behind = [(x, y, 2.0) for x, y, _ in TRIANGLES["in the middle"]]
    assert (drawn(behind).face < 0).all() and (drawn(behind[::-1]).face < 0).all(), "something behind is seen"


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_of_two_triangles_is_seen_whichever_is_drawn_first(order: tuple[int, int]) -> None:
    both = [TRIANGLES["over all edges"], TRIANGLES["in the middle"]]  # at 3 and at 2 metres
    canvas = drawn(*(both[number] for number in order))
    near = ~np.isnan(cast(both[1])[0]) & ~cast(both[1])[1]
    far = np.isnan(cast(both[1])[0]) & ~cast(both[1])[1]
    assert (canvas.face[near] == order.index(1)).all(), "the farther one hides the nearer"
    assert (canvas.face[far] == order.index(0)).all(), "the farther one is missing beside the nearer"


corner = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.sampled_from((-0.2, -1.0, -2.0, -4.0)) | st.floats(-9, 0.5))
triangles = st.tuples(corner, corner, corner).map(list)


@settings(max_examples=60, deadline=None)
@example([[(0.0, -1.0, -0.2), (1.0, 0.0, -0.2), (-1.0, 1.0, 0.0)]] * 2, False, Random(0))  # a corner beside the eye
@given(st.lists(triangles, min_size=2, max_size=5), st.booleans(), st.randoms(use_true_random=False))
def test_any_order_of_drawing_shows_what_tinyrenderer_shows(shapes: list[Corners], again: bool, rng: Random) -> None:
    shapes = shapes + shapes[:1] * again  # of two in one place the later one is seen
    alone = [drawn(shape) for shape in shapes]
    face, raw = np.full((SIZE, SIZE), -1), np.full((SIZE, SIZE), -np.inf)
    for number, canvas in enumerate(alone):
        shown = (canvas.face == 0) & ~(raw.astype(np.float32) > canvas.raw)
        face[shown], raw[shown] = number, canvas.raw[shown]
    stage, canvas = scene(*shapes), clean_canvas(SIZE)
    for number in rng.sample(range(len(shapes)), len(shapes)):
        draw_on(canvas, stage, [number])
    assert (canvas.face == face).all() and (canvas.raw == raw).all()
    together = drawn(*shapes)
    assert (together.face == face).all() and (together.raw == raw).all()


@pytest.mark.parametrize(("distance", "seen"), [(1.9, False), (2.0, False), (2.1, True)])
def test_the_home_hides_what_is_not_nearer(distance: float, seen: bool) -> None:
    home = np.full((SIZE, SIZE), buffer_depth(distance), np.float32)
    if distance == 2.0:  # exactly as deep, bit by bit
        home[:] = depth_of(drawn(TRIANGLES["in the middle"]).raw.max(), np.float32(NEAR), np.float32(FAR))
    covered = int((drawn(TRIANGLES["in the middle"], home=home).face >= 0).sum())
    assert (covered > 0) == seen, f"the home at {distance} m leaves {covered} pixels of a triangle at 2 m"


def test_a_canvas_is_clean_again_after_painting_and_only_covered_pixels_change_their_colour() -> None:
    triangle = TRIANGLES["in the middle"]
    stage, sight = scene(triangle), Sight(camera(), np.ones((SIZE, SIZE), np.float32))
    canvas, colour = clean_canvas(SIZE), np.zeros((SIZE, SIZE, 3), np.uint8)
    light = Light(np.array([0, 0, 1], np.float32), np.array([0.5, 0.25, 0.0, 1.0], np.float32))
    paint(np.array([0]), stage.words, sight.words, light, pack(canvas).words, colour)
    assert (canvas.face == -1).all() and np.isneginf(canvas.raw).all(), "the canvas is not clean"
    distance, unsure = cast(triangle)
    # It faces the light: half its colour by ambient light, a quarter by diffuse.
    assert (colour[~np.isnan(distance) & ~unsure] == [150, 75, 37]).all(), "a covered pixel has another colour"
    assert (colour[np.isnan(distance) & ~unsure] == 0).all(), "a pixel that is not covered was painted"


def ball(x: float, y: float, z: float, radius: float) -> NDArray[np.float64]:
    return np.array([x, y, z, radius])


def tiles_at(depth: float) -> NDArray[np.float32]:
    tiles: NDArray[np.float32] = farthest(np.full((SIZE, SIZE), depth, np.float32))
    return tiles


@pytest.mark.parametrize("name", TRIANGLES)
def test_the_ball_around_a_body_bounds_its_pixels(name: str) -> None:
    stage = scene(TRIANGLES[name])
    left, right, top, bottom = extent(stage.placed.balls[0], camera(), tiles_at(1.0), SIZE)
    for row, column in np.argwhere(~np.isnan(cast(TRIANGLES[name])[0])):
        assert left <= column <= right and top <= row <= bottom, f"row {row}, column {column} is outside the bounds"


@pytest.mark.parametrize(
    ("where", "body", "shown"),
    [
        ("ahead", ball(0, 0, -2, 0.1), True),
        ("behind the camera", ball(0, 0, 2, 0.1), False),
        ("beyond the far plane", ball(0, 0, -10.2, 0.1), False),
        ("far to the left", ball(-4, 0, -2, 0.1), False),
        ("far above", ball(0, 4, -2, 0.1), False),
        ("around the camera", ball(0, 0, 0, 0.5), True),
        ("on the edge of the picture", ball(-2, 0, -2, 0.1), True),
    ],
)
def test_balls_in_and_out_of_view(where: str, body: NDArray[np.float64], shown: bool) -> None:
    assert may_show(body, camera(), tiles_at(1.0), SIZE) == shown, f"a ball {where}"


def test_a_ball_is_hidden_only_if_the_home_is_nearer_in_every_tile_that_it_touches() -> None:
    depth = np.full((SIZE, SIZE), buffer_depth(1.5), np.float32)
    body = ball(0, 0, -2, 0.1)
    assert not may_show(body, camera(), farthest(depth), SIZE), "it is seen through a wall at 1.5 m"
    depth[SIZE // 2, SIZE // 2] = buffer_depth(2.5)
    assert may_show(body, camera(), farthest(depth), SIZE), "a hole in the wall right before it does not help"
    depth[:] = buffer_depth(1.5)
    depth[0, 0] = 1.0
    assert not may_show(body, camera(), farthest(depth), SIZE), "a hole far beside it lets it be seen"


def test_tiles_hold_the_farthest_of_their_pixels() -> None:
    depth = np.zeros((TILE + 1, TILE + 1), np.float32)
    depth[3, 5], depth[TILE, 0] = 0.25, 0.5  # the latter in a tile that the picture cuts off
    assert farthest(depth).tolist() == [[0.25, 0.0], [0.5, 0.0]]


def counted(triangles: list[Corners], enough: int) -> NDArray[np.int64]:
    """Pixels of the home's only thing, a wall at 4 m, and of each triangle before it."""
    stage, links = scene(*triangles), np.zeros((SIZE, SIZE), np.int32)
    sight = Sight(camera(), np.full((SIZE, SIZE), buffer_depth(4.0), np.float32))
    canvas, pixels = clean_canvas(SIZE), np.zeros(1 + len(triangles), np.int64)
    count(
        np.arange(len(triangles)), 1, enough, stage.words, sight.words, links, count_pixels(links, 1),
        pack(canvas).words, pixels,
    )  # fmt: skip
    assert (canvas.face == -1).all(), "the canvas is not clean"
    return pixels


def test_pixels_of_a_body_are_taken_off_what_is_behind_it() -> None:
    triangle = TRIANGLES["in the middle"]
    covered = int((drawn(triangle).face >= 0).sum())
    assert counted([triangle], SIZE * SIZE + 1).tolist() == [SIZE * SIZE - covered, covered]


def test_pixels_of_a_body_that_another_hides_count_for_the_one_before_it() -> None:
    front, back = TRIANGLES["in the middle"], [(x, y, -3.0) for x, y, _ in TRIANGLES["in the middle"]]
    wall, first, second = counted([back, front], 4)
    assert second == (drawn(front).face >= 0).sum(), "the one in front is not seen in all its pixels"
    assert first == 0, "what is smaller, farther away and behind is seen"
    assert wall == SIZE * SIZE - second, "the wall shows where the body is"
