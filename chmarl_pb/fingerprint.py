"""What tells apart what results name by a class or a function alone: its file, and what it holds."""

import hashlib
import inspect
import io
import pickle
import sys
from collections.abc import Iterable
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from chmarl_pb.files import file_hash


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


def fingerprint(given: object) -> str | None:
    """Return the sha256 of an object.

    Of a function or a class of a module it is that of the file; of anything else it covers the files of all classes and
    functions in it, and what it holds: two objects of one class with other numbers, or other weights, differ.

    Returns:
        None if that cannot be told: it holds what cannot be pickled, or there is no file, as in a notebook.
    """
    if isinstance(given, type | FunctionType) and _is_named(given):
        path = _file_of(given)
        return None if path is None else file_hash(path)
    for fast in (True, False):  # fast: equal parts read alike, one object or several; it cannot do cycles
        buffer = io.BytesIO()
        reader = _Reader(buffer)
        reader.fast = fast
        try:
            reader.dump(given)
        except Exception:  # whatever the methods raise by which objects say what they hold
            continue
        return sha256_of([buffer.getvalue(), *(file_hash(path).encode() for path in sorted(reader.files))])
    return None


def _is_named(given: Any) -> bool:
    """Return whether a module has a class or function by its name."""
    found: Any = sys.modules.get(given.__module__)
    for part in given.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is given


def _file_of(given: Any) -> Path | None:
    """Return the file that defines a class or a function."""
    try:
        path = inspect.getsourcefile(given)
    except (OSError, TypeError):
        return None
    return Path(path) if path and Path(path).is_file() else None


def _told(code: CodeType) -> tuple[Any, ...]:
    """Return what code does, as plain data."""
    constants = tuple(_told(one) if isinstance(one, CodeType) else one for one in code.co_consts)
    return code.co_code, code.co_names, constants


class _Reader(pickle.Pickler):
    """Reads an object as pickle does; notes the files of classes and functions, and reads what pickle cannot.

    Attributes:
        files: of the classes and functions that it came by.
    """

    def __init__(self, buffer: io.BytesIO):
        """Write what is read to a buffer."""
        super().__init__(buffer, pickle.HIGHEST_PROTOCOL)
        self.files: set[Path] = set()

    def persistent_id(self, given: Any) -> Any:
        """Return what stands for a set, whose order is no one's, and for a tensor, whose bytes name an address."""
        for part in given.__mro__ if isinstance(given, type) else [given] if isinstance(given, FunctionType) else []:
            self._note(part)
        if type(given) in (set, frozenset):
            return type(given).__name__, sorted(map(repr, given))
        torch: Any = sys.modules.get("torch")
        if torch is not None and isinstance(given, torch.Tensor):
            flat = given.detach().cpu().contiguous().reshape(-1).view(torch.uint8)
            return str(given.dtype), tuple(given.shape), flat.numpy().tobytes()
        return None

    def _note(self, part: Any) -> None:
        path = _file_of(part)
        if path is not None:
            self.files.add(path)
        elif part.__module__ == "__main__":
            raise pickle.PicklingError(f"{part} has no file")

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
            held = (_told(given.__code__), given.__defaults__, given.__kwdefaults__, cells)
        return tuple, ((name_of(given), held),)
