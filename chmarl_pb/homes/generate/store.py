"""Generated homes as files: named after their seeds, made when asked for, in a folder with one set of meshes."""

import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path

from chmarl_pb.errors import OptionError
from chmarl_pb.files import cache_folder, write_atomically
from chmarl_pb.homes.generate.draws import VERSION
from chmarl_pb.homes.generate.names import MOST_SEED, home_name, seed_of

#: Homes that the user's cache holds, some 160 KB each; those that were made first give way, and can be made again.
MOST_HOMES = 4000

_IN_USE = 3600  # seconds: younger homes stay, for they may just be played in


def generate_home(seed: int, out: str | Path | None = None) -> Path:
    """Return the URDF of the home of a seed, made with its layout (TOML) beside it unless it is there already.

    Args:
        seed: whole number from 0 on; it alone decides about the home, on any machine.
        out: folder to write to; by default one of generated homes in the user's cache, which holds the last few
            thousand. Homes in one folder share their meshes.

    Raises:
        OptionError: the seed is none.
        WriteError: the folder cannot be written.
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < MOST_SEED:
        raise OptionError(f"seed={seed!r} is not a whole number from 0 to {MOST_SEED - 1:,}")
    path = (_own_folder() if out is None else Path(out)) / f"{home_name(seed)}.urdf"
    if out is not None or not path.is_file():
        _write(seed, path)
        if out is None:
            _prune(path.parent)
    return path


def is_generated(name_or_path: str | Path) -> bool:
    """Return whether this is the name of a generated home, or the path of one in the user's cache."""
    path = Path(str(name_or_path))
    return seed_of(str(name_or_path)) is not None or (seed_of(path.stem) is not None and path.parent == _own_folder())


def _own_folder() -> Path:
    """Return the folder of the homes of this version of the rules."""
    folder = cache_folder()
    return folder / "homes" / f"generated-{VERSION}" if folder else Path(_temporary().name)


@cache
def _temporary() -> "tempfile.TemporaryDirectory[str]":
    """Return a folder that lasts as long as this process, for users without a cache."""
    return tempfile.TemporaryDirectory(prefix="chmarl-homes-")


def _prune(folder: Path) -> None:
    """Remove the homes that were made first, where there are more than ``MOST_HOMES``, but none of the last hour."""
    homes = list(folder.glob("*.urdf"))
    if len(homes) <= MOST_HOMES:
        return
    made = []
    for path in homes:
        with suppress(FileNotFoundError):  # another process has removed it
            made.append((path.stat().st_mtime, path))
    for when, path in sorted(made)[: -MOST_HOMES // 2]:  # half of them, so that most homes are made without looking
        if when < time.time() - _IN_USE:
            with suppress(OSError):  # open elsewhere, on systems that keep such files
                path.unlink(missing_ok=True)
                path.with_suffix(".toml").unlink(missing_ok=True)


def _write(seed: int, path: Path) -> None:
    """Write a home: first its meshes and its layout, last its URDF, which is therefore there only with all of them."""
    from chmarl_pb.homes.assemble import write_home  # two seconds of imports, of no use where the home is there already
    from chmarl_pb.homes.generate.home_layout import draw_layout
    from chmarl_pb.homes.layout_text import layout_text

    layout = draw_layout(seed)
    write_atomically(path.with_suffix(".toml"), layout_text(layout))
    write_home(layout, path)
