"""What a home's files hold, as one number: it tells homes apart that share a name."""

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from defusedxml import ElementTree

from chmarl_pb.homes.home import Home
from chmarl_pb.homes.urdf import referred_files


def content_hash(home: Home) -> str:
    """Return the sha256 of a home as its files are now: its URDF and all files that it names."""
    text = home.path.read_bytes()
    return sha256_of([text, *(file.read_bytes() for file in _named_files(home.path.parent, text))])


def sha256_of(parts: Iterable[bytes]) -> str:
    """Return the sha256 of parts; the length before each keeps their borders."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()


def _named_files(folder: Path, urdf: bytes) -> Iterator[Path]:
    """Yield the meshes and textures that a URDF names, then the materials and textures that the meshes name."""
    root = ElementTree.fromstring(urdf)
    names = {element.get("filename", "") for tag in ("mesh", "texture") for element in root.iter(tag)}
    named = [folder / name for name in sorted(names)]
    yield from named
    for file in named:
        yield from (inner for name in referred_files(file) if (inner := file.parent / name).is_file())
