"""One thread for BLAS and LAPACK: lagcli's matrices are too small to benefit from threads.

See docs/decisions/2026-11-blas-threads.md for the measurements.
"""

from __future__ import annotations

import os
from _thread import allocate_lock  # of `threading`, which is slow to import
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: Environment variables of BLAS libraries, read once, when NumPy is first imported.
VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "OMP_NUM_THREADS",
)
#: Whether this thread is inside `one_thread`: finding the libraries takes longer than a short run.
_limited: ContextVar[bool] = ContextVar("_limited", default=False)
#: Held by the thread that has set the limit.
_limiting = allocate_lock()


def limit_process() -> None:
    """Limit BLAS to one thread in this process and its child processes.

    Must be called before NumPy is imported. A number set by the user is kept.
    """
    if not _set():
        os.environ.update(dict.fromkeys(VARIABLES, "1"))


@contextmanager
def one_thread() -> Iterator[None]:
    """Context manager that limits BLAS to one thread, unless the environment sets a number.

    The limit applies to the process: if several threads are inside at once, it ends with the one
    that came first.
    """
    # a second limit would restore, at its end, the number that the first has set
    if _set() or _limited.get() or not _limiting.acquire(blocking=False):
        yield
        return
    try:
        # imported on demand: the command line sets the environment instead
        from threadpoolctl import threadpool_limits
    except ImportError:  # affects only speed
        _limiting.release()
        yield
        return
    try:
        with threadpool_limits(1, "blas"):
            token = _limited.set(True)
            try:
                yield
            finally:
                _limited.reset(token)
    finally:
        _limiting.release()


def _set() -> bool:
    return any(name in os.environ for name in VARIABLES)
