"""The tables of the learners: their rows, their runs with fake learners, and the page."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest

from chmarl_pb.cli.idle_options import idle_in_sb3, refuse_idle
from chmarl_pb.cli.sb3 import parse as parse_sb3
from chmarl_pb.cli.train import Play
from chmarl_pb.cli.train import parse as parse_train
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.envs.tracks import GROUNDED, PAPER, TRACKS
from chmarl_pb.errors import BusyError, ChmarlError, OptionError, ResultError
from chmarl_pb.evaluation import paper
from chmarl_pb.evaluation.as_text import points
from chmarl_pb.evaluation.audit_file import published_audit
from chmarl_pb.evaluation.gain import gain
from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.executors import Local
from chmarl_pb.learning.policies.cloned import CloningConfig
from chmarl_pb.learning.runs.logger import Logger
from chmarl_pb.learning.sb3.config import Config
from training import table
from training.tables.attribution import LINES
from training.tables.cells import NOT_RUN, gained
from training.tables.curves import side_by_side
from training.tables.goals import GOALS
from training.tables.page import write_page
from training.tables.row import LIMITED, LIMITED_DATA, Row
from training.tables.rows import TABLES
from training.tables.runs import FORMAT, Run, curve, read_records
from training.tables.schedule import Launch, Schedule

#: Stands for the trainer and for the evaluation: both write what the real ones write. The trainer counts its starts,
#: does four epochs, keeps each, and stops hard after STOP of them, or waits for a signal after HANG.
FAKE = """
import json, os, sys, time
from pathlib import Path
from types import SimpleNamespace
module, arguments = sys.argv[1], sys.argv[2:]
folder = Path(arguments[arguments.index("--out") + 1])
def figure(mean): return {"mean": mean, "deviation": None, "low": None, "high": None}
if module == "training.score":
    summary, ends = {"success_rate": figure(0.5), "plw": figure(0.25)}, {"0.0": 1, "4.0": 1, "10.0": 2}
    splits = {s: {"tasks": 4, "tasks_sha256": TASKS[s], "summary": summary, "ends": ends} for s in TASKS}
    (folder / "scores.json").write_text(json.dumps({
        "checkpoint": {"config": {"episodes": 4, "seed": 0}, "sha256": "0"},
        "evaluation": {"source_sha256": "f" * 64, "options": OPTIONS, "splits": splits}}))
    raise SystemExit
with (folder / "starts").open("a") as file: file.write("x")
if "--fail" in arguments: raise SystemExit("error: no luck")
rows = folder / "metrics.jsonl"
done = len(rows.read_text().splitlines()) if rows.exists() else 0
for epoch in range(done + 1, 5):
    with rows.open("a") as file:
        row = {"episodes": epoch, "train": {"success": epoch / 4}, "validation": {"score": 0.1 * epoch}}
        file.write(json.dumps(row) + chr(10))
    (folder / "best.pt").write_text("weights")
    if epoch == int(os.environ.get("STOP", 0)): os._exit(9)
    if epoch == int(os.environ.get("HANG", 0)): time.sleep(60)
"""


@pytest.fixture
def launch(tmp_path: Path) -> Launch:
    script = tmp_path / "fake.py"
    audit = published_audit(SPLITS[-1])
    assert audit is not None
    tasks = dict.fromkeys(SPLITS, audit.settings["tasks_sha256"])
    script.write_text(f"TASKS = {tasks}\nOPTIONS = {audit.settings['options']}\n{FAKE}")
    return lambda command: [sys.executable, str(script), *command]


def row_of(name: str, table_name: str = "scene-graph") -> Row:
    return next(row for row in TABLES[table_name] if row.name == name)


def run_of(tmp_path: Path, name: str = "QMIX", seed: int = 0, table_name: str = "scene-graph", **changes: Any) -> Run:
    folders = (tmp_path / "out", tmp_path / "results", tmp_path / "data")
    return Run(replace(row_of(name, table_name), **changes), seed, *folders)


def work(runs: list[Run], launch: Launch, **options: Any) -> Schedule:
    schedule = Schedule(runs, launch=launch, **options)
    schedule.work()
    return schedule


# Rows


@pytest.mark.parametrize(
    ("name", "published"), [("scene-graph", paper.SCENE_GRAPH), ("visual", paper.VISUAL), ("feedback", paper.FEEDBACK)]
)
def test_each_row_of_the_paper_is_there_once(name: str, published: paper.PaperTable) -> None:
    ours = [row.published for row in TABLES[name]]
    assert [ours.count(row) for row in published.rows] == [1] * len(published.rows)


def test_rows_say_what_their_names_say() -> None:
    for row in {row for rows in TABLES.values() for row in rows if row.published}:
        assert row.messages == row.name.endswith("+ messages")
        assert row.published is not None
        assert (row.observation, row.feedback) == (row.published.observation, row.published.feedback)
        assert row.options[1] == row.name.split()[0].lower()
        assert ("--centralized" in row.options) == ("BC centralized" in row.name)


@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_messages_and_feedback_come_in_all_combinations(observation: str) -> None:
    rows = [row for row in TABLES["feedback"] if row.observation == observation and "QMIX" in row.name]
    assert {(row.messages, row.feedback) for row in rows} == {(a, b) for a in (True, False) for b in (True, False)}
    assert {row.options for row in rows} == {("--algo", "qmix")}
    ours = [row for row in TABLES["feedback"] if row.observation == observation and row not in rows]
    assert [(row.messages, row.feedback) for row in ours] == [(True, True), (True, False)]
    assert len({row.options for row in ours}) == 1 and ours[0] in TABLES[observation.replace("_", "-")]


def test_names_of_runs_are_unique_and_commands_are_understood(tmp_path: Path) -> None:
    rows = {row for rows in TABLES.values() for row in rows}
    assert len({(row.table, row.slug) for row in rows}) == len(rows) >= 26
    for row in rows:
        run = Run(row, 3, tmp_path, tmp_path, tmp_path)
        arguments = run.command("train")[1:]
        if row.module == "training.train":
            command = parse_train(arguments)
            rules: Any = command.env.options if isinstance(command, Play) else command.config
            given = (rules.observation, bool(rules.messages), rules.feedback, command.config.seed, command.place.out)
            assert given == (row.observation, row.messages, row.feedback, 3, run.folder)
            assert getattr(rules, "track", PAPER) == row.track
        if row.module == "training.sb3":
            baseline = parse_sb3(arguments)
            config = baseline.config
            assert (config.observation, config.messages, config.feedback, config.seed) == (
                row.observation, row.messages, row.feedback, 3,
            )  # fmt: skip
            assert (baseline.folder, baseline.workers, config.alone) == (run.folder, 1, "humanoid only" in row.name)
            assert config.track == row.track
            if row.track != PAPER:
                assert (config.preset, config.partner) == ("encoder", "belief")
                continue
            strong = row.name.endswith("goal observed")
            # The others as the published rows were trained, beside the older drone.
            assert (config.preset, config.envs) == (("goal", 16) if strong else ("encoder", 8))
            assert config.partner == ("belief" if strong and config.alone else "search")


@pytest.mark.parametrize("table_name", ["scene-graph", "visual"])
@pytest.mark.parametrize("name", ["IQL", "VDN", "QMIX", "QTRAN"])
def test_longer_rows_have_the_settings_that_the_docs_recommend(name: str, table_name: str, tmp_path: Path) -> None:
    longer, paper = (
        run_of(tmp_path, f"{name} + messages{more}", table_name=table_name) for more in (", longer", "")
    )  # fmt: skip
    command = parse_train(longer.command("train")[1:])
    assert isinstance(command, Play) and command.config.episodes == 12_000 and command.algo == name.lower()
    paper_row = parse_train(paper.command("train")[1:])
    assert isinstance(paper_row, Play) and command.env == paper_row.env
    assert command.config.image_encoder == paper_row.config.image_encoder
    documented = next(
        line.split("#")[0].split()[3:]
        for line in (Path(__file__).parents[2] / "docs/training.md").read_text().splitlines()
        if line.startswith("python -m training.train --algo qmix --envs 16")
    )
    advised = parse_train(documented)
    assert isinstance(advised, Play)
    assert command.config == replace(advised.config, episodes=12_000) and command.config.graph_pool == "mean"


def test_clones_with_the_grounded_encoder_differ_in_the_encoder_alone(tmp_path: Path) -> None:
    for name in ("BC decentralized", "BC decentralized + messages"):
        mean, grounded = (
            parse_train(run_of(tmp_path, row).command("train")[1:]).config for row in (name, f"{name}, grounded")
        )
        assert isinstance(mean, CloningConfig)
        assert grounded == replace(
            mean, graph_pool="grounded", word_vectors=True, grounding_coef=1.0, numbers_past=True
        )


def test_clones_of_limited_layouts_differ_in_the_data_alone(tmp_path: Path) -> None:
    name = "BC decentralized + messages, grounded"
    run = run_of(tmp_path, name, table_name=LIMITED)
    uniform, limited = (
        parse_train(one.command("train")[1:]).config for one in (run_of(tmp_path, name), run)
    )  # fmt: skip
    assert isinstance(uniform, CloningConfig) and LIMITED_DATA == "train-limited"
    assert limited == replace(uniform, split="train-limited")
    score = run.command("score")
    assert score[score.index("--splits") + 1 : score.index("--out")] == list(run.row.splits)
    assert "--splits" not in run_of(tmp_path, name).command("score")


def test_runs_go_seed_by_seed_and_shared_rows_run_once() -> None:
    runs = table.make_runs(table._parser().parse_args(["--seeds", "2"]))
    assert len(runs) == len({run.name for run in runs})
    rows = [run.row for run in runs if run.seed == 0]
    assert [(run.row, run.seed) for run in runs] == [(row, seed) for seed in (0, 1) for row in rows]


def test_rows_have_their_own_number_of_seeds() -> None:
    runs = table.make_runs(table._parser().parse_args(["--table", "scene-graph", "visual", "--rows", "vdn", "ppo-*"]))
    assert [run.seed for run in runs] == sorted(run.seed for run in runs)
    for row in {run.row for run in runs}:
        seeds = [run.seed for run in runs if run.row == row]
        assert seeds == ([0, 1, 2] if row.observation == "scene_graph" else [0, 1])
    ablated = [row for row in TABLES["feedback"] if row.messages and "QMIX" in row.name]
    assert len(ablated) == len(paper.FEEDBACK.rows) and all(row.seeds == 3 for row in ablated)


def test_row_of_ones_own_is_run_and_shown_below_those_of_the_paper(
    tmp_path: Path, launch: Launch, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = Row("Best effort", "visual", ("--deep",), messages=True, module="mine.train", checkpoint="best.pt", seeds=2)
    run = replace(run_of(tmp_path), row=own)
    assert run.command("train")[:3] == ["mine.train", "--deep", "--observation"]
    assert work([run], launch).failed == []
    monkeypatch.setitem(TABLES, "visual", (*TABLES["visual"], own))
    write_page(run.results, tmp_path / "results.md")
    lines = (tmp_path / "results.md").read_text().split("## Pictures")[1].splitlines()
    rows = [line for line in lines if line.startswith("| ")]
    assert rows[len(TABLES["visual"])].startswith("| *Best effort* (ours) | 1 of 2 | ")


def test_only_takes_patterns_and_refuses_what_is_no_row() -> None:
    chosen = table._parser().parse_args(["--table", "visual", "--only", "bc-*", "qmix", "--seeds", "1"])
    assert [run.row.slug for run in table.make_runs(chosen)] == [
        "bc-decentralized", "bc-decentralized-messages", "bc-centralized", "qmix",
    ]  # fmt: skip
    chosen.only = ["sarsa"]
    with pytest.raises(OptionError, match=r"sarsa.*qmix-messages"):
        table.make_runs(chosen)


def test_tries_do_not_mix_with_results(capsys: pytest.CaptureFixture[str]) -> None:
    for where in ([], ["--results", "results"], ["--results", str(Path("results").resolve())]):
        with pytest.raises(SystemExit):
            table.main(["--only", "qmix", *where, "--", "--episodes", "5"])
        assert "--results" in capsys.readouterr().err


def test_tries_with_other_options_are_not_taken_for_those_that_are_kept(tmp_path: Path, launch: Launch) -> None:
    run = replace(run_of(tmp_path), extra=("--episodes", "8"))
    work([run], launch)
    table.check_tries([run, run_of(tmp_path, "IQL")])
    other = replace(run, extra=("--episodes", "400"))
    with pytest.raises(OptionError, match=r"qmix-seed0\.json: was made by other options .*--episodes 8 .*--results"):
        table.check_tries([other])


def test_rows_with_another_team_are_scored_with_it(tmp_path: Path) -> None:
    own = replace(row_of("QMIX"), options=("--algo", "qmix", "--robots", "humanoid,humanoid,drone"))
    score = replace(run_of(tmp_path), row=own).command("score")
    assert score[score.index("--robots") + 1] == "humanoid,humanoid,drone"
    assert "--robots" not in run_of(tmp_path).command("score")


def test_trouble_with_a_data_set_stops_the_clones_alone(
    tmp_path: Path, launch: Launch, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def prepare(recipe: Recipe, *_: object) -> None:
        raise BusyError(f"{recipe.split}: another process is writing it")

    monkeypatch.setattr(table, "_prepare_data", prepare)
    runs = [run_of(tmp_path, name) for name in ("BC decentralized", "QMIX")]
    schedule = Schedule(runs, launch=launch)
    schedule.fail(table.prepare(schedule.waiting, tmp_path / "data", Local(1)))
    schedule.work()
    assert schedule.failed == [runs[0].name] and schedule.over == 1 and runs[1].result.is_file()
    told = capsys.readouterr()
    assert f"{runs[0].name}: --data {tmp_path / 'data'}: train: another process is writing it" in told.out + told.err


# Runs


def test_runs_leave_small_files_and_are_skipped_afterwards(tmp_path: Path, launch: Launch) -> None:
    runs = [run_of(tmp_path, name, seed) for seed in (0, 1) for name in ("QMIX", "IQL + messages")]
    finished: list[str] = []
    assert work(runs, launch, finished=lambda run: finished.append(run.name)).failed == []
    assert sorted(finished) == sorted(run.name for run in runs)
    record = json.loads(runs[1].result.read_text())
    assert (
        record["format"] == FORMAT and record["name"] == "IQL + messages" and record["curve"]["success"][-1] == [4, 1]
    )
    assert record["commands"]["train"].startswith("python -m training.train --algo iql --observation scene_graph")
    assert runs[1].result.stat().st_size < 8_000
    assert work(runs, launch).over == 4
    assert (runs[0].folder / "starts").read_text() == "x"


def test_killed_training_goes_on(tmp_path: Path, launch: Launch, monkeypatch: pytest.MonkeyPatch) -> None:
    run = run_of(tmp_path)
    monkeypatch.setenv("STOP", "2")
    assert work([run], launch).failed == [run.name]
    assert not run.result.exists() and run.next_step() == "train"
    monkeypatch.delenv("STOP")
    assert work([run], launch).failed == []
    assert [x for x, _ in json.loads(run.result.read_text())["curve"]["success"]] == [1, 2, 3, 4]
    assert run.state()["seconds"]["train"] > 0


def test_versions_of_the_code_that_trained_a_run_are_kept(
    tmp_path: Path, launch: Launch, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = run_of(tmp_path)
    for version, stop in (("old", "2"), ("new", "0")):
        monkeypatch.setenv("STOP", stop)
        monkeypatch.setattr("training.tables.runs.source_hash", lambda _, version=version: version)
        work([run], launch)
    assert json.loads(run.result.read_text())["trained_by"] == ["old", "new"]


def test_interrupt_stops_the_processes_and_keeps_all(
    tmp_path: Path, launch: Launch, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = [run_of(tmp_path), run_of(tmp_path, "IQL")]
    monkeypatch.setenv("HANG", "3")
    begun = time.monotonic()

    def press() -> None:
        while not all(len(curve(run.folder / "metrics.jsonl")["success"]) == 3 for run in runs):
            time.sleep(0.02)
        os.kill(os.getpid(), signal.SIGINT)

    Thread(target=press, daemon=True).start()
    with pytest.raises(KeyboardInterrupt):
        work(runs, launch)
    assert time.monotonic() - begun < 15
    monkeypatch.delenv("HANG")
    assert work(runs, launch).over == 2


def test_run_that_is_trained_is_only_scored(tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    run.result.unlink()
    assert run.next_step() == "score"
    work([run], launch)
    assert run.result.is_file() and (run.folder / "starts").read_text() == "x"
    run.result.unlink()
    assert replace(run, row=replace(run.row, options=("--algo", "vdn"))).next_step() == "train"


def test_failed_run_tells_why_and_lets_the_others_go_on(
    tmp_path: Path, launch: Launch, capsys: pytest.CaptureFixture[str]
) -> None:
    bad, good = run_of(tmp_path, options=("--algo", "qmix", "--fail")), run_of(tmp_path, "IQL")
    assert work([bad, good], launch, jobs=1).failed == [bad.name]
    assert "no luck" in " ".join(capsys.readouterr().err.split())
    assert good.result.is_file() and not bad.result.exists()


def test_trouble_with_the_page_stops_no_run(tmp_path: Path, launch: Launch, capsys: pytest.CaptureFixture[str]) -> None:
    def fail(run: Run) -> None:
        raise ResultError("other.json: damaged")

    runs = [run_of(tmp_path), run_of(tmp_path, "IQL")]
    assert not work(runs, launch, finished=fail).failed
    assert all(run.next_step() is None for run in runs) and "other.json: damaged" in capsys.readouterr().err


def test_run_of_another_process_is_left_alone(tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path)
    lock = run.lock()
    assert work([run], launch).failed == [run.name]
    lock.close()
    assert work([run], launch).failed == []


def test_damaged_rows_and_states_are_noticed(tmp_path: Path) -> None:
    logger = Logger(tmp_path, total=3, quiet=True)
    for episodes in (8, 16, 24):
        logger.write({"episodes": episodes, "train": {"success": 0.5}})
    logger.close()
    path = tmp_path / "metrics.jsonl"
    path.write_text(path.read_text().replace("16", "17"))
    with pytest.warns(RuntimeWarning, match=r"metrics\.jsonl: 1 of 3 rows"):
        assert curve(path)["success"] == [[8, 0.5], [24, 0.5]]
    run = run_of(tmp_path)
    run.spend("train", 12.0)
    state = run.folder / "state.json"
    state.write_text(state.read_text().replace("12.0", "11.0"))
    with pytest.raises(ResultError, match=r"state\.json: damaged .*checksum"):
        run.state()
    state.write_text(json.dumps({"seconds": {"train": 3.0, "score": 0.0}, "trained": None}))  # of an earlier version
    assert run.state()["seconds"]["train"] == 3.0


SLEEPER = """
import time
print("begun", flush=True)
try:
    time.sleep(600)
except KeyboardInterrupt:
    print("saved", flush=True)
"""


def test_a_step_ends_with_the_process_that_started_it(tmp_path: Path) -> None:
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    parent = (
        "import subprocess, sys, time\n"
        "from training.tables.schedule import as_step\n"
        "subprocess.Popen(as_step(['sleeper']), stdin=subprocess.PIPE)\n"
        "time.sleep(600)"
    )
    path = os.pathsep.join([str(Path(__file__).parents[2]), str(tmp_path)])
    process = subprocess.Popen(
        [sys.executable, "-c", parent], stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path}
    )
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    process.kill()
    assert process.communicate(timeout=60)[0] == "saved\n"


def test_no_run_starts_when_the_time_is_up(tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path)
    schedule = work([run], launch, budget=0.0)
    assert schedule.waiting == [run] and not run.folder.exists()


def test_results_are_whole_or_not_there(tmp_path: Path, launch: Launch, monkeypatch: pytest.MonkeyPatch) -> None:
    run = run_of(tmp_path)
    monkeypatch.setattr(Path, "replace", lambda self, target: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(KeyboardInterrupt):
        run.spend("train", 1.0)
    monkeypatch.undo()
    assert not (run.folder / "state.json").exists()
    assert work([run], launch).failed == []
    assert list(tmp_path.rglob("*.tmp")) == []


def test_half_a_line_of_metrics_is_no_trouble(tmp_path: Path) -> None:
    metrics = tmp_path / "metrics.jsonl"
    metrics.write_text('{"epoch": 1, "humanoid_loss": 1.0, "drone_loss": 0.5, "score": 0.25}\n{"epoch": 2, "huma')
    assert curve(metrics) == {"unit": "epochs", "success": [], "loss": [[1, 1.5]], "validation": [[1, 0.25]]}


def test_metrics_of_stable_baselines3_have_curves(tmp_path: Path) -> None:
    metrics = tmp_path / "metrics.jsonl"
    rows = [{"steps": 512, "rollout/success_rate": 0.25}, {"steps": 1024, "eval/mean_reward": 0.5}]
    metrics.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    assert curve(metrics) == {"unit": "steps", "success": [[512, 0.25]], "loss": [], "validation": [[1024, 0.5]]}


def test_curves_of_trainings_are_averaged_where_they_are_alike_in_steps() -> None:
    one, other = np.array([[0, 0.0], [10, 1.0], [20, 2.0]]), np.array([[5, 1.0], [15, 3.0], [25, 5.0]])
    places, values = side_by_side([one, other])
    assert places.tolist() == [5, 10, 15, 20]
    assert values.tolist() == [[0.5, 1.0, 1.5, 2.0], [1.0, 2.0, 3.0, 4.0]]
    places, values = side_by_side([one, one])
    assert places.tolist() == [0, 10, 20] and values.tolist() == [[0.0, 1.0, 2.0]] * 2


# The page


def test_page_has_every_row_before_anything_has_run(tmp_path: Path) -> None:
    write_page(tmp_path / "results", tmp_path / "results.md")
    text = (tmp_path / "results.md").read_text()
    assert text.count(f"| {NOT_RUN} |") == len(GOALS) + len(LINES) + sum(
        len(rows) * (1 if table in TRACKS else 2) for table, rows in TABLES.items()
    )
    for published in (row.published for rows in TABLES.values() for row in rows if row.published):
        for value in (*published.success, *published.plw):
            assert f" {value:.2f} |" in text


@pytest.mark.parametrize("policy", ["open-loop", "reactive", "blind", "instruction-blind", "search"])
def test_built_in_policies_stand_below_with_the_numbers_of_the_benchmark(tmp_path: Path, policy: str) -> None:
    write_page(tmp_path / "results", tmp_path / "results.md")
    text = (tmp_path / "results.md").read_text()
    lines = [line for line in text.splitlines() if line.startswith(f"| *{policy}* |")]
    grounded = [line for line in lines if line.startswith(f"| *{policy}* | graphs |")]
    lines = [line for line in lines if line not in grounded]
    apart = [line for line in lines if ", " in line.split("|")[4]]  # for seen and for held-out wording
    papers = [name for name in TABLES if name not in (*TRACKS, LIMITED)]
    assert len(lines) == 2 * len(papers) + len(apart) and len(apart) == len(papers) - 1
    measured = Path(__file__).parents[2].joinpath("docs", "benchmark.md").read_text()
    assert apart[0].replace("*", "") in measured
    for line, title in zip(lines[:2], ("PLW", "success"), strict=True):
        known = next(
            row
            for row in measured.split("## Baselines")[1].split(f"| {title} % |")[1].splitlines()
            if row.startswith(f"| {policy} |")
        )
        theirs = [float(cell.split("±")[0]) for cell in known.split("|")[3:7]]
        ours = [float(cell) for cell in line.split("|")[5:-1:2]]
        assert ours == pytest.approx(theirs, abs=0.06)
    audited = measured.split("audit --track grounded --seeds 1\n")[-1]
    success, plw = next(row for row in audited.splitlines() if row.startswith(f"| {policy} |")).split("|")[3:6:2]
    assert [cell.strip() for cell in grounded[0].split("|")[5:7]] == [success.strip(), plw.strip()]


def test_page_shows_means_and_spread(tmp_path: Path, launch: Launch) -> None:
    runs = [run_of(tmp_path, seed=seed) for seed in (0, 1)] + [run_of(tmp_path, "QMIX", table_name="visual")]
    work(runs, launch)
    change(runs[1], plw=0.35)
    write_page(runs[0].results, tmp_path / "docs" / "results.md")
    text = (tmp_path / "docs" / "results.md").read_text()
    assert (
        "| QMIX | 2 of 3 | mean pool, 4 episodes, 0 min, feedback at test | 13.73 | 30.0 ± 7.1 | 12.84 | 30.0 ± 7.1 |"
        in text
    )
    assert "| QMIX | 1 of 2 | 4 episodes, 0 min, feedback at test | 14.09 | 25.0 |" in text
    assert (
        "**QMIX** (best on val-unseen of those with all seeds run): PLW **30.0 ± 7.1**, success" in text
    )  # without intervals
    assert "curves_scene_graph.png" in text and (tmp_path / "docs" / "curves_scene_graph.png").stat().st_size > 10_000
    assert "4 episodes" in text
    assert "| QMIX | 25 | 0 | 25 | 50 |" in text
    qmix = next(line for line in text.splitlines() if line.startswith("| QMIX | 2 of 3"))
    assert qmix.endswith(f"| 30.0 ± 7.1 | {points(gain([0.3], SPLITS[-1]))} |")


def test_page_tells_runs_of_different_settings(tmp_path: Path, launch: Launch) -> None:
    runs = [run_of(tmp_path, seed=seed) for seed in (0, 1)]
    work(runs, launch)
    record = json.loads(runs[1].result.read_text())
    record["checkpoint"]["config"] |= {"seed": 1, "episodes": 8}
    runs[1].result.write_text(json.dumps(record))
    write_page(runs[0].results, tmp_path / "results.md")
    assert "| QMIX | 2 of 3 (settings differ) |" in (tmp_path / "results.md").read_text()


def test_page_knows_settings_by_their_earlier_names(tmp_path: Path, launch: Launch) -> None:
    runs = [run_of(tmp_path, seed=seed) for seed in (0, 1)]
    work(runs, launch)
    names: list[dict[str, object]] = [{"gradient_steps": 4, "tau": 1.0, "layer_norm": False}, {"updates": 4}]
    for run, told in zip(runs, names, strict=True):
        record = json.loads(run.result.read_text())
        record["checkpoint"]["config"] = {"seed": run.seed, "episodes": 4, **told}
        run.result.write_text(json.dumps(record))
    write_page(runs[0].results, tmp_path / "results.md")
    assert "| QMIX | 2 of 3 |" in (tmp_path / "results.md").read_text()


def test_page_is_the_same_when_written_again(tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    pages = []
    for _ in range(2):
        write_page(run.results, tmp_path / "results.md")
        pages.append([(tmp_path / name).read_bytes() for name in ("results.md", "curves_scene_graph.png")])
    assert pages[0] == pages[1]


def test_damaged_result_is_named(tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    run.result.write_text(run.result.read_text()[:100])
    with pytest.raises(ResultError, match=r"qmix-seed0\.json"):
        read_records(run.results, TABLES)


def test_a_folder_in_the_place_of_a_result_is_named(tmp_path: Path) -> None:
    (tmp_path / "scene-graph" / "x.json").mkdir(parents=True)
    with pytest.raises(ResultError, match=r"x\.json: not the result of a run: .*is not a regular file.*; remove it"):
        read_records(tmp_path, TABLES)


def test_the_page_of_no_results_is_not_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert table.main(["--show", "--results", str(tmp_path / "nores")]) == 2
    assert f"--results {tmp_path / 'nores'}: no such folder; name the one that has" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["qmix-seed1", "vdn-seed0"])
def test_a_result_counts_for_its_own_row_and_seed_alone(tmp_path: Path, launch: Launch, name: str) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    run.result.rename(run.result.with_name(f"{name}.json"))
    with pytest.raises(ResultError, match=rf"{name}\.json.*it is that of .*qmix-seed0"):
        read_records(run.results, TABLES)


@pytest.mark.parametrize("missing", ["seed", "evaluation", "checkpoint", "curve", "test-unseen"])
def test_result_that_lacks_something_is_named(tmp_path: Path, launch: Launch, missing: str) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    record = json.loads(run.result.read_text())
    record.pop(missing, None)
    record.get("evaluation", {}).get("splits", {}).pop(missing, None)
    run.result.write_text(json.dumps(record))
    with pytest.raises(ResultError, match=r"qmix-seed0\.json"):
        write_page(run.results, tmp_path / "results.md")


PLAYED = ("evaluation", "splits", "test-unseen")


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ((*PLAYED, "summary", "plw", "mean"), "much"), ((*PLAYED, "summary", "plw", "mean"), math.nan),
        ((*PLAYED, "summary", "success_rate"), None), ((*PLAYED, "ends"), [1]), ((*PLAYED, "ends"), {"0.0": "x"}),
        ((*PLAYED, "per_wording"), {}), ((*PLAYED, "recognition"), {"pick_share": None}),
        ((*PLAYED, "plw_of_tasks"), None), ((*PLAYED, "plw_of_tasks"), {"test-seen-000": 0.5}),
        ((*PLAYED, "tasks_sha256"), None), (("evaluation", "source_sha256"), None), (("evaluation", "options"), None),
        (("curve",), {}), (("curve",), None), (("curve", "validation"), [[1]]), (("curve", "unit"), "years"),
        (("seconds",), None), (("seconds", "train"), "long"), (("checkpoint", "config"), None), (("name",), 3),
        (("checkpoint", "learners_sha256"), 5), (("checkpoint", "frozen"), 5), (("checkpoint", "episodes"), "all"),
        (("checkpoint", "validation"), "best"), (("checkpoint", "config"), {"episodes": "many"}),
        (("checkpoint", "config"), {"env_id": 3}), (("checkpoint",), None), (("commands",), ["train"]),
    ],
)  # fmt: skip
def test_result_that_holds_something_else_is_named(
    place: tuple[str, ...], value: Any, tmp_path: Path, launch: Launch
) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    record = json.loads(run.result.read_text())
    inner = record
    for name in place[:-1]:
        inner = inner[name]
    inner[place[-1]] = value
    run.result.write_text(json.dumps(record))
    with pytest.raises(ResultError, match=r"qmix-seed0\.json"):
        write_page(run.results, tmp_path / "results.md")


@pytest.mark.parametrize("changed", [{"max_steps": 60}, {"messages": True, "feedback": "planner"}, {"goal": True}])
def test_what_was_played_by_other_rules_gains_nothing(changed: dict[str, Any], tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    same = read_records(run.results, TABLES)["scene-graph", "qmix"]
    assert gained(same) is not None
    for less in ({"messages": False}, {"feedback": False}, {"image_size": 64}):
        assert gained([{**one, "evaluation": with_options(one, less)} for one in same]) == gained(same)
    assert gained([{**one, "evaluation": with_options(one, changed)} for one in same]) is None
    assert gained([{**same[0], "evaluation": same[0]["evaluation"] | {"options": {}}}]) is None
    other = {**same[0]["evaluation"]["splits"]["test-unseen"], "tasks_sha256": "other"}
    splits = {**same[0]["evaluation"]["splits"], "test-unseen": other}
    assert gained([{**same[0], "evaluation": same[0]["evaluation"] | {"splits": splits}}]) is None


def with_options(record: dict[str, Any], changed: dict[str, Any]) -> dict[str, Any]:
    played: dict[str, Any] = record["evaluation"]
    return played | {"options": played["options"] | changed}


def test_damaged_scores_and_states_are_named(tmp_path: Path, launch: Launch) -> None:
    run, other = run_of(tmp_path), run_of(tmp_path, "IQL")
    work([run], launch)
    (run.folder / "scores.json").write_text("{}")
    with pytest.raises(ResultError, match=r"scores\.json"):
        run.finish("score")
    other.folder.mkdir(parents=True)
    (other.folder / "state.json").write_text('{"seconds": 3')
    with pytest.raises(ResultError, match=r"state\.json: damaged"):
        work([other], launch)


@pytest.mark.parametrize(
    ("checkpoint", "after"),
    [({"episodes": 20}, "20"), ({"validation": {"epoch": 10}}, "10"), ({}, "30")],
)  # what the weights tell; of equal validations the last
def test_page_tells_after_what_the_kept_weights_were_had(
    checkpoint: dict[str, Any], after: str, tmp_path: Path, launch: Launch
) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    record = json.loads(run.result.read_text())
    kept = {name: value for name, value in record["checkpoint"].items() if name not in ("episodes", "validation")}
    record["checkpoint"] = kept | checkpoint
    record["curve"]["validation"] = [[10, 0.0], [20, 0.0], [30, 0.0]]
    run.result.write_text(json.dumps(record))
    write_page(run.results, tmp_path / "results.md")
    assert f"| {after} |" in (tmp_path / "results.md").read_text().split("## The runs")[1]


def test_page_tells_both_steps_of_ours_and_the_intervals(tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path)
    work([run], launch)
    record = json.loads(run.result.read_text())
    record["checkpoint"]["begun_with"] = {"config": {"episodes": 3}}
    for metric, low in (("plw", 0.0), ("success_rate", 0.375)):
        record["evaluation"]["splits"]["test-unseen"]["summary"][metric] |= {"low": low, "high": 0.625}
    run.result.write_text(json.dumps(record))
    write_page(run.results, tmp_path / "results.md")
    text = (tmp_path / "results.md").read_text()
    assert "3 + 4 episodes, 0 min, feedback" in text
    assert "PLW **25.0** (0 to 62), success **50.0** (38 to 62)" in text


def test_minutes_of_a_run_that_begins_with_the_weights_of_another_are_its_own(tmp_path: Path, launch: Launch) -> None:
    run = run_of(tmp_path, options=("--algo", "mappo", "--start", "best.pt"))
    work([run], launch)
    write_page(run.results, tmp_path / "results.md")
    assert "0 min (after that of the weights it begins with)" in (tmp_path / "results.md").read_text()


def test_the_scores_of_each_run_are_lines_of_a_sheet(tmp_path: Path, launch: Launch) -> None:
    runs = [run_of(tmp_path, seed=seed) for seed in (0, 1)]
    work(runs, launch)
    change(runs[1], plw=0.35)
    options = ["--show", "--results", str(runs[0].results), "--csv", str(tmp_path / "scores.csv")]
    assert table.main(options) == 0
    with (tmp_path / "scores.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    scores = [("qmix", str(seed), split, plw, "0.5") for seed, plw in enumerate(("0.25", "0.35")) for split in SPLITS]
    assert [tuple(line[key] for key in ("row", "seed", "split", "plw", "success_rate")) for line in lines] == scores
    assert {line["plw_low"] for line in lines} == {""} and lines[0]["messages"] == "False"


def change(run: Run, plw: float) -> None:
    record = json.loads(run.result.read_text())
    for split in SPLITS:
        record["evaluation"]["splits"][split]["summary"]["plw"]["mean"] = plw
    run.result.write_text(json.dumps(record))


def test_weights_that_rows_on_pictures_need_are_made_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("RESNET18", "DETECTOR"):
        monkeypatch.setenv(f"CHMARL_{name}", str(tmp_path / f"{name}.pt"))
    (tmp_path / "RESNET18.pt").touch()
    begun: list[list[str]] = []

    def finished(command: list[str]) -> int:
        begun.append(command[-3:])
        return len(begun) - 1

    monkeypatch.setattr(table, "_finished", finished)
    rows = [row_of("IQL", "visual"), row_of("Imitation of search, then MAPPO", "visual"), row_of("QMIX")]
    runs = [Run(row, 0, tmp_path / "out", tmp_path / "results", tmp_path) for row in rows]
    table.prepare(runs, tmp_path, Local(1))
    assert begun == [["training.pretrain", "--network", "detector"]]
    with pytest.raises(ChmarlError, match=r"training\.pretrain has failed"):
        table.prepare(runs, tmp_path, Local(1))


# The grounded track


def test_rows_of_the_grounded_track_are_trained_by_its_rules_and_scored_on_its_split(tmp_path: Path) -> None:
    rows = TABLES[GROUNDED]
    assert len(rows) == 13 and {(row.table, row.splits) for row in rows} == {(GROUNDED, ("generated-test",))}
    assert {row.slug.split("-")[0] for row in rows} == {"graphs", "pictures"}
    assert {row.slug for row in rows if row.seeds != 3} == {
        f"pictures-{name}" for name in ("qmix", "mappo", "ppo-humanoid-only", "imitation-of-belief-then-mappo")
    }
    assert {row.seeds for row in rows} == {2, 3}
    for row in rows:
        run = Run(row, 0, tmp_path, tmp_path, tmp_path)
        train, score = (" ".join(run.command(step)) for step in ("train", "score"))
        assert "--track grounded" in train or "CHMARL/Grounded" in train
        assert "--splits generated-test" in score and "messages" not in score, "a checkpoint knows its rules"


def test_commands_of_rows_name_no_option_that_changes_nothing(tmp_path: Path) -> None:
    rows = [row for table in TABLES.values() for row in table if row.module == "training.sb3"]
    assert any(row.track == GROUNDED for row in rows)
    for row in rows:
        command = Run(row, 0, tmp_path, tmp_path, tmp_path).command("train")
        config = parse_sb3(command[command.index("training.sb3") + 1 :]).config
        refuse_idle(config, Config(config.algo), partial(idle_in_sb3, config=config))


def test_the_grounded_track_has_a_table_of_its_own(tmp_path: Path, launch: Launch) -> None:
    row = TABLES[GROUNDED][0]
    run = run_of(tmp_path, row.name, table_name=GROUNDED)
    work([run], launch)
    assert not run.result.exists(), "the scores are not those of its split"
    figure = {"mean": 0.25, "deviation": None, "low": None, "high": None}
    summary = {"success_rate": figure, "plw": figure}
    split = {"tasks": 4, "tasks_sha256": "0", "summary": summary, "recognition": {"pick_share": 0.5}}
    kept = {
        "checkpoint": {"config": {"episodes": 4}, "sha256": "0"},
        "evaluation": {"source_sha256": "f" * 64, "options": {}, "splits": {"generated-test": split}},
    }
    (run.folder / "scores.json").write_text(json.dumps(kept))
    run.finish("score")
    write_page(run.results, tmp_path / "results.md")
    part = (tmp_path / "results.md").read_text().split("## The grounded track")[1]
    assert "| QMIX | graphs | 1 of 3 |" in part
    assert "| 25.0 | 25.0 | 50.0 |  |" in part
