"""scikit-sundae: SUNDIALS' CVODE on the explicit equations and IDA on the index-1 DAE.

Functions are compiled, those of chains from loops written by hand, with SUNDIALS' banded
solver in the order body by body. IDA's option to leave λ out of the error test is not offered; an
absolute tolerance without bound does the same.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison import chain_loops, compiled, mechanisms
from comparison.cases import Case
from comparison.methods import Method, decades, not_stiff, stiff_only

Array = NDArray[np.float64]
_STEPS = 10_000_000
_UNTESTED = 1e30


def rate(case: Case) -> Any:
    """Return the compiled (t, y, out) of a case."""
    if case.geometry is mechanisms.chain:
        return chain_loops.rate(case.start.parameters)
    return compiled.rate(case)


class Cvode:
    """CVODE on y' = F(t, y)."""

    def __init__(self, case: Case, method: str, linsolver: str):
        self.case = case
        self.y0 = np.concatenate([case.start.q, case.start.v])
        self.options: dict[str, Any] = {"method": method, "linsolver": linsolver}
        f = rate(case)
        f(0.0, self.y0, np.empty_like(self.y0))
        self.rate = lambda t, y, out: f(t, y, out)
        if linsolver == "dense":
            jacobian = compiled.rate_jacobian(f)
            jacobian(0.0, self.y0, np.empty((len(self.y0), len(self.y0))))
            self.options["jacfn"] = lambda t, y, yp, out: jacobian(t, y, out)

    def at(self, setting: float) -> Callable[[], Any]:
        """Prepare a run at a tolerance."""
        from sksundae.cvode import CVODE

        solver = CVODE(self.rate, rtol=setting, atol=setting, max_num_steps=_STEPS, **self.options)
        return lambda: solver.solve(self.case.times, self.y0)

    def positions(self, result: Any) -> Array:
        """Return q."""
        if not result.success:
            raise RuntimeError(result.message)
        return result.y[:, : len(self.case.start.q)]


class Ida:
    """IDA on the index-1 DAE."""

    def __init__(self, case: Case):
        self.case = case
        start, nq = case.start, len(case.start.q)
        f = rate(case)
        self.chain = case.geometry is mechanisms.chain
        state = np.concatenate([start.q, start.v])
        slope = np.empty_like(state)
        f(0.0, state, slope)
        self.options: dict[str, Any] = {}
        if self.chain:
            residual = chain_loops.residual(start.parameters)
            self.y0 = chain_loops.to_blocks(start.q, start.v)
            self.slope = chain_loops.to_blocks(slope[:nq], slope[nq:])
            self.algebraic = np.arange(chain_loops.BLOCK - 1, len(self.y0), chain_loops.BLOCK)
            width = chain_loops.BANDWIDTH
            self.options |= {"linsolver": "band", "lband": width, "uband": width}
        else:
            residual, jacobian, nc = compiled.residual(case)
            self.y0 = np.concatenate([state, np.zeros(nc)])
            self.slope = np.concatenate([slope, np.zeros(nc)])
            self.algebraic = np.arange(2 * nq, 2 * nq + nc)
            n = len(self.y0)
            jacobian(0.0, self.y0, self.slope, 1.0, np.empty((n, n)))
            self.options["jacfn"] = lambda t, y, yp, res, c, out: jacobian(t, y, yp, c, out)
        residual(0.0, self.y0, self.slope, np.empty_like(self.y0))
        self.residual = lambda t, y, yp, out: residual(t, y, yp, out)

    def at(self, setting: float) -> Callable[[], Any]:
        """Prepare a run at a tolerance."""
        from sksundae.ida import IDA

        atol = np.full(len(self.y0), setting)
        atol[self.algebraic] = _UNTESTED
        solver = IDA(
            self.residual,
            rtol=setting,
            atol=atol,
            algebraic_idx=self.algebraic,
            calc_initcond="yp0",
            calc_init_dt=1e-6,
            max_num_steps=_STEPS,
            **self.options,
        )
        return lambda: solver.solve(self.case.times, self.y0.copy(), self.slope.copy())

    def positions(self, result: Any) -> Array:
        """Return q."""
        if not result.success:
            raise RuntimeError(result.message)
        if self.chain:
            return chain_loops.from_blocks(result.y)
        return result.y[:, : len(self.case.start.q)]


def _settings(case: Case) -> tuple[float, ...]:
    return decades(6, 14)[::2] if case.bodies < 100 else decades(6, 12)[::2]


def _cvode(method: str, linsolver: str, unfit: Callable[[Case], str]) -> Method:
    def prepare(case: Case) -> Cvode:
        return Cvode(case, method, linsolver)

    name = f"CVODE {method}, {linsolver}"
    return Method("scikit-sundae", name, prepare, _settings, unfit, packages=_PACKAGES)


_PACKAGES = ("scikit-sundae", "sympy", "numba")
METHODS = (
    _cvode("Adams", "gmres", not_stiff),
    _cvode("BDF", "dense", stiff_only),
    Method("scikit-sundae", "IDA", Ida, _settings, packages=_PACKAGES),
)
