"""The files of a data set: HDF5 in Minari's layout, read by plain ``minari.load_dataset``.

While a data set is made, every episode is one file ``ROOT/chmarl/.parts/NAME-KEY/EPISODE.hdf5``, written whole or
not at all, with a sha256 of its contents in its user block. At the end all are joined to
``ROOT/chmarl/NAME/data/main_data.hdf5``, in the order of the tasks; so the file does not depend on the number of
processes. Arrays are compressed without loss; Minari itself would not.
"""

import hashlib
import json
import os
import shutil
from pathlib import Path
from typing import Any, BinaryIO

from chmarl_pb.data.recipe import NAMESPACE, Recipe
from chmarl_pb.data.record import Arrays, Recording, make_env
from chmarl_pb.evaluation.provenance import versions
from chmarl_pb.extras import needs
from chmarl_pb.files import file_hash, replacing, write_atomically, writing
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.tasks.splits import STREAM

with needs("a data set", "data"):
    import h5py
    import minari
    from minari.dataset.minari_storage import MinariStorage

_LIBVER = ("v110", "v110")  # far less overhead for small arrays than the oldest format
MAIN_FILE, METADATA_FILE = "main_data.hdf5", "metadata.json"  # Minari's names
_WORTH_PACKING = 256  # bytes
_SPARE = 2**20  # bytes of disk space that a joined file may take beyond that of its parts
_USER_BLOCK = 512  # bytes at the beginning of a file that HDF5 leaves to us, at least


def default_root() -> Path:
    """Return the folder where Minari keeps its data sets: ``$MINARI_DATASETS_PATH``, or one in the home folder."""
    folder = os.environ.get("MINARI_DATASETS_PATH")
    return Path(folder) if folder else Path.home() / ".minari" / "datasets"


def dataset_folder(root: Path, dataset_id: str) -> Path:
    """Return the folder of a data set."""
    return root / dataset_id


def parts_folder(root: Path, recipe: Recipe) -> Path:
    """Return the folder of the episodes of an unfinished data set."""
    return root / NAMESPACE / ".parts" / f"{recipe.dataset_id.rpartition('/')[2]}-{recipe.key()}"


# Writing


def part_of(recording: Recording) -> bytes:
    """Return one episode as a file with a checksum."""
    # In memory: on a full disk HDF5 would end the process.
    with h5py.File("episode", "w", driver="core", backing_store=False, libver=_LIBVER) as file:
        group = file.create_group("episode")
        _write(group, recording.arrays)
        group.attrs.update(recording.metadata)
        file.flush()
        content: bytes = file.id.get_file_image()
    return _seal(content) + content


def write_part(path: Path, part: bytes) -> None:
    """Write one episode, whole or not at all.

    Raises:
        WriteError: the disk is full.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(part)


def _seal(content: bytes) -> bytes:
    """Return a user block with a checksum of the contents behind it."""
    return hashlib.sha256(content).hexdigest().encode().ljust(_USER_BLOCK, b"\0")


def _write(group: "h5py.Group", arrays: Arrays) -> None:
    for name, values in arrays.items():
        if isinstance(values, dict):
            _write(group.create_group(name), values)
        elif values.nbytes < _WORTH_PACKING:
            group.create_dataset(name, data=values)
        else:
            group.create_dataset(
                name, data=values, chunks=values.shape, compression="gzip", compression_opts=4, shuffle=True
            )


def is_whole(path: Path) -> bool:
    """Return whether a part is there, as it was written."""
    if not path.is_file():
        return False
    content = path.read_bytes()
    return content[:_USER_BLOCK] == _seal(content[_USER_BLOCK:])


def join_parts(root: Path, recipe: Recipe, parts: list[Path]) -> Path:
    """Join episodes to a data set, whole or not at all, and remove them; return its folder.

    Raises:
        WriteError: the disk is full.
    """
    folder = dataset_folder(root, recipe.dataset_id)
    making = parts[0].parent / "joined"
    shutil.rmtree(making, ignore_errors=True)  # of a process that was killed
    try:
        with writing(folder, parts[0].parent):
            making.mkdir()
            storage = _new_storage(making / "data", recipe)
            steps = _copy(parts, making / "data" / MAIN_FILE)
            storage.update_metadata(_metadata(recipe, len(parts), steps, making / "data" / MAIN_FILE))
            making.replace(folder)
    finally:
        shutil.rmtree(making, ignore_errors=True)
    _describe_namespace(root)
    for parts_of_any_version in parts[0].parent.parent.glob(f"{folder.name}-*"):
        shutil.rmtree(parts_of_any_version)
    return folder


def _new_storage(path: Path, recipe: Recipe) -> "MinariStorage":
    env = make_env(recipe)
    try:
        # Without JPEG, which changes pixels.
        return MinariStorage.new(path, env.observation_space, env.action_space, env.spec, jpeg_encoding=False)
    finally:
        env.close()


def _copy(parts: list[Path], path: Path) -> int:
    """Copy all parts into one file and return their number of steps."""
    steps, room = 0, sum(part.stat().st_size for part in parts) + _SPARE
    _reserve(path, room)
    with h5py.File(path, "w", libver=_LIBVER) as file:
        _reserve(path, room)  # once more, as the file was emptied
        for number, part in enumerate(parts):
            with h5py.File(part, "r") as source:
                source.copy("episode", file, f"episode_{number}")
            attributes = file[f"episode_{number}"].attrs
            attributes["id"] = number
            steps += int(attributes["total_steps"])
    with path.open("rb+") as written:
        written.truncate(_end(written))
        os.fsync(written.fileno())  # before the parts are removed
    return steps


def _reserve(path: Path, size: int) -> None:
    """Take disk space for a file, which HDF5 then writes: were the disk full meanwhile, it would end the process."""
    with path.open("ab") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
        else:
            file.write(bytes(max(0, size - file.tell())))


def _end(file: BinaryIO) -> int:
    """Return where the contents of an HDF5 file end, as its superblock says."""
    file.seek(28)
    return int.from_bytes(file.read(8), "little")


def megabytes(path: Path) -> float:
    """Return the size of a file, as the metadata tell it."""
    return round(path.stat().st_size / 1e6, 1)


def _metadata(recipe: Recipe, episodes: int, steps: int, path: Path) -> dict[str, Any]:
    who = "planner" if not recipe.noise else f"planner with {recipe.noise:.0%} random actions"
    return {
        "dataset_id": recipe.dataset_id,
        "minari_version": minari.__version__,
        "total_episodes": episodes,
        "total_steps": steps,
        "dataset_size": megabytes(path),
        "algorithm_name": who,
        "description": f"{_team(recipe)} solve {_which(recipe)}, driven by the {who}. One episode for each task.",
        "requirements": ["chmarl-pb"],
        "sha256": file_hash(path),
        "recipe": recipe.facts(),
        "made_with": versions(),
    }


def _team(recipe: Recipe) -> str:
    return "A humanoid and a drone" if recipe.robots == TEAM else f"Robots ({', '.join(team_of(recipe.robots))})"


def _which(recipe: Recipe) -> str:
    if recipe.home is not None:
        return f"tasks that were drawn for the home {Path(recipe.home).stem}"
    if recipe.split == STREAM:
        return "tasks that were drawn in generated homes"
    return f"the tasks of {recipe.split} in simulated homes, in the order of the task file"


def _describe_namespace(root: Path) -> None:
    path = root / NAMESPACE / "namespace_metadata.json"
    if not path.exists():
        write_atomically(path, json.dumps({"description": "Cooperative, heterogeneous robots in homes (chmarl_pb)"}))
