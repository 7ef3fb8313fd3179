"""``chmarl-pb cache``: show or clear the pictures of homes on disk."""

from datetime import datetime

from rich.console import Console
from rich.table import Column, Table

from chmarl_pb.sensing.view_store import Entry, view_store


def run_cache(clear: bool) -> int:
    """Print what is stored and where, or remove it all."""
    store = view_store()
    if store is None:
        print("no pictures are stored on disk")
        return 0
    entries = store.entries()
    size = sum(entry.bytes for entry in entries) / 2**20
    if clear:
        store.clear()
        print(f"{store.folder}: removed {len(entries)} files, {size:,.1f} MB")
        return 0
    if entries:
        _print_table(entries)
    print(f"{store.folder}: {len(entries)} files, {size:,.1f} MB of {store.limit / 2**20:,.0f} MB")
    return 0


def _print_table(entries: list[Entry]) -> None:
    table = Table("home, camera, pixels", Column("MB", justify="right"), "last used")
    for entry in reversed(entries):
        used = datetime.fromtimestamp(entry.used).strftime("%Y-%m-%d %H:%M")
        what = entry.path.stem.rpartition("_")[0]
        table.add_row(what, f"{entry.bytes / 2**20:,.1f}", used)
    Console().print(table)
