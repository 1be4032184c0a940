"""A case's functions compiled: what a user of SciPy or scikit-sundae does for speed.

SymPy prints C, the C compiler makes a library of it, and Numba joins it with the linear solve. The
functions of chains are loops in `comparison.chain_loops`.
"""

from __future__ import annotations

import ctypes
import os
import shlex
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from comparison.cases import Case
from comparison.symbols import SymbolicCase, c_source


def library(name: str, text: str, count: int) -> Any:
    """Compile C code and return its function of ``count`` arrays."""
    folder = Path(tempfile.mkdtemp(prefix="comparison-"))
    code, built = folder / f"{name}.c", folder / f"{name}.so"
    code.write_text(text, encoding="utf-8")
    compiler = shlex.split(os.environ.get("CC", "cc"))
    subprocess.run(
        [*compiler, "-O2", "-shared", "-fPIC", str(code), "-lm", "-o", str(built)], check=True
    )
    function = getattr(ctypes.CDLL(str(built)), name)
    for path in (code, built):
        path.unlink()  # the loaded library stays
    folder.rmdir()
    function.argtypes = [ctypes.c_void_p] * count
    function.restype = None
    return function


def rate(case: Case) -> Any:
    """Return the compiled (t, y, out), which fills in y' = F(t, y); K is solved by LAPACK."""
    import numba

    symbolic = SymbolicCase(case)
    entries, rhs = symbolic.kinetics.kkt()
    nq, n = len(symbolic.q), len(rhs)
    places = np.array([i * n + j for i, j in entries])
    text = c_source("fill", {"y": symbolic.states}, {"k": list(entries.values()), "r": rhs})
    fill = library("fill", text, 3)

    @numba.njit
    def rate(t, y, out):
        values, vector, matrix = np.empty(len(places)), np.empty(n), np.zeros(n * n)
        fill(y.ctypes, values.ctypes, vector.ctypes)
        for i in range(len(places)):
            matrix[places[i]] = values[i]
        x = np.linalg.solve(matrix.reshape(n, n), vector)
        out[:nq] = y[nq:]
        out[nq:] = x[:nq]

    return rate


def rate_jacobian(rate: Any) -> Any:
    """Return the compiled (t, y, out), which fills in ∂F/∂y by forward differences."""
    import numba

    @numba.njit
    def jacobian(t, y, out):
        n = len(y)
        at, moved, shifted = np.empty(n), np.empty(n), y.copy()
        rate(t, y, at)
        for j in range(n):
            step = 1.5e-8 * max(1e-3, abs(y[j]))
            shifted[j] = y[j] + step
            rate(t, shifted, moved)
            shifted[j] = y[j]
            out[:, j] = (moved - at) / step

    return jacobian


def residual(case: Case) -> tuple[Any, Any, int]:
    """Return residual and Jacobian of the index-1 DAE in (q, v, λ), and the number of λ.

    (t, y, y', out): q' − v, M v' − f − Bᵀλ, B v' − γ; and (t, y, y', c, J) with
    J = ∂out/∂y + c ∂out/∂y'.
    """
    import numba
    import sympy as sp

    symbolic = SymbolicCase(case)
    kinetics = symbolic.kinetics
    nq, nc = len(symbolic.q), len(kinetics.rhs)
    multipliers = [sp.Symbol(f"u{i}", real=True) for i in range(nc)]
    rates = [sp.Symbol(f"d{i}", real=True) for i in range(2 * nq)]
    a = rates[nq:]
    y = [*symbolic.states, *multipliers]
    c = sp.Symbol("c", real=True)
    rows = [d - v for d, v in zip(rates, symbolic.v, strict=False)]
    rows += [-f for f in kinetics.forcing]
    rows += [-g for g in kinetics.rhs]
    for (i, j), entry in kinetics.mass.items():
        rows[nq + i] += entry * a[j]
    for (i, j), entry in kinetics.jacobian.items():
        rows[nq + j] -= entry * multipliers[i]
        rows[2 * nq + i] += entry * a[j]
    places, entries = [], []
    for i, row in enumerate(rows):
        for j, symbol in enumerate(y):
            entry = row.diff(symbol) + (c * row.diff(rates[j]) if j < 2 * nq else 0)
            if entry != 0:
                places.append((i, j))
                entries.append(entry)
    at = np.array(places)
    text = c_source("defect", {"y": y, "d": rates}, {"out": rows})
    fill = library("defect", text, 3)
    text = c_source("slopes", {"y": y, "d": rates, "f": [c]}, {"k": entries})
    fill_slopes = library("slopes", text, 4)

    @numba.njit
    def residual(t, y, d, out):
        fill(y.ctypes, d.ctypes, out.ctypes)

    @numba.njit
    def jacobian(t, y, d, c, out):
        values, factor = np.empty(len(at)), np.full(1, c)
        fill_slopes(y.ctypes, d.ctypes, factor.ctypes, values.ctypes)
        out[:] = 0.0
        for i in range(len(at)):
            out[at[i, 0], at[i, 1]] = values[i]

    return residual, jacobian, nc
