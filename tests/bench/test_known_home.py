"""The belief search that knows a home by heart."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from benchmarks.known_home import KNOWN, play


@pytest.mark.slow
def test_a_known_home_is_searched_faster() -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), max_tasks_per_child=1) as processes:
        unknown, generated, known = processes.map(play, ["test-unseen"] * 3, KNOWN)
    assert unknown.episodes == generated.episodes == known.episodes == 50
    assert generated.plw != unknown.plw
    assert unknown.plw.mean is not None
    assert known.plw.mean is not None
    assert known.plw.mean > unknown.plw.mean
