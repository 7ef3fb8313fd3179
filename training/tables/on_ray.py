"""A step of a run on a Ray cluster: ``python -m training.tables.on_ray ADDRESS MODULE [OPTION ...] --out FOLDER``.

The run's folder, the data sets that it clones from and the weights that it starts from travel to a node; there the same
command runs; what it has written comes back. A step whose node is lost begins again from what this machine has.
"""

import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

from chmarl_pb.errors import OptionError
from chmarl_pb.files import replacing
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.ray_executor import RayExecutor
from training.tables.runs import python

_NEEDS = ("training",)  # of the checkout, which the package does not bring
_TO_SEND = ("--out", "--data", "--start")  # options that name folders of files, or a file

Files = dict[Path, bytes]
Job = tuple[list[str], Files]


def main() -> int:
    """Run the command; return its exit code."""
    return run_command(lambda: _run(*sys.argv[1:]))


def _run(address: str, *command: str) -> int:
    """Run a step on the cluster, print what it prints, and write what it writes; return its exit code."""
    folders = [Path(value) for name, value in pairwise(command) if name in _TO_SEND]
    with RayExecutor(address, _NEEDS) as executor:
        ((code, printed, files),) = executor.map(_do, [(list(command), files_of(folders))])
    for path in sorted(files, key=lambda path: path.stem == "best"):  # a run without its last checkpoint cannot go on
        content = files[path]
        with replacing(path) as temporary:
            temporary.write_bytes(content)
    sys.stdout.buffer.write(printed)
    return code


def files_of(folders: list[Path]) -> Files:
    """Return the files of folders below this one, but not those of locks and logs; a file stands for itself.

    Raises:
        OptionError: a folder lies elsewhere.
    """
    for folder in folders:
        if folder.is_absolute() or ".." in folder.parts:
            raise OptionError(f"{folder}: on other machines it is another folder; name one below the checkout")
    found = (path for folder in folders for path in (folder, *folder.rglob("*")))
    return {path: path.read_bytes() for path in found if path.is_file() and path.suffix not in (".lock", ".txt")}


def _do(job: Job) -> tuple[int, bytes, Files]:
    """Run a step on a node; return its exit code, what it has printed, and the files that it has written."""
    command, files = job
    for path, content in files.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    ended = subprocess.run(
        python(command), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env={**os.environ, "OMP_NUM_THREADS": "1"}
    )
    made = files_of([Path(command[command.index("--out") + 1])])
    return ended.returncode, ended.stdout, {path: data for path, data in made.items() if files.get(path) != data}


if __name__ == "__main__":
    raise SystemExit(main())
