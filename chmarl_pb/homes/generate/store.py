"""Generated homes as files: named after their seeds, made when asked for, in a folder with one set of meshes.

Beside a home in the user's cache lies its seal, which names its files and has their hash: a home that differs from it,
or has none, as those of earlier versions, is made anew.
"""

import os
import re
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

from chmarl_pb.assets import URDF_DIR
from chmarl_pb.errors import OptionError, WriteError
from chmarl_pb.files import cache_folder, replaced_name, replacing, sealed, unsealed, write_atomically
from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.homes.generate.draws import VERSION
from chmarl_pb.homes.generate.names import MOST_SEED, home_name, seed_of
from chmarl_pb.kept import Kept
from chmarl_pb.limits import whole_number
from chmarl_pb.reading import read_regular

#: Homes that the user's cache holds, some 160 KB each; those that were made first give way, and can be made again.
MOST_HOMES = 4000

_IN_USE = 3600  # seconds: younger homes stay, for they may just be played in
_ENDINGS = (".urdf", ".toml", ".json")  # of a home, its layout and its seal
_MESHES = "meshes"
_FOLDER = re.compile(r"generated-[0-9]+")
_WHOLE: Kept[Path] = Kept(32)


def generate_home(seed: int, out: str | Path | None = None) -> Path:
    """Return the URDF of the home of a seed, made with its layout (TOML) beside it unless it is there already, whole.

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
        return put_home(_files(seed), Path(out))
    path = _own_folder() / f"{home_name(seed)}.urdf"
    return _WHOLE.get(path, _seal(path), lambda: _whole(seed, path))


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
    return generated_seed(name_or_path) is not None


def generated_seed(name_or_path: str | Path) -> int | None:
    """Return the seed of a generated home by its name, or by its path in the user's cache; None if it is no such."""
    path = Path(str(name_or_path))
    seed = seed_of(str(name_or_path))
    if seed is None and path.suffix == ".urdf" and seed_of(path.stem) is not None and "\0" not in str(path):
        there = os.path.realpath(path.parent) == os.path.realpath(_own_folder())
        return seed_of(path.stem) if there else None
    return seed


def kept_files(homes: Path) -> Iterator[Path]:
    """Yield what any version has written into the cache's folder of generated homes, and nothing of others.

    A link in the place of a folder is yielded itself, and nothing that it leads to.
    """
    for folder in sorted(homes.glob("generated-*")):
        if _FOLDER.fullmatch(folder.name):
            yield from [folder] if folder.is_symlink() else _kept_in(folder)


def _kept_in(folder: Path) -> Iterator[Path]:
    for file in folder.glob("*"):
        name = Path(replaced_name(file))
        if seed_of(name.stem) is not None and name.suffix in _ENDINGS:
            yield file
    if (meshes := folder / _MESHES).is_symlink():
        yield meshes
        return
    names = {file.name for file in (URDF_DIR / "furniture" / _MESHES).glob("*")}
    for home in folder.glob("*.urdf"):
        names |= {Path(name).name for name in _sealed(home)[1]} if seed_of(home.stem) is not None else set()
    yield from (file for file in meshes.glob("*") if replaced_name(file) in names)


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
                for ending in _ENDINGS:
                    path.with_suffix(ending).unlink(missing_ok=True)


def _files(seed: int) -> dict[Path, bytes]:
    """Return the files of a home by their paths in its folder, its URDF last."""
    from chmarl_pb.homes.assemble import home_files  # two seconds of imports, of no use where the home is there already
    from chmarl_pb.homes.generate.home_layout import draw_layout
    from chmarl_pb.homes.layout_text import layout_text

    layout, name = draw_layout(seed), home_name(seed)
    return {Path(f"{name}.toml"): layout_text(layout).encode()} | home_files(layout, f"{name}.urdf")


# Homes in the cache tell when they are damaged


def _whole(seed: int, path: Path) -> tuple[Path, list[Path]]:
    """Return a home, made anew unless it is as it was made, and its files.

    Processes that do so at once write the same bytes; the seal comes last, and where there is no place for it, the
    home is compared with what it has to be in every process.
    """
    digest, names = _sealed(path)
    if not names or digest != _digest(path.parent, names):
        from chmarl_pb.homes.assemble import write_files

        files = _files(seed)
        for place in (Path(_MESHES), *files, Path(_seal(path).name)):
            _unlink_odd(path.parent / place)
        write_files(files, path.parent)
        names = [file.as_posix() for file in files]
        seal = {"sha256": sha256_of(files.values()), "files": names}
        with suppress(WriteError):
            write_atomically(_seal(path), sealed(seal, path.stem))
        _prune(path.parent)
    return path, [_seal(path), *(path.parent / name for name in names)]


def _unlink_odd(path: Path) -> None:
    """Remove what is neither a file nor a folder, as a link, which homes must not follow, or a pipe."""
    if path.is_symlink() or not (path.is_file() or path.is_dir()):
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _seal(path: Path) -> Path:
    return path.with_suffix(".json")


def _sealed(path: Path) -> tuple[str, list[str]]:
    """Return the hash of a home's files as they were made, and their names; none if its seal is not good."""
    with suppress(ValueError, RecursionError):
        seal = unsealed(read_regular(_seal(path)).decode(), path.stem)
        return seal["sha256"], seal["files"]
    return "", []


def _digest(folder: Path, names: list[str]) -> str | None:
    """Return the hash of some files as they are now, None if one cannot be read or is a link."""
    if any(os.path.islink(folder / name) for name in (_MESHES, *names)):
        return None
    try:
        return sha256_of(read_regular(folder / name) for name in names)
    except ValueError:
        return None
