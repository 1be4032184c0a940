"""Compile the core to WebAssembly, for pages that simulate a model: `make wasm`.

By Zig's compiler. The same sources give the same module, on every machine.

    python building/wasm.py
"""

from __future__ import annotations

import re
import sys

from core_library import ROOT, CannotCompile, Compiler, build, core, zig

#: The module, which the repository, wheels and source distributions contain.
MODULE = ROOT / "lagcli" / "live" / "assets" / "core.wasm"


class WasmCompiler(Compiler):
    """Zig's compiler for a module without imports, with the functions of ``page/page.h``.

    Small functions are optimized by browsers earlier: -Os is faster than -O3 here, from the first
    run on. And a jump through a table is one instruction.
    """

    __slots__ = ()
    _OF_PROCESSORS = ("-fPIC", "-O3", "-fno-jump-tables")

    @property
    def compiling(self) -> list[str]:
        """The command that compiles a file."""
        others = [flag for flag in super().compiling if flag not in self._OF_PROCESSORS]
        return [*others, "-Os", "-msimd128"]

    @property
    def linking(self) -> list[str]:
        """The command that links the module."""
        header = (core.CORE / "page" / "page.h").read_text("utf-8")
        names = ["_initialize", "lag_fingerprint", *re.findall(r"\b(lag_page_\w+)\(", header)]
        exports = [f"-Wl,--export={name}" for name in names]
        module = ["-mexec-model=reactor", "-Wl,--no-entry", "-Wl,--strip-all"]
        return [*self.command, *module, *exports]


if __name__ == "__main__":
    try:
        build(MODULE, WasmCompiler(*zig("wasm32-wasi")))
        MODULE.chmod(0o644)
    except CannotCompile as error:
        sys.exit(str(error))
