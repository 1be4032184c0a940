"""The core compiles for WebAssembly and for five platforms, by Zig's compiler."""

from __future__ import annotations

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from lagcli.engine.core.fingerprint import CORE, c_files

core_library = pytest.importorskip("core_library")
pytest.importorskip("ziglang", reason="`make targets` installs ziglang")

TARGETS = (
    "wasm32-wasi",
    "x86_64-linux-gnu.2.17",
    "aarch64-linux-gnu.2.17",
    "x86_64-windows-gnu",
    f"x86_64-macos.{core_library.MACOS}",
    f"aarch64-macos.{core_library.MACOS}",
)


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_the_core_compiles_for_a_platform(target: str, tmp_path: Path) -> None:
    """All files, and as one library where the platform has libraries."""
    compiler = core_library.zig(target)
    flags = [*core_library.FLAGS, "-ffp-contract=off"]
    objects = [tmp_path / f"{i}.o" for i in range(len(c_files()))]

    def compiled(source: str, made: Path) -> None:
        command = [*compiler.command, *flags, f"-I{CORE}", "-c", source, "-o", str(made)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compiled, c_files(), objects))
    linked = tmp_path / "liblagcore"
    how = ["-shared"] if target != "wasm32-wasi" else ["-mexec-model=reactor", "-Wl,--no-entry"]
    done = subprocess.run(
        [*compiler.command, *how, *map(str, objects), "-o", str(linked)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert linked.stat().st_size > 100_000
