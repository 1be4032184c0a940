"""PyDy: Kane's equations of SymPy, compiled by PyDy, integrated by SciPy's odeint.

PyDy's System has no multipliers: pendulum and chains are in the angles of the rods, the
slider-crank in one independent and one dependent coordinate.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison import mechanisms
from comparison.cases import Case
from comparison.methods import Method, decades

Array = NDArray[np.float64]
#: Links above which SymPy takes minutes.
_MOST_LINKS = 5


def _symbols(*names: str) -> dict[str, Any]:
    import sympy as sp

    return {name: sp.Symbol(name) for name in names}


def _pendulum(case: Case) -> tuple[Any, list[float]]:
    """Return Kane's method of point masses on rods, and the start (angles, speeds)."""
    from sympy.physics import mechanics as me

    p, n = _symbols("m", "g", "l"), len(case.start.q) // 2
    q, u = me.dynamicsymbols(f"q:{n}"), me.dynamicsymbols(f"u:{n}")
    frame = me.ReferenceFrame("N")
    point = me.Point("O")
    point.set_vel(frame, 0)
    particles, loads = [], []
    for i in range(n):
        rod = frame.orientnew(f"A{i}", "Axis", [q[i], frame.z])
        rod.set_ang_vel(frame, u[i] * frame.z)
        end = point.locatenew(f"P{i}", p["l"] * rod.x)
        end.v2pt_theory(point, frame, rod)
        particles.append(me.Particle(f"m{i}", end, p["m"]))
        loads.append((end, -p["m"] * p["g"] * frame.y))
        point = end
    rates = [a.diff(me.dynamicsymbols._t) - b for a, b in zip(q, u, strict=True)]
    kane = me.KanesMethod(frame, q_ind=q, u_ind=u, kd_eqs=rates)
    kane.kanes_equations(particles, loads)
    rods = np.diff(np.vstack([np.zeros(2), case.start.q.reshape(-1, 2)]), axis=0)
    return kane, [*np.unwrap(np.arctan2(rods[:, 1], rods[:, 0])), *[0.0] * n]


def _slider_crank(case: Case) -> tuple[Any, list[float]]:
    """Return Kane's method with φ independent and ψ dependent, and the start."""
    import sympy as sp
    from sympy.physics import mechanics as me

    p = _symbols("m", "g", "r", "l")
    t = me.dynamicsymbols._t
    (phi, psi), (u, w) = me.dynamicsymbols("phi psi"), me.dynamicsymbols("u w")
    frame = me.ReferenceFrame("N")
    a, b = me.Point("A"), me.Point("B")
    r, l = p["r"], p["l"]
    a.set_vel(frame, r * u * (-sp.sin(phi) * frame.x + sp.cos(phi) * frame.y))
    b.set_vel(frame, -(r * u * sp.sin(phi) + l * w * sp.sin(psi)) * frame.x)
    loop = r * sp.sin(phi) - l * sp.sin(psi)
    kane = me.KanesMethod(
        frame,
        q_ind=[phi],
        u_ind=[u],
        kd_eqs=[phi.diff(t) - u, psi.diff(t) - w],
        q_dependent=[psi],
        u_dependent=[w],
        configuration_constraints=[loop],
        velocity_constraints=[r * sp.cos(phi) * u - l * sp.cos(psi) * w],
    )
    particles = [me.Particle(str(x), x, p["m"]) for x in (a, b)]
    kane.kanes_equations(particles, [(a, -p["m"] * p["g"] * frame.y)])
    return kane, [*case.start.q, *case.start.v]


class PyDy:
    """A case in PyDy's System."""

    def __init__(self, case: Case):
        from pydy.system import System

        self.case = case
        self.angles = case.geometry is mechanisms.slider_crank
        if self.angles:
            kane, start = _slider_crank(case)
        else:
            kane, start = _pendulum(case)
        states = [*kane.q, *kane.u]
        self.system = System(kane, times=case.times)
        known = case.start.parameters
        self.system.constants = {s: known[s.name] for s in self.system.constants_symbols}
        self.system.initial_conditions = dict(zip(states, map(float, start), strict=True))
        self.system.generate_ode_function(generator="cython")

    def at(self, setting: float) -> Callable[[], Array]:
        """Prepare a run at a tolerance."""
        return lambda: self.system.integrate(rtol=setting, atol=setting, mxstep=1_000_000)

    def positions(self, result: Array) -> Array:
        """Return q from the states."""
        turn = result[:, : result.shape[1] // 2]
        if self.angles:
            return turn
        rods = self.case.start.parameters["l"] * np.stack([np.cos(turn), np.sin(turn)], axis=2)
        return rods.cumsum(axis=1).reshape(len(turn), -1)


def unfit(case: Case) -> str:
    """Return why a case is not for PyDy."""
    if case.geometry not in (mechanisms.pendulum, mechanisms.slider_crank, mechanisms.chain):
        return "not written in minimal coordinates"
    return (
        f"deriving more than {_MOST_LINKS} links takes minutes" if case.bodies > _MOST_LINKS else ""
    )


METHODS = (
    Method(
        "PyDy",
        "Kane, odeint",
        PyDy,
        lambda case: decades(6, 12)[::2],
        unfit,
        packages=("pydy", "sympy", "scipy"),
    ),
)
