"""The benchmark of speed: every figure can be measured, and says what was asked."""

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from chmarl_pb.bench import figures
from chmarl_pb.bench.figures import FIGURES, Figure, chosen, measure
from chmarl_pb.bench.fresh import samples
from chmarl_pb.bench.playing import Effort, Samples, per_second, scouted_poses, tasks_to_play
from chmarl_pb.cli import main
from chmarl_pb.cli.bench import readable, run
from chmarl_pb.cli.program import parser_of
from chmarl_pb.errors import OptionError

TINY = Effort(runs=1, seconds=0.001, warm_up=5)
FEW: dict[str, tuple[object, ...]] = {
    "first_visits": (64, 2),
    "memory": ("scene_graph", 1),
    "loads": (1,),
    "new_homes": (1, 1),
}  # arguments that ask for little
SLOW = (
    "URDF files", "first reset of a home, filled", "memory of one more environment, visual",
    "vector environment,", "vector beside AsyncVectorEnv,", "execution", "a new home",
)  # fmt: skip


@pytest.mark.parametrize(
    "figure",
    [
        pytest.param(figure, id=figure.name, marks=[pytest.mark.slow] * figure.name.startswith(SLOW))
        for figure in FIGURES
    ],
)
def test_figure_is_measured(figure: Figure, monkeypatch: pytest.MonkeyPatch) -> None:

    def few(name: str, *rest: object, keep: bool) -> Iterator[dict[str, float]]:
        return samples(name, *FEW.get(name, rest), keep=keep)

    monkeypatch.setattr(figures, "samples", few)
    rows = list(measure(figure, TINY))
    assert rows
    for row in rows:
        assert row.name == figure.name
        assert math.isfinite(row.median)
        assert row.least == row.median == row.greatest
        assert row.median == 0 if row.unit == "files" else row.median > 0 or row.unit in ("MB", "collisions")


def test_figures_are_chosen_by_part_of_their_name() -> None:
    assert len(chosen(())) == len(FIGURES)
    assert [figure.name for figure in chosen(("RESET", "planner"))] == [
        figure.name for figure in FIGURES if "reset" in figure.name or "planner" in figure.name
    ]


def test_median_and_extremes() -> None:
    def stream(effort: Effort) -> Samples:
        yield from ({"ms": value} for value in (5.0, 1.0, 3.0, 99.0))

    (row,) = measure(Figure("f", stream), Effort(runs=3))
    assert (row.median, row.least, row.greatest) == (3.0, 1.0, 5.0)


def test_streams_are_closed() -> None:
    closed = []

    def stream(effort: Effort) -> Samples:
        try:
            while True:
                yield {"ms": 1.0}
        finally:
            closed.append(True)

    list(measure(Figure("f", stream), Effort(runs=2)))
    assert closed


def test_rate_counts_all_work() -> None:
    done = []
    rate = per_second(lambda: done.append(1), 0.01, count=4)
    assert 0 < rate <= 4 * len(done) / 0.01


def test_scouted_poses_are_poses_of_the_robots() -> None:
    assert {robot for robot, _ in scouted_poses(5)} == {"humanoid", "drone"}


def test_tasks_of_training_are_new_after_the_warm_up_and_those_of_tests_are_few() -> None:
    few, others = tasks_to_play("train")
    assert len(others) > 900 and not {task.id for task in few} & {task.id for task in others}
    assert len({task.home for task in (*few, *others)}) == 1
    assert tasks_to_play("test-unseen")[0] == tasks_to_play("test-unseen")[1] and len(others) > 50


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (12.0, "12"), (1234.56, "1,235"), (99.95, "100"), (1.234, "1.23"), (0.2004, "0.2"), (math.nan, "nan")],
)
def test_readable(value: float, text: str) -> None:
    assert readable(value) == text


@pytest.fixture
def one_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    def stream(effort: Effort) -> Samples:
        while True:
            yield {"ms": 2.0}

    monkeypatch.setattr(figures, "FIGURES", (Figure("steady", stream),))


@pytest.mark.usefixtures("one_figure")
def test_command_writes_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--only", "stead", "--runs", "2", "--json", str(tmp_path / "bench.json")]) == 0
    content = json.loads((tmp_path / "bench.json").read_text())
    assert content["figures"] == [{"name": "steady", "unit": "ms", "median": 2.0, "least": 2.0, "greatest": 2.0}]
    assert "steady" in capsys.readouterr().out


def asked(*words: str) -> argparse.Namespace:
    return parser_of(["bench"]).parse_args(["bench", *words])


def test_interruption_keeps_what_was_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def quick(effort: Effort) -> Samples:
        yield {"ms": 1.0}

    def interrupted(effort: Effort) -> Samples:
        yield {"ms": 1.0}
        raise KeyboardInterrupt

    monkeypatch.setattr(figures, "FIGURES", (Figure("quick", quick), Figure("stopped", interrupted)))
    out = tmp_path / "bench.json"
    with pytest.raises(KeyboardInterrupt):
        run(asked("--json", str(out), "--runs", "2"))
    assert [row["name"] for row in json.loads(out.read_text())["figures"]] == ["quick"]


@pytest.mark.usefixtures("one_figure")
def test_unknown_names_and_no_runs_are_refused() -> None:
    with pytest.raises(OptionError, match="steady"):
        run(asked("--only", "nonsense"))
    with pytest.raises(OptionError, match="runs"):
        run(asked("--runs", "0"))
