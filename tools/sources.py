"""Which commit has the code of a result: ``python -m tools.sources HASH ...``; HASH is its sha256, or the beginning.

Results name the code that they were made with by ``source_sha256`` and ``learners_sha256``, those of whole packages. Of
older results ``source_sha256`` is of the Python files alone, without the data of policies and language.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import PurePosixPath

from chmarl_pb.evaluation.provenance import DATA, LEARNED
from chmarl_pb.fingerprint import sha256_of

PACKAGES = ("chmarl_pb", "chmarl_pb/learning", "training")  # that results name; learners were in the last one once
_DATA_FOLDERS = [f"{PACKAGES[0]}/{name}" for name in LEARNED]


def commits() -> list[str]:
    """Return the commits that changed the packages, with their dates, the last first."""
    return _git("log", "--format=%h %cs", "--", *PACKAGES).decode().splitlines()


def hashes(commit: str) -> dict[str, str]:
    """Return package -> sha256 of its files at a commit, as :mod:`chmarl_pb.evaluation.provenance` has it."""
    files = dict[PurePosixPath, str]()
    for line in _git("ls-tree", "-r", commit, "--", *PACKAGES).decode().splitlines():
        about, _, name = line.partition("\t")
        files[PurePosixPath(name)] = about.split()[2]
    code = [path for path in files if path.suffix == ".py"]
    counted = {package: [path for path in code if path.is_relative_to(package)] for package in PACKAGES}
    data = [path for path in files if path.suffix in DATA and any(map(path.is_relative_to, _DATA_FOLDERS))]
    counted[f"{PACKAGES[0]} with its data"] = [*counted[PACKAGES[0]], *data]
    return {name: sha256_of(_content(files[path]) for path in sorted(paths)) for name, paths in counted.items()}


@cache
def _content(blob: str) -> bytes:
    return _git("cat-file", "blob", blob)


def _git(*arguments: str) -> bytes:
    done = subprocess.run(["git", *arguments], check=False, capture_output=True)
    if done.returncode:
        raise SystemExit(f"{done.stderr.decode().strip()}; run this in a clone of the repository")
    return done.stdout


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the last commit with each hash; return 1 if one is of no commit."""
    parser = argparse.ArgumentParser(prog="python -m tools.sources", description=__doc__)
    parser.add_argument("hash", nargs="+", help="7 digits or more")
    wanted = list(dict.fromkeys(parser.parse_args(arguments).hash))
    if short := [start for start in wanted if len(start) < 7]:
        parser.error(f"{short[0]!r}: give 7 digits or more")
    for commit in commits():
        for package, found in hashes(commit.split()[0]).items():
            for start in filter(found.startswith, list(wanted)):
                print(f"{start}: {package} at {commit}", flush=True)
                wanted.remove(start)
        if not wanted:
            return 0
    for start in wanted:
        print(f"{start}: of no commit", file=sys.stderr)
    return 1


if __name__ == "__main__":
    raise SystemExit(main())
