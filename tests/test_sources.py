"""The commit whose code a result was made with."""

import subprocess
from pathlib import Path
from types import ModuleType

import pytest

import chmarl_pb
from chmarl_pb.evaluation.provenance import source_hash
from tools.sources import main


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty repository, in which the test is."""
    monkeypatch.chdir(tmp_path)
    subprocess.run(["git", "init", "--quiet"], check=True)
    return tmp_path


def commit(content: str) -> tuple[str, str]:
    """Commit a version of the package, and return the commit and the hash that its results have."""
    names = ("__init__.py", "deeper/part.py", "about.txt", "policies/learned.json", "tasks/language/words.txt")
    for file in (Path("chmarl_pb") / name for name in names):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content)
    subprocess.run(["git", "add", "--all"], check=True)
    who = ["-c", "user.name=N", "-c", "user.email=n@example.org"]
    subprocess.run(["git", *who, "commit", "--quiet", "--message", content], check=True)
    package = ModuleType("chmarl_pb")
    package.__file__ = str(Path("chmarl_pb/__init__.py").resolve())
    head = subprocess.run(["git", "rev-parse", "--short", "HEAD"], check=True, capture_output=True, text=True)
    return head.stdout.strip(), source_hash(package)


def test_a_hash_names_its_commit(repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    versions = [commit(f"VERSION = {number}\n") for number in range(3)]
    assert main([sha[:8] for _, sha in versions]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {(line[:8], line.split()[-2]) for line in lines} == {(sha[:8], head) for head, sha in versions}


def test_the_package_of_results_has_data_that_counts(
    repository: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    head, _ = commit("VERSION = 1\n")
    monkeypatch.setattr(chmarl_pb, "__file__", str(Path("chmarl_pb/__init__.py").resolve()))
    sha = source_hash.__wrapped__(chmarl_pb)
    assert main([sha]) == 0
    assert capsys.readouterr().out.split(": ")[1].startswith(f"chmarl_pb with its data at {head}")
    for name, counts in (("policies/learned.json", True), ("tasks/language/words.txt", True), ("about.txt", False)):
        before = source_hash.__wrapped__(chmarl_pb)
        (Path("chmarl_pb") / name).write_text("other")
        assert (source_hash.__wrapped__(chmarl_pb) != before) == counts, name


def test_hashes_of_no_commit_are_named(repository: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head, sha = commit("VERSION = 1\n")
    assert main(["0" * 8, sha]) == 1
    told = capsys.readouterr()
    assert f"chmarl_pb at {head}" in told.out and told.err == "00000000: of no commit\n"


def test_elsewhere_it_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match="run this in a clone"):
        main(["0" * 8])
