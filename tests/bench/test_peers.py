"""The comparison with other simulators and the scaling curves: logic, and our own measurements with tiny counts."""

import io
import json
import math
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks import peers, scaling, tables
from benchmarks.peers import Result
from benchmarks.simulators import OURS, PEERS, Peer, Work
from chmarl_pb.bench.figures import FIGURES
from chmarl_pb.bench.playing import Effort

TINY = Effort(runs=1, seconds=0.001, warm_up=5)
TINY_OPTIONS = ["--runs", "1", "--seconds", "0.001", "--warm-up", "5", "--sizes", "32"]


def text_of(results: list[Result]) -> str:
    out = io.StringIO()
    Console(file=out, width=200).print(peers.table(results))
    return out.getvalue()


def row_of(text: str, name: str) -> str:
    (row,) = [line for line in text.splitlines() if name in line]
    return row


def test_ratio_is_to_ours_at_the_same_size() -> None:
    text = text_of(
        [
            Result(OURS, 64, (1000.0,)),
            Result(OURS, 128, (600.0, 500.0, 400.0)),
            Result("other", 128, (50.0, 40.0, 60.0)),
        ]
    )
    cells = [cell.strip() for cell in row_of(text, "other").split("│")]
    assert cells[1:-1] == ["other", "128 px", "50", "40", "60", "frames/s", "10"]


def test_no_ratio_without_ours() -> None:
    assert row_of(text_of([Result("other", None, (50.0,))]), "other").split("│")[-2].strip() == "-"


def test_skipped_simulators_say_why() -> None:
    text = text_of([Result(OURS, 64, (10.0,)), Result("other", 64, (), "not installed: pip install other")])
    assert "pip install other" in row_of(text, "not installed")


@pytest.mark.parametrize(
    ("errors", "word"),
    [
        ("Traceback\nModuleNotFoundError: No module named 'minigrid'", "pip install minigrid"),
        ("Traceback\nOSError: no EGL\n", "OSError: no EGL"),
        ("", "exit code -11"),
    ],
)
def test_reason(errors: str, word: str) -> None:
    peer = next(peer for peer in PEERS if peer.install == "minigrid")
    assert word in peers.reason(peer, -11, errors)


def test_jobs_are_symbolic_first_then_by_size() -> None:
    todo = peers.jobs((), (64, 128))
    sizes = [size for _, size in todo]
    assert sizes == sorted(sizes, key=lambda size: size or 0)
    assert {peer.name for peer, size in todo if size is None} == {peer.name for peer in PEERS if peer.symbolic}
    assert [(peer.name, size) for peer, size in peers.jobs(("MINIGRID",), (64,))] == [("Minigrid FourRooms", None)]


@pytest.mark.parametrize("size", [None, 32])
def test_ours_is_measured(size: int | None) -> None:
    rate = next(iter(PEERS[0].measure(Work(size, TINY))))
    assert math.isfinite(rate)
    assert rate > 0


def test_a_failing_simulator_is_skipped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "peers.json"
    missing = [*TINY_OPTIONS, "--only", "minigrid", "--timeout", "60", "--json", str(out)]
    assert peers.main(missing) == 0
    for result in json.loads(out.read_text()):
        assert bool(result["values"]) != bool(result["skipped"])


def test_a_slow_simulator_is_skipped() -> None:
    options = peers._options([*TINY_OPTIONS, "--timeout", "0.01"])
    assert "longer" in peers.result_of(PEERS[0], 32, options).skipped


@pytest.mark.slow
@pytest.mark.parametrize("peer", PEERS, ids=lambda peer: peer.name)
def test_every_simulator_that_is_installed_runs(peer: Peer) -> None:
    options = peers._options([*TINY_OPTIONS, "--timeout", "120"])
    result = peers.result_of(peer, 32 if peer.visual else None, options)
    if "not installed" in result.skipped:
        pytest.skip(result.skipped)
    assert not result.skipped
    assert result.median > 0


def test_home_is_a_mujoco_model() -> None:
    from xml.etree import ElementTree

    from benchmarks.home_boxes import mjcf
    from chmarl_pb.envs.parallel import HouseholdEnv

    env = HouseholdEnv(split="test-unseen")
    env.reset(seed=0)
    geoms = list(ElementTree.fromstring(mjcf(env, 90.0)).iter("geom"))
    env.close()
    solids = sum(len(thing.solids) for thing in env.simulation.home.structure + env.simulation.home.things)
    assert len(geoms) == solids + len(env.world.objects)


@pytest.mark.parametrize(
    ("panel", "value", "observation"),
    [
        ("pixels", 32, "visual"),
        pytest.param("objects", 60, "visual", marks=pytest.mark.slow),
        pytest.param("rooms", 2, "scene_graph", marks=pytest.mark.slow),
        pytest.param("environments", 2, "scene_graph", marks=pytest.mark.slow),
    ],
)
def test_point_is_measured(panel: str, value: int, observation: str) -> None:
    point = scaling.point_of(panel, value, observation, scaling._options(["--runs", "1", "--steps", "30"]))
    assert (point["panel"], point["value"], point["observation"]) == (panel, value, observation)
    assert all(rate > 0 for rate in point["steps/s"])


def test_plot_is_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    points = [
        {"panel": panel, "value": value, "observation": observation, "steps/s": [100.0, 90.0]}
        for panel, (_, values, observations, _) in scaling.PANELS.items()
        for value in values
        for observation in observations
    ]
    (tmp_path / "scaling.json").write_text(json.dumps(points))
    assert scaling.main(["--redraw", "--out", str(tmp_path / "scaling.png")]) == 0
    assert (tmp_path / "scaling.png").stat().st_size > 10_000


def test_tables_of_the_document_are_filled(tmp_path: Path) -> None:
    page = tmp_path / "performance.md"
    page.write_text("# P\n<!-- bench -->\nold\n<!-- end of bench -->\nbetween\n<!-- peers -->\n<!-- end of peers -->\n")
    row = {"name": "reset", "unit": "resets/s", "median": 500.0, "least": 400.0, "greatest": 1234.0}
    (tmp_path / "bench.json").write_text(json.dumps({"version": "1", "machine": "m", "figures": [row]}))
    entries = [
        {"name": OURS, "size": 64, "values": [1000.0], "skipped": ""},
        {"name": "slow", "size": 64, "values": [10.0, 20.0, 30.0], "skipped": ""},
        {"name": "gone", "size": 64, "values": [], "skipped": "not installed"},
    ]
    (tmp_path / "peers.json").write_text(json.dumps(entries))
    assert tables.main(["--docs", str(tmp_path)]) == 0
    assert tables.main(["--docs", str(tmp_path)]) == 0  # filling again changes nothing
    text = page.read_text()
    assert "old" not in text
    assert "between" in text
    assert text.count("| reset | 500 | 400 | 1,234 | resets/s | 300 |") == 1
    assert "| slow | 20 (50) |" in text
    assert "gone was skipped: not installed." in text


def test_goals_name_figures() -> None:
    assert {name for name, _ in tables.GOALS} <= {figure.name for figure in FIGURES}


def test_document_has_places_for_the_tables() -> None:
    text = (Path(__file__).parents[2] / "docs" / "performance.md").read_text(encoding="utf-8")
    for name in tables.TABLES:
        assert "| new |" in tables.filled(text, name, "| new |")
