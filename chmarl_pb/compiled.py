"""Functions that Numba compiles at their first use, and their machine code on disk, shared by all processes.

Numba's own store of machine code ends the program where it finds no folder to write to, trusts damaged files, and runs
old code when a constant or a called function of another file has changed. Here a file's name holds a hash of all that
its machine code depends on, a checksum stands before its content, and what cannot be stored is compiled in memory.
Of processes that need the same code, one compiles it and the others wait: functions that call each other do not do so
in a circle, so no two processes wait for one another.
"""

import hashlib
import os
import pickle
import platform
import stat
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import config as numba_config
from numba.core import sigutils
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps

from chmarl_pb.errors import BusyError, WriteError
from chmarl_pb.files import Lock, cache_folder, replacing

config: Any = numba_config  # what Numba makes of its environment variables
COMPILES = not config.DISABLE_JIT

_SUFFIX = ".kernel"
_CHECKSUM = hashlib.sha256().digest_size  # bytes at the start of a file
_PATIENCE = 60.0  # seconds that a process waits for what another one compiles, many times what it takes
_PAUSE = 0.02  # seconds between two looks
_KEPT = 16  # files of one function in a folder: signatures, machines and versions of its code


def compiled(function: Callable[..., Any]) -> Any:
    """Let Numba compile a function, or run it as Python if NUMBA_DISABLE_JIT is set, with the same results.

    A division by zero gives infinity. Literals need the type in which Numba computes: in NumPy, other than in Numba,
    ``2.0 * np.float32(x)`` is of single precision.
    """
    if not COMPILES:
        return np.errstate(all="ignore")(function)
    dispatcher: Any = numba.njit(error_model="numpy")(function)
    dispatcher._cache = KernelStore(dispatcher.py_func)
    return dispatcher


class KernelStore(NullCache):
    """The machine code of one function on disk, as Numba asks for it: a file for each signature."""

    def __init__(self, function: FunctionType):
        """Keep the code of a function."""
        self._function = function
        self._compiling: dict[str, Lock | None] = {}  # name of a file -> what keeps other processes from making it

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled function of a signature, or None if it is not stored or the file is damaged."""
        target_context.refresh()
        name = self._file_name(sig, target_context.codegen())
        found = _stored(name, target_context)
        if found is None and name not in self._compiling:
            self._compiling[name] = _lock(name)
            found = _stored(name, target_context)  # by the process that was waited for
            if found is not None:
                self._compiled(name)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled function of a signature in the first folder that can be written."""
        name = self._file_name(sig, data.codegen)
        try:
            if not data.library.has_dynamic_globals:  # addresses of this process
                self._store(name, dumps(data._reduce()))
        finally:
            self._compiled(name)

    def _compiled(self, name: str) -> None:
        """Let other processes go on that wait for a file."""
        lock = self._compiling.pop(name, None)
        if lock is not None:
            lock.close()

    def _store(self, name: str, content: bytes) -> None:
        tried = []
        for folder in _folders(to_write=True):
            try:
                with replacing(folder / name) as path:
                    path.write_bytes(hashlib.sha256(content).digest() + content)
                with suppress(OSError):
                    _prune(folder, name)
                return
            except OSError:
                tried.append(str(folder))
        _warn(", ".join(tried))

    def _file_name(self, sig: Any, codegen: Any) -> str:
        arguments, _ = sigutils.normalize_signature(sig)
        facts = _versions(), codegen.magic_tuple(), [_kind(one) for one in arguments], _code(self._function)
        key = hashlib.sha256(repr(facts).encode()).hexdigest()[:32]
        return f"{_start(self._function)}-{key}{_SUFFIX}"


def _stored(name: str, target_context: Any) -> Any:
    """Return the compiled function of a file, or None if there is none or it is damaged."""
    for folder in _folders():
        with suppress(Exception):  # whatever is wrong with a file, to compile anew puts it right
            return CompileResult._rebuild(target_context, *pickle.loads(_checked((folder / name).read_bytes())))
    return None


def _lock(name: str) -> Lock | None:
    """Wait until no other process makes a file, and keep others from it.

    None where nothing can be written, or if it takes too long: the other one may have been interrupted at it.
    """
    end = time.monotonic() + _PATIENCE
    for folder in _folders(to_write=True):
        with suppress(WriteError), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # without locks, processes compile side by side
            while time.monotonic() < end:
                with suppress(BusyError):
                    return Lock(folder / name)
                time.sleep(_PAUSE)
            break
    return None


def _start(function: FunctionType) -> str:
    return f"{function.__module__}.{function.__qualname__}"


def kernels() -> dict[Path, list[Path]]:
    """Return the files of machine code that are stored, by their folders, the best first."""
    return {folder: sorted(folder.glob(f"*{_SUFFIX}")) for folder in _folders()}


def is_stored(function: Any) -> bool:
    """Return whether some machine code of a compiled function lies on disk, or none is needed."""
    code = getattr(function, "py_func", None)
    return code is None or any(any(folder.glob(f"{_start(code)}-*{_SUFFIX}")) for folder in _folders())


def _checked(content: bytes) -> bytes:
    """Return a file's content without its checksum.

    Raises:
        ValueError: the checksum is wrong.
    """
    if hashlib.sha256(content[_CHECKSUM:]).digest() != content[:_CHECKSUM]:
        raise ValueError("the checksum is wrong")
    return content[_CHECKSUM:]


def _prune(folder: Path, name: str) -> None:
    """Remove the oldest files of the function whose file has this name, but for the newest ones."""
    files = folder.glob(f"{name.rpartition('-')[0]}-*{_SUFFIX}")
    for path in sorted(files, key=lambda path: path.stat().st_mtime)[:-_KEPT]:
        path.unlink()


def _folders(to_write: bool = False) -> Iterator[Path]:
    """Yield the folders for machine code, the best first."""
    if config.CACHE_DIR:
        yield Path(config.CACHE_DIR).absolute() / "chmarl_pb"
    yield Path(__file__).parent / "__pycache__"
    own = cache_folder()
    if own is not None:
        yield own / "kernels"
    with suppress(OSError):
        shared = Path(tempfile.gettempdir()) / f"chmarl_pb-{getattr(os, 'getuid', int)()}"
        if to_write:
            shared.mkdir(mode=0o700, exist_ok=True)
        if _is_private(shared):
            yield shared


def _is_private(folder: Path) -> bool:
    """Return whether nobody else can write to a folder: what lies there is run."""
    status = folder.lstat()
    own = not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)
    return own and stat.S_ISDIR(status.st_mode)


# What machine code depends on


@cache
def _versions() -> tuple[object, ...]:
    options = config.OPT, config.BOUNDSCHECK, config.DEBUGINFO_DEFAULT
    return sys.version, platform.machine(), numba.__version__, llvmlite.__version__, np.__version__, repr(options)


def _kind(kind: Any) -> str:
    """Return the text of a type, with the fields of named tuples in it."""
    fields = f"{kind.instance_class}{kind.fields}" if hasattr(kind, "fields") else ""
    return f"{kind}{fields}{[_kind(one) for one in getattr(kind, 'types', ())]}"


def _code(function: FunctionType) -> list[str]:
    """Return the code of a function and of all compiled functions that it calls, directly or not, with constants."""
    texts: dict[FunctionType, str] = {}
    waiting = [function]
    while waiting:
        one = waiting.pop()
        if one not in texts:
            texts[one] = _text(one)
            waiting += [value.py_func for value in _globals(one).values() if isinstance(value, Dispatcher)]
    return list(texts.values())


@cache
def _text(function: FunctionType) -> str:
    constants = {name: _constant(value) for name, value in _globals(function).items()}
    return repr((function.__module__, function.__qualname__, _instructions(function.__code__), constants))


def _instructions(code: CodeType) -> tuple[object, ...]:
    names = code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars
    constants = [_instructions(value) if isinstance(value, CodeType) else value for value in code.co_consts]
    return code.co_code, constants, names


def _globals(function: FunctionType) -> dict[str, Any]:
    """Return what a function may read from outside: name -> value, but for modules and what Python brings."""
    outside = {name: function.__globals__[name] for name in function.__code__.co_names if name in function.__globals__}
    outside |= {f"closure {place}": cell.cell_contents for place, cell in enumerate(function.__closure__ or ())}
    return {name: value for name, value in outside.items() if not isinstance(value, ModuleType)}


def _constant(value: Any) -> str:
    """Return a text of a value that is the same in every process: none may hold an address."""
    if isinstance(value, Dispatcher):
        return ""  # its own code counts
    value = getattr(value, "__wrapped__", value)  # of what Numba makes code of by itself
    if isinstance(value, FunctionType):
        own = value.__module__.partition(".")[0] == __name__.partition(".")[0]
        return _text(value) if own else f"{value.__module__}.{value.__qualname__}"  # of a library the version counts
    if isinstance(value, np.ndarray | np.generic):
        return f"{value.dtype}{value.shape}{value.tobytes()!r}"
    return f"{value!r}{getattr(value, '_fields', '')}"


@cache
def _warn(folders: str) -> None:
    warnings.warn(
        f"machine code cannot be written to any of: {folders}; so every process compiles for some 15 s; to store it, "
        "set NUMBA_CACHE_DIR to a folder that can be written",
        RuntimeWarning,
        stacklevel=2,
    )
