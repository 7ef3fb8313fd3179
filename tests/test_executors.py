"""Whoever does the jobs, what comes of them is the same; only this process writes files."""

import os
import pickle
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb.cli.arguments import own_files
from chmarl_pb.cli.program import main
from chmarl_pb.data.generate import generate
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.verify import verify
from chmarl_pb.errors import OptionError
from chmarl_pb.executors import Local, executor_of
from chmarl_pb.processes import Job, Result

IDS = [f"val-unseen-{number:03d}" for number in range(6)]


class Elsewhere:
    """Does jobs in another folder, the last first; work, jobs and results travel as bytes, as on a cluster."""

    alone, workers, worthwhile = False, 1, 2

    def __init__(self, folder: Path):
        self.folder, self.jobs = folder, 0

    def map(self, work: Callable[[Job], Result], jobs: Iterable[Job], ordered: bool = False) -> Iterator[Result]:
        sent, here = [pickle.dumps((work, job)) for job in jobs], Path.cwd()
        results = []
        for job in sent if ordered else reversed(sent):
            os.chdir(self.folder)
            try:
                do, argument = pickle.loads(job)
                results.append(pickle.loads(pickle.dumps(do(argument))))
            finally:
                os.chdir(here)
        self.jobs += len(results)
        yield from results

    everywhere = map


@pytest.fixture
def elsewhere(tmp_path: Path) -> Elsewhere:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    return Elsewhere(folder)


def test_processes_are_the_default() -> None:
    assert executor_of(None, 3).workers == 3 and executor_of(None, 1).alone
    with pytest.raises(OptionError, match="workers=0 is not a whole number from 1"):
        executor_of(None, 0)


def test_jobs_are_taken_as_results_are_asked_for() -> None:
    taken: list[float] = []
    jobs = (taken.append(number) or float(number) for number in range(1000))  # type: ignore[func-returns-value]
    results = Local(1).map(abs, jobs, ordered=True)
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    assert len(taken) < 20


def test_an_evaluation_elsewhere_gives_the_same_episodes(elsewhere: Elsewhere) -> None:
    here = chmarl_pb.evaluate("search", "val-unseen", seeds=[0], workers=1, tasks=IDS)
    there = chmarl_pb.evaluate("search", "val-unseen", seeds=[0], tasks=IDS, executor=elsewhere)
    assert there.episodes == here.episodes and there.settings == here.settings
    assert elsewhere.jobs > 1


def test_an_audit_elsewhere_goes_on_where_it_was(elsewhere: Elsewhere, tmp_path: Path) -> None:
    out = tmp_path / "audit.json"
    first = chmarl_pb.audit("val-unseen", seeds=[0], tasks=IDS[:2], executor=elsewhere, out=out)
    played = elsewhere.jobs
    assert first.lines == chmarl_pb.audit("val-unseen", seeds=[0], workers=1, tasks=IDS[:2]).lines
    assert chmarl_pb.audit("val-unseen", seeds=[0], tasks=IDS[:2], executor=elsewhere, out=out).lines == first.lines
    assert elsewhere.jobs == played and list(elsewhere.folder.iterdir()) == []


def test_a_data_set_made_elsewhere_is_the_same_file(elsewhere: Elsewhere, tmp_path: Path) -> None:
    recipe = Recipe("val-unseen", limit=4)
    there = generate(recipe, tmp_path / "there", executor=elsewhere)
    assert there.sha256 == generate(recipe, tmp_path / "here", workers=1).sha256
    assert verify(there, executor=elsewhere) == 4
    assert elsewhere.jobs == 8 and list(elsewhere.folder.iterdir()) == []


def test_homes_are_made_by_several_processes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for workers in ("1", "2"):
        given = ["--seed", "7", "--count", "2", "--workers", workers, "--out", str(tmp_path / workers)]
        assert main(["homes", "generate", *given]) == 0
    one, two = (
        {path.relative_to(tmp_path / name): path.read_bytes() for path in (tmp_path / name).rglob("*.*")}
        for name in ("1", "2")
    )
    assert one == two and len(list((tmp_path / "2").glob("*.urdf"))) == 2
    assert [Path(line).stem for line in capsys.readouterr().out.split()][:2] == ["generated-7", "generated-8"]


def test_own_files_are_those_that_options_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("my_policy.py", "cabin.urdf", "things.toml", "other.txt"):
        Path(name).touch()
    options = {"home": "cabin.urdf", "catalog": "things.toml", "policy": "my_policy:Mine", "robots": ("humanoid",)}
    assert sorted(map(str, own_files(options))) == ["cabin.urdf", "my_policy.py", "things.toml"]
