"""Smooth motions by SciPy, independent of lagcli's integration: an oracle for tests.

a and λ solve [[M, Bᵀ], [B, 0]]·[a; −λ] = [f; γ] as one dense system, by least squares where
constraints are redundant. The constraints are not enforced: at these tolerances, and over the short
times of tests, their drift is far below what is compared.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import lstsq, solve

from lagcli.arrays import Array
from lagcli.engine.evaluator import Evaluator
from lagcli.model.model import Model
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.sampling import sample_times
from lagcli.simulations.simulation import prepare


class Motion(NamedTuple):
    """Samples of a motion.

    Parameters
    ----------
    time : (nt,) array
    q, v, a : (nt, n) arrays
    multipliers : (nt, m) array
    """

    time: Array
    q: Array
    v: Array
    a: Array
    multipliers: Array


def motion(
    model: Model,
    *,
    method: str = "DOP853",
    rtol: float = 1e-12,
    atol: float = 1e-13,
    **settings: Any,
) -> Motion:
    """Return the motion of a model without contacts, events and kinks.

    Parameters
    ----------
    model : Model
    method, rtol, atol
        As for `scipy.integrate.solve_ivp`.
    **settings
        Settings of lagcli, of which the initial state and the samples follow.
    """
    prepared = prepare(model, SettingsOverrides(**settings))
    state, redundant = prepared.start.state, prepared.start.rank < len(prepared.system.constraints)
    evaluator, n = Evaluator(prepared.system, state.p), len(state.q)

    def accelerations(t: float, y: Array) -> tuple[Array, Array]:
        equations = evaluator.dynamics(t, y[:n], y[n:])
        b = equations.jacobian
        matrix = np.block([[equations.mass_matrix, b.T], [b, np.zeros((len(b), len(b)))]])
        right = np.concatenate([equations.forcing, equations.rhs])
        solution = lstsq(matrix, right)[0] if redundant else solve(matrix, right)
        return solution[:n], -solution[n:]

    times = sample_times(prepared.settings)
    solution = solve_ivp(
        lambda t, y: np.concatenate([y[n:], accelerations(t, y)[0]]),
        (state.t, prepared.settings.t_end),
        np.concatenate([state.q, state.v]),
        method,
        times,
        rtol=rtol,
        atol=atol,
    )
    assert solution.success, solution.message
    parts = [accelerations(t, y) for t, y in zip(times, solution.y.T, strict=True)]
    a, multipliers = (np.array(x) for x in zip(*parts, strict=True))
    return Motion(times, solution.y[:n].T, solution.y[n:].T, a, multipliers)
