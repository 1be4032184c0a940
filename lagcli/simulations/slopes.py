"""Derivatives of expressions along a run whose motion has derivatives."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from symengine import Basic

from lagcli.arrays import Array
from lagcli.engine.integrate.many_states import Batch
from lagcli.engine.lowering.lower import lower
from lagcli.engine.lowering.tangent import lower_observed, lower_tangent
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.engine.tape.tape import Tape
from lagcli.equations.derivation.lagrange import Equations
from lagcli.simulations.directions import Directions


def slopes_along(
    equations: Equations,
    directions: Directions,
    columns: Mapping[str, Array],
    expressions: Mapping[str, Basic],
) -> dict[str, Array]:
    """Return the derivatives of expressions at the samples of a run, (nt, n), by name.

    Parameters
    ----------
    equations : Equations
        Of the model with the values of the run.
    directions : Directions
        The n parameters and initial values with respect to which the run has derivatives.
    columns : mapping of str to arrays
        The fields ``time``, ``q``, ``v``, ``a``, ``multipliers``, ``dq``, ``dv`` and
        ``dmultipliers`` of `Samples`.
    expressions : mapping of str to expression
        In t, q, v, a, λ and parameters. Those with accelerations are left out if constraints
        switch: the accelerations then have no derivative of their own.
    """
    p = tuple(equations.model.parameter_values.values())
    switches = equations.model.switches
    chosen = {
        name: e
        for name, e in expressions.items()
        if not (switches and not e.free_symbols.isdisjoint(equations.a))
    }
    if not chosen:
        return {}
    scales, count = directions.scales, len(columns["time"])
    # by direction, then by coordinate or constraint: (nt, nq, n) → (n, nq, nt)
    changes = [(columns[x] * scales).T for x in ("dq", "dv", "dmultipliers")]
    motion = [columns["time"], *(x for f in ("q", "v", "a") for x in columns[f].T)]
    motion += [*columns["multipliers"].T]
    rates = np.zeros_like(changes[0])
    if not switches:
        system = lower(equations)
        tape = lower_tangent(equations, directions.rates).dynamics
        rates = _accelerations(system, tape, p, columns, changes[0], changes[1])
    _, slopes = lower_observed(equations, list(chosen.values()), directions.rates)
    parts = (changes[0], changes[1], rates, changes[2])
    inputs = [*motion, *(x for part in parts for direction in part for x in direction), *p]
    with np.errstate(all="ignore"):
        values = run_arrays(slopes, inputs, count).reshape(len(scales), len(chosen), count)
    return dict(zip(chosen, np.moveaxis(values, 0, 2) / scales, strict=True))


def _accelerations(
    system: System,
    tape: Tape,
    p: tuple[float, ...],
    columns: Mapping[str, Array],
    positions: Array,
    velocities: Array,
) -> Array:
    """Return s̈, (n, nq, nt), which M s̈ − Bᵀλ_θ = force, B s̈ = rhs determine."""
    q, v = columns["q"], columns["v"]
    count, nq = q.shape
    d = Batch(system, p, columns["time"], q, v).dynamics()
    nc, n = len(d.jacobian), len(positions)
    inputs = [
        *(columns["time"], *q.T, *positions.reshape(-1, count), *v.T),
        *(*velocities.reshape(-1, count), *columns["a"].T, *columns["multipliers"].T, *p),
    ]
    right = run_arrays(tape, inputs, count).reshape(n, nq + nc, count)
    matrix = np.zeros((count, nq + nc, nq + nc))
    matrix[:, :nq, :nq] = np.moveaxis(d.mass_matrix, -1, 0)
    matrix[:, nq:, :nq] = np.moveaxis(d.jacobian, -1, 0)
    matrix[:, :nq, nq:] = -np.moveaxis(d.jacobian, -1, 0).transpose(0, 2, 1)
    found = np.empty((n, nq, count))
    for i in range(count):  # of least norm in λ_θ, where this is not unique
        found[:, :, i] = np.linalg.lstsq(matrix[i], right[:, :, i].T, rcond=1e-12)[0][:nq].T
    return found
