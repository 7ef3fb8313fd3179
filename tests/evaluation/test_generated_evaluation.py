"""Evaluation in generated homes: home after home, each in one process, with the homes' recorded hashes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest

from chmarl_pb.cli import main
from chmarl_pb.errors import TaskError
from chmarl_pb.evaluation import play
from chmarl_pb.evaluation.drawn import stream_tasks
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.play import Job, Setup
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.executors import Local
from chmarl_pb.homes import home as home_module
from chmarl_pb.tasks.generated_homes import EPISODES_IN_A_HOME
from chmarl_pb.tasks.splits import fixed_homes, load_tasks


def guessed(setup: Setup, jobs: Sequence[Job]) -> Iterator[Played]:
    """Yield made-up episodes: every other home is one where all goes well."""
    homes = list(dict.fromkeys(task.home for task, _ in jobs))
    for task, seed in jobs:
        yield Played(task, seed, task.optimal_steps, homes.index(task.home) % 2 == 0, 10.0)


def test_homes_are_played_one_after_the_other_and_need_not_be_made_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(home_module, "generate_home", lambda seed: pytest.fail(f"makes the home of {seed}"))
    played: list[str] = []

    def plays(setup: Setup, jobs: Sequence[Job]) -> Iterator[Played]:
        played.extend(task.home for task, _ in jobs)
        return guessed(setup, jobs)

    report = evaluate("random", "generated-test", seeds=(0, 1, 2), plays=plays)
    assert len(played) == 6000 and sum(one != other for one, other in zip(played[1:], played, strict=False)) == 99
    assert report.settings["homes_sha256"].items() <= fixed_homes().items()
    assert [episode.job for episode in report.episodes[:2]] == [(task, 0) for task in load_tasks("generated-test")[:2]]
    figure = report.summary.success_rate
    assert (
        figure.mean == 0.5
        and figure.low == pytest.approx(0.4, abs=0.02)
        and figure.high == pytest.approx(0.6, abs=0.02)
    )


def test_jobs_of_a_home_go_to_one_process_where_there_are_many_homes() -> None:
    jobs = [(task, seed) for task in load_tasks("generated-val") for seed in (0, 1)]
    lots = play._lots(jobs, Local(2))
    assert [job for lot in lots for job in lot] == jobs
    assert len(lots) == 50 and all(len({task.home for task, _ in lot}) == 1 for lot in lots)
    assert max(map(len, play._lots(jobs, Local(100)))) == 2, "many processes share the jobs of a home"
    few: list[Job] = [(task, 0) for task in load_tasks("test-seen")]
    assert sorted(play._lots(few, Local(2)), key=lambda lot: few.index(lot[0])) == [[job] for job in few]


def test_the_hash_of_a_fixed_home_is_the_recorded_one() -> None:
    name, digest = next(iter(fixed_homes().items()))
    assert home_hash(name) == digest


def test_the_endless_split_is_not_evaluated() -> None:
    with pytest.raises(TaskError, match="endless; use generated-val or generated-test"):
        evaluate("planner", "generated")


def test_drawn_tasks_of_the_stream_are_what_a_reset_plays() -> None:
    tasks = stream_tasks(2, seed=3)
    assert tasks == stream_tasks(2, seed=3) and tasks[0].home == tasks[1].home
    from chmarl_pb.envs.parallel import HouseholdEnv

    env = HouseholdEnv(split="generated")
    env.reset(seed=3 * 10**6 * EPISODES_IN_A_HOME + 1)
    assert env.task == tasks[1]
    env.close()


@pytest.mark.parametrize("workers", [1, 2])
def test_policies_play_generated_homes(workers: int) -> None:
    tasks = load_tasks("generated-val")[::100]
    report = evaluate("planner", "generated-val", tasks=tasks, workers=workers)
    assert (report.success_rate, report.plw) == (1.0, 1.0)
    other = replace(tasks[0], id="mine", home=tasks[1].home)
    assert other not in [episode.task for episode in report.episodes]


def test_the_command_says_what_was_drawn_anew(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["evaluate", "--policy", "random", "--split", "generated-val", "--workers", "1", "--seeds", "1"]
    assert main([*words, "--max-steps", "1", "--task", "generated-val-000", "--task", "generated-val-010"]) == 0
    assert "interval over homes:" in " ".join(capsys.readouterr().out.split())
