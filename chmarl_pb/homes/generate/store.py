"""Generated homes as files: named after their seeds, made when asked for, in a folder with one set of meshes."""

import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

from chmarl_pb.errors import OptionError
from chmarl_pb.files import cache_folder, replacing, write_atomically
from chmarl_pb.homes.generate.draws import VERSION
from chmarl_pb.homes.generate.names import MOST_SEED, home_name, seed_of
from chmarl_pb.limits import whole_number

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
        OptionError: the seed is none, or the folder has other files by the names of the home's, as those that were
            changed by hand.
        WriteError: the folder cannot be written.
    """
    seed = check_seed(seed)
    if out is not None:
        with tempfile.TemporaryDirectory(prefix="chmarl-home-") as scratch:
            made = _write(seed, Path(scratch))
            return put_home(files_of(made), Path(out))
    path = _path(seed, _own_folder())
    if not path.is_file():
        _write(seed, path.parent)
        _prune(path.parent)
    return path


def check_seed(seed: int) -> int:
    """Return the seed of a home.

    Raises:
        OptionError: it is none.
    """
    return whole_number("seed", seed, 0, MOST_SEED - 1)


def files_of(home: Path) -> dict[Path, bytes]:
    """Return all files in the folder of a home by their paths in it; its URDF, which needs the others, last."""
    files = sorted((path for path in home.parent.rglob("*") if path.is_file()), key=lambda path: path == home)
    return {path.relative_to(home.parent): path.read_bytes() for path in files}


def put_home(files: Mapping[Path, bytes], folder: Path) -> Path:
    """Write the files of a home into a folder, where it may be already, and return its URDF.

    Args:
        files: by their paths in the folder, the URDF last.
        folder: homes in it share their meshes.

    Raises:
        OptionError: a file differs from the one that is there; then nothing is written. A picture is drawn anew.
        WriteError: the folder cannot be written.
    """
    missing = {path: content for path, content in files.items() if not _holds(folder / path, content)}
    for path in missing:
        if path.suffix != ".png" and (folder / path).exists():
            raise OptionError(
                f"{folder / path} is there already and differs; name another folder, or move it away to make it anew"
            )
    for path, content in missing.items():
        with replacing(folder / path) as temporary:
            temporary.write_bytes(content)
    return folder / list(files)[-1]


def _holds(path: Path, content: bytes) -> bool:
    """Return whether a file, e.g. a mesh that homes share, is there already."""
    return path.is_file() and path.read_bytes() == content


def is_generated(name_or_path: str | Path) -> bool:
    """Return whether this is the name of a generated home, or the path of one in the user's cache."""
    path = Path(str(name_or_path))
    return seed_of(str(name_or_path)) is not None or (seed_of(path.stem) is not None and path.parent == _own_folder())


def _path(seed: int, folder: Path) -> Path:
    return folder / f"{home_name(seed)}.urdf"


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


def _write(seed: int, folder: Path) -> Path:
    """Write a home and return its URDF, which is written last and is therefore there only with all that it needs."""
    from chmarl_pb.homes.assemble import write_home  # two seconds of imports, of no use where the home is there already
    from chmarl_pb.homes.generate.home_layout import draw_layout
    from chmarl_pb.homes.layout_text import layout_text

    layout, path = draw_layout(seed), _path(seed, folder)
    write_atomically(path.with_suffix(".toml"), layout_text(layout))
    return write_home(layout, path)
