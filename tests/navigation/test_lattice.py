"""Where robots can be: on free floor, connected, the same however the home is turned and moved."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.homes.solids import inside, segments_hit
from chmarl_pb.navigation.lattice import (
    DRONE_CELLS,
    DRONE_SPACING,
    FOOTPRINT,
    FORWARD,
    FORWARD_CELLS,
    HEADINGS,
    SPACING,
    Lattice,
    build_drone_lattice,
    build_lattice,
)
from chmarl_pb.tasks.simulation import Simulation

_HAIR = 1e-5  # metres


def drives_into(home: Home, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return which straight drives come nearer to any solid than the footprint's radius."""
    hit = np.zeros(len(starts), dtype=bool)
    for solid in home.solids:
        if solid.spans(FOOTPRINT.low, FOOTPRINT.high):
            low, high = solid.low - FOOTPRINT.radius, solid.high + FOOTPRINT.radius
            near = ((np.minimum(starts, ends) < high) & (np.maximum(starts, ends) > low)).all(axis=1)
            hit[near] |= segments_hit(solid.polygon, starts[near], ends[near], FOOTPRINT.radius - _HAIR)
    return hit


def test_positions_lie_on_the_grid_and_in_their_rooms(simulation: Simulation) -> None:
    for lattice, spacing in ((simulation.space.lattice, SPACING), (simulation.space.drone_lattice, DRONE_SPACING)):
        np.testing.assert_allclose(lattice.points / spacing, np.round(lattice.points / spacing), atol=1e-9)
        for number, room in enumerate(simulation.home.rooms.values()):
            points = lattice.points[lattice.rooms == number]
            assert np.logical_or.reduce([inside(floor, points) for floor in room.floors]).all()
        assert set(lattice.rooms) == set(range(len(simulation.home.rooms)))


def test_positions_keep_their_distance(simulation: Simulation) -> None:
    points = simulation.space.lattice.points
    assert not drives_into(simulation.home, points, points).any()


def test_forward_moves_stay_free_and_no_free_one_is_missing(simulation: Simulation) -> None:
    lattice = simulation.space.lattice
    index = {tuple(cell): n for n, cell in enumerate(np.round(lattice.points / SPACING).astype(int).tolist())}
    for heading in range(HEADINGS):
        ends = np.round(lattice.points / SPACING).astype(int) + FORWARD_CELLS[heading]
        expected = np.array([index.get(tuple(cell), -1) for cell in ends.tolist()])
        there = expected >= 0
        blocked = drives_into(simulation.home, lattice.points[there], lattice.points[expected[there]])
        expected[np.flatnonzero(there)[blocked]] = -1
        np.testing.assert_array_equal(lattice.forward[:, heading], expected)


def test_forward_cells_go_half_a_metre_along_the_heading() -> None:
    for heading, cells in enumerate(FORWARD_CELLS):
        angle = heading * np.pi / 6
        wanted = FORWARD * np.array([np.cos(angle), np.sin(angle)])
        assert np.abs(cells * SPACING - wanted).max() <= SPACING / 2
        np.testing.assert_array_equal(FORWARD_CELLS[(heading + 6) % HEADINGS], -cells)


def test_roads_are_symmetric_short_free_and_connected(simulation: Simulation) -> None:
    lattice = simulation.space.lattice
    roads = lattice.roads.toarray()
    np.testing.assert_array_equal(roads, roads.T)
    starts, ends = np.nonzero(roads)
    lengths = np.linalg.norm(lattice.points[ends] - lattice.points[starts], axis=1)
    np.testing.assert_allclose(roads[starts, ends], lengths)
    assert lengths.max() < 1.5 * SPACING
    assert not drives_into(simulation.home, lattice.points[starts], lattice.points[ends]).any()
    assert all(np.isfinite(lattice.distance(n, 0)) for n in range(len(lattice.points)))


def test_anchors_stand_in_their_rooms(simulation: Simulation) -> None:
    rooms = list(simulation.home.rooms)
    lattice, above = simulation.space.lattice, simulation.space.drone_lattice
    assert tuple(lattice.anchors) == tuple(above.anchors) == simulation.home.goto_rooms
    for name in simulation.home.goto_rooms:
        assert rooms[lattice.rooms[lattice.anchors[name] // HEADINGS]] == name
        assert rooms[above.rooms[above.anchors[name]]] == name


def test_anchor_is_near_the_middle_and_faces_receptacles(simulation: Simulation) -> None:
    for name, anchor in simulation.space.lattice.anchors.items():
        x, y, yaw = simulation.space.lattice.pose(anchor)
        centre = simulation.home.rooms[name].centre
        own = simulation.space.lattice.points[simulation.space.lattice.rooms == list(simulation.home.rooms).index(name)]
        assert np.hypot(*(centre - (x, y))) == pytest.approx(np.hypot(*(own - centre).T).min())
        away = [t.centre - (x, y) for t in simulation.home.receptacles.values() if t.room == name]
        if away:
            bearings = [np.arctan2(dy, dx) - yaw for dx, dy in away]
            assert any(np.cos(bearing) > np.cos(np.pi / 4) for bearing in bearings)


def test_paths_and_waypoints_stay_free(simulation: Simulation) -> None:
    lattice, rng = simulation.space.lattice, np.random.default_rng(0)
    for start, goal in rng.integers(len(lattice.points), size=(8, 2)).tolist():
        path = lattice.path(start, goal)
        assert (path[0], path[-1]) == (start, goal)
        steps = lattice.points[path]
        assert np.linalg.norm(np.diff(steps, axis=0), axis=1).sum() == pytest.approx(lattice.distance(start, goal))
        corners = lattice.waypoints(tuple(path))
        np.testing.assert_array_equal(corners[[0, -1]], lattice.points[[start, goal]])
        assert not drives_into(simulation.home, corners[:-1], corners[1:]).any()
        assert len(corners) <= len(path)


def test_moves_table_agrees_with_the_humanoid(simulation: Simulation) -> None:
    humanoid, rng = simulation.oracle.robot, np.random.default_rng(1)
    moving = [name for name in humanoid.actions if name not in ("pick", "place", "stay")]
    for pose in rng.integers(len(humanoid.lattice.moves), size=100).tolist():
        humanoid.spawn(pose)
        for number, action in enumerate(moving):
            motion = humanoid.plan(action)
            assert humanoid.lattice.moves[pose, number] == (-1 if motion is None else motion.pose)


def test_drone_stays_inside_and_comes_back(simulation: Simulation) -> None:
    lattice = simulation.space.drone_lattice
    low, high = simulation.home.bounds
    assert (lattice.points >= low - 1e-9).all() and (lattice.points <= high + 1e-9).all()
    back = [1, 0, 3, 2]
    for kind, cells in enumerate(DRONE_CELLS):
        starts = np.flatnonzero(lattice.neighbours[:, kind] >= 0)
        ends = lattice.neighbours[starts, kind]
        np.testing.assert_allclose(lattice.points[ends] - lattice.points[starts], np.tile(cells * 0.5, (len(ends), 1)))
        np.testing.assert_array_equal(lattice.neighbours[ends, back[kind]], starts)


def moved_home(source: Path, folder: Path, turn: int, shift: tuple[float, float]) -> Home:
    """Return a home of which every joint to the world is turned by quarters and then shifted."""
    model = load_home(source)
    angle = turn * np.pi / 2
    text = source.read_text()
    root = text[text.index("<link name=") :].split('"')[1]
    joint = (
        f'<link name="moved"/><joint name="moved" type="fixed"><parent link="moved"/><child link="{root}"/>'
        f'<origin xyz="{shift[0]} {shift[1]} 0" rpy="0 0 {angle!r}"/></joint>\n'
    )
    path = folder / f"{model.name}_{turn}.urdf"
    path.write_text(text.replace("</robot>", f"{joint}</robot>"))
    if not (folder / "meshes").exists():
        (folder / "meshes").mkdir()
        for mesh in (source.parent / "meshes").iterdir():
            (folder / "meshes" / mesh.name).write_bytes(mesh.read_bytes())
    return load_home(path)


@pytest.mark.parametrize(("turn", "shift"), [(0, (1.25, -0.75)), (1, (0.0, 0.0)), (2, (-3.0, 2.25)), (3, (0.25, 4.0))])
def test_a_moved_home_has_the_moved_lattice(
    tmp_path: Path, simulation_of: Callable[[str], Simulation], turn: int, shift: tuple[float, float]
) -> None:
    simulation = simulation_of("home_1")
    home = moved_home(simulation.home.path, tmp_path, turn, shift)
    old, new = simulation.space.lattice, build_lattice(home)
    angle = turn * np.pi / 2
    rotation = np.round([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    number = numbers_after(old, new, rotation, np.array(shift))
    quarter = np.roll(np.arange(HEADINGS), -3 * turn)
    for heading in range(HEADINGS):
        there = old.forward[:, heading]
        moved = np.where(there < 0, -1, number[there])
        np.testing.assert_array_equal(new.forward[number, quarter[heading]], moved)
    np.testing.assert_allclose(new.roads.toarray()[np.ix_(number, number)], old.roads.toarray())
    np.testing.assert_array_equal(new.rooms[number], old.rooms)
    if not np.mod(shift, DRONE_SPACING).any():
        assert len(build_drone_lattice(home).points) == len(simulation.space.drone_lattice.points)


def numbers_after(old: Lattice, new: Lattice, rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Return the new number of each old position, and check that there are no others."""
    cells = np.round((old.points @ rotation.T + shift) / SPACING).astype(int)
    index = {tuple(cell): n for n, cell in enumerate(np.round(new.points / SPACING).astype(int).tolist())}
    assert set(index) == {tuple(cell) for cell in cells.tolist()}
    return np.array([index[tuple(cell)] for cell in cells.tolist()])
