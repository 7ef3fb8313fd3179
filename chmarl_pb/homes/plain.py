"""A home as PyBullet may read it: a copy that holds nothing but what we have parsed and written ourselves.

PyBullet's importers end the process on many a broken file, follow names out of the folder, and look for
meshes in the working directory first. So they never see a user's file: every home is written anew, as one root
with all things fixed to it, in the plainest words of URDF and OBJ. Frames without geometry are left out.
"""

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from threading import Lock
from xml.sax.saxutils import quoteattr

import numpy as np

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.mesh import Mesh
from chmarl_pb.homes.shape import Numbers, Origin
from chmarl_pb.homes.solids import Points
from chmarl_pb.homes.urdf import Link

ROOT = "home"

_STATIC = (
    '<inertial><origin xyz="0 0 0" rpy="0 0 0"/><mass value="0"/>'
    '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
)
_LONGEST_PATH = 800  # characters: PyBullet has room for 1,024 bytes
_one_at_a_time = Lock()


@contextmanager
def plain_copy(links: Sequence[Link]) -> Iterator[Path]:
    """Write a home for PyBullet and yield its URDF; it is there, with its meshes, as long as the context lasts.

    Args:
        links: the links of the home that have geometry, their names checked.

    Raises:
        HomeError: it cannot be written.
    """
    with _new_folder() as folder:
        yield _write(links, folder)


def plain_mesh(corners: Points, normals: Points) -> tuple[str, bytes]:
    """Return name and content of an OBJ file of triangles (n, 3, 3) in metres; the name tells contents apart."""
    lines, numbers = [], []
    for kind, rows in (("v", corners), ("vn", normals)):
        distinct, inverse = np.unique(np.round(rows.reshape(-1, 3), 5) + 0.0, axis=0, return_inverse=True)
        lines += [f"{kind} {x:.5f} {y:.5f} {z:.5f}" for x, y, z in distinct.tolist()]
        numbers.append(inverse.reshape(-1, 3) + 1)
    for vertices, directions in zip(*(rows.tolist() for rows in numbers), strict=True):
        lines.append("f " + " ".join(f"{v}//{vn}" for v, vn in zip(vertices, directions, strict=True)))
    content = ("\n".join(lines) + "\n").encode()
    return f"{hashlib.sha256(content).hexdigest()[:16]}.obj", content


@contextmanager
def plain_files(files: Mapping[str, bytes]) -> Iterator[Path]:
    """Write files for PyBullet and yield their folder; they are there as long as the context lasts.

    Raises:
        HomeError: they cannot be written.
    """
    with _new_folder() as folder:
        try:
            for name, content in files.items():
                (folder / name).write_bytes(content)
        except OSError as error:
            raise _cannot_copy(error) from error
        yield folder


@contextmanager
def _new_folder() -> Iterator[Path]:
    with _one_at_a_time:
        try:
            folder = _folder(os.getpid())
            folder.mkdir(mode=0o700)
        except OSError as error:
            raise _cannot_copy(error) from error
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _write(links: Sequence[Link], folder: Path) -> Path:
    """Write the copy into a folder and return its URDF."""
    path = folder / "home.urdf"
    try:
        path.write_text(write_links(links, folder), encoding="utf-8")
    except OSError as error:
        raise _cannot_copy(error) from error
    return path


def _cannot_copy(error: OSError) -> HomeError:
    where = error.filename or tempfile.tempdir or "no folder for temporary files"
    return HomeError(
        f"{where}: the home or an object cannot be copied there for PyBullet ({error.strerror}); "
        "make room, or name another folder by TMPDIR"
    )


@cache
def _folder(process: int) -> Path:
    """Return where a process writes its copies: one place, for PyBullet reads a mesh only once from each path."""
    folder = Path(tempfile.mkdtemp(prefix=f"chmarl-home-{process}-"))
    folder.rmdir()
    if len(str(folder)) > _LONGEST_PATH:
        raise HomeError(f"{folder}: too long a path for PyBullet; name another folder by TMPDIR")
    return folder


def write_links(links: Sequence[Link], folder: Path, name: str = ROOT, relative: str | None = None) -> str:
    """Return the text of a URDF; its meshes are written into a folder.

    Args:
        links: the links of the home that have geometry.
        folder: for the meshes; one that is plain already is named where it lies.
        name: of the home.
        relative: all meshes are written, and named by this folder's path as seen from the URDF.
    """
    meshes = _Meshes(folder, relative)
    return "\n".join(_urdf(links, name, meshes)) + "\n"


@dataclass
class _Meshes:
    """Where the URDF's meshes lie."""

    folder: Path
    relative: str | None

    def name(self, mesh: Mesh, visible: bool) -> str:
        """Return the name of a mesh: its own file's if that is plain, else a copy's, with its texture if visible."""
        if self.relative is None and mesh.file is not None and _is_plain(str(mesh.file)):
            return str(mesh.file)
        files = mesh.drawn if visible else mesh.solid
        for name, content in files.items():
            if not (self.folder / name).exists():
                (self.folder / name).write_bytes(content)
        last = list(files)[-1]
        return str(self.folder / last) if self.relative is None else f"{self.relative}/{last}"


def _urdf(links: Sequence[Link], name: str, meshes: _Meshes) -> Iterator[str]:
    """Yield the lines of the URDF; the meshes are written."""
    yield f'<?xml version="1.0"?>\n<robot name={quoteattr(name)}>\n<link name="{ROOT}">{_STATIC}</link>'
    for link in links:
        yield f'<link name="{link.name}">{_STATIC}'
        for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
            for shape in shapes:
                file = "" if shape.mesh is None else meshes.name(shape.mesh, tag == "visual")
                yield _shape(tag, shape.kind, tuple(shape.sizes.items()), shape.origin, shape.colour, file)
        yield f'</link>\n<joint name="fix {link.name}" type="fixed"><parent link="{ROOT}"/><child link="{link.name}"/>'
        yield f"{_origin(link.origin)}</joint>"
    yield "</robot>"


@lru_cache(maxsize=4096)
def _shape(
    tag: str, kind: str, sizes: tuple[tuple[str, Numbers], ...], origin: Origin, colour: Numbers | None, file: str
) -> str:
    """Return the lines of a shape; homes share those of their furniture."""
    lines = [f"<{tag}>{_origin(origin)}<geometry>"]
    words = " ".join(f'{name}="{_words(numbers)}"' for name, numbers in sizes)
    lines.append(f"<{kind} {words}{file and f' filename={quoteattr(file)}'}/></geometry>")
    if colour is not None:
        words = _words(colour)
        lines.append(f'<material name="{words}"><color rgba="{words}"/></material>')
    return "\n".join([*lines, f"</{tag}>"])


def _is_plain(path: str) -> bool:
    """Tell whether a path goes through XML and PyBullet unharmed."""
    return len(path) <= _LONGEST_PATH and path.isascii() and path.isprintable()


def _origin(origin: Origin) -> str:
    return f'<origin xyz="{_words(origin.xyz)}" rpy="{_words(origin.rpy)}"/>'


def _words(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))
