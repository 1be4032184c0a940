"""Available memory, so that a run that cannot fit is rejected before it starts."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from lagcli.errors import NumericalError

if TYPE_CHECKING:
    from lagcli.engine.system import System

#: Files in which Linux reports the limit and the use of a control group, bytes.
_GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))
_SYSTEM, _PROCESS = Path("/proc/meminfo"), Path("/proc/self/status")
#: Address space needed by imports and a small run, bytes: below it, libraries abort the process.
_LEAST = 260_000_000
#: Address space that libraries need beyond that, bytes. OpenBLAS ends the process, or never
#: returns, if it cannot allocate its buffers when SciPy is imported.
_LIBRARIES = {"scipy": 230_000_000}
#: Rows of matrices whose product needs OpenBLAS' buffer.
_PRODUCT = 200


def available() -> int | None:
    """Return the memory available to this process, bytes; None if the system does not report it.

    The minimum of the system's free memory, the remainder of the process limit (``ulimit -v``), and
    the remainder of the limit of its control group.
    """
    return min(_limits(), default=None)


def numbers_per_sample(system: System) -> int:
    """Return the number of values stored for each sample."""
    nq, nc = len(system.coordinates), len(system.constraints)
    return 3 * nq + 3 * nc + len(system.jacobian_pattern) + len(system.outputs) + 10


def check_fits(needed: int, what: str, remedy: str) -> None:
    """Raise NumericalError if more memory is needed than available.

    Parameters
    ----------
    needed : int
        Bytes.
    what, remedy : str
        Description of the use, and a remedy.
    """
    free = available()
    if free is not None and needed > free:
        raise NumericalError(
            f"{what} needs about {_size(needed)} of memory, and {_size(free)} is free; {remedy}"
        )


def check_address_space() -> None:
    """Raise NumericalError if the limit of the process is too low for the libraries.

    Those that only some runs need are checked when they are imported.
    """
    limit = _address_space()
    if limit is None:
        return
    if limit < _LEAST:
        raise NumericalError(
            f"the memory of this process is limited to {_size(limit)} (ulimit -v), and lagcli needs"
            f" {_size(_LEAST)}; raise the limit"
        )
    _take_buffer()
    if _CheckedImports not in sys.meta_path:
        sys.meta_path.insert(0, _CheckedImports)


def _take_buffer() -> None:
    """Let NumPy's BLAS allocate its buffer, which OpenBLAS keeps.

    It does so at the first product of matrices that are not small, and ends the process if a large
    model has left too little by then.
    """
    import numpy as np

    square = np.ones((_PRODUCT, _PRODUCT))
    square @ square


class _CheckedImports:
    """Finder of modules that finds none, but checks that a library fits before it is loaded."""

    @staticmethod
    def find_spec(fullname: str, path: object, target: object = None) -> None:
        """Raise NumericalError if a library needs more memory than available."""
        if fullname in _LIBRARIES:
            remedy = "close other programs, or raise the limit (ulimit -v)"
            check_fits(_LIBRARIES[fullname], f"loading {fullname}", remedy)


def _limits() -> Iterator[int]:
    with suppress(OSError, ValueError):
        yield _entry(_SYSTEM, "MemAvailable")
    with suppress(OSError, ValueError):
        limit, used = (int(path.read_text()) for path in _GROUP)
        yield max(0, limit - used)
    with suppress(OSError, ValueError):
        limit_ = _address_space()
        if limit_ is not None:
            yield max(0, limit_ - _entry(_PROCESS, "VmSize"))


def _address_space() -> int | None:
    """Return the limit of ``ulimit -v``, bytes; None if there is none."""
    try:
        import resource
    except ImportError:  # not a POSIX system
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _entry(path: Path, name: str) -> int:
    """Return an entry of a file in /proc, bytes."""
    for line in path.read_text().splitlines():
        key, _, value = line.partition(":")
        if key == name:
            return int(value.removesuffix("kB")) * 1024
    raise ValueError(name)


def _size(count: int) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e9 else f"{count / 1e6:.3g} MB"
