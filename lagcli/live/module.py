"""The core as a WebAssembly module."""

from __future__ import annotations

from importlib.resources import files

from lagcli.engine.core import fingerprint
from lagcli.errors import Diagnostic, FileError

_MODULE = "core.wasm"


def module() -> bytes:
    """Return the module.

    Raises
    ------
    FileError
        It is not there, or not that of the sources.
    """
    file = files("lagcli.live").joinpath("assets", _MODULE)
    checkout = fingerprint.sources_are_here()
    if not file.is_file():
        remedy = "install a wheel of lagcli, which has it"
        if checkout:
            remedy = "run `make wasm` in the checkout, which compiles it"
        raise FileError(
            Diagnostic("core", "this installation has no core for pages (core.wasm)", help=remedy)
        )
    content = file.read_bytes()
    if checkout and fingerprint.fingerprint().encode() not in content:
        raise FileError(
            Diagnostic(
                "core",
                f"{file} was compiled from other sources than those here",
                help="run `make wasm` in the checkout",
            )
        )
    return content
