"""What a home's files hold, as one number: it tells homes apart that share a name."""

from pathlib import Path

from chmarl_pb.errors import HomeError
from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.homes.home import Home
from chmarl_pb.reading import read_regular


def content_hash(home: Home) -> str:
    """Return the sha256 of a home as its files are now: its URDF and all files that it names.

    Raises:
        HomeError: one of them cannot be read any more.
    """
    return sha256_of(_content(home, file) for file in home.files)


def _content(home: Home, file: Path) -> bytes:
    try:
        return read_regular(file)
    except ValueError as error:
        raise HomeError(f"{home.path}: {file.name!r} {error}; load the home anew") from error
