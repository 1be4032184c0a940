"""CasADi: equations in SX, its own derivatives, SUNDIALS' IDAS on the DAE, CVODES on the ODE.

The accelerations a and multipliers λ are algebraic variables of the DAE, left out of the error
test. For the ODE, K (a, −λ) = r is eliminated symbolically.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.cases import Case
from comparison.kinetics import Kinetics, derive, solve_symmetric
from comparison.methods import Method, decades, not_stiff, stiff_only

Array = NDArray[np.float64]
_STEPS = 10_000_000


def kinetics(case: Case) -> tuple[Any, Any, Kinetics]:
    """Return the vectors q and v, and the case's equations in CasADi's SX."""
    import casadi as ca

    nq = len(case.start.q)
    q, v = ca.SX.sym("q", nq), ca.SX.sym("v", nq)
    qs, vs = ca.vertsplit(q), ca.vertsplit(v)
    index = {x.element_hash(): i for i, x in enumerate(qs)}
    algebra = SimpleNamespace(
        sin=ca.sin,
        cos=ca.cos,
        sqrt=ca.sqrt,
        diff=lambda x, s: ca.jacobian(ca.SX(x), s),
        variables=lambda x: sorted(
            index[s.element_hash()] for s in ca.symvar(ca.SX(x)) if s.element_hash() in index
        ),
        is_zero=lambda x: ca.SX(x).is_zero(),
    )
    geometry = case.geometry(algebra, qs, case.start.parameters)
    return q, v, derive(algebra, geometry, qs, vs)


class Integrator:
    """A case in one of CasADi's integrators."""

    def __init__(self, case: Case, plugin: str, options: dict[str, Any]):
        import casadi as ca

        self.case, self.plugin = case, plugin
        self.options = {"max_num_steps": _STEPS, **options}
        q, v, equations = kinetics(case)
        nq, nc = len(case.start.q), len(equations.rhs)
        entries, rhs = equations.kkt()
        dae = {"x": ca.vertcat(q, v)}
        if plugin == "idas":
            z = ca.SX.sym("z", nq + nc)
            defect = [-r for r in rhs]
            for (i, j), entry in entries.items():
                defect[i] += entry * z[j]
            dae |= {"z": z, "ode": ca.vertcat(v, z[:nq]), "alg": ca.vertcat(*defect)}
            matrix = ca.SX(nq + nc, nq + nc)
            for (i, j), entry in entries.items():
                matrix[i, j] = entry
            at = ca.Function("at", [q, v], [matrix, ca.vertcat(*rhs)])
            k, r = at(case.start.q, case.start.v)
            self.start = {"z0": np.linalg.solve(np.array(k), np.array(r).ravel())}
        else:
            dae["ode"] = ca.vertcat(v, *solve_symmetric(entries, rhs)[:nq])
            self.start = {}
        self.start["x0"] = np.concatenate([case.start.q, case.start.v])
        self.dae = dae

    def at(self, setting: float) -> Callable[[], Any]:
        """Prepare a run at a tolerance."""
        import casadi as ca

        options = {**self.options, "reltol": setting, "abstol": setting}
        integrator = ca.integrator("run", self.plugin, self.dae, 0.0, self.case.times, options)
        return lambda: integrator(**self.start)

    def positions(self, result: Any) -> Array:
        """Return q."""
        return np.array(result["xf"]).T[:, : len(self.case.start.q)]


def _settings(case: Case) -> tuple[float, ...]:
    return decades(6, 14)[::2] if case.bodies < 100 else decades(6, 12)[::2]


def _method(name: str, plugin: str, options: dict[str, Any], **more: Any) -> Method:
    def prepare(case: Case) -> Integrator:
        return Integrator(case, plugin, options)

    return Method("CasADi", name, prepare, _settings, packages=("casadi",), **more)


_ADAMS = {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
METHODS = (
    _method("IDAS", "idas", {"suppress_algebraic": True}),
    _method("CVODES Adams", "cvodes", _ADAMS, unfit=not_stiff),
    _method("CVODES BDF", "cvodes", {}, unfit=stiff_only),
)
