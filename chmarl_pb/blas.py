"""Threads of NumPy's matrix products: products as small as ours only wait for more than one."""

from contextlib import AbstractContextManager, nullcontext
from functools import cache

from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which matrix products use one thread, so that their sums depend on no count of cores."""
    libraries = _libraries()
    if all(library.num_threads == 1 for library in libraries.lib_controllers):
        return nullcontext()  # to set it again takes as long as a product
    limits: AbstractContextManager[object] = libraries.limit(limits=1)
    return limits


@cache
def _libraries() -> ThreadpoolController:
    """Return what knows NumPy's libraries; finding them takes some milliseconds, so once in a process."""
    return ThreadpoolController().select(user_api="blas")
