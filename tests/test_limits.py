"""Numbers that users give: what is taken, and what is told of the rest."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chmarl_pb.errors import OptionError
from chmarl_pb.limits import real_number, whole_number


@given(st.integers(-5, 15), st.sampled_from([int, np.int64, np.int8]))
def test_whole_numbers_in_range_are_plain(value: int, kind: Any) -> None:
    if 1 <= value <= 9:
        assert whole_number("n", kind(value), 1, 9) == value and type(whole_number("n", kind(value), 1, 9)) is int
    else:
        with pytest.raises(OptionError, match=r"^n=.*from 1 to 9$"):
            whole_number("n", kind(value), 1, 9)


@given(st.floats(width=32), st.sampled_from([float, np.float32, np.float64]))
def test_numbers_in_range_are_plain(value: float, kind: Any) -> None:
    if 0 <= kind(value) <= 1:
        assert real_number("p", kind(value), 0, 1) == kind(value) and type(real_number("p", kind(value), 0, 1)) is float
    else:
        with pytest.raises(OptionError, match=r"^p=.*from 0 to 1$"):
            real_number("p", kind(value), 0, 1)


@pytest.mark.parametrize("value", [True, None, "1", 1.0, [1], 1j])
def test_what_is_no_whole_number(value: Any) -> None:
    with pytest.raises(OptionError, match="not a whole number from 0 on"):
        whole_number("n", value)


@pytest.mark.parametrize("value", [True, None, "0.5", math.inf, math.nan, [0.5], 1j])
def test_what_is_no_number(value: Any) -> None:
    with pytest.raises(OptionError, match="not a number from 0 on"):
        real_number("x", value, 0)
