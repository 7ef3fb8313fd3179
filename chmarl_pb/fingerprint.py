"""What tells apart what results name by a class or a function alone: its file, and what it holds."""

import ast
import hashlib
import inspect
import math
import os
import pickle
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from chmarl_pb.files import file_hash

#: Folders of this package and of Python.
_NOT_THE_USERS = tuple(
    os.path.join(os.path.realpath(folder), "") for folder in (Path(__file__).parent, sysconfig.get_path("stdlib"))
)
_PROTOCOL = 5  # of pickle; a fixed one, so that hashes stay
_REPEATED = 4  # times the length of an object, that it may have when shared parts are read as often as they are met


def sha256_of(parts: Iterable[bytes]) -> str:
    """Return the sha256 of parts; the length before each keeps their borders."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()


def name_of(given: object) -> str:
    """Return the name of a callable, or of the class of another object, with its module."""
    kind: Any = given if hasattr(given, "__qualname__") else type(given)
    return f"{kind.__module__}:{kind.__qualname__}"


def fingerprint(given: object, code: bool = True) -> str | None:
    """Return the sha256 of an object.

    It covers what the object holds, and the files of all classes and functions in it, with those around decorated ones
    and the user's own modules that these import; what is read from other files it does not know:
    two objects of one class with other numbers, or other weights, differ.

    Args:
        given: the object.
        code: whether the files count, and the code of functions that no module names.

    Returns:
        None if that cannot be told: it holds what cannot be pickled, or there is no file, as in a notebook.
    """
    files = set[Path]()
    try:
        content = _content(given, files, code)
    except Exception:  # whatever the methods raise by which objects say what they hold
        return None
    return sha256_of([content, *(file_hash(path).encode() for path in sorted(files) if code)])


def _content(given: object, files: set[Path], code: bool) -> bytes:
    """Return the hash of what an object holds; note the files of classes and functions."""
    told = _Digest()
    _Reader(told, files, code).dump(given)
    alike = _Digest(limit=_REPEATED * told.size)
    reader = _Reader(alike, files, code)
    reader.fast = True  # equal parts read alike, one object or several
    try:
        reader.dump(given)
    except (ValueError, RecursionError, _TooLongError):  # of cycles, and of much that is reached in many ways
        return told.sha256.digest()
    return alike.sha256.digest()


class _TooLongError(Exception):
    """More was written than is let."""


class _Digest:
    """A file of which only the hash is kept.

    Attributes:
        sha256: of all that was written.
        size: of the same, in bytes.
    """

    def __init__(self, limit: float = math.inf):
        """Let as many bytes be written."""
        self.sha256, self.size, self._limit = hashlib.sha256(), 0, limit

    def write(self, data: bytes) -> None:
        """Take some bytes."""
        self.size += len(data)
        if self.size > self._limit:
            raise _TooLongError
        self.sha256.update(data)


def _is_named(given: Any) -> bool:
    """Return whether a module has a class or function by its name."""
    found: Any = sys.modules.get(given.__module__)
    for part in given.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is given


def _file_of(given: Any) -> Path | None:
    """Return the file of a class, a function or a module."""
    try:
        path = inspect.getsourcefile(given)
    except (OSError, TypeError):
        return None
    return Path(path) if path and Path(path).is_file() else None


def _imported_by(module: str) -> set[Path]:
    """Return the files of the user's own modules that a module of theirs imports, and of those that these import.

    It makes no difference whether they have been imported yet, as those that functions import.
    """
    found, left = set[Path](), [module]
    while left:
        path = _module_file(name := left.pop())
        if path is None or path in found or not _is_users(path):
            continue
        found.add(path)
        left += _imports(path, _package_of(name, path))
    return found


def _package_of(module: str, path: Path) -> str:
    """Return the package that relative imports of a module begin in; that of ``python -m`` is not in its name."""
    if spec := getattr(sys.modules.get(module), "__spec__", None):
        return str(spec.parent)
    return module if path.stem == "__init__" else module.rpartition(".")[0]


def _module_file(name: str) -> Path | None:
    """Return the file of a module by its name; nothing is imported for it."""
    if name in sys.modules:
        return _file_of(sys.modules[name])
    spec = _spec_of(name)
    path = Path(str(spec and spec.origin))
    return path if path.suffix == ".py" and path.is_file() else None


def _spec_of(name: str) -> ModuleSpec | None:
    """Return where a module is, imported or not; packages that are imported know where their modules are."""
    package = name.rpartition(".")[0]
    if not package:
        return getattr(sys.modules.get(name), "__spec__", None) or PathFinder.find_spec(name)
    folders = getattr(sys.modules.get(package), "__path__", None)
    if folders is None and (above := _spec_of(package)):
        folders = above.submodule_search_locations
    return PathFinder.find_spec(name, folders) if folders else None


def _is_users(path: Path) -> bool:
    """Return whether a file is neither of this package, nor of Python, nor of an installed package."""
    folder = str(path.resolve().parent) + os.sep
    return not folder.startswith(_NOT_THE_USERS) and {"site-packages", "dist-packages"}.isdisjoint(path.parts)


def _imports(path: Path, package: str) -> Iterator[str]:
    """Yield the names of the modules that a file may import; those of objects in modules are among them."""
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):  # it has changed since it was imported
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: 1 - node.level or None] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from (base, *(f"{base}.{alias.name}" for alias in node.names))


def _layers(given: Any) -> list[Any]:
    """Return what a class inherits, or what a callable is wrapped around, and itself; nothing for other objects."""
    if isinstance(given, type):
        return list(given.__mro__)
    if not callable(given) or not isinstance(getattr(given, "__qualname__", None), str):
        return []
    layers = [given]
    while (inner := getattr(layers[-1], "__wrapped__", None)) is not None and all(inner is not one for one in layers):
        layers.append(inner)
    return layers


def _told(code: CodeType) -> tuple[Any, ...]:
    """Return what code does, as plain data."""
    constants = tuple(_told(one) if isinstance(one, CodeType) else one for one in code.co_consts)
    return code.co_code, code.co_names, constants


class _Reader(pickle.Pickler):
    """Reads an object as pickle does; notes the files of classes and functions, and reads what pickle cannot.

    Attributes:
        files: of the classes and functions that it came by.
        code: whether the code of functions that no module names is read, too.
    """

    def __init__(self, written: _Digest, files: set[Path], code: bool):
        """Write what is read, and note files."""
        super().__init__(written, _PROTOCOL)
        self.files, self.code = files, code

    def persistent_id(self, given: Any) -> Any:
        """Return what stands for a set, whose order is no one's, and for a tensor, whose bytes name an address."""
        for part in _layers(given):
            self._note(part)
        if type(given) in (set, frozenset):
            return type(given).__name__, sorted(_content(one, self.files, self.code) for one in given)
        torch: Any = sys.modules.get("torch")
        if torch is not None and isinstance(given, torch.Tensor):
            flat = given.detach().cpu().contiguous().reshape(-1).view(torch.uint8)
            return str(given.dtype), tuple(given.shape), flat.numpy().tobytes()
        return None

    def _note(self, part: Any) -> None:
        module = getattr(part, "__module__", None)  # beside its own: a decorator may be another file's
        found = {path for one in (part, sys.modules.get(str(module))) if (path := _file_of(one)) is not None}
        if not found and module == "__main__":
            raise pickle.PicklingError(f"{part} has no file")
        if not found <= self.files:
            self.files |= found | _imported_by(str(module))

    def reducer_override(self, given: Any) -> Any:
        """Return how a function or a class is read that has no name in its module."""
        if not isinstance(given, type | FunctionType) or _is_named(given):
            return NotImplemented
        if isinstance(given, type):
            own = vars(given).items()
            held: Any = {key: value for key, value in own if not key.startswith("__") or callable(value)}
        else:
            around = zip(given.__code__.co_freevars, given.__closure__ or (), strict=True)
            cells = {key: cell.cell_contents for key, cell in around if key != "__class__"}
            code = _told(given.__code__) if self.code else ()
            held = (code, given.__defaults__, given.__kwdefaults__, cells)
        return tuple, ((name_of(given), held),)
