"""Commands of robots lose their last bits, which libraries round differently on different processors."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from chmarl_pb.robots.rounding import rounded

values = st.floats(-10, 10)


@given(values, values, values)
def test_commands_are_near_and_within_limits(value: float, one: float, other: float) -> None:
    lower, upper = min(one, other), max(one, other)
    found = rounded(value, lower, upper)
    assert lower <= found <= upper
    assert abs(found - np.clip(value, lower, upper)) <= 0.5000001e-6
    assert rounded(value) == rounded(rounded(value))


@given(st.integers(-10_000_000, 10_000_000), st.sampled_from((-4, -1, 1, 4)))
def test_what_differs_by_some_last_bits_becomes_the_same_bits(millionths: int, steps: int) -> None:
    value = millionths / 1e6
    other = value + steps * np.spacing(value)
    assert rounded(value).tobytes() == rounded(other).tobytes()


def test_zero_has_one_sign() -> None:
    assert rounded([-0.0, -1e-9, 1e-9]).tobytes() == np.zeros(3).tobytes()
