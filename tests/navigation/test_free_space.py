"""Places hold what they promise to hold, and the arm reaches them from where the robot would stand."""

from contextlib import closing

import numpy as np
import pytest

from chmarl_pb import catalog
from chmarl_pb.homes.solids import inside
from chmarl_pb.navigation.free_space import grip_point, space_of
from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.navigation.surfaces import CELL
from chmarl_pb.tasks.simulation import Simulation

SIZES = ["mug_1", "book_1", "wine_bottle_1", "cushion_1", "knife_1", "frying_pan_1"]


def corners_of(place: np.ndarray, size: tuple[float, float, float]) -> np.ndarray:
    """Return the corners (4, 2) of an object's footprint at a place."""
    x, y, _, yaw = place
    half = np.array([(sx, sy) for sx in (-0.5, 0.5) for sy in (-0.5, 0.5)]) * size[:2]
    rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    corners: np.ndarray = half @ rotation.T + (x, y)
    return corners


def samples_of(place: np.ndarray, size: tuple[float, float, float]) -> np.ndarray:
    """Return points (49, 2) all over an object's footprint at a place."""
    ticks = np.linspace(-0.5, 0.5, 7)
    half = np.array([(sx, sy) for sx in ticks for sy in ticks]) * size[:2]
    yaw = place[3]
    samples: np.ndarray = half @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) + place[:2]
    return samples


@pytest.mark.parametrize("item", SIZES)
def test_objects_fit_their_places(simulation: Simulation, item: str) -> None:
    size, rng, heights, samples = simulation.world.size(item), np.random.default_rng(0), [], []
    for name, thing in simulation.home.receptacles.items():
        places = simulation.space.places(name, size)
        for place in places[rng.permutation(len(places))[:15]]:
            tops = [solid for solid in thing.solids if abs(solid.top - place[2]) < 0.005]
            points = samples_of(place, size)
            assert np.logical_or.reduce([inside(top.polygon, points, 2e-3) for top in tops]).all(), name
            heights.append(place[2])
            samples.append(points)
    points, levels = np.stack(samples), np.array(heights)
    for solid in simulation.home.solids:
        spanned = [solid.spans(level + 0.01, level + size[2]) for level in levels]
        within = points[spanned].reshape(-1, 2)
        assert not inside(solid.polygon, within).any(), f"{item} in {solid}"


def test_places_are_fixed_and_distinct(simulation: Simulation) -> None:
    for name in simulation.home.receptacles:
        places = simulation.space.places(name, (0.1, 0.06, 0.1))
        assert places is simulation.space.places(name, (0.1, 0.06, 0.1))
        assert len(np.unique(places.round(6), axis=0)) == len(places)


def test_stand_is_within_reach_and_its_line_is_free(simulation: Simulation) -> None:
    space, rng, found = simulation.space, np.random.default_rng(1), 0
    size = (0.08, 0.08, 0.1)
    for name in simulation.home.receptacles:
        places = space.places(name, size)
        for place in places[rng.permutation(len(places))[:8]].tolist():
            grip = grip_point((place[0], place[1], place[2]), size)
            stand = space.stand(grip)
            if stand is None:
                continue
            found += 1
            x, y, yaw = space.lattice.pose(stand)
            distance, bearing = np.hypot(grip[0] - x, grip[1] - y), np.arctan2(grip[1] - y, grip[0] - x) - yaw
            assert REACH.contains(distance, grip[2], bearing)
            line = np.array([x, y]) + np.linspace(0, 1, 200)[:, None] * np.subtract(grip[:2], (x, y))
            for solid in simulation.home.solids:
                if solid.top > grip[2] + 1e-3 and solid.bottom < grip[2]:
                    assert not inside(solid.polygon, line, -1e-6).any(), f"{solid} cuts the reach to {name}"
    assert found > 30


def test_no_stand_out_of_reach(simulation: Simulation) -> None:
    x, y = simulation.space.lattice.points[0]
    assert simulation.space.stand((float(x), float(y) + 0.5, 2.0)) is None
    assert simulation.space.stand((100.0, 100.0, 1.0)) is None


def test_the_arm_reaches_every_stand(simulation: Simulation) -> None:
    """What ``stand`` promises, inverse kinematics keep."""
    rng, size = np.random.default_rng(2), (0.08, 0.08, 0.1)
    for name in rng.choice(list(simulation.home.receptacles), size=4, replace=False):
        places = simulation.space.places(str(name), size)
        for place in places[rng.permutation(len(places))[:3]].tolist():
            grip = grip_point((place[0], place[1], place[2]), size)
            stand = simulation.space.stand(grip)
            if stand is not None:
                assert stand // HEADINGS < len(simulation.space.lattice.points)
                assert simulation.oracle.robot._reach(stand, grip) is not None


def test_every_receptacle_holds_a_small_object(simulation: Simulation) -> None:
    assert all(len(simulation.space.places(name, (0.1, 0.1, 0.1))) for name in simulation.home.receptacles)


def test_every_object_fits_somewhere_within_reach(simulation: Simulation) -> None:
    for name in catalog.BENCHMARK.graspables:
        size = simulation.world.size(f"{name}_1")
        assert any(
            simulation.space.stand(grip_point((x, y, z), size)) is not None
            for receptacle in simulation.home.receptacles
            for x, y, z in simulation.space.places(receptacle, size)[:: max(1, int(1 / CELL)), :3].tolist()
        ), name


def test_one_space_for_a_home() -> None:
    with closing(Simulation("home_1")) as one, closing(Simulation("home_1")) as other:
        assert one.space is other.space is space_of(one.home)
