"""Trained weights that come with the package: a manifest says what each file is, and by its sha256 that it is that.

The files lie in ``results/weights`` of a checkout, and travel with the wheel. ``python -m training.publish`` adds one.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from chmarl_pb.assets import WEIGHTS_DIR
from chmarl_pb.errors import OptionError
from chmarl_pb.files import file_hash, write_atomically

MANIFEST = "manifest.json"
MOST_BYTES = 40 * 2**20  # of all files together
POLICY, ENCODER = "policy", "encoder"
KINDS = (POLICY, ENCODER)


@dataclass(frozen=True)
class Weights:
    """What is known of a file of weights.

    Attributes:
        name: by which it is asked for.
        file: its name in the folder of the manifest.
        sha256: of the file.
        kind: "policy", or "encoder": a frozen network that others see by.
        trained_by: the command.
        observation: what a policy observes.
        track: rules that a policy plays by.
        options: of the environment, where they are not the track's.
        published: split -> figure ("success_rate", "plw", 0 to 1) -> its mean.
        result: file of the repository that the figures are from.
    """

    name: str
    file: str
    sha256: str
    kind: str
    trained_by: str
    observation: str
    track: str = "paper"
    options: Mapping[str, Any] = field(default_factory=dict)
    published: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    result: str = ""

    @property
    def rules(self) -> dict[str, Any]:
        """Options of the environment that a policy plays by, without what it observes."""
        return {"track": self.track, **self.options}


def weights_folder() -> Path:
    """Return the folder of the manifest: the one that ``CHMARL_WEIGHTS`` names, else the package's own."""
    chosen = os.environ.get("CHMARL_WEIGHTS")
    return Path(chosen).expanduser() if chosen else WEIGHTS_DIR


def read_manifest(folder: Path) -> dict[str, Weights]:
    """Return name -> weights; nothing if the folder has no manifest.

    Raises:
        OptionError: the manifest is damaged.
    """
    path = folder / MANIFEST
    if not path.is_file():
        return {}
    try:
        rows = [Weights(**row) for row in json.loads(path.read_text(encoding="utf-8"))]
        if wrong := [str(row.name) for row in rows if not _is_whole(row)]:
            raise ValueError(f"kind, file or another field of {', '.join(wrong)}")
        return {row.name: row for row in rows}
    except (TypeError, ValueError, RecursionError) as error:
        raise OptionError(
            f"{path}: not a manifest of weights ({error}); get it again, or name another folder by CHMARL_WEIGHTS"
        ) from error


def _is_whole(row: Weights) -> bool:
    """Return whether the fields of a row are of their kinds."""
    texts = (row.name, row.file, row.sha256, row.trained_by, row.observation, row.track, row.result)
    figures = row.published.values() if isinstance(row.published, dict) else [None]
    return (
        all(isinstance(text, str) for text in texts)
        and row.kind in KINDS
        and Path(row.file).name == row.file
        and isinstance(row.options, dict)
        and all(isinstance(one, dict) and all(map(_is_number, one.values())) for one in figures)
    )


def _is_number(value: object) -> bool:
    return isinstance(value, float | int)


def write_manifest(folder: Path, rows: Mapping[str, Weights]) -> None:
    """Write a manifest, ordered by name."""
    content = [asdict(rows[name]) for name in sorted(rows)]
    write_atomically(folder / MANIFEST, json.dumps(content, indent=1) + "\n")


def published_names() -> list[str]:
    """Return the names of the policies whose weights come with the package."""
    return [row.name for row in read_manifest(weights_folder()).values() if row.kind == POLICY]


def published(name: str, kind: str = POLICY) -> Weights | None:
    """Return the weights that come with the package under a name; None if there are none."""
    row = read_manifest(weights_folder()).get(name)
    return row if row is not None and row.kind == kind else None


def published_encoders(name: str) -> list[Weights]:
    """Return the encoders of one name that come with the package: ``name`` itself, and earlier ones ``name-...``."""
    rows = read_manifest(weights_folder()).values()
    return [row for row in rows if row.kind == ENCODER and f"{row.name}-".startswith(f"{name}-")]


def checked_file(row: Weights) -> Path:
    """Return the file of weights.

    Raises:
        OptionError: it is missing, or is not the one that was published.
    """
    path = weights_folder() / row.file
    if not path.is_file():
        raise OptionError(f"{path}: the weights {row.name!r} are not there; get the package's files again")
    if (found := file_hash(path)) != row.sha256:
        copy = "give the path of the copy as a checkpoint of your own"
        if row.kind == ENCODER:
            copy = f"name the copy by CHMARL_{row.name.partition('-')[0].upper()}"
        raise OptionError(
            f"{path}: not the published weights {row.name!r} (sha256 {found[:12]}, not {row.sha256[:12]}): it was "
            f"changed or damaged; get it again, or copy it and {copy}"
        )
    return path
