"""The files that a home, thing or robot is made of: regular, inside its folder, each read once, within limits."""

import os
import stat
from functools import lru_cache
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.homes.problem import Refused
from chmarl_pb.reading import MOST_FILE_BYTES, read_regular

MOST_URDF_BYTES = 4 * 2**20
MOST_BYTES = 32 * 2**20  # of all of them
MOST_LINES = 1_000_000  # of all OBJ meshes and material files
MOST_FILES = 1000
MOST_ELEMENTS = 200_000  # of an XML file: each takes far more memory than bytes

_LONGEST_SHOWN = 80  # characters


def _is_link(path: str) -> bool:
    """Return whether a path is a symbolic link.

    Raises:
        OSError: it cannot be a path.
    """
    try:
        return stat.S_ISLNK(os.lstat(path).st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False


@lru_cache(maxsize=4096)
def _path(folder: str, name: str) -> Path:
    """Return the path of a file in a folder; homes share the meshes of their furniture."""
    return Path(folder, name)


def shown(name: str) -> str:
    """Return a name as messages show it: without control characters, and cut where it is long."""
    return repr(name if len(name) <= _LONGEST_SHOWN else f"{name[:_LONGEST_SHOWN]}...")


class Source:
    """The files of one home, or of one thing or robot; what has been read is kept.

    Attributes:
        urdf: where its URDF is.
        whole: what the files make up, as messages call it: "home", "thing" or "robot".
        pictures: path of a texture -> the same as the content of a BMP file, for those that have been needed.
    """

    def __init__(self, urdf: Path, whole: str = "home"):
        """Remember where a URDF is, and so its folder, and what it is of."""
        self.urdf, self.whole = urdf, whole
        self.pictures: dict[Path, bytes] = {}
        # Places of files are texts: a home has a hundred meshes, and paths as objects take longer than reading them.
        self._beside = os.fspath(urdf.parent)
        self._within = os.path.join(urdf.resolve().parent, "")
        self._folders: dict[str, Path] = {}
        self._places: dict[str, str] = {}
        self._lines = 0
        self._named: dict[str, Path] = {}
        self._inner: set[Path] = set()
        self._contents: dict[str, bytes] = {}
        self._bytes = 0

    def read_urdf(self) -> bytes:
        """Return the URDF.

        Raises:
            Refused: it cannot be read.
        """
        try:
            return self.read(self._resolved(os.fspath(self.urdf)), MOST_URDF_BYTES)
        except ValueError as error:
            hint = "; `chmarl-pb homes list` names the packaged homes" if self.whole == "home" else ""
            raise Refused(f"{error}{hint}") from error

    def named(self, name: str) -> tuple[Path, bytes]:
        """Return a file that the URDF names, and its content.

        Raises:
            ValueError: see :meth:`inside` and :func:`read_regular`.
        """
        content = self.read(self._inside(self._beside, name))
        self._named[name] = _path(self._beside, name)
        return self._named[name], content

    def inner(self, beside: Path, name: str, most: int = MOST_FILE_BYTES) -> tuple[Path, bytes]:
        """Return a file that another one names, and its content of at most so many bytes.

        Raises:
            ValueError: see :meth:`inside` and :func:`read_regular`.
        """
        content = self.read(self._inside(os.fspath(beside.parent), name), most)
        self._inner.add(beside.parent / name)
        return beside.parent / name, content

    def inside(self, folder: Path, name: str) -> Path:
        """Return where a name, seen from a folder of the home, leads to in the end.

        Raises:
            ValueError: it leads out of the home's folder.
        """
        return Path(self._inside(os.fspath(folder), name))

    def _inside(self, folder: str, name: str) -> str:
        """Return the same as a text."""
        try:
            place = self._resolved(os.path.join(folder, name))
        except (OSError, RuntimeError, ValueError) as error:  # too long, a loop of links, a null character
            raise ValueError("is not the name of a file; rename it") from error
        if "://" in name or not os.path.join(place, "").startswith(self._within):
            raise ValueError(f"leaves the {self.whole}'s folder; copy it beside the URDF and use a relative path")
        return place

    def _resolved(self, path: str) -> str:
        """Return where a path leads to in the end; most files lie in one folder, which is followed once."""
        if path not in self._places:
            folder, name = os.path.split(path)
            if folder not in self._folders:
                self._folders[folder] = Path(folder).resolve()
            place = os.path.join(self._folders[folder], name)
            odd = name in ("", ".", "..") or "\0" in name or _is_link(place)
            self._places[path] = str(Path(place).resolve()) if odd else place
        return self._places[path]

    def read(self, path: Path | str, most: int = MOST_FILE_BYTES) -> bytes:
        """Return a file's content; it is read at the first time.

        Raises:
            ValueError: see :func:`read_regular`; or the home has too many files or too large ones.
        """
        path = os.fspath(path)
        if path in self._contents:
            return self._contents[path]
        if len(self._contents) > MOST_FILES:
            raise ValueError(f"is one file too many; a {self.whole} has at most {MOST_FILES:,}, join some")
        content = read_regular(path, most)
        self._bytes += len(content)
        if self._bytes > MOST_BYTES:
            raise ValueError(
                f"is too much; the files of a {self.whole} have at most {MOST_BYTES:,} bytes, make them smaller"
            )
        self._contents[path] = content
        return content

    def lines_of(self, text: bytes) -> list[bytes]:
        """Return the lines of a text.

        Raises:
            ValueError: with them, the home's files have too many.
        """
        self._lines += text.count(b"\n") + text.count(b"\r")
        if self._lines > MOST_LINES:
            raise ValueError(f"is too long; meshes and materials have at most {MOST_LINES:,} lines, simplify them")
        return text.splitlines()

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that were read: the URDF, what it names, and what those name."""
        return (self.urdf, *(self._named[name] for name in sorted(self._named)), *sorted(self._inner))

    @property
    def content(self) -> str:
        """The sha256 of all files as they were read."""
        return sha256_of(self._contents[self._resolved(os.fspath(path))] for path in self.files)


def safe_xml(text: bytes) -> ElementTree.Element:
    """Return the root of an XML text without document types and entities.

    Raises:
        ValueError: it is not such a text, or too large.
    """
    if text.count(b"<") > 2 * MOST_ELEMENTS:  # a start and an end
        raise ValueError(f"has more than {MOST_ELEMENTS:,} XML elements; make it smaller")
    try:
        guard = expat.ParserCreate()
        guard.StartDoctypeDeclHandler = _refuse_doctype
        guard.Parse(text, True)
        return ElementTree.fromstring(text)
    except _DoctypeError as error:
        raise ValueError("document types and entities are refused; remove the <!DOCTYPE>") from error
    # The last two: its encoding.
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError) as error:
        raise ValueError(f"not XML ({error}); fix the file at that place") from error


class _DoctypeError(Exception):
    """An XML text declares its type, and with that perhaps entities, which can be any size and any file."""


def _refuse_doctype(*_: object) -> NoReturn:
    raise _DoctypeError
