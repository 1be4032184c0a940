"""What a user writes by hand: SymPy's lambdify, a linear solve, and SciPy's solve_ivp.

The expressions are evaluated with ``math`` (faster than NumPy for numbers), common subexpressions
shared; the linear system is solved dense where it is small, and by SuperLU where it is not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.cases import Case
from comparison.methods import Method, decades, stiff_only
from comparison.symbols import SymbolicCase

Array = NDArray[np.float64]
#: Unknowns from which on SuperLU beats LAPACK's dense solver.
_SPARSE = 150


def rate(case: Case) -> Callable[[float, Array], Array]:
    """Return y' = F(t, y) of a case."""
    import sympy as sp

    symbolic = SymbolicCase(case)
    entries, rhs = symbolic.kinetics.kkt()
    nq, n = len(symbolic.q), len(rhs)
    places = list(entries)
    evaluate = sp.lambdify(
        [symbolic.states], [[entries[k] for k in places], rhs], modules="math", cse=True
    )
    rows, columns = np.array(places).T
    solve = _sparse(rows, columns, n) if n > _SPARSE else _dense(rows, columns, n)

    def rate(t: float, y: Array) -> Array:
        values, r = evaluate(y.tolist())
        return np.concatenate([y[nq:], solve(values, r)[:nq]])

    return rate


def _dense(rows: Array, columns: Array, n: int) -> Callable[..., Array]:
    matrix = np.zeros((n, n))

    def solve(values: list[float], rhs: list[float]) -> Array:
        matrix[rows, columns] = values
        return np.linalg.solve(matrix, rhs)

    return solve


def _sparse(rows: Array, columns: Array, n: int) -> Callable[..., Array]:
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    # the places' order in compressed columns, so that each solve only fills in values
    order = np.lexsort((rows, columns))
    pattern = csc_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n))

    def solve(values: list[float], rhs: list[float]) -> Array:
        pattern.data[:] = np.array(values)[order]
        return splu(pattern).solve(np.array(rhs))

    return solve


class SolveIvp:
    """A case for `scipy.integrate.solve_ivp`."""

    def __init__(self, case: Case, method: str, rate: Callable[[Case], Any] = rate):
        self.case, self.method = case, method
        self.options: dict[str, Any] = {}
        self.rate = rate(case)

    def at(self, setting: float) -> Callable[[], Any]:
        """Prepare a run at a tolerance."""
        from scipy.integrate import solve_ivp

        start = np.concatenate([self.case.start.q, self.case.start.v])
        return lambda: solve_ivp(
            self.rate,
            (0.0, self.case.t_end),
            start,
            method=self.method,
            t_eval=self.case.times,
            rtol=setting,
            atol=setting,
            **self.options,
        )

    def positions(self, result: Any) -> Array:
        """Return q."""
        if not result.success:
            raise RuntimeError(result.message)
        return result.y[: len(self.case.start.q)].T


class CompiledSolveIvp(SolveIvp):
    """As SolveIvp, with right-hand side and Jacobian compiled."""

    def __init__(self, case: Case, method: str):
        from comparison import compiled

        f = compiled.rate(case)
        jacobian = compiled.rate_jacobian(f)

        def filled(function: Any, shape: tuple[int, ...]) -> Callable[[float, Array], Array]:
            def call(t: float, y: Array) -> Array:
                out = np.empty(shape)
                function(t, y, out)
                return out

            return call

        n = 2 * len(case.start.q)
        super().__init__(case, method, lambda case: filled(f, (n,)))
        self.options = {"jac": filled(jacobian, (n, n))}


def _settings(case: Case) -> tuple[float, ...]:
    return decades(6, 12)[::2] if case.bodies < 100 else decades(6, 10)[::2]


def _stiff(name: str) -> Method:
    return Method(
        "SciPy",
        f"{name}, compiled",
        lambda case: CompiledSolveIvp(case, name),
        lambda case: decades(4, 10)[::2],
        stiff_only,
        packages=("scipy", "sympy", "numba"),
    )


METHODS = (
    Method(
        "lambdify + solve_ivp",
        "DOP853",
        lambda case: SolveIvp(case, "DOP853"),
        _settings,
        packages=("scipy", "sympy"),
    ),
    _stiff("Radau"),
    _stiff("BDF"),
)
