import json
import os
import re
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.cli import main
from chmarl_pb.cli.baselines import success_within
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import BusyError, OptionError, ResultError, TaskError
from chmarl_pb.evaluation import cooperation as accounting
from chmarl_pb.evaluation.cooperation import VARIANTS, cooperation, gain_share, read_reference, reference_json
from chmarl_pb.evaluation.episode_file import load_episode, replay_episode
from chmarl_pb.evaluation.ledger import Ledger
from chmarl_pb.evaluation.metrics import Played, path_weighted, summarize, summarize_by
from chmarl_pb.evaluation.play import Job, Player, Setup, play
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.provenance import robots_hash
from chmarl_pb.evaluation.replays import replays
from chmarl_pb.evaluation.result import Report, load_result
from chmarl_pb.evaluation.sample import TRAIN_SAMPLE, evaluated_tasks
from chmarl_pb.executors import Local
from chmarl_pb.files import Lock, file_hash
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.policies.registry import BUILT_IN, make_policy
from chmarl_pb.policies.sources import find_policy, register_loader
from chmarl_pb.policies.variants import Noting, Unheard
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.mobile import MobileRobot
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.registry import team_of
from chmarl_pb.sensing.sensors import SceneGraphSensor, View
from chmarl_pb.tasks.advisers import CRITICS, SpokenAdviser
from chmarl_pb.tasks.kinds import Rearrange
from chmarl_pb.tasks.messages import Board
from chmarl_pb.tasks.splits import SPLITS, TRAINING_SPLITS, load_tasks
from chmarl_pb.tasks.task import Optimum, Task
from chmarl_pb.tasks.unreliable import NoisyBoard, UnreliableAdviser

TASKS = load_tasks("test-unseen")[:3]
MAX_STEPS = 12


def staying(env: HouseholdEnv) -> Policy:
    """Return a policy that does nothing."""

    class Staying:
        def reset(self, seed: int | None) -> None:
            pass

        def act(self, observations: Observations, infos: Infos) -> Actions:
            return {name: names.index("stay") for name, names in env.action_names.items()}

    return Staying()


staying.deterministic = True  # type: ignore[attr-defined]


def task(number: int, optimal_steps: int, home: str = "home_1") -> Task:
    return Task(f"t-{number:03d}", home, "mug", "desk", "sofa", number, optimal_steps)


def played(number: int, optimal: int, steps: int, success: bool = True, seed: int = 0, home: str = "home_1") -> Played:
    return Played(task(number, optimal, home), seed, steps, success, 10.0 if success else 4.0)


# --- metrics -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("success", "steps", "optimal", "score"),
    [
        (True, 6, 6, 1.0),
        (True, 12, 6, 0.5),
        (True, 50, 5, 0.1),
        (False, 6, 6, 0.0),
        (False, 50, 6, 0.0),
        (True, 5, 6, 1.0),
    ],
)
def test_path_weighted_by_hand(success: bool, steps: int, optimal: int, score: float) -> None:
    assert path_weighted(success, steps, optimal) == pytest.approx(score)


def test_unknown_optimal_length_is_refused() -> None:
    with pytest.raises(TaskError, match="optimal_steps"):
        path_weighted(True, 5, 0)
    assert path_weighted(False, 5, 0) == 0.0  # of a failure nothing is to be known


def test_summary_by_hand() -> None:
    seed_0 = [played(0, 4, 8), played(1, 5, 5), played(2, 5, 50, success=False), played(3, 6, 50, success=False)]
    seed_1 = [played(n, e.task.optimal_steps, 50, success=False, seed=1) for n, e in enumerate(seed_0)]
    summary = summarize([*seed_0, *seed_1])
    assert summary.episodes == 8
    assert summary.success_rate.mean == pytest.approx(0.25)  # seeds: 0.5 and 0
    assert summary.success_rate.deviation == pytest.approx(np.std([0.5, 0.0], ddof=1))
    assert summary.plw.mean == pytest.approx((0.5 + 1) / 4 / 2)
    assert summary.length_on_success.mean == pytest.approx(6.5)
    assert summary.length_on_success.deviation is None  # only one seed has a success
    assert summary.final_potential.mean == pytest.approx((7.0 + 4.0) / 2)


def test_no_success_has_no_length() -> None:
    assert summarize([played(0, 4, 50, success=False)]).length_on_success.mean is None


def test_groups() -> None:
    groups = summarize_by([played(0, 4, 4), played(1, 4, 8, home="home_2")], lambda task: task.home)
    assert [(home, summary.plw.mean) for home, summary in groups.items()] == [("home_1", 1.0), ("home_2", 0.5)]


episodes = st.lists(
    st.builds(
        lambda number, optimal, extra, success: played(number, optimal, optimal + extra, success),
        st.integers(0, 10**6), st.integers(1, 20), st.integers(0, 40), st.booleans(),
    ),
    min_size=1, max_size=30,
)  # fmt: skip


@given(episodes)
def test_plw_lies_between_zero_and_success_rate(played: list[Played]) -> None:
    summary = summarize(played, intervals=False)
    success, plw = summary.success_rate.mean, summary.plw.mean
    assert success is not None and plw is not None
    assert 0 <= plw <= success + 1e-12 <= 1 + 2e-12
    optimal = all(episode.steps == episode.task.optimal_steps for episode in played if episode.success)
    assert (abs(plw - success) < 1e-12) == optimal


def test_interval_covers_the_mean_and_repeats() -> None:
    rng = np.random.default_rng(0)
    sample = [played(n, 5, 5 + int(rng.integers(20)), home=f"home_{n % 3}") for n in range(60)]
    plw = summarize(sample).plw
    assert plw.mean is not None and plw.low is not None and plw.high is not None
    assert plw.low < plw.mean < plw.high
    again = summarize(sample[::-1]).plw
    assert (plw.low, plw.high) == (again.low, again.high)


def test_interval_keeps_the_shares_of_homes() -> None:
    """Within each home all tasks are alike, so drawing anew within homes changes nothing."""
    sample = [played(n, 5, 5 if n < 10 else 10, home="home_1" if n < 10 else "home_2") for n in range(20)]
    plw = summarize(sample).plw
    assert (plw.low, plw.high) == pytest.approx((0.75, 0.75))


def test_single_task_has_no_interval() -> None:
    assert summarize([played(0, 4, 4)]).plw.low is None


def test_success_within() -> None:
    sample = [played(0, 4, 10), played(1, 4, 30), played(2, 4, 50, success=False)]
    assert [success_within(sample, steps) for steps in (9, 10, 30, 50)] == pytest.approx([0, 1 / 3, 2 / 3, 2 / 3])


# --- policies ------------------------------------------------------------------------------------


def test_policies_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    assert find_policy("planner").deterministic and not find_policy("random").deterministic
    source = find_policy(f"{__name__}:staying")
    assert source.deterministic and source.name == f"{__name__}:staying" and source.sha256
    assert find_policy(staying).name.endswith(":staying")


@pytest.mark.parametrize(
    ("policy", "words"),
    [
        ("plannner", "search-silent"),
        ("no_such_module:f", "no_such_module"),
        ("json:no_such", "no_such"),
        ("json:__name__", "not callable"),
    ],
)
def test_unknown_policies_are_refused(policy: str, words: str) -> None:
    with pytest.raises(OptionError, match=words):
        find_policy(policy)


def test_checkpoints_need_a_loader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chmarl_pb.policies.sources._LOADERS", {})
    path = tmp_path / "net.weights"
    path.write_bytes(b"1")
    with pytest.raises(OptionError, match=r"'\.weights'"):
        find_policy(str(path))
    register_loader(".weights", lambda path: staying)
    assert find_policy(str(path)).make is staying


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkpoint: it names the built-in policy that it is."""
    path = tmp_path / "best.named"
    path.write_text("random")
    monkeypatch.setattr("chmarl_pb.policies.sources._LOADERS", {})
    register_loader(".named", lambda path: lambda env: make_policy(path.read_text(), env))
    return path


@pytest.mark.parametrize("played", [0, 1, 3], ids=["before", "amid", "after"])
@pytest.mark.parametrize("loaded", [False, True], ids=["path", "loaded"])
def test_weights_that_change_while_they_are_evaluated_are_refused(weights: Path, played: int, loaded: bool) -> None:
    def replaced(finished: int, total: int) -> None:
        if finished == played:
            weights.write_text("search")

    def plays(setup: Setup, jobs: Sequence[Job]) -> Iterator[Played]:
        if played == 0:
            weights.write_text("search")
        return play(setup, jobs, Local(1))

    out, policy = weights.with_name("result.json"), find_policy(weights) if loaded else str(weights)
    options: dict[str, Any] = {"tasks": TASKS, "seeds": [0], "workers": 1, "max_steps": 2, "out": out}
    with pytest.raises(OptionError, match=r"best\.named: changed while it was evaluated; copy it, or evaluate again"):
        evaluate(policy, progress=replaced, plays=plays, **options)
    assert not out.exists()
    kept = out.with_name("result.json.partial")
    assert kept.exists() == (played > 0)
    if played:
        assert json.loads(kept.read_text().splitlines()[0])["policy_sha256"] != file_hash(weights)


def test_the_policy_of_another_process_is_the_one_that_the_result_names(weights: Path) -> None:
    options, sha256 = Options(split="test-unseen", max_steps=2), file_hash(weights)
    Player(Setup(str(weights), options, sha256=sha256)).close()
    weights.write_text("search")
    with pytest.raises(OptionError, match="changed while it was evaluated"):
        Player(Setup(str(weights), options, sha256=sha256))


def test_own_code_that_changes_while_it_is_evaluated_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "changing_policy.py"
    module.write_text("from chmarl_pb.policies.registry import make_policy\ndef mine(env):\n"
                      "    return make_policy('random', env)\n")  # fmt: skip
    monkeypatch.syspath_prepend(str(tmp_path))

    def changed(finished: int, total: int) -> None:
        module.write_text(module.read_text().replace("random", "search"))

    with pytest.raises(OptionError, match="changing_policy:mine: changed while it was evaluated"):
        evaluate("changing_policy:mine", tasks=TASKS, seeds=[0], workers=1, max_steps=2, progress=changed)


def test_a_fingerprint_that_differs_in_each_process_is_the_users_affair(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_fingerprint.py").write_text(
        "import os\nfrom chmarl_pb.policies.registry import make_policy\ndef mine(env):\n"
        "    return make_policy('search', env)\nmine.fingerprint = f'process {os.getpid()}'\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    report = evaluate("own_fingerprint:mine", tasks=TASKS, seeds=[0], workers=2, max_steps=2)
    assert report.settings["policy_sha256"] == f"process {os.getpid()}"


def noting(make: Callable[[HouseholdEnv], Policy]) -> Callable[[HouseholdEnv], Policy]:
    """Return a function that holds more each time that it is called, as one that loads weights but once."""
    made: list[str] = []

    def noted(env: HouseholdEnv) -> Policy:
        made.append("a policy")
        return make(env)

    return noted


noted = noting(staying)


def test_what_own_code_holds_may_change() -> None:
    for workers in (1, 2):
        evaluate(f"{__name__}:noted", tasks=TASKS, seeds=[0], workers=workers, max_steps=2)


def refuses(env: HouseholdEnv) -> Policy:
    """A policy that was made for something else, as a checkpoint may be."""
    raise OptionError("a policy for pictures")


def test_a_refused_policy_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="a policy for pictures"):
        evaluate(f"{__name__}:refuses", tasks=TASKS, workers=1, out=tmp_path / "result.json")
    assert list(tmp_path.iterdir()) == []


def test_silent_and_alone_hide_what_they_should(env: HouseholdEnv, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lone humanoid's drone stays; its messages never say more than the pair's."""

    def noted(
        shown: list[np.ndarray], act: Callable[[Observations, Infos], Actions], seen: Observations, infos: Infos
    ) -> Actions:
        shown.append(seen["humanoid"]["messages"])
        return act(seen, infos)

    for name in ("search-silent", "search-alone"):
        policy = BUILT_IN[name].make(env)
        assert isinstance(policy, Unheard | Noting)
        observations, infos = env.reset(options={"task": TASKS[0]})
        policy.reset(0)
        shown: list[np.ndarray] = []
        inner = policy.policy
        monkeypatch.setattr(inner, "act", partial(noted, shown, inner.act))
        while env.agents:
            actions = policy.act(observations, infos)
            assert (shown[-1] <= observations["humanoid"]["messages"]).all()
            if name == "search-silent":
                assert not shown[-1].any()
            else:
                assert env.action_names["drone"][actions["drone"]] == "stay"
            observations, _, _, _, infos = env.step(actions)


# --- protocol ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def random_report() -> Report:
    return evaluate("random", tasks=TASKS, seeds=(0, 1), workers=1, max_steps=MAX_STEPS)


def test_every_task_once_for_each_seed(random_report: Report) -> None:
    order = [(episode.seed, episode.task) for episode in random_report.episodes]
    assert order == [(seed, task) for seed in (0, 1) for task in TASKS]
    assert len({episode.actions[:5] for episode in random_report.episodes}) == len(order)  # no two seeds alike


def test_workers_do_not_matter(random_report: Report) -> None:
    again = evaluate("random", tasks=TASKS, seeds=(0, 1), workers=2, max_steps=MAX_STEPS)
    assert again.episodes == random_report.episodes and again.settings == random_report.settings


def test_planner_plays_once_and_is_optimal() -> None:
    report = evaluate("planner", tasks=[task.id for task in TASKS], workers=1)
    assert len(report.episodes) == len(TASKS)
    assert (report.success_rate, report.plw) == (1.0, 1.0)


def test_other_robots_have_an_optimum_of_their_own(tmp_path: Path) -> None:
    """PLW counts from the planner's steps with these robots; the result says where they are but an upper bound."""
    robots, out = ("humanoid", "humanoid", "drone"), tmp_path / "team.json"
    report = evaluate("planner", workers=1, tasks=TASKS[:2], robots=robots, out=out, max_steps=30)
    assert load_result(out) == report and report.settings["options"]["robots"] == list(robots)
    assert report.changed == "robots humanoid, humanoid, drone" and report.cooperation is None
    models = team_of(robots).values()
    assert report.settings["robots_sha256"] == robots_hash(models) and list(robots_hash(models)) == [
        "humanoid",
        "drone",
    ]
    faster = replace(next(iter(models)), speed=9.0)
    assert robots_hash([faster])["humanoid"] != robots_hash(models)["humanoid"]
    env = HouseholdEnv(robots=robots, home=TASKS[0].home)
    for episode in report.episodes:
        plan = env.simulation.solve(episode.task)
        assert episode.success and episode.optimum == Optimum(plan.steps, plan.proven)
        assert episode.score == plan.steps / max(episode.steps, plan.steps)
        assert {len(numbers) for numbers in episode.actions} == {3}
    env.close()
    assert report.bounded == sum(not episode.optimum.proven for episode in report.episodes if episode.optimum)
    page = replays([report], tmp_path / "episodes")
    assert '<th class="r2">drone</th>' in page and 'class="r2 flies"' in page
    (file,) = (tmp_path / "episodes").iterdir()
    assert replay_episode(load_episode(file)) is None


def test_the_benchmarks_robots_keep_their_rows(tmp_path: Path) -> None:
    """Rows and settings name no robots, as in results from before there was a choice."""
    report = evaluate("planner", workers=1, tasks=TASKS[:1], out=tmp_path / "own.json")
    (row,) = json.loads((tmp_path / "own.json").read_text())["episodes"]
    assert set(row) == {"task", "seed", "steps", "success", "potential", "actions", "instruction", "recognition"}
    assert "robots" not in report.settings["options"]


def test_a_policy_that_stays_gets_nothing() -> None:
    report = evaluate(staying, tasks=TASKS, workers=1, max_steps=3)
    assert report.settings["seeds"] == [0]
    assert (report.success_rate, report.plw) == (0.0, 0.0)
    assert {episode.steps for episode in report.episodes} == {3}


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"seeds": ()}, OptionError), ({"seeds": (0, 0)}, OptionError), ({"seeds": (-1,)}, OptionError),
        ({"workers": 0}, OptionError), ({"split": "test"}, OptionError), ({"tasks": []}, TaskError),
        ({"tasks": ["test-unseen-xyz"]}, TaskError), ({"tasks": [TASKS[0], TASKS[0]]}, TaskError),
        ({"observation": "smell"}, OptionError), ({"max_steps": 0}, OptionError), ({"seeds": 3}, OptionError),
        ({"seeds": (0.5,)}, OptionError), ({"out": "/tmp"}, OptionError), ({"tasks": ["val-seen-000"]}, TaskError),
        ({"tasks": 5}, TaskError), ({"tasks": [5]}, TaskError), ({"tasks": TASKS[0]}, TaskError),
        ({"workers": "2"}, OptionError), ({"templates": 2.0}, OptionError),
    ],
)  # fmt: skip
def test_bad_options_are_refused(options: dict[str, Any], error: type[Exception]) -> None:
    with pytest.raises(error):
        evaluate("random", **{"workers": 1, **options})


def test_a_policy_that_cannot_travel_is_refused() -> None:
    held = threading.Lock()
    with pytest.raises(OptionError, match="workers=1"):
        evaluate(lambda env: (held, make_policy("random", env))[1], tasks=TASKS, workers=2)


def test_policies_of_notebooks_and_functions_travel(random_report: Report) -> None:
    scope: dict[str, Any] = {"__name__": "__main__", "make_policy": make_policy}
    exec("def policy(env):\n    return make_policy('random', env)", scope)
    for factory in (scope["policy"], lambda env: make_policy("random", env)):
        report = evaluate(factory, tasks=TASKS, seeds=(0, 1), workers=2, max_steps=MAX_STEPS)
        assert report.episodes == random_report.episodes


def test_unknown_classes_are_told_before_anything_is_played() -> None:
    wrong = Task("mine", "home_1", "mugg", "desk", "bed", 5)
    with pytest.raises(TaskError, match="unknown graspable 'mugg'; did you mean 'mug'"):
        evaluate("search", tasks=[wrong], workers=1)


def test_interrupted_evaluations_go_on(tmp_path: Path, random_report: Report) -> None:
    out = tmp_path / "result.json"

    def interrupt(finished: int, total: int) -> None:
        if finished == 4:
            raise KeyboardInterrupt

    options: dict[str, Any] = {"tasks": TASKS, "seeds": (0, 1), "workers": 1, "max_steps": MAX_STEPS, "out": out}
    with pytest.raises(KeyboardInterrupt):
        evaluate("random", progress=interrupt, **options)
    unfinished = tmp_path / "result.json.partial"
    text = unfinished.read_text()
    assert len(text.splitlines()) == 1 + 4 and not out.exists()
    unfinished.write_text(text[:-20])  # as if the machine had gone down while it wrote
    counts: list[int] = []
    with pytest.warns(RuntimeWarning, match=r"result\.json\.partial: 1 of 4 lines"):
        report = evaluate("random", progress=lambda finished, total: counts.append(finished), **options)
    assert counts == [3, 4, 5, 6]
    assert report.episodes == random_report.episodes and not unfinished.exists()
    assert load_result(out).episodes == report.episodes


JOBS = [(task(number, 4), seed) for number in range(3) for seed in (0, 1)]


def ledger_of(folder: Path, settings: str = "a") -> Ledger:
    return Ledger(folder / "result.json", {"policy": settings}, JOBS)


def test_other_settings_start_anew(tmp_path: Path) -> None:
    ledger_of(tmp_path).add(played(0, 4, 4))
    assert len(ledger_of(tmp_path).episodes) == 1
    with pytest.warns(RuntimeWarning, match=r"result\.json\.partial: is of another evaluation; it is kept as"):
        assert ledger_of(tmp_path, "b").episodes == []
    (tmp_path / "result.json.old").replace(tmp_path / "result.json.partial")
    assert len(ledger_of(tmp_path).episodes) == 1
    (tmp_path / "result.json.partial").write_text("my notes\n")
    with pytest.warns(RuntimeWarning, match="is of another evaluation"):
        ledger_of(tmp_path)
    assert (tmp_path / "result.json.old").read_text() == "my notes\n"


def test_no_side_file_takes_the_place_of_another(tmp_path: Path) -> None:
    for number, settings in enumerate("abc"):
        if number:
            with pytest.warns(RuntimeWarning, match="is of another evaluation"):
                ledger_of(tmp_path, settings).add(played(number, 4, 4))
        else:
            ledger_of(tmp_path, settings).add(played(number, 4, 4))
    assert [(tmp_path / f"result.json.{ending}").is_file() for ending in ("partial", "old", "old2", "old3")] == [
        True, True, True, False,
    ]  # fmt: skip
    (tmp_path / "result.json.old2").replace(tmp_path / "result.json.partial")
    assert [episode.job for episode in ledger_of(tmp_path, "b").episodes] == [(task(1, 4), 0)]


def test_a_job_counts_once_whoever_wrote_it(tmp_path: Path) -> None:
    """As two processes left it that wrote one ledger without knowing of each other."""
    both = [ledger_of(tmp_path), ledger_of(tmp_path)]
    for number in range(3):
        for ledger in both:
            ledger.add(played(number, 4, 4 + number))
    both[0].add(played(7, 4, 4))  # nobody asked for this one
    with pytest.warns(RuntimeWarning, match="4 of 7 lines"):
        again = ledger_of(tmp_path)
    assert [episode.job for episode in again.episodes] == [(task(number, 4), 0) for number in range(3)]
    assert len(again.path.read_text().splitlines()) == 1 + 3


@pytest.mark.parametrize("line", [0, 1, 2])
def test_no_flipped_bit_of_a_ledger_counts(tmp_path: Path, line: int) -> None:
    ledger = ledger_of(tmp_path)
    for number in range(2):
        ledger.add(played(number, 4, 14))
    whole, wanted = ledger.path.read_bytes(), [played(number, 4, 14) for number in range(2)]
    lines = whole.splitlines(keepends=True)
    start = sum(map(len, lines[:line]))
    for place in range(start, start + len(lines[line])):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << place % 8
        ledger.path.write_bytes(damaged)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            found = ledger_of(tmp_path).episodes
        assert all(episode in wanted for episode in found)
        assert len(found) == 2 or caught or damaged.count(b"\n") < 3


def test_every_job_is_played_exactly_once() -> None:
    options: dict[str, Any] = {"tasks": TASKS, "seeds": (0, 1), "max_steps": 3}
    report = evaluate("random", workers=1, **options)

    def pretended(wrong: Sequence[Played], setup: Setup, jobs: Sequence[Job]) -> Iterator[Played]:
        return iter(wrong)

    for wrong in (report.episodes[1:], (*report.episodes, report.episodes[0]), [*report.episodes[1:], played(0, 4, 4)]):
        with pytest.raises(ResultError, match="played"):
            evaluate("random", plays=partial(pretended, wrong), **options)


def test_a_result_with_an_episode_twice_is_refused(tmp_path: Path, random_report: Report) -> None:
    episodes = random_report.episodes
    for wrong in ((*episodes[:-1], episodes[0]), (*episodes, episodes[0]), episodes[:-1], episodes[::-1]):
        replace(random_report, episodes=wrong).save(tmp_path / "result.json")
        with pytest.raises(ResultError, match="not one for each task and seed"):
            load_result(tmp_path / "result.json")


@pytest.mark.parametrize(
    ("old", "new"),
    [('"steps":12', '"steps":11'), ('"success":false', '"success":true'), ('"max_steps": 12', '"max_steps": 13')],
)
def test_a_changed_result_is_refused(tmp_path: Path, random_report: Report, old: str, new: str) -> None:
    path = tmp_path / "result.json"
    random_report.save(path)
    text = path.read_text()
    assert old in text and load_result(path)
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ResultError, match=r"result\.json.*checksum"):
        load_result(path)
    path.write_text(re.sub(r' "sha256": "[0-9a-f]+",\n', "", text))  # as the first versions wrote it
    assert load_result(path).episodes == random_report.episodes


@pytest.mark.parametrize("depth", [500, 900, 100_000])
def test_a_result_that_is_nested_too_deeply_is_refused(tmp_path: Path, random_report: Report, depth: int) -> None:
    path = tmp_path / "result.json"
    random_report.save(path)
    data = json.loads(path.read_text())
    data["episodes"][0]["recognition"] = {"x_seen": "deep", "picks": 0, "y_seen": 0, "places": 0}
    path.write_text(json.dumps(data).replace('"deep"', '{"a":' * depth + "0" + "}" * depth))
    with pytest.raises(ResultError, match="not a whole result"):
        load_result(path)


def test_result_file_tells_how_to_repeat_it(tmp_path: Path, random_report: Report) -> None:
    path = tmp_path / "deep" / "result.json"
    random_report.save(path)
    data = json.loads(path.read_text())
    assert {
        "policy",
        "split",
        "observation",
        "options",
        "seeds",
        "tasks_sha256",
        "homes_sha256",
        "source_sha256",
    } <= set(data["settings"])
    assert {"versions", "machine", "command"} <= set(data["run"])
    assert data["summary"]["plw"]["mean"] == random_report.plw
    assert load_result(path).summary == random_report.summary
    path.write_text(path.read_text()[:-40])
    with pytest.raises(ResultError, match=r"result\.json"):
        load_result(path)


@pytest.mark.parametrize(
    ("flags", "style"), [([], True), (["--feedback", "planner"], "planner"), (["--no-feedback"], False)]
)
def test_style_of_feedback_on_the_command_line(tmp_path: Path, flags: list[str], style: bool | str) -> None:
    out = tmp_path / "result.json"
    arguments = ["evaluate", "--policy", "random", "--task", TASKS[0].id, "--seeds", "1", "--workers", "1"]
    assert main([*arguments, "--max-steps", "3", *flags, "--out", str(out)]) == 0
    assert load_result(out).settings["options"]["feedback"] == style


def test_train_is_sampled() -> None:
    assert all(evaluated_tasks(split) == load_tasks(split)[:TRAIN_SAMPLE] for split in TRAINING_SPLITS)
    assert all(evaluated_tasks(split) == load_tasks(split) for split in SPLITS if split not in TRAINING_SPLITS)


# --- cooperation ---------------------------------------------------------------------------------


def test_gain_share() -> None:
    assert [gain_share(plw, 0.5) for plw in (0.5, 0.75, 1.0, 0.25)] == pytest.approx([0.0, 0.5, 1.0, -0.5])
    assert gain_share(1.0, 1.0) is None


def of_split(split: str, steps: Callable[[Task], int | None]) -> Sequence[Played]:
    rows = [(task, steps(task)) for task in evaluated_tasks(split)]
    return [Played(task, 0, length or 50, length is not None, 0.0) for task, length in rows]


def test_cooperation_by_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    split = "val-unseen"
    lengths: dict[str, Callable[[Task], int | None]] = {
        "belief-alone": lambda task: 4 * task.optimal_steps,
        "belief-silent": lambda task: None,
        "belief": lambda task: 2 * task.optimal_steps,
    }
    text = reference_json(split, 50, {name: of_split(split, lengths[name]) for name in VARIANTS})
    (tmp_path / f"{split}.json").write_text(text)
    monkeypatch.setattr(accounting, "FOLDER", tmp_path)
    read_reference.cache_clear()
    gain = cooperation(of_split(split, lambda task: task.optimal_steps), split, 50)
    assert gain is not None
    assert (gain.plw_alone, gain.plw_silent, gain.plw_pair, gain.plw) == pytest.approx((0.25, 0, 0.5, 1))
    assert (gain.share, gain.share_pair, gain.faster) == pytest.approx((1, 1 / 3, 1))
    assert gain.steps_saved == pytest.approx(gain.steps_possible)
    alone = cooperation(of_split(split, lengths["belief-alone"]), split, 50)
    assert alone is not None and (alone.share, alone.steps_saved, alone.faster) == pytest.approx((0, 0, 0))
    assert cooperation([], split, 50) is None
    assert cooperation(of_split(split, lengths["belief"]), split, 60) is None  # cut later than the references
    cut = cooperation(of_split(split, lambda task: task.optimal_steps), split, 1)
    assert cut is not None and (cut.plw_alone, cut.plw_pair) == (0, 0)  # no reference is as short as one step
    (tmp_path / f"{split}.json").write_text(text.replace('"tasks": "', '"tasks": "0'))
    read_reference.cache_clear()
    assert read_reference(split) is None  # of other tasks
    read_reference.cache_clear()


def test_references_keep_what_other_policies_did_on_the_same_tasks() -> None:
    split = "val-unseen"
    first, second = {"search": of_split(split, lambda task: 7)}, {"belief": of_split(split, lambda task: 5)}
    text = reference_json(split, 28, second, reference_json(split, 28, first))
    assert text == reference_json(split, 28, {**first, **second})
    assert reference_json(split, 28, second, text) == text
    assert reference_json(split, 30, second, text) == reference_json(split, 30, second), "cut elsewhere"
    assert reference_json(split, 28, second, text[:-9]) == reference_json(split, 28, second), "a cut file"


# --- command line --------------------------------------------------------------------------------


def test_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "result.json"
    arguments = ["evaluate", "--policy", "planner", "--task", TASKS[0].id, "--workers", "1", "--no-messages", "--out"]
    assert main([*arguments, str(out)]) == 0
    printed = capsys.readouterr().out
    assert "no messages" in printed and "100.0" in printed and out.name in printed
    assert "on the same tasks" in printed and "instruction-blind" in printed
    assert load_result(out).settings["options"]["messages"] is False
    assert main(["evaluate", "--policy", "nobody"]) == 2
    assert "nobody" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["evaluate", "--policy", "random", "--out", "{folder}"], "is a folder; name a file in it"),
        (["evaluate", "--policy", "random", "--out", "{file}/result.json"], "is a file; name a folder"),
        (["report", "--out", "{folder}"], "is a folder"),
        (["episode", "save", "--task", TASKS[0].id, "--out", "{folder}"], "is a folder"),
        (["homes", "preview", "home_1", "--out", "{folder}"], "is a folder"),
        (["bench", "--json", "{folder}"], "is a folder"),
        (["demo", "--out", "{file}"], "is a file; name a folder"),
        (["baselines", "--out", "{file}"], "is a file; name a folder"),
    ],
)
def test_where_nothing_can_be_written_is_said_at_once(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, file = tmp_path / "folder", tmp_path / "file"
    folder.mkdir()
    file.write_text("kept")
    with pytest.raises(SystemExit):
        main([word.format(folder=folder, file=file) for word in arguments])
    assert words in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == [file, folder] and file.read_text() == "kept"


# --- own objects ---------------------------------------------------------------------------------


class Lossy(Board):
    """A board of which bits are lost."""

    def __init__(self, loss: float):
        self.loss = loss

    def hear(self, messages: Any, robot: str, rng: np.random.Generator) -> Any:
        return messages * (rng.random(messages.shape) >= self.loss).astype(np.int8)


class Standing:
    """A policy that always takes one action."""

    def __init__(self, action: int):
        self.action = action

    def reset(self, seed: int | None) -> None: ...

    def act(self, observations: Observations, infos: Infos) -> Actions:
        return dict.fromkeys(observations, self.action)


def made_by(options: float, **given: Any) -> Any:
    return HouseholdEnv(**given)


@pytest.mark.parametrize(
    "ways",
    [
        [{"messages": Lossy(0.0)}, {"messages": Lossy(1.0)}],
        [{"policy": Standing(1)}, {"policy": Standing(2)}],
        [{"policy": lambda env: Standing(1)}, {"policy": lambda env: Standing(2)}],
        [{"env_fn": partial(made_by, 0.0)}, {"env_fn": partial(made_by, 1.0)}],
    ],
)
def test_results_of_objects_that_differ_in_what_they_hold_are_not_taken_for_each_other(
    ways: list[dict[str, Any]], tmp_path: Path
) -> None:
    def played_by(way: dict[str, Any], **given: Any) -> Report:
        given = {"policy": staying, "workers": 1, "tasks": TASKS, "max_steps": 2, "seeds": [0], **way, **given}
        return evaluate(split="test-unseen", **given)

    told = list[int]()
    first, same, second = (
        played_by(ways[number], out=tmp_path / "one.json", reuse=True, progress=lambda done, of: told.append(done))
        for number in (0, 0, 1)
    )
    assert first == same and told == 2 * [*range(len(TASKS) + 1)]
    assert second.settings != first.settings

    def stop(finished: int, total: int) -> None:
        if finished == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        played_by(ways[0], out=tmp_path / "two.json", progress=stop)
    with pytest.warns(RuntimeWarning, match="of another evaluation"):
        assert played_by(ways[1], out=tmp_path / "two.json").settings == second.settings


def test_nothing_is_reused_where_nothing_tells_what_was_played(tmp_path: Path) -> None:
    held = Standing(1)
    held.lock = threading.Lock()  # type: ignore[attr-defined]
    maker = lambda env: Standing(held.action)  # noqa: E731
    for _ in range(2):
        with pytest.warns(UserWarning, match="policy: holds what cannot be pickled"):
            report = evaluate(
                maker, "test-unseen", workers=1, tasks=TASKS[:1], max_steps=2, seeds=[0], out=tmp_path / "r.json",
                reuse=True,
            )  # fmt: skip
        assert report.settings["policy_sha256"].startswith("unknown-")
    maker.fingerprint = "what it is"  # type: ignore[attr-defined]
    report = evaluate(maker, "test-unseen", workers=1, tasks=TASKS[:1], max_steps=2, seeds=[0])
    assert report.settings["policy_sha256"] == "what it is"


@pytest.mark.parametrize("label", ["mine ", " mine", "my  own", "mine\n", "A | b", "<b>mine</b>", "mine\u200b"])
def test_labels_that_tables_cannot_show_are_refused(label: str) -> None:
    with pytest.raises(OptionError, match=r"^label=.*; name the row otherwise$"):
        evaluate("belief", tasks=TASKS, workers=1, label=label)


def test_what_is_reused_gets_the_label_that_is_asked_for(tmp_path: Path) -> None:
    out = tmp_path / "r.json"
    given: dict[str, Any] = {"workers": 1, "tasks": TASKS[:1], "seeds": [0], "out": out, "reuse": True}
    first = evaluate("belief", label="one", **given)
    other = evaluate("belief", label="other", **given)
    assert (other.run["date"], other.run["label"]) == (first.run["date"], "other") and load_result(out) == other
    assert evaluate("belief", **given) == other


def test_settings_tell_robots_and_objects_apart() -> None:
    given: dict[str, Any] = {"workers": 1, "tasks": TASKS[:1], "seeds": [0]}
    settings = evaluate("belief", **given).settings
    assert list(settings["robots_sha256"]) == ["humanoid", "drone"] and len(settings["catalog_sha256"]) == 64


def held() -> Standing:
    """A policy of which nothing tells what it does."""
    policy = Standing(1)
    policy.lock = threading.Lock()  # type: ignore[attr-defined]
    return policy


HELD = partial(lambda policy, env: policy, held())


def test_nor_where_it_is_named_by_its_module(tmp_path: Path) -> None:
    dates = []
    for _ in range(2):
        with pytest.warns(UserWarning, match="policy: holds what cannot be pickled"):
            report = evaluate(
                f"{__name__}:HELD", "test-unseen", workers=1, tasks=TASKS[:1], max_steps=2, seeds=[0],
                out=tmp_path / "r.json", reuse=True,
            )  # fmt: skip
        dates.append(report.settings["policy_sha256"])
    assert dates[0] != dates[1]


def test_where_a_channel_draws_all_seeds_are_played() -> None:
    given: dict[str, Any] = {"workers": 1, "tasks": TASKS[:1], "max_steps": 2, "seeds": [0, 1]}
    assert evaluate("belief", **given).settings["seeds"] == [0]
    assert evaluate("belief", messages=NoisyBoard(0.3), **given).settings["seeds"] == [0, 1]


class Numb:
    """A sensor of one's own."""

    def spaces(self) -> dict[str, spaces.Box]:
        return {"numb": spaces.Box(0, 1, (1,), np.float32)}

    def observe(self, view: View) -> dict[str, Any]:
        return {"numb": np.zeros(1, np.float32)}


class Mute(SpokenAdviser):
    """An adviser of one's own."""

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        return {}


class Chore(Rearrange):
    """A kind of tasks of one's own."""


class Buzzing(MobileRobot):
    """A robot's class of one's own, with something that it is made with."""

    def __init__(self, *arguments: Any, held: Any = None):
        super().__init__(*arguments)


def buzzing(held: Any = None) -> tuple[str, RobotModel]:
    return "humanoid", replace(find_model("drone"), name="buzzing", make=partial(Buzzing, held=held))


@pytest.mark.parametrize(
    ("part", "seeds"),
    [
        ({"observation": ("scene_graph", Numb())}, [0, 1]), ({"feedback": Mute(CRITICS["paper"])}, [0, 1]),
        ({"task": Chore()}, [0, 1]), ({"robots": buzzing()}, [0, 1]), ({"env_fn": partial(made_by, 0.0)}, [0, 1]),
        ({"observation": "scene_graph+text", "feedback": "planner", "messages": False}, [0]),
        ({"feedback": UnreliableAdviser("planner", wrong=0.5), "robots": ("humanoid", find_model("drone"))}, [0]),
    ],
)  # fmt: skip
def test_where_an_own_part_may_draw_all_seeds_are_played(part: dict[str, Any], seeds: list[int]) -> None:
    report = evaluate("belief", workers=1, tasks=TASKS[:1], max_steps=2, seeds=[0, 1], **part)
    assert report.settings["seeds"] == seeds and report.run["deterministic"] == (seeds == [0])
    assert len(report.episodes) == len(seeds)


def test_nothing_is_reused_where_nothing_tells_a_robots_class_apart(tmp_path: Path) -> None:
    given: dict[str, Any] = {"workers": 1, "tasks": TASKS[:2], "max_steps": 2, "seeds": [0], "out": tmp_path / "r.json"}
    told = {"robots": buzzing(held=1), **given}
    assert evaluate("belief", **told).run == evaluate("belief", reuse=True, **told).run
    untold, played = {"robots": buzzing(held=threading.Lock()), **given}, list[str]()
    for _ in range(2):
        with pytest.warns(UserWarning, match=r"^robots \(buzzing\): holds what cannot be pickled, or has no file"):
            played.append(evaluate("belief", reuse=True, **untold).settings["robots_sha256"]["buzzing"])
    assert played[0].startswith("unknown-") and played[0] != played[1]


def test_nor_does_an_interrupted_evaluation_go_on_there(tmp_path: Path) -> None:
    def stop(finished: int, total: int) -> None:
        if finished == 1:
            raise KeyboardInterrupt

    given: dict[str, Any] = {
        "robots": buzzing(held=threading.Lock()), "workers": 1, "tasks": TASKS[:2], "max_steps": 2, "seeds": [0],
        "out": tmp_path / "r.json",
    }  # fmt: skip
    with pytest.warns(UserWarning, match="robots"), pytest.raises(KeyboardInterrupt):
        evaluate("belief", progress=stop, **given)
    told = list[int]()
    with pytest.warns(RuntimeWarning, match="of another evaluation"):
        evaluate("belief", progress=lambda finished, total: told.append(finished), **given)
    assert told == [0, 1, 2]


class Errands(Rearrange):
    """A kind with two tasks of its own, which do not tell their L*."""

    def tasks(self, split: str) -> list[Any]:
        return [replace(task, id=f"errand-{number}", optimal_steps=0) for number, task in enumerate(TASKS[:2])]


def test_a_kinds_own_tasks_are_played_and_found_by_their_ids() -> None:
    given: dict[str, Any] = {"task": Errands(), "workers": 1, "seeds": [0]}
    report = evaluate("planner", "test-unseen", **given)
    assert [episode.task.id for episode in report.episodes] == ["errand-0", "errand-1"]
    assert report.plw == 1.0 and all(episode.optimal_steps == task.optimal_steps for episode, task in zip(
        report.episodes, TASKS[:2], strict=True
    ))  # fmt: skip
    (alone,) = evaluate("planner", "test-unseen", tasks=["errand-1"], **given).episodes
    assert alone == report.episodes[1]
    failed = evaluate(staying, "test-unseen", max_steps=1, **given)
    assert (failed.plw, failed.success_rate) == (0.0, 0.0)
    with pytest.raises(TaskError, match="unknown task 'errand-2'"):
        evaluate("planner", "test-unseen", tasks=["errand-2"], **given)
    env = HouseholdEnv(task=Errands(), split="test-unseen")
    assert env.reset(options={"task": "errand-1"})[1]["drone"]["task_id"] == "errand-1"
    assert env.reset(options={"task": "val-seen-000"})[1]["drone"]["task_id"] == "val-seen-000"
    env.close()


def test_a_file_of_another_kind_is_not_to_be_removed(tmp_path: Path) -> None:
    path = tmp_path / "episode.json"
    path.write_text('{"format": "chmarl-pb episode 1"}')
    with pytest.raises(ResultError, match=r"of another kind \(chmarl-pb episode 1\); name one that"):
        load_result(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("import sys\nsys.exit(0)\n", r"its module calls sys\.exit\(0\)"),
        ("def Policy(env):\n  return (\n", r"quits_1\.py, line 2: "),
    ],
)
def test_modules_that_cannot_be_imported(
    text: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    name = f"quits_{int('def' in text)}"
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["evaluate", "--policy", f"{name}:Policy", "--task", "val-unseen-000", "--split", "val-unseen"]) == 2
    assert re.search(words, capsys.readouterr().err)


class Quitter:
    """A policy that ends the process."""

    def __init__(self, env: Any):
        self.env = env

    def reset(self, seed: int | None) -> None: ...

    def act(self, observations: Any, infos: Any) -> Any:
        raise SystemExit(0)


@pytest.mark.parametrize("workers", [1, 2])
def test_a_policy_that_quits_is_an_error(workers: int) -> None:
    with pytest.raises(OptionError, match=r"calls sys\.exit\(0\)"):
        evaluate(Quitter, "val-unseen", tasks=["val-unseen-000", "val-unseen-001"], workers=workers)


def test_going_on_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["evaluate", "--policy", "open-loop", "--split", "val-unseen", "--workers", "1"]
    tasks, out = [f"val-unseen-{number:03d}" for number in range(3)], tmp_path / "r.json"
    command = [*words, *(part for task in tasks for part in ("--task", task)), "--out", str(out)]

    def stop(finished: int, total: int) -> None:
        if finished == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evaluate("open-loop", "val-unseen", tasks=tasks, workers=1, out=out, progress=stop)
    assert main(command) == 0 and "going on: 2 of 3 episodes are there already" in capsys.readouterr().err


def test_what_own_sensors_tell_is_what_the_result_says() -> None:
    class Graphs(SceneGraphSensor):
        """Scene graphs by a sensor of one's own."""

    report = evaluate("search", observation=Graphs(BENCHMARK), workers=1, tasks=TASKS[:1], seeds=[0])
    assert "privileged" not in report.settings and not report.privileged
    assert evaluate("search", observation="visual", workers=1, tasks=TASKS[:1], seeds=[0], max_steps=2).privileged


def test_a_result_gets_a_label_by_one_process_at_a_time(tmp_path: Path) -> None:
    given: dict[str, Any] = {"workers": 1, "tasks": TASKS[:1], "seeds": [0], "out": tmp_path / "r.json", "reuse": True}
    evaluate("belief", label="one", **given)
    with Lock(tmp_path / "r.json"):
        assert evaluate("belief", label="one", **given).run["label"] == "one"
        with pytest.raises(BusyError):
            evaluate("belief", label="other", **given)
    assert load_result(tmp_path / "r.json").run["label"] == "one"
