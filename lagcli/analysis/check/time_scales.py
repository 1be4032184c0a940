"""Time scales of small motions about a state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import SingularSystem, decompose, solve_redundant
from lagcli.engine.system import Pattern, State, System
from lagcli.engine.tape.interpreter import ScalarTape

#: Largest numbers of coordinates and of entries of M for which eigenvalues are computed: the
#: derivatives of larger models take seconds.
_LARGEST, _ENTRIES = 60, 400
#: Eigenvalues below this part of the largest count as zero. For a chain of two, zeros are about
#: 1e-8.
_ZERO = 1e-6


@dataclass(frozen=True)
class TimeScales:
    """Eigenvalues s of small motions δq ~ exp(s t) about a state, with frozen coefficients.

    Parameters
    ----------
    largest_frequency : float
        The largest \\|Im s\\|, rad/s; 0 without oscillation.
    damping_ratio : float
        −Re s/\\|s\\| of the fastest oscillation; negative if it grows.
    fastest_decay, fastest_growth : float
        The largest −Re s and Re s, 1/s; 0 if there is none.
    slowest : float
        The least \\|s\\| that is not zero, 1/s; 0 without.
    """

    largest_frequency: float
    damping_ratio: float
    fastest_decay: float
    fastest_growth: float
    slowest: float

    @property
    def stiffness(self) -> float:
        """Ratio of the fastest decay to the slowest motion: large if the motion is stiff."""
        return self.fastest_decay / self.slowest if self.slowest else 0.0


def time_scales(system: System, start: ConsistentState) -> TimeScales | None:
    """Return the time scales of small motions about a state.

    The equations M a = f + Bᵀλ, B a = γ are linearized. The constraints make some of their 2k
    eigenvalues zero; these are omitted.

    Returns
    -------
    TimeScales or None
        None for a large system, or if the derivatives are not finite.
    """
    nq = len(system.coordinates)
    if not 0 < nq <= _LARGEST or len(system.mass_pattern) > _ENTRIES or system.variation is None:
        return None
    try:
        matrix = _linearized(system, start.state, start.rank)
    except SingularSystem:
        return None
    if not np.isfinite(matrix).all():
        return None
    holonomic = _holonomic_rank(system, start)
    values = np.linalg.eigvals(matrix)
    values = values[np.argsort(np.abs(values))][start.rank + holonomic :]
    size = np.abs(values).max(initial=0.0)
    values = values[np.abs(values) > _ZERO * size] if size else values[:0]
    if not len(values):
        return TimeScales(0.0, 0.0, 0.0, 0.0, 0.0)
    imaginary = np.where(np.abs(values.imag) > _ZERO * size, values.imag, 0.0)
    real = np.where(np.abs(values.real) > _ZERO * size, values.real, 0.0)
    fastest = int(np.abs(imaginary).argmax())
    ratio = -real[fastest] / abs(values[fastest]) if imaginary[fastest] else 0.0
    return TimeScales(
        largest_frequency=float(np.abs(imaginary).max()),
        damping_ratio=float(ratio) + 0.0,
        fastest_decay=float((-real).max(initial=0.0)) + 0.0,
        fastest_growth=float(real.max(initial=0.0)),
        slowest=float(np.abs(values).min()),
    )


def _holonomic_rank(system: System, start: ConsistentState) -> int:
    if len(system.holonomic) == len(system.constraints):
        return start.rank
    s = start.state
    jacobian = Evaluator(system, s.p).constraints(s.t, s.q, s.v).jacobian
    return decompose(jacobian[list(system.holonomic)]).rank if system.holonomic else 0


def _linearized(system: System, state: State, rank: int) -> Array:
    """Return A of δẏ = A δy with y = (q, v), (2 nq, 2 nq)."""
    assert system.variation is not None
    t, q, v, p = state.t, state.q, state.v, state.p
    nq, nc = len(q), len(system.constraints)
    d = Evaluator(system, p).dynamics(t, q, v)
    decomposition = decompose(d.jacobian, rank) if nc else decompose(np.zeros((0, nq)), 0)

    def solve(forces: Array, rhs: Array) -> tuple[Array, Array]:
        return solve_redundant(d.mass_matrix, forces, rhs, decomposition)

    a, multipliers = solve(d.forcing, d.rhs)
    tapes = system.variation()
    inputs = (t, *q.tolist(), *v.tolist(), *a.tolist(), *multipliers.tolist(), *p)
    entries = iter(ScalarTape(tapes.tape)(inputs))

    def matrix(pattern: Pattern, rows: int) -> Array:
        values = np.zeros((rows, nq))
        for place in pattern:
            values[place] = next(entries)
        return values

    force = [matrix(x, nq) for x in (tapes.force_position, tapes.force_velocity)]
    rhs = [matrix(x, nc) for x in (tapes.rhs_position, tapes.rhs_velocity)]
    linearization = np.zeros((2 * nq, 2 * nq))
    linearization[:nq, nq:] = np.eye(nq)
    for block in range(2):
        for j in range(nq):
            change, _ = solve(force[block][:, j], rhs[block][:, j])
            linearization[nq:, block * nq + j] = change
    return linearization
