"""Surfaces of receptacles: level, free of what stands on or over them, within reach in height."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.solids import inside
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.navigation.surfaces import CELL, Surface, find_surfaces
from chmarl_pb.tasks.simulation import Simulation
from tests.helpers.small_homes import Boxes, Triple, home_text

FLOOR: Boxes = {"livingroom/floor_1": ((4, 4, 0.1), (0, 0, -0.05))}


def test_every_receptacle_has_a_surface(simulation: Simulation) -> None:
    assert {surface.receptacle for surface in simulation.space.surfaces} == set(simulation.home.receptacles)


def test_surfaces_are_within_reach_and_on_a_top_of_their_receptacle(simulation: Simulation) -> None:
    for surface in simulation.space.surfaces:
        assert REACH.height[0] <= surface.height <= REACH.height[1]
        solids = simulation.home.receptacles[surface.receptacle].solids
        tops = [solid for solid in solids if abs(solid.top - surface.height) < 0.005]
        free = surface.points[surface.free > 0]
        assert np.logical_or.reduce([inside(solid.polygon, free, 2e-3) for solid in tops]).all()


def test_nothing_stands_in_the_free_height(simulation: Simulation) -> None:
    for surface in simulation.space.surfaces:
        points, heights = surface.points[surface.free > 0], surface.free[surface.free > 0]
        for solid in simulation.home.solids:
            over = inside(solid.polygon, points)
            cut = (solid.top > surface.height + 0.01) & (solid.bottom < surface.height + heights - 1e-9)
            assert not (over & cut).any(), f"{surface.receptacle} at {surface.height:.2f} m"


def small_surfaces(write_home: Callable[..., Path], boxes: Boxes) -> tuple[Surface, ...]:
    return find_surfaces(load_home(write_home(home_text({**FLOOR, **boxes}))))


def test_a_plain_top_is_one_surface(write_home: Callable[..., Path]) -> None:
    (surface,) = small_surfaces(write_home, {"livingroom/desk_1": ((1.0, 0.5, 0.7), (0, 0, 0.35))})
    assert surface.height == pytest.approx(0.7) and not surface.covered
    assert surface.points.shape == (20, 10, 2) and (surface.free > 0).all()


@pytest.mark.parametrize(
    ("position", "height"),
    [((0, 0, 0.05), 0.1), ((0, 0, 1.6), 0.1)],
    ids=["too low", "too high"],
)
def test_tops_out_of_reach_are_none(write_home: Callable[..., Path], position: Triple, height: float) -> None:
    assert small_surfaces(write_home, {"livingroom/bench_1": ((1, 1, height), position)}) == ()


def test_a_narrow_top_is_none(write_home: Callable[..., Path]) -> None:
    assert small_surfaces(write_home, {"livingroom/bench_1": ((1, 0.2, 0.5), (0, 0, 0.25))}) == ()


def test_what_stands_on_it_and_hangs_over_it_takes_its_place(write_home: Callable[..., Path]) -> None:
    desk, lamp = ((2, 1, 0.7), (0, 0, 0.35)), ((0.2, 0.2, 0.4), (0.8, 0.3, 0.9))
    shelf = ((0.5, 1, 0.05), (-0.75, 0, 1.025))
    (surface,) = small_surfaces(
        write_home, {"livingroom/desk_1": desk, "livingroom/table_lamp_1": lamp, "livingroom/picture_1": shelf}
    )
    x, y = surface.points[..., 0], surface.points[..., 1]
    under_lamp = (np.abs(x - 0.8) < 0.1) & (np.abs(y - 0.3) < 0.1)
    assert (surface.free[under_lamp] == 0).all()
    np.testing.assert_allclose(surface.free[x < -0.5 - CELL], 0.3)
    assert surface.free[(np.abs(x) < 0.2)].min() == 1.0
    fits = surface.fits((0.1, 0.1, 0.4))
    assert surface.points[fits[:, 0], fits[:, 1]][:, 0].min() > -0.5
