"""Write the tables of docs/performance.md from measured JSON: ``python -m benchmarks.tables``.

Each table stands between ``<!-- NAME -->`` and ``<!-- end of NAME -->``; its numbers come from ``docs/NAME.json``,
which ``chmarl-pb bench --json docs/bench.json`` and ``python -m benchmarks.peers --json docs/peers.json`` write.
"""

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.peers import Result
from benchmarks.simulators import OURS
from chmarl_pb.cli.bench import readable
from chmarl_pb.files import write_atomically

#: What is asked of a figure: its name and its unit -> goal.
GOALS = {
    ("scene graph, fresh tasks", "joint steps/s"): "10,000",
    ("scene graph, the same 50 tasks", "joint steps/s"): "15,000",
    ("visual, two 128 px views, fresh tasks", "joint steps/s"): "5,000",
    ("a new home every 100 episodes, scene graph", "joint steps/s"): "8,000",
    ("visual, 128 px, first visits", "times plain TinyRenderer"): "at most 1",
    ("reset", "resets/s"): "300",
    ("URDF files loaded after the first reset of each home", "files"): "0",
    ("memory of one more environment, scene graph", "MB"): "under 60",
    ("memory of one more environment, visual", "MB"): "under 60",
    ("vector environment, scene graph", "times 1 process, 2 processes"): "1.8",
    ("vector environment, two 128 px views", "times 1 process, 2 processes"): "1.8",
    ("vector environment, scene graph", "times 1 process, 2 processes asynchronous"): "1.8",
    ("vector environment, two 128 px views", "times 1 process, 2 processes asynchronous"): "1.8",
    ('execution="simulated"', "times real time"): "20",
    ("import chmarl_pb", "s"): "under 0.3",
    ("first reset of a home, empty view store", "s"): "under 2",
}


def bench_table(content: Any) -> str:
    """Return the figures of ``chmarl-pb bench`` as a Markdown table under a line on the machine."""
    rows = [
        (
            row["name"], *(readable(row[key]) for key in ("median", "least", "greatest")), row["unit"],
            GOALS.get((row["name"], row["unit"]), ""),
        )
        for row in content["figures"]
    ]  # fmt: skip
    header = ("figure", "median", "least", "greatest", "unit", "goal")
    return f"chmarl_pb {content['version']}, {content['machine']}.\n\n{_markdown(header, rows)}"


def peers_table(content: Any) -> str:
    """Return the rates of all simulators, with the ratio of ours to each, and a list of those that were skipped."""
    results = [Result(**{**entry, "values": tuple(entry["values"])}) for entry in content]
    medians = {(result.name, result.size): result.median for result in results if result.values}
    sizes = sorted({result.size for result in results}, key=lambda size: size or 0)
    names = list(dict.fromkeys(result.name for result in results))

    def cell(name: str, size: int | None) -> str:
        if (name, size) not in medians:
            return ""
        rate, ours = medians[name, size], medians.get((OURS, size))
        return readable(rate) + (f" ({readable(ours / rate)})" if ours and name != OURS else "")

    header = ("simulator", *("steps/s, no pictures" if size is None else f"frames/s, {size} px" for size in sizes))
    rows = [(name, *(cell(name, size) for size in sizes)) for name in names]
    skipped = sorted({f"{result.name} was skipped: {result.skipped}." for result in results if not result.values})
    return "\n\n".join([_markdown(header, rows), *skipped])


TABLES: dict[str, Callable[[Any], str]] = {"bench": bench_table, "peers": peers_table}


def _markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    rule = ["---" if name in ("figure", "simulator", "unit") else "--:" for name in header]
    return "\n".join(f"| {' | '.join(row)} |" for row in (header, rule, *rows))


def filled(text: str, name: str, table: str) -> str:
    """Return a document with one table replaced.

    Raises:
        ValueError: the document has no place for it.
    """
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    place = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    if not place.search(text):
        raise ValueError(f"no {begin} ... {end} in the document")
    return place.sub(lambda _: f"{begin}\n{table}\n{end}", text)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fill every table whose JSON is there."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--docs", type=Path, default=Path("docs"), metavar="DIR", help="folder (default: docs)")
    folder = parser.parse_args(arguments).docs
    page = folder / "performance.md"
    text = page.read_text(encoding="utf-8")
    for name, table_of in TABLES.items():
        data = folder / f"{name}.json"
        if data.is_file():
            text = filled(text, name, table_of(json.loads(data.read_text(encoding="utf-8"))))
            print(f"{page}: {name} from {data}")
    write_atomically(page, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
