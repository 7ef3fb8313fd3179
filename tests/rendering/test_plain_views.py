"""Who only asks what is visible gets views without colours, drawn in half of the time; all else of them is the same."""

from pathlib import Path

import numpy as np
import pytest

from chmarl_pb.compiled import COMPILES
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.homes.home import load_home
from chmarl_pb.rendering import home_views as module
from chmarl_pb.rendering.home_views import HomeViews
from chmarl_pb.rendering.view_store import ViewStore
from chmarl_pb.robots.file import find_model

HOME, SIZE = "home_7", 48
POSES = range(0, 60, 7)

pytestmark = pytest.mark.skipif(not COMPILES, reason="TinyRenderer draws homes, with colours")


@pytest.fixture(params=["disk", "memory"])
def store(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ViewStore | None:
    """A store of views that is empty, or none."""
    store = ViewStore(tmp_path / "views", 2**30) if request.param == "disk" else None
    monkeypatch.setattr(module, "view_store", lambda: store)
    return store


def test_plain_views_are_those_with_colours_but_for_the_colours(store: ViewStore | None) -> None:
    home, robot = load_home(HOME), find_model("humanoid")
    plain, coloured = HomeViews(home), HomeViews(home)
    for pose in POSES:
        one = plain.look(robot, pose, SIZE, colours=False).picture
        other = coloured.look(robot, pose, SIZE).picture
        assert one.colour.size == 0 and other.colour.size == SIZE * SIZE
        assert np.array_equal(one.depth, other.depth) and np.array_equal(one.segmentation, other.segmentation)
        assert one.segmentation.dtype == other.segmentation.dtype and not one.depth.flags.writeable


def test_they_come_back_from_disk(store: ViewStore | None) -> None:
    home, robot = load_home(HOME), find_model("humanoid")
    before = [HomeViews(home).look(robot, pose, SIZE, colours=False).picture for pose in POSES]
    if store is None:
        return
    again = HomeViews(home)
    again._model_is_known = True  # and no model: nothing can be drawn
    after = [again.look(robot, pose, SIZE, colours=False).picture for pose in POSES]
    for one, other in zip(before, after, strict=True):
        assert np.array_equal(one.depth, other.depth) and np.array_equal(one.segmentation, other.segmentation)


def test_once_somebody_wants_colours_all_have_them(store: ViewStore | None) -> None:
    home, robot = load_home(HOME), find_model("humanoid")
    views = HomeViews(home)
    assert views.look(robot, 0, SIZE, colours=False).picture.colour.size == 0
    assert views.look(robot, 1, SIZE).picture.colour.size > 0
    for pose in POSES:
        assert views.look(robot, pose, SIZE, colours=False).picture.colour.size > 0
    another = HomeViews(home)  # as of the next process: those with colours are on disk
    assert (another.look(robot, 2, SIZE, colours=False).picture.colour.size > 0) == (store is not None)


def test_a_robot_that_observes_graphs_can_still_be_shown_in_colours(store: ViewStore | None) -> None:
    graphs = HouseholdEnv("scene_graph", home=HOME, render_mode="rgb_array")
    pictures = HouseholdEnv("visual", home=HOME)
    try:
        for env in (graphs, pictures):
            env.reset(seed=3)
        seen = graphs.simulation.renderer.visible("humanoid")
        shown = graphs.simulation.renderer.image("humanoid", 128)
        assert np.array_equal(shown, pictures.simulation.renderer.image("humanoid", 128)) and shown.std() > 0
        assert graphs.simulation.renderer.visible("humanoid") == seen
    finally:
        graphs.close()
        pictures.close()
