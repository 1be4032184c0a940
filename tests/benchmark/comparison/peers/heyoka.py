"""heyoka: Taylor's method on the explicit equations, compiled to machine code by LLVM.

Accelerations are expressions: K (a, −λ) = r is eliminated symbolically.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.cases import Case
from comparison.kinetics import derive, solve_symmetric
from comparison.methods import Method, decades

#: Bodies above which LLVM takes longer than the measurement may.
MOST_BODIES = 100
#: Operations of Taylor's recursion up to which code is unrolled.
LONGEST_UNROLLED = 300


def equations(case: Case) -> list[tuple[Any, Any]]:
    """Return heyoka's (state, rate) pairs of a case."""
    import heyoka as hy

    nq = len(case.start.q)
    q = hy.make_vars(*[f"q{i}" for i in range(nq)])
    v = hy.make_vars(*[f"v{i}" for i in range(nq)])
    index = {str(x): i for i, x in enumerate(q)}
    algebra = SimpleNamespace(
        sin=hy.sin,
        cos=hy.cos,
        sqrt=hy.sqrt,
        diff=hy.diff,
        variables=lambda x: sorted(
            index[n] for n in hy.get_variables(hy.expression(x)) if n in index
        ),
        is_zero=lambda x: isinstance(x, int) or str(x).startswith("0.0000000000000000"),
    )
    geometry = case.geometry(algebra, q, case.start.parameters)
    a = solve_symmetric(*derive(algebra, geometry, q, v).kkt())[:nq]
    return [*zip(q, v, strict=True), *zip(v, a, strict=True)]


class Taylor:
    """The equations of a case, compiled at each tolerance.

    Unrolled code is twice as fast as compact code, and takes minutes to compile where the
    equations are long.
    """

    def __init__(self, case: Case, compact: bool | None = None):
        import heyoka as hy

        self.case = case
        self.system = equations(case)
        self.start = np.concatenate([case.start.q, case.start.v])
        if compact is None:
            trial = hy.taylor_adaptive(self.system, self.start, tol=1e-4, compact_mode=True)
            compact = len(trial.decomposition) > LONGEST_UNROLLED
        self.compact = compact

    def at(self, setting: float, number: type = np.float64) -> Callable[[], NDArray]:
        """Compile, and prepare a run at a tolerance."""
        import heyoka as hy

        start = self.start.astype(number)
        times = self.case.times.astype(number)
        options = {"tol": number(setting), "compact_mode": self.compact, "fp_type": number}
        integrator = hy.taylor_adaptive(self.system, start, **options)

        def run() -> NDArray:
            integrator.time = number(0)
            integrator.state[:] = start
            *_, states = integrator.propagate_grid(times)
            return states

        return run

    def positions(self, result: NDArray) -> NDArray:
        """Return q."""
        return result[:, : len(self.case.start.q)]


def unfit(case: Case) -> str:
    """Return why a case is not for heyoka."""
    too_many = case.bodies > MOST_BODIES
    return f"compiling more than {MOST_BODIES} bodies takes minutes" if too_many else ""


def _settings(case: Case) -> tuple[float, ...]:
    return decades(6, 16)[:: 2 if case.bodies < 100 else 4]


METHODS = (Method("heyoka", "Taylor", Taylor, _settings, unfit, packages=("heyoka",)),)
