"""The material files of OBJ meshes: colours, and the textures that they name; the rest of a material is not drawn."""

import io
import os
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from chmarl_pb.homes.source import MOST_FILES, Source, shown

MOST_LIBRARY_BYTES = 2**20
MOST_PIXELS = 2048 * 2048

Numbers = tuple[float, ...]

_FORMATS = ("PNG", "JPEG", "BMP")
_PICTURES = (b"map_", b"bump", b"disp", b"decal", b"refl", b"norm")  # the keywords that name a picture
_MOST_SCANS = 100  # of a JPEG: each takes as long as a picture of its own
_SCAN = b"\xff\xda"


@dataclass
class Materials:
    """What is read of the material files of one mesh.

    Attributes:
        colours: material -> red, green, blue in 0..1.
        textures: material -> the file that names its texture, and that name.
    """

    colours: dict[str, Numbers] = field(default_factory=dict)
    textures: dict[str, tuple[Path, str]] = field(default_factory=dict)

    def texture(self, used: Sequence[str], source: Source) -> bytes | None:
        """Return the first texture among the materials that a mesh uses, as the content of a BMP file.

        Raises:
            ValueError: it cannot be used.
        """
        name = next((name for name in dict.fromkeys(used) if name in self.textures), None)
        return None if name is None else _picture(*self.textures[name], source)


def read_materials(libraries: Sequence[str], mesh: Path, source: Source) -> Materials:
    """Return the materials that a mesh can use.

    Args:
        libraries: the names after each ``mtllib``.
        mesh: the OBJ file; names are seen from there.
        source: the files of the home.

    Raises:
        ValueError: a file that is named cannot be used.
    """
    found = Materials()
    read: set[Path] = set()
    for name in dict.fromkeys(name for line in dict.fromkeys(libraries) for name in _library_names(line, mesh.parent)):
        try:
            path = source.inside(mesh.parent, name)
            if path in read:
                continue
            read.add(path)
            library, content = source.inner(mesh, name, MOST_LIBRARY_BYTES)
            found.textures |= {
                material: (library, picture) for material, picture in _textures(content, library, source)
            }
            found.colours |= _colours(content)
        except ValueError as error:
            raise ValueError(f"material file {shown(name)}: {error}") from error
    return found


def _colours(content: bytes) -> dict[str, Numbers]:
    """Return the diffuse colour of each material of a library that has one: three numbers from 0 to 1."""
    material, found = "", dict[str, Numbers]()
    for line in content.splitlines():
        keyword, *words = line.partition(b"#")[0].split()[:5] or [b""]
        if keyword == b"newmtl":
            material = os.fsdecode(words[0]) if words else ""
        elif keyword == b"Kd":
            with suppress(ValueError):
                colour = tuple(round(float(word), 3) for word in words)
                if len(colour) == 3 and all(0 <= channel <= 1 for channel in colour):
                    found[material] = colour
    return found


def _picture(library: Path, name: str, source: Source) -> bytes:
    try:
        path, content = source.inner(library, name)
        if path not in source.pictures:
            source.pictures[path] = as_bmp(content)
        return source.pictures[path]
    except ValueError as error:
        raise ValueError(f"texture {shown(name)}: {error}") from error


def _library_names(line: str, folder: Path) -> list[str]:
    """Return the files that one ``mtllib`` names: one whose name may have blanks, or several."""
    return [line] if not line.split() or os.path.isfile(folder / line) else line.split()


def _textures(content: bytes, library: Path, source: Source) -> list[tuple[str, str]]:
    """Return each material of a library that has a texture, and the texture's name.

    Raises:
        ValueError: a picture leaves the home's folder, or a texture has options.
    """
    material, found = "", []
    pictures: dict[str, None] = {}
    for line in source.lines_of(content):
        keyword, rest = (*line.split(None, 1), b"", b"")[:2]
        words = [os.fsdecode(word) for word in rest.split()]
        if keyword == b"newmtl":
            material = words[0] if words else ""
        elif keyword == b"map_Kd" and words:
            if words[0].startswith("-"):
                raise ValueError(f"options of textures are not read; write map_Kd {shown(words[-1])}")
            found.append((material, os.fsdecode(rest.strip())))
            pictures[found[-1][1]] = None
        elif keyword.lower().startswith(_PICTURES) and words:
            pictures[words[-1]] = None
    if len(pictures) > MOST_FILES:
        raise ValueError(f"names {len(pictures):,} pictures, at most {MOST_FILES:,} are read; remove some")
    for name in pictures:
        try:
            source.inside(library.parent, name)
        except ValueError as error:
            raise ValueError(f"picture {shown(name)} {error}") from error
    return found


def as_bmp(content: bytes) -> bytes:
    """Return a picture as the content of a BMP file of 24 bits, which any reader reads.

    Raises:
        ValueError: it is no picture of a known format, damaged or too large.
    """
    from PIL import Image, UnidentifiedImageError  # only here: most homes have no textures

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of pictures that are too large: they are refused below
            picture = Image.open(io.BytesIO(content), formats=_FORMATS)
        if picture.width * picture.height > MOST_PIXELS:
            raise ValueError(f"{picture.width:,} x {picture.height:,} pixels, at most {MOST_PIXELS:,} are read")
        if picture.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA"):
            raise ValueError(f"its pixels are of the kind {picture.mode}, not RGB of 8 bits")
        if content.count(_SCAN) > _MOST_SCANS and picture.format == "JPEG":
            raise ValueError(f"more than {_MOST_SCANS} scans")
        written = io.BytesIO()
        picture.convert("RGB").save(written, "BMP")
        return written.getvalue()
    except UnidentifiedImageError as error:
        raise ValueError(f"is not one of {', '.join(_FORMATS)}; save it as a small PNG of 8 bits") from error
    except Exception as error:  # Pillow's readers raise what they like
        raise ValueError(f"cannot be read as a picture ({error}); save it as a small PNG of 8 bits") from error
