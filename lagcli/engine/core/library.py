"""The core's library, loaded, and how its functions are bound.

A library that was not compiled from the sources beside it is refused: its structures and its
numbering of operations may be others, and its numbers wrong.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Mapping
from ctypes import c_char_p, c_int
from typing import Any, NoReturn

from lagcli.engine.core import fingerprint
from lagcli.errors import Diagnostic, LagcliError

#: Functions that take long, during which other threads of Python run.
_LONG = {"lag_simulate", "lag_batch_advance", "lag_table_evaluate"}

LIBRARY = fingerprint.library_in(fingerprint.CORE)


class CoreNotBuilt(LagcliError):
    """The core's library is missing, cannot be loaded, or is not that of the sources."""

    exit_status = 4


def _refuse(problem: str) -> NoReturn:
    remedy = "install lagcli again"
    if fingerprint.sources_are_here():
        where = fingerprint.CORE.parents[2]
        remedy = f"run `python -m pip install --no-deps --editable .` in {where}"
    raise CoreNotBuilt(Diagnostic("core", problem, help=remedy))


def _load(loader: type[ctypes.CDLL]) -> ctypes.CDLL:
    try:
        return loader(str(LIBRARY))
    except OSError as error:
        if not LIBRARY.exists():
            _refuse(f"the numerical core was not compiled: there is no {LIBRARY}")
        _refuse(f"the numerical core cannot be loaded: {error}")


def _is_current(built_from: str) -> bool:
    """Return whether the library was compiled from the sources, if they are installed."""
    if not fingerprint.sources_are_here():
        return True
    return fingerprint.unchanged() or fingerprint.fingerprint() == built_from


class Functions:
    """Functions of the library as attributes, each bound when it is first used.

    Parameters
    ----------
    signatures : mapping of str to tuple
        The types of the result and of the arguments of each; handles, and pointers to what is
        given, are addresses.
    """

    def __init__(self, signatures: Mapping[str, tuple[Any, ...]]):
        self.signatures = signatures

    def __getattr__(self, name: str) -> Any:
        if name not in self.signatures:
            raise AttributeError(name)
        # without releasing the lock of the interpreter, a short call takes half the time
        function = getattr(_long if name in _LONG else _short, name)
        function.restype, *function.argtypes = self.signatures[name]
        setattr(self, name, function)
        return function


_short, _long = _load(ctypes.PyDLL), _load(ctypes.CDLL)
_core = Functions({"lag_fingerprint": (c_char_p,), "lag_best_kernel": (c_int,)})
#: The fingerprint of the sources that the library was compiled from.
BUILT_FROM: str = _core.lag_fingerprint().decode()
if not _is_current(BUILT_FROM):
    _refuse(f"{LIBRARY} was compiled from other sources than those beside it")

#: Versions of the core's loops: for any processor, for AVX2, and the same with machine code.
PORTABLE, AVX2, NATIVE = range(3)
#: The version for this processor. LAGCLI_NATIVE=0: without machine code.
KERNEL: int = _core.lag_best_kernel()
if os.environ.get("LAGCLI_NATIVE") == "0":
    KERNEL = min(KERNEL, AVX2)


def check(failed: object) -> None:
    """Raise MemoryError if a function of the core has returned a failure or a null pointer."""
    if failed:
        raise MemoryError
