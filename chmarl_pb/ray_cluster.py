"""A Ray cluster joined, with this package and own files shipped to it: nodes need only what the package depends on."""

import logging
import os
import shutil
import signal
import socket
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from threading import current_thread, main_thread
from typing import Any

from chmarl_pb.assets import SCENES_DIR, URDF_DIR, WEIGHTS_DIR
from chmarl_pb.compiled import kernels
from chmarl_pb.errors import OptionError
from chmarl_pb.extras import needs

with needs("work on a Ray cluster", "scale"):
    import ray

_PACKAGE = Path(__file__).parent
_ASSETS = {"urdf": URDF_DIR, "scenes": SCENES_DIR, "weights": WEIGHTS_DIR}
_BESIDE = ("meshes", "textures")  # folders that the files of homes and things name
#: Variables that go to the nodes where they are set here.
_SET = ("CHMARL_CACHE", "CHMARL_CACHE_LIMIT", "CHMARL_TRUSTED", "CHMARL_VIEW_MEMORY")
_CODE = "machine_code"  # not __pycache__, which Ray leaves out
_MOST = 200  # MB that are shipped; Ray itself refuses more than 500


def connect(address: str, files: Iterable[str | Path] = (), runtime_env: Mapping[str, Any] | None = None) -> bool:
    """Join a cluster, unless this process has joined one; tell whether that was done.

    Args:
        address: ``HOST:PORT`` of its head node, "auto" for the one on this machine, "local" for a new one on this
            machine alone, which ends with this process.
        files: own homes, catalogues, robots, modules and checkpoints, below the current folder; see ``shipped``.
        runtime_env: more of Ray's runtime environment, e.g. ``{"pip": ["pybullet==3.2.7"]}``.

    Raises:
        OptionError: no cluster answers, or a file cannot be shipped.
        MissingExtraError: Ray is not installed.
    """
    if ray.is_initialized():
        return False
    variables = {"NUMBA_CACHE_DIR": _CODE, **{name: os.environ[name] for name in _SET if name in os.environ}}
    given = dict(runtime_env or {})
    with shipped(files) as folder, _own_signals():
        given |= {"working_dir": str(folder), "env_vars": {**variables, **given.get("env_vars", {})}}
        try:
            _knock(address)
            ray.init(address, runtime_env=given, log_to_driver=False, logging_level=logging.ERROR)
        except (OSError, ValueError) as error:
            raise OptionError(
                f"no Ray cluster answers at {address!r} ({error}); start one by `ray start --head` and give its "
                "HOST:PORT, or 'local' for this machine alone"
            ) from error
    return True


def _knock(address: str) -> None:
    """Ask whether anybody listens at ``HOST:PORT``: Ray itself goes on asking for minutes.

    Raises:
        OSError: nobody does.
    """
    host, _, port = address.rpartition(":")
    if host and "/" not in host and port.isdigit():
        socket.create_connection((host, int(port)), timeout=10).close()


def processors() -> float:
    """Return the number of processors of the cluster that this process has joined, as it is now."""
    resources: Any = ray.cluster_resources
    return float(resources().get("CPU", 0))


@contextmanager
def shipped(files: Iterable[str | Path] = ()) -> Iterator[Path]:
    """Yield a folder as nodes get it: this package as in its wheel, and files at their place below the current folder.

    Of a file in a subfolder its whole folder is shipped, of one in the current folder itself the file, with the
    folders "meshes" and "textures" beside it. Machine code goes along, so that nodes with this processor need not
    compile.

    Raises:
        OptionError: a file is not there, does not lie below the current folder, or all take too much room.
    """
    with tempfile.TemporaryDirectory(prefix="chmarl-ship-") as name:
        folder = Path(name)
        package = folder / _PACKAGE.name
        shutil.copytree(_PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
        for asset, source in _ASSETS.items():
            shutil.copytree(source, package / "_assets" / asset, dirs_exist_ok=True)
        code = folder / _CODE / _PACKAGE.name
        code.mkdir(parents=True)
        for path in (file for found in kernels().values() for file in found):
            shutil.copy2(path, code)
        _write_metadata(folder)
        for file in files:
            _copy_own(Path(file), folder)
        size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / 2**20
        if size > _MOST:
            raise OptionError(
                f"{size:,.0f} MB would be shipped to each node; keep own files in a folder without others"
            )
        yield folder


def _write_metadata(folder: Path) -> None:
    """Write what tells the version of the package, and what its extras add to it."""
    try:
        own = distribution("chmarl-pb")
    except PackageNotFoundError:
        return
    target = folder / f"chmarl_pb-{own.version}.dist-info"
    target.mkdir()
    for name in ("METADATA", "entry_points.txt"):
        (target / name).write_text(own.read_text(name) or "", encoding="utf-8")


def _copy_own(file: Path, folder: Path) -> None:
    try:
        inside = file.resolve(strict=True).relative_to(Path.cwd().resolve())
    except (OSError, ValueError) as error:
        raise OptionError(
            f"{file}: cannot be shipped to other machines; own files have to lie below the folder that this runs in"
        ) from error
    if file.is_absolute():
        raise OptionError(f"{file}: other machines have it in another place; name it as {inside}")
    if inside.parent != Path("."):
        shutil.copytree(inside.parent, folder / inside.parent, dirs_exist_ok=True)
    elif inside.is_dir():
        shutil.copytree(inside, folder / inside, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    else:
        shutil.copy2(inside, folder / inside)
        for beside in filter(os.path.isdir, _BESIDE):
            shutil.copytree(beside, folder / beside, dirs_exist_ok=True)


@contextmanager
def _own_signals() -> Iterator[None]:
    """Keep what this process does when it is asked to end: Ray puts its own in place of it."""
    if current_thread() is not main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
