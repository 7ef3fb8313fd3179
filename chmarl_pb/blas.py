"""Threads of NumPy's matrix products: products as small as ours only wait for more than one."""

from contextlib import AbstractContextManager
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which matrix products use one thread, so that their sums depend on no count of cores."""
    limits: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return limits


@cache
def _controller() -> ThreadpoolController:
    """Return what knows NumPy's libraries; finding them takes some milliseconds, so once in a process."""
    return ThreadpoolController()
