"""The derivatives of a consistent initial state, by the implicit function theorem.

Fixed initial values have given derivatives; the others follow from

    φ_q s + φ_θ = 0,  B ṡ + ψ_q s + ψ_θ = 0,

by the smallest change in the metric of M, as in `lagcli.engine.constraints.initial`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import (
    Spin,
    along,
    free_directions,
    rates_of_spin,
    spin_derivative,
    spin_of,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.lowering.tangent import TangentTapes
from lagcli.engine.scales import largest, lengths_of_rows, usable
from lagcli.engine.system import State

#: Residuals of the linearized constraints above this part of their scale are contradictions.
_REACHED = 1e-7
#: Residuals below this part of what derivatives of their largest size would give are rounding
#: errors: so is the scale of a constraint whose coordinates do not change.
_ROUNDING = 1e-12


class StartDerivatives(NamedTuple):
    """∂q/∂θ and ∂v/∂θ at the start.

    Parameters
    ----------
    q, v : (n, nq) arrays
    """

    q: Array
    v: Array


class ContradictingStart(Exception):
    """The fixed initial values satisfy a constraint only for one value of a parameter.

    Parameters
    ----------
    direction, constraint : int
    level : str
        "position" or "velocity".
    """

    def __init__(self, direction: int, constraint: int, level: str):
        super().__init__(level)
        self.direction, self.constraint, self.level = direction, constraint, level


def start_derivatives(
    evaluator: Evaluator,
    tangent: TangentTapes,
    state: State,
    given: StartDerivatives,
    fixed_q: Flags,
    fixed_v: Flags,
    spins: Sequence[Spin] = (),
    before: State | None = None,
) -> StartDerivatives:
    """Return the derivatives of a consistent initial state.

    Parameters
    ----------
    evaluator : Evaluator
        Evaluator of the motion, with the parameters of the start.
    tangent : TangentTapes
    state : State
        The consistent initial state.
    given : StartDerivatives
        Derivatives of the given initial values, fixed ones and guesses.
    fixed_q, fixed_v : (nq,) arrays of bool
    spins : sequence of Spin, optional
        As for `consistent_state`.
    before : State, optional
        The given initial values; needed for spins.

    Returns
    -------
    StartDerivatives

    Raises
    ------
    ContradictingStart
    """
    system, t, q, v = evaluator.system, state.t, state.q, state.v
    s, u = given.q.copy(), given.v.copy()
    nh, nc, n = len(system.holonomic), len(system.constraints), len(s)
    held = list(system.held_at_start)
    if not held or not n:
        return StartDerivatives(s, u)
    tape = tangent.constraint_at
    places = [k for k, row in enumerate(system.holonomic) if row in set(held)]
    holonomic = [system.holonomic[k] for k in places]
    jacobian = evaluator.constraints(t, q, v).jacobian
    mass = evaluator.dynamics(t, q, v).mass_matrix
    sizes = evaluator.sizes(t, q, v)

    def residuals() -> tuple[Array, Array, Array, Array]:
        inputs = (t, *q, *s.ravel(), *v, *u.ravel(), *state.p)
        out = np.array(tape(tuple(map(float, inputs))))
        first, second, third = n * nh, n * (nh + nc), n * (2 * nh + nc)
        velocity = out[first:second].reshape(n, nc) + u @ jacobian.T
        return (
            out[:first].reshape(n, nh)[:, places],
            velocity[:, held],
            out[second:third].reshape(n, nh)[:, places],
            out[third:].reshape(n, nc)[:, held],
        )

    def correct(rows: list[int], values: Array, residual: Array, free: Array) -> None:
        part, own = along(jacobian[rows], free), 1 / usable(lengths_of_rows(free.T, 1 / sizes))
        rank = dense.count_rank(part, sizes=own)
        for k in range(n):
            if free.shape[1] and np.abs(residual[k]).max() > 0:
                weight = free.T @ mass @ free
                values[k] += free @ dense.least_change(part, residual[k], weight, rank, sizes=own)

    def rounding(rows: list[int], *values: Array) -> Array:
        """Return the scales below which residuals are rounding errors, (n, rows)."""
        most = np.max([np.abs(x / sizes).max(axis=1) for x in values], axis=0)
        lengths = np.abs(jacobian[rows] * sizes).sum(axis=1)
        return np.asarray(_ROUNDING / _REACHED * np.outer(most, lengths))

    if holonomic:
        correct(holonomic, s, residuals()[0], np.eye(len(q))[:, ~fixed_q])
        position, _, scale, _ = residuals()
        scale = np.maximum(scale, rounding(holonomic, s, given.q))
        _check(position, scale, holonomic, "position")
    for spin in spins:
        assert before is not None
        parts = list(spin.places)
        e, rates = before.q[parts], before.v[parts]
        for k in range(n):
            turn = spin_derivative(e, rates, given.q[k, parts], given.v[k, parts])
            turn = rates_of_spin(q[parts]) @ turn
            u[k, parts] = turn + rates_of_spin(s[k, parts]) @ spin_of(q[parts], v[parts])
    correct(held, u, residuals()[1], free_directions(spins, fixed_v, q))
    _, velocity, _, scale = residuals()
    # the change of the rates by one of the configuration
    turning = given.q * (largest(v, sizes) / (largest(q, sizes) or 1.0))
    scale = np.maximum(scale, rounding(held, u, given.v, turning))
    _check(velocity, scale, held, "velocity")
    return StartDerivatives(s, u)


def _check(residual: Array, scale: Array, rows: list[int], level: str) -> None:
    """Raise ContradictingStart for the first residual that does not vanish."""
    bad = np.argwhere(np.abs(residual) > _REACHED * np.maximum(scale, 1e-300))
    if len(bad):
        direction, row = bad[0]
        raise ContradictingStart(int(direction), rows[row], level)
