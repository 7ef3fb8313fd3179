"""Arrays that are packed for compiled functions: what they read and write is what was given."""

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from chmarl_pb.compiled import compiled
from chmarl_pb.errors import CopyError
from chmarl_pb.packed import Packed, block, line, table

KINDS = (("i2", 1), ("f4", 2), ("f8", 3))
axes = st.integers(0, 4)


@compiled
def doubled(words):  # type: ignore[no-untyped-def]
    """Double the second of three arrays; return the sum of each."""
    first, second, third = line(words, 0, np.int16), table(words, 1, np.float32), block(words, 2, np.float64)
    for row in range(second.shape[0]):
        for column in range(second.shape[1]):
            second[row, column] *= 2
    return first.sum(), second.sum(), third.sum()


@given(
    arrays(np.int16, axes, elements=st.integers(-99, 99)),
    arrays(np.float32, st.tuples(axes, axes), elements=st.integers(-99, 99)),
    arrays(np.float64, st.tuples(axes, axes, axes), elements=st.integers(-99, 99)),
)
def test_compiled_functions_read_and_write_the_arrays_themselves(
    first: np.ndarray, second: np.ndarray, third: np.ndarray
) -> None:
    before = second.copy()
    packed = Packed((first, second, third), KINDS)
    assert doubled(packed.words) == (first.sum(), 2 * before.sum(), third.sum())
    assert (second == 2 * before).all(), "what the function wrote is not in the array"


@pytest.mark.parametrize(
    "wrong",
    [np.zeros((2, 3), np.float64), np.zeros(3, np.float32), np.zeros((3, 2), np.float32).T],
    ids=["another type", "another number of axes", "columns after columns"],
)
def test_an_array_of_another_kind_is_refused(wrong: np.ndarray) -> None:
    with pytest.raises(TypeError, match="array 1 is"):
        Packed((np.zeros(1, np.int16), wrong, np.zeros((1, 1, 1))), KINDS)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_it_is_not_copied_with_the_addresses_of_other_arrays(copied: Callable[[Packed], object]) -> None:
    with pytest.raises(CopyError, match="pack them again"):
        copied(Packed((np.zeros(3),), (("f8", 1),)))
