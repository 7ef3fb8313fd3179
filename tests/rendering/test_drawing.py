"""Stored pictures of homes are found again by a version of how homes are drawn, which must grow when they change."""

import hashlib
import platform
import sys

import numpy as np
import pytest

from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.rendering.camera import camera_of, view_matrix
from chmarl_pb.rendering.home_views import DRAWING, HomeViews
from chmarl_pb.robots.file import find_model

VIEWS = (("humanoid", 5, 48), ("humanoid", 777, 64), ("humanoid", 2001, 33), ("drone", 3, 64), ("drone", 40, 48))
#: Version of the drawing -> hash of ``VIEWS`` of two homes.
DRAWN = {1: "24c4bf4906c91bb2"}


@pytest.mark.skipif((sys.platform, platform.machine()) != ("linux", "x86_64"), reason="other machines round otherwise")
def test_homes_are_drawn_as_the_version_says() -> None:
    """If this fails, stored pictures are outdated: raise ``DRAWING`` and enter the new hash."""
    digest = hashlib.sha256()
    for name in ("home_1", "home_6"):
        home = load_home(name)
        for robot, pose, size in VIEWS:
            model = find_model(robot)
            view = view_matrix(model.eye(space_of(home), pose))
            picture = HomeViews(home).draw(camera_of(model), view, size).picture
            for array in (picture.colour, picture.depth, picture.segmentation):
                digest.update(np.ascontiguousarray(array).tobytes())
    assert digest.hexdigest()[:16] == DRAWN[DRAWING]
