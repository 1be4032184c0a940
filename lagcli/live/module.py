"""The core as a WebAssembly module."""

from __future__ import annotations

from importlib.resources import files

from lagcli.engine.core import fingerprint
from lagcli.engine.core.library import BUILT_FROM
from lagcli.errors import Diagnostic, FileError

_MODULE = "core.wasm"


def module() -> bytes:
    """Return the module.

    Raises
    ------
    FileError
        It is not there, or not that of the core's library.
    """
    file = files("lagcli.live").joinpath("assets", _MODULE)
    remedy = "run `make wasm` in the checkout, which compiles it"
    if not fingerprint.sources_are_here():
        remedy += ", and install lagcli from there again"
    if not file.is_file():
        raise FileError(
            Diagnostic("core", "this installation has no core for pages (core.wasm)", help=remedy)
        )
    content = file.read_bytes()
    if BUILT_FROM.encode() not in content:
        raise FileError(
            Diagnostic(
                "core",
                f"{file} was compiled from other sources than the library of the core",
                help=remedy,
            )
        )
    return content
