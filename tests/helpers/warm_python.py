"""`python -m ...` and `python -c ...` in a process that has loaded what takes long: see ``warm_server``."""

import os
import runpy
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.helpers.warm_processes import WarmProcess


class WarmPython:
    """What the tests need of ``subprocess.Popen([sys.executable, *words])``, without its start.

    Args:
        words: ``-m MODULE``, ``-c CODE`` or a script, and its arguments.
        folder: where it runs, and what its ``sitecustomize.py`` is in, if it has one.
        environment: all its variables; those of this process if None.
        missing: modules that are not there, as ``sitecustomize.py`` says, too.
    """

    def __init__(
        self,
        words: Sequence[str],
        folder: Path | None = None,
        environment: dict[str, str] | None = None,
        missing: Sequence[str] = (),
    ):
        """Start it."""
        self._told = Path(tempfile.mkdtemp(prefix="chmarl-told-"))
        for name in "12":
            (self._told / name).touch()
        given = list(words), str(folder or Path.cwd()), dict(environment or os.environ), missing, str(self._told)
        self._process = WarmProcess(target=_python, args=given, daemon=True)
        self._process.start()
        self.pid = self._process.pid
        self.kill = self._process.kill

    def poll(self) -> int | None:
        """Return the exit code, or None while it runs."""
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        """Send a signal."""
        assert self.pid is not None
        os.kill(self.pid, number)

    def communicate(self) -> tuple[str, str]:
        """Wait for its end, and return what it has printed."""
        self._process.join()
        self.returncode = self._process.exitcode
        out, errors = ((self._told / name).read_text() for name in "12")
        shutil.rmtree(self._told)
        return out, errors


def run(
    words: Sequence[str],
    folder: Path | None = None,
    environment: dict[str, str] | None = None,
    missing: Sequence[str] = (),
) -> "subprocess.CompletedProcess[str]":
    """Run it to its end, as ``subprocess.run`` does."""
    process = WarmPython(words, folder, environment, missing)
    out, errors = process.communicate()
    return subprocess.CompletedProcess(list(words), process.returncode or 0, out, errors)


def _python(words: list[str], folder: str, variables: dict[str, str], missing: Sequence[str], told: str) -> None:
    """Do what the interpreter does with its arguments."""
    for number in (1, 2):
        os.dup2(os.open(f"{told}/{number}", os.O_WRONLY), number)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(variables)
    sys.path[:0] = [path for path in variables.get("PYTHONPATH", "").split(os.pathsep) if path]
    for name in [name for name in sys.modules if name.partition(".")[0] in missing]:
        del sys.modules[name]
    if missing:
        runpy.run_path(f"{folder}/sitecustomize.py")
    kind, rest, sys.orig_argv = words[0], words[1:], [sys.executable, *words]
    if kind == "-m":
        sys.argv = ["-m", *rest[1:]]
        runpy.run_module(rest[0], run_name="__main__", alter_sys=True)
    elif kind == "-c":
        sys.argv = ["-c", *rest[1:]]
        exec(compile(rest[0], "<string>", "exec"), {"__name__": "__main__"})
    else:
        sys.argv = words
        sys.path.insert(0, str(Path(kind).parent))
        runpy.run_path(kind, run_name="__main__")
