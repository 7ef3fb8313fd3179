"""Many arrays as one argument of a compiled function.

In every call Numba looks at each array that it is given, also at those in tuples, some 0.3 microseconds each: for the
thirty arrays that drawing takes, as long as most views take to be decided. Packed, they are one array of their
addresses and lengths, of which the function makes arrays again.
"""

from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from chmarl_pb.compiled import COMPILES, compiled
from chmarl_pb.errors import CopyError

_FIELD = 4  # numbers of an array: its address, then its lengths


class Packed:
    """Arrays that compiled functions take as one argument.

    Attributes:
        arrays: as they were given; what writes to them writes to what the functions read. They live as long as this.
        words: what is passed on.
    """

    __slots__ = ("arrays", "words")

    def __init__(self, arrays: Sequence[NDArray[Any]], kinds: Sequence[tuple[str, int]]):
        """Pack arrays.

        Args:
            arrays: the arrays, rows after rows in memory.
            kinds: the type of each, and how many axes it has, as the functions read it.

        Raises:
            TypeError: an array is of another kind, so that its memory would be read wrongly.
        """
        for place, (array, (kind, axes)) in enumerate(zip(arrays, kinds, strict=True)):
            if array.dtype != kind or array.ndim != axes or not array.flags.c_contiguous:
                raise TypeError(f"array {place} is {array.dtype}, {array.ndim} axes; {kind}, {axes} in rows are needed")
        self.arrays = tuple(arrays)
        self.words: Any = _words(self.arrays) if COMPILES else self.arrays

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied or pickled: the addresses would still be those of the arrays here.

        Raises:
            CopyError: always.
        """
        raise CopyError("packed arrays cannot be copied or pickled; copy the arrays, and pack them again")


def _words(arrays: Sequence[NDArray[Any]]) -> NDArray[np.int64]:
    words = np.zeros((len(arrays), _FIELD), np.int64)
    for row, array in zip(words, arrays, strict=True):
        row[0], row[1 : 1 + array.ndim] = array.ctypes.data, array.shape
    return words.reshape(-1)


def _address(typing_context: Any, address: Any) -> Any:
    """Take a number for an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.voidptr(address), generate


_pointer: Any = intrinsic(_address)


def _reader(function: Any) -> Any:
    """Let a function that finds an array among words be compiled; what is not compiled gets the arrays themselves."""
    return compiled(function) if COMPILES else lambda words, place, kind: words[place]


@_reader
def line(words, place, kind):  # type: ignore[no-untyped-def]
    """Return the array of one axis that has a place among those packed, and this type."""
    at = place * _FIELD
    return carray(_pointer(words[at]), (words[at + 1],), kind)


@_reader
def table(words, place, kind):  # type: ignore[no-untyped-def]
    """Return the array of two axes at a place."""
    at = place * _FIELD
    return carray(_pointer(words[at]), (words[at + 1], words[at + 2]), kind)


@_reader
def block(words, place, kind):  # type: ignore[no-untyped-def]
    """Return the array of three axes at a place."""
    at = place * _FIELD
    return carray(_pointer(words[at]), (words[at + 1], words[at + 2], words[at + 3]), kind)
