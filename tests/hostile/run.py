"""``python -m tests.hostile.run [KIND ...] [--cases N]``: how readers end on mutated files; one line of JSON a kind."""

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.hostile.kinds import Kind, kinds
from tests.hostile.mutations import SECRET, Stream, replaced
from tests.hostile.watch import Guard, Openings, Worker

_ODD = 0.02  # share of the cases in which a file is a link, a pipe, a folder, a device or endless
_USED = 10  # of so many cases one is also used: a home by cameras, a result for a page
_NAMED = (".urdf", ".obj", ".stl", ".dae", ".mtl", ".png")


def make(kind: Kind, valid: Sequence[dict[str, bytes]], rng: Stream, folder: Path) -> None:
    """Write the files of a case."""
    files = dict(valid[int(rng.integers(len(valid)))])
    name = kind.mutated[int(rng.integers(len(kind.mutated)))]
    for _ in range(int(rng.choice((1, 1, 1, 2, 3)))):
        try:
            files[name] = kind.mutations[int(rng.integers(len(kind.mutations)))](files[name], rng)
        except (ValueError, RecursionError):  # no JSON any more, or one that is nested too deeply
            break
    folder.mkdir()
    for other, content in files.items():
        (folder / other).write_bytes(content)
    if rng.random() < _ODD:
        # A file that the user names may be a link to anywhere; what it names stays in its folder.
        replaced(folder / name, rng, outside=name.endswith(_NAMED) and name != "home.urdf")


def fuzz(name: str, kind: Kind, cases: Sequence[int], guard: Guard, keep: Path | None) -> dict[str, Any]:
    """Play the cases of a kind and count how they end."""
    ends: Counter[str] = Counter()
    bad: dict[str, str] = {}
    slowest, start = 0.0, time.monotonic()
    with tempfile.TemporaryDirectory(prefix="hostile-") as place:
        root, before = Path(place), os.getcwd()
        secret = root / SECRET
        secret.write_text("v 0 0 0\n")
        worker = Worker(guard, Openings(secret))
        os.chdir(root)
        valid = kind.files()
        for number, files in enumerate(valid):  # whole ones load; what is loaded once is there for all cases
            folder = root / f"valid-{number}"
            folder.mkdir()
            for other, content in files.items():
                (folder / other).write_bytes(content)
            kind.load(folder)
            if kind.use:
                kind.use(folder)
        for case in cases:
            folder = root / str(case)
            make(kind, valid, np.random.default_rng([zlib.crc32(name.encode()), case]), folder)
            end = worker.end_of(kind.use if kind.use and case % _USED == 9 else kind.load, folder)
            ends[end.outcome] += 1
            slowest = max(slowest, end.seconds)
            if not end.is_good:
                bad[str(case)] = f"{end.outcome}: {end.says} {' | '.join(end.deeds)}"
                if keep:
                    shutil.copytree(folder, keep / f"{name}-{case}", symlinks=True, ignore=_pipes, dirs_exist_ok=True)
            shutil.rmtree(folder)
        worker.close()
        os.chdir(before)
    took = {"slowest_s": round(slowest, 2), "seconds": round(time.monotonic() - start)}
    return {"kind": name, "cases": len(cases), **ends, "bad": bad, **took}


def _pipes(folder: str, names: list[str]) -> list[str]:
    odd = [name for name in names if not Path(folder, name).is_file() or Path(folder, name).stat().st_size > 2**24]
    return [name for name in odd if not Path(folder, name).is_dir()]


def main(arguments: Sequence[str] | None = None) -> int:
    """Play the cases; 1 if one ends badly."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", help="default: all")
    parser.add_argument("--cases", type=int, default=20, help="of each kind")
    parser.add_argument("--case", type=int, action="append", help="only these")
    parser.add_argument("--keep", type=Path, help="folder for the files of the cases that end badly")
    given = parser.parse_args(arguments)
    import torch

    torch.set_num_threads(1)
    known, failed = kinds(given.cases), 0
    with tempfile.TemporaryDirectory(prefix="hostile-cache-") as cache:
        os.environ |= {"CHMARL_CACHE": cache, "TMPDIR": cache}
        tempfile.tempdir = None
        guard = Guard()
        for name in given.kinds or known:
            found = fuzz(name, known[name], given.case or range(given.cases), guard, given.keep)
            print(json.dumps(found), flush=True)
            failed += len(found["bad"])
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
