"""Detection of angles, and large changes of the other coordinates."""

from __future__ import annotations

import numpy as np
import symengine as se

from lagcli.arrays import Array, Flags
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear import dense
from lagcli.equations.derivation.lagrange import Equations

_TURN = 2 * np.pi
#: Differences below this part of the largest value of a tape are rounding errors.
_SAME = 1e-9
_PROBES = 3


def angles(equations: Equations, evaluator: Evaluator, t: float, q: Array) -> Flags:
    """Return which coordinates have the period 2π, such that M, f, B, γ and φ repeat after a turn.

    Parameters
    ----------
    equations : Equations
    evaluator : Evaluator
    t : float
        s.
    q : (nq,) array
        A state near which the expressions have values.
    """
    nq = len(q)
    random = np.random.default_rng(1)
    found = np.ones(nq, dtype=bool)
    for _ in range(_PROBES):
        near = q + 0.3 * random.standard_normal(nq) * np.maximum(1e-3, np.abs(q))
        v = random.standard_normal(nq)
        before = _numbers(evaluator, t, near, v)
        for j in np.flatnonzero(found):
            turned = near.copy()
            turned[j] += _TURN
            after = _numbers(evaluator, t, turned, v)
            known = np.isfinite(before) & np.isfinite(after)
            size = np.abs(before[known]).max(initial=0.0) + np.abs(after[known]).max(initial=0.0)
            change = np.abs(after[known] - before[known]).max(initial=0.0)
            matters = known.any() and enters(equations, int(j))
            found[j] = bool(matters and change <= _SAME * size)
    return found


def _numbers(evaluator: Evaluator, t: float, q: Array, v: Array) -> Array:
    c = evaluator.constraints(t, q, v)
    return np.concatenate([evaluator.entries(t, q, v), c.position, c.drift])


def enters(eq: Equations, j: int) -> bool:
    """Whether the equations depend on a coordinate; an absent one has no period."""
    symbol = eq.q[j]
    expressions = [eq.lagrangian, *eq.applied_forces, *(c.velocity for c in eq.constraints)]
    expressions += [c.position for c in eq.constraints if c.position is not None]
    return any(symbol in e.free_symbols for e in expressions)


def turning(eq: Equations) -> Flags:
    """Return which coordinates occur in sines and cosines, times a number, (nq,).

    They need not have a period: the moment of a torsion spring depends on the number of turns.
    """
    expressions = [eq.lagrangian, *eq.applied_forces]
    expressions += [c.position for c in eq.constraints if c.position is not None]
    arguments = {x.args[0] for e in expressions for x in e.atoms(se.sin, se.cos)}
    return np.array([any(x.diff(q).is_Number and x.diff(q) != 0 for x in arguments) for q in eq.q])


def lengths(evaluator: Evaluator, t: float, q: Array, periodic: Flags, turning: Flags) -> Array:
    """Return large changes of the coordinates, (nq,).

    1 rad for an angle, or more for one without a period. For other coordinates, the size of the
    largest coordinate, compared by inertia, or the size of the constraints' terms if all are zero.
    """
    zero = np.zeros(len(q))
    c = evaluator.constraints(t, q, zero)
    sizes = evaluator.sizes(t, q, zero)
    others = ~periodic
    largest = np.abs(q / sizes)[others].max(initial=0.0)
    rows = c.jacobian[list(evaluator.system.holonomic)] * sizes
    if not largest and len(rows):
        largest = float((c.position_scale / dense.row_scale(rows)).max())
    found = (largest or 1.0) * sizes
    found[periodic] = 1.0
    found[turning] = np.maximum(found[turning], 1.0)
    return np.asarray(found)
