"""One thread for BLAS and LAPACK: lagcli's matrices are too small to be shared among threads.

See docs/decisions/2026-11-blas-threads.md for the measurements.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

#: What the libraries that NumPy may be built with read, once, when NumPy is first imported.
VARIABLES = (
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "OMP_NUM_THREADS",
)


def limit_process() -> None:
    """Let BLAS have one thread in this process and in those that it starts.

    To be called before NumPy is imported. A number that the user has set stays.
    """
    if not _set():
        os.environ.update(dict.fromkeys(VARIABLES, "1"))


@contextmanager
def one_thread() -> Iterator[None]:
    """Let BLAS have one thread inside a ``with`` statement, where the environment sets no number.

    The limit is the process' own: where several threads are inside at once, it is that of the first
    and ends with it.
    """
    if _set():
        yield
        return
    try:
        # imported where it is needed: the command line sets the environment instead
        from threadpoolctl import threadpool_limits
    except ImportError:  # only speed depends on it
        yield
        return
    with threadpool_limits(1, "blas"):
        yield


def _set() -> bool:
    return any(name in os.environ for name in VARIABLES)
