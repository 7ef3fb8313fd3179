"""The finished examples among the layouts: good homes of all four kinds of rooms, in which tasks can be solved."""

from pathlib import Path

import pytest

from chmarl_pb.catalog import ROOM_KINDS, room_kind
from chmarl_pb.cli import main
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.homes.assemble import build_home
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.layout import STYLES

EXAMPLES = [name for name in STYLES if name != "starter"]


@pytest.fixture(params=EXAMPLES)
def example(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    layout = tmp_path / "own.toml"
    assert main(["homes", "new", str(layout), "--style", request.param]) == 0
    return build_home(layout)


def test_there_are_three_examples() -> None:
    assert EXAMPLES == ["loft", "studio", "townhouse"]


def test_an_example_is_a_good_and_varied_home(example: Path) -> None:
    assert main(["homes", "check", str(example)]) == 0
    home = load_home(example)
    assert {room_kind(room) for room in home.rooms} >= set(ROOM_KINDS)
    assert len({thing.class_name for thing in home.receptacles.values()}) >= 10
    assert len(home.things) <= 62  # room for a team of four


@pytest.mark.slow
def test_the_planner_solves_tasks_of_an_example(example: Path) -> None:
    report = evaluate("planner", seeds=[0], workers=1, tasks=draw_tasks(str(example), 20))
    assert (report.success_rate, report.plw) == (1.0, 1.0)
