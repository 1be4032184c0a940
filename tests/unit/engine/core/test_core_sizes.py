"""The size of what accelerations are made of, by rounding modes and without them.

A body with the force c_1 x + c_2 x² + … + c_6 x⁶, whose terms nearly cancel: the size must be that
of the terms, which bounds the rounding errors, not that of their sum.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
from ctypes import byref, c_void_p
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from core_parts import SIGNATURES, parts

import lagcli
from lagcli.engine.core.library import LIBRARY
from lagcli.engine.core.run import core
from lagcli.engine.core.structures import lag_model
from lagcli.engine.integrate.model_data import model_data
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import prepare

core_library = pytest.importorskip("core_library")
COUNT = 25
TERMS = 6
EPSILON = float(np.finfo(float).eps)


@pytest.fixture(scope="module")
def without_modes(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The library as it is for a machine without rounding modes, such as WebAssembly."""
    if core_library.needs_zig():
        pytest.skip("no C compiler works")
    compiler = core_library.find_compiler()
    options = repr((compiler.compiling, compiler.linking)).encode()
    built = core_library.ROOT / "build" / "core" / hashlib.sha256(options).hexdigest()[:16]
    names = [os.path.relpath(path, LIBRARY.parent) for path in core_library.core.c_files()]
    objects = {name: built / f"{name.replace(os.sep, '_')}.o" for name in names}
    if not all(path.exists() for path in objects.values()):
        pytest.skip("the core was not built here by this compiler")
    folder = tmp_path_factory.mktemp("sizes")
    source, made = LIBRARY.parent / "sizes.c", folder / "sizes.o"
    objects["sizes.c"] = made
    flags = ["-DLAGCLI_NO_ROUNDING_MODES", f"-I{LIBRARY.parent}"]
    library = folder / LIBRARY.name
    subprocess.run([*compiler.compiling, *flags, str(source), "-o", str(made)], check=True)
    linked = [*compiler.linking, *map(str, objects.values()), "-lm", "-o", str(library)]
    subprocess.run(linked, check=True)
    return declared(ctypes.CDLL(str(library)))


def declared(library: Any) -> Any:
    """Return a library whose functions are declared as in the binding."""
    known = core.signatures | SIGNATURES
    for name in (
        *("lag_read_model", "lag_release_model", "lag_make_simulation", "lag_simulate"),
        *("lag_run_of", "lag_destroy_simulation", "lag_part_acceleration_terms"),
    ):
        function = getattr(library, name)
        function.restype, *function.argtypes = known[name]
    return library


class Case:
    """A force whose terms nearly cancel at the initial state."""

    def __init__(self, seed: int):
        random = np.random.default_rng(seed)
        self.x = float(random.uniform(0.3, 3.0))
        self.m = float(random.uniform(0.5, 5.0))
        c = [float(x) for x in random.normal(size=TERMS) * 10.0 ** random.uniform(-3, 6)]
        rest = sum(Fraction(ck) * Fraction(self.x) ** (k + 1) for k, ck in enumerate(c[:-1]))
        c[-1] = float(-rest / Fraction(self.x) ** TERMS) * (1.0 + 10.0 ** random.uniform(-12, -6))
        self.c = c
        terms = [
            Fraction(ck) * Fraction(self.x) ** (k + 1) / Fraction(self.m) for k, ck in enumerate(c)
        ]
        # the sum of the terms' magnitudes, and the exact acceleration
        self.size, self.exact = float(sum(map(abs, terms))), float(sum(terms))

    def data(self) -> bytes:
        force = " + ".join(f"({ck!r})*x^{k + 1}" for k, ck in enumerate(self.c))
        text = (
            f"coordinates: [x]\nT: {self.m!r}*x'^2/2\nQ: {{x: '{force}'}}\n"
            f"initial: {{x: {self.x!r}, x': 0}}\n"
        )
        settings = SettingsOverrides(t_end=1e-9, samples=1)
        simulation = prepare(lagcli.load_text(text), settings)
        return model_data(simulation.system, simulation.request, ("DOP853",))


def size_by(library: Any, data: bytes) -> float:
    """Return A of the coordinate at the start."""
    memory = np.frombuffer(data, dtype=np.int64).copy()
    model, made, block = lag_model(), c_void_p(), np.empty((4, 5))
    assert library.lag_read_model(None, memory.ctypes.data, len(data), byref(model)) == 0
    model.problem.block, model.problem.block_rows = block.ctypes.data, len(block)
    assert library.lag_make_simulation(None, byref(model), b"DOP853", byref(made)) == 0
    library.lag_simulate(made, 0)
    run = library.lag_run_of(made)
    pointer = library.lag_part_acceleration_terms(run)
    found = ctypes.c_double.from_address(pointer.value).value
    library.lag_destroy_simulation(made)
    library.lag_release_model(byref(model))
    return found


def check(library: Any, seeds: range) -> None:
    ratios = []
    for seed in seeds:
        case = Case(seed)
        found = size_by(library, case.data())
        # no smaller than the acceleration, but for its rounding error, which is that of the terms
        assert found >= abs(case.exact) - 20 * EPSILON * case.size
        # no larger than what all operations can do, one rounding each
        assert found <= 10 * TERMS * case.size
        ratios.append(found / case.size)
    # the sum is smaller than the terms by 6 to 12 orders of magnitude; in some cases, the errors
    # of the two evaluations are equal by chance: in 1.3 % with rounding modes, 2.7 % without
    assert np.median(ratios) > 0.1
    assert np.mean(np.array(ratios) > 0.01) >= 0.85


def test_the_size_of_terms_that_cancel_by_rounding_modes() -> None:
    check(declared(parts), range(COUNT))


def test_the_size_of_terms_that_cancel_without_rounding_modes(without_modes: Any) -> None:
    check(without_modes, range(COUNT))
