"""The core compiles for WebAssembly and five platforms by Zig, and runs where it is emulated."""

from __future__ import annotations

import os
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from core_runs import data_of, prepared

from lagcli.engine.core.fingerprint import CORE, c_files
from lagcli.engine.core.status import Status
from lagcli.engine.integrate.engine import integrate

core_library = pytest.importorskip("core_library")
wheels = pytest.importorskip("wheels")
pytest.importorskip("ziglang", reason="`make targets` installs ziglang")

TARGETS = ("wasm32-wasi", *(platform.target for platform in wheels.PLATFORMS))
#: What runs a program of another platform here, and the target whose program needs nothing else.
EMULATORS = {
    "x86_64-windows-gnu": ("wine",),
    "aarch64-linux-musl": ("qemu-aarch64-static", "qemu-aarch64"),
}
SIMULATE = Path(__file__).with_name("simulate.c")


def compile_all(target: str, folder: Path) -> tuple[list[str], list[str]]:
    """Compile the core; return the compiler's command and the objects."""
    compiler = core_library.zig(target)
    flags = [*core_library.FLAGS, "-ffp-contract=off", "-Werror"]
    objects = [folder / f"{i}.o" for i in range(len(c_files()))]

    def compiled(source: str, made: Path) -> None:
        check([*compiler.command, *flags, f"-I{CORE}", "-c", source, "-o", str(made)])

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compiled, c_files(), objects))
    return compiler.command, [str(path) for path in objects]


def check(command: list[str]) -> str:
    """Run a command; return what it prints."""
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_the_core_compiles_for_a_platform(target: str, tmp_path: Path) -> None:
    """All files, without a warning, and as one library where the platform has libraries."""
    command, objects = compile_all(target, tmp_path)
    linked = tmp_path / "liblagcore"
    how = ["-shared"] if target != "wasm32-wasi" else ["-mexec-model=reactor", "-Wl,--no-entry"]
    check([*command, *how, *objects, "-o", str(linked)])
    assert linked.stat().st_size > 100_000


@pytest.mark.slow
@pytest.mark.parametrize("target", EMULATORS)
def test_the_core_simulates_under_an_emulator(target: str, tmp_path: Path) -> None:
    """Models as data, by a C program; the platforms' functions of libm differ in the last bit."""
    emulator = next(filter(None, map(shutil.which, EMULATORS[target])), None)
    if emulator is None:
        pytest.skip(f"not installed: {EMULATORS[target][0]}")
    command, objects = compile_all(target, tmp_path)
    program = tmp_path / "simulate.exe"
    check([*command, f"-I{CORE}", str(SIMULATE), *objects, "-o", str(program)])
    for name, method in (
        ("slider_crank", "Taylor"),
        ("andrews_squeezer", "DOP853"),
        ("parallelogram", "Radau"),
        ("contact/bouncing_ball", "DOP853"),
        ("contact/stick_slip_belt", "Rodas5P"),
    ):
        data = tmp_path / "model"
        data.write_bytes(data_of(name, (method,)))
        lines = check([emulator, str(program), str(data), method, "0", "0"]).splitlines()
        status, _ = map(int, lines[0].split())
        rows, width = map(int, lines[1].split())
        found = [[float.fromhex(x) for x in line.split()] for line in lines[2 : 2 + rows]]
        simulation = prepared(name, method=method)
        blocks: list[np.ndarray] = []
        integrate(
            simulation.system,
            simulation.request,
            lambda block, blocks=blocks: blocks.append(np.column_stack(block)),
        )
        expected = np.concatenate(blocks)
        assert status == Status.DONE, (name, method)
        assert expected.shape == (rows, width)
        atol = 1e-6 * np.abs(expected).max()
        np.testing.assert_allclose(np.array(found), expected, rtol=0.0, atol=atol)
