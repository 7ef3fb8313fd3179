"""What is installed where, and with which interpreter."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
VERSIONS = ("3.10", "3.11", "3.12", "3.13")
#: Kinds of machines -> Python versions that official PyBullet has a wheel for, and those that the fork has one for.
WHEELS = {
    ("linux", "x86_64"): (("3.10", "3.11"), VERSIONS),
    ("darwin", "arm64"): ((), VERSIONS),
    ("darwin", "x86_64"): ((), ("3.11", "3.12")),
    ("win32", "AMD64"): ((), VERSIONS),
    ("linux", "aarch64"): ((), ()),
}


def fits(marker: Marker | None, machine: tuple[str, str], version: str) -> bool:
    names = {"sys_platform": machine[0], "platform_machine": machine[1], "python_version": version}
    return marker is None or marker.evaluate(names)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("machine", WHEELS, ids=" ".join)
def test_one_pybullet_is_installed_and_ready_made_where_there_is_one(machine: tuple[str, str], version: str) -> None:
    wanted = [Requirement(line) for line in PROJECT["dependencies"]]
    chosen = [r.name for r in wanted if r.name.startswith("pybullet") and fits(r.marker, machine, version)]
    official, fork = (version in versions for versions in WHEELS[machine])
    assert chosen == (["pybullet"] if official else ["pybullet-arm64"])
    assert official or fork or machine in (("linux", "aarch64"), ("darwin", "x86_64"))


def test_the_pythons_that_are_promised_are_allowed() -> None:
    allowed = SpecifierSet(PROJECT["requires-python"])
    named = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    assert tuple(named) == VERSIONS
    assert [version in allowed for version in ("3.9.18", "3.10.0", "3.13.9", "3.14.0")] == [False, True, True, False]


def make(path: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run make as far as the interpreter; ``path`` is the first folder on PATH."""
    command = ["make", "--no-print-directory", f"VENV={path / 'venv'}", *words]
    return subprocess.run(command, cwd=ROOT, env={"PATH": f"{path}:/usr/bin:/bin"}, capture_output=True, text=True)


def interpreter(path: Path, name: str, code: str) -> None:
    (path / name).write_text(f"#!/bin/sh\n{code}\n")
    (path / name).chmod(0o755)


REAL = f'exec "{sys.executable}" "$@"'
SHIM = "echo 'no such version is installed' >&2; exit 127"  # what pyenv leaves on PATH for each version it knows
OLD = f"""exec "{sys.executable}" -c 'import sys; sys.version_info = (3, 9, 18); exec(sys.argv[2])' "$@" """


@pytest.mark.parametrize(
    ("there", "taken"),
    [
        ({"python3.11": REAL, "python3.12": REAL, "python3.13": REAL}, "python3.11"),
        ({"python3.11": SHIM, "python3.12": REAL, "python3.10": REAL}, "python3.12"),
        ({"python3.11": SHIM, "python3.12": SHIM, "python3.13": REAL, "python3.10": REAL}, "python3.13"),
        ({"python3.11": SHIM, "python3.12": OLD, "python3.13": SHIM, "python3.10": SHIM, "python3": REAL}, "python3"),
    ],
)
def test_make_takes_the_first_interpreter_that_runs(there: dict[str, str], taken: str, tmp_path: Path) -> None:
    for name, code in there.items():
        interpreter(tmp_path, name, code)
    assert f"{taken} -m venv" in make(tmp_path, "--dry-run", "demo").stdout


@pytest.mark.parametrize("code", [SHIM, OLD])
def test_make_says_what_it_needs(code: str, tmp_path: Path) -> None:
    interpreter(tmp_path, "python3.15", code)
    done = make(tmp_path, "demo", "PYTHON=python3.15")
    assert done.returncode == 2 and not (tmp_path / "venv").exists()
    assert "needs Python 3.10 to 3.13" in done.stderr and "make demo PYTHON=" in done.stderr


def test_ci_runs_the_readmes_test_command_and_builds_the_documentation() -> None:
    run = (ROOT / ".ci" / "run").read_text()
    assert "\nmake test\n" in run and "\nmake docs\n" in run
    assert re.search(r"^make test ", (ROOT / "README.md").read_text(), re.MULTILINE)
