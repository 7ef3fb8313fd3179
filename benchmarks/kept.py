"""What is kept of runs before: it stays, and is said to be of other code where it is."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from chmarl_pb.evaluation.provenance import source_hash

#: Field of a kept row: the sha256 of the package's Python files that made it.
SOURCE = "source_sha256"


def warn_of_other_code(path: Path, rows: Iterable[Mapping[str, Any]]) -> None:
    """Print how many rows of a file were made by other code than the package's, if there are any.

    Args:
        path: of the file.
        rows: kept in it; one without ``SOURCE`` is of other code, as it was written before rows had it.
    """
    sources = [row.get(SOURCE) for row in rows]
    if others := sum(source != source_hash() for source in sources):
        print(f"{path}: {others:,} of {len(sources):,} rows were made by other code; delete it to make all anew")
