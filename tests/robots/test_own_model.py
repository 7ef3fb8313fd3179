"""Robots that a user makes in Python: what robot files refuse is refused here, too."""

from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import chmarl_pb
from chmarl_pb.errors import AssetError
from chmarl_pb.evaluation.provenance import robots_hash
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.mobile import MobileRobot

DRONE, HUMANOID = find_model("drone"), find_model("humanoid")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"class_name": "rover"}, "class_name='rover'; use one of: humanoid, drone"),
        ({"speed": -1.0}, "speed=-1.0; use a number from 0.05 to 10"),
        ({"turn_speed": float("nan")}, "turn_speed=nan; use a number"),
        ({"camera": replace(DRONE.camera, fov=400.0)}, "camera.fov=400.0; use a number from 10 to 150"),
        ({"make": "Slow"}, "make='Slow' is no function"),
    ],
)
def test_what_no_robot_can_be_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(AssetError, match=words):
        replace(DRONE, **change)


def test_a_path_may_be_a_text() -> None:
    model = replace(DRONE, name="plain", urdf=str(DRONE.urdf))  # type: ignore[arg-type]
    assert model.urdf == Path(DRONE.urdf)
    with closing(chmarl_pb.parallel_env(robots=(HUMANOID, model))) as env:
        assert env.possible_agents == ["humanoid", "plain"]


class Duck:
    """No robot."""

    def __init__(self, *arguments: Any):
        self.lattice = None


def test_what_is_no_robot_is_refused() -> None:
    duck = replace(DRONE, name="duck", make=Duck)
    with (
        pytest.raises(AssetError, match="make gives a Duck without actions, plan"),
        closing(chmarl_pb.parallel_env(robots=(HUMANOID, duck))) as env,
    ):
        env.reset(seed=0)


class Cautious(MobileRobot):
    """A robot with a number of its own."""

    def __init__(self, *arguments: Any, care: float = 1.0):
        super().__init__(*arguments)
        self.care = care


def test_robots_that_are_made_otherwise_have_other_hashes() -> None:
    makes = [None, Cautious, partial(Cautious, care=0.5), partial(Cautious, care=0.7)]
    hashes = [robots_hash([replace(DRONE, make=make)])["drone"] for make in makes]
    assert len(set(hashes)) == len(makes)
    assert robots_hash([replace(DRONE, make=partial(Cautious, care=0.5))])["drone"] == hashes[2]
