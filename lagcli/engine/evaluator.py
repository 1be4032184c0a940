"""A System's matrices as NumPy arrays, for one state or for many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lagcli.engine.interpreter import ScalarTape, run_arrays
from lagcli.engine.system import System

Array = NDArray[np.float64]

#: A row of B shorter than this, next to the constraint's terms, counts as zero.
_SMALL_ROW = 1e-6


@dataclass(frozen=True)
class Dynamics:
    """M, f, B, γ and the external power at one state (or, with a last axis, at many)."""

    mass_matrix: Array
    forcing: Array
    jacobian: Array
    rhs: Array
    power: Array | float


@dataclass(frozen=True)
class Constraints:
    """φ, B, b_0 and the constraints' own scales at one state (or, with a last axis, at many)."""

    position: Array
    jacobian: Array
    drift: Array
    position_scale: Array
    velocity_scale: Array


class Evaluator:
    """Evaluates a System at single states."""

    def __init__(self, system: System):
        self.system = system
        self._dynamics = ScalarTape(system.dynamics)
        self._constraint = ScalarTape(system.constraint)
        nq, nc = len(system.coordinates), len(system.constraints)
        self._mass_places = [i * nq + j for i, j in system.mass_pattern]
        self._jacobian_places = [i * nq + j for i, j in system.jacobian_pattern]
        self._shape = nq, nc, len(system.holonomic)

    def dynamics(self, t: float, q: Array, v: Array) -> Dynamics:
        """Return M, f, B, γ and the external power."""
        nq, nc, _ = self._shape
        inputs = (t, *q.tolist(), *v.tolist(), *self.system.parameters)
        return _dynamics(np.array(self._dynamics(inputs)), self._places, nq, nc)

    def constraints(self, t: float, q: Array, v: Array) -> Constraints:
        """Return φ, B, b_0 and scales."""
        nq, nc, nh = self._shape
        inputs = (t, *q.tolist(), *v.tolist(), *self.system.parameters)
        return _constraints(np.array(self._constraint(inputs)), self._places, nq, nc, nh)

    def row_lengths(self, c: Constraints, q: Array, v: Array) -> Array:
        """Return a scale for each row of B that does not vanish with the row.

        It is the row's length, or, if that is smaller, a small part of the constraint's terms over
        the coordinates that they are functions of.
        """
        floor = np.zeros(len(c.jacobian))
        holonomic = list(self.system.holonomic)
        floor[holonomic] = c.position_scale / (np.abs(q).max(initial=0.0) or 1.0)
        rates = np.setdiff1d(np.arange(len(floor)), holonomic)
        floor[rates] = c.velocity_scale[rates] / (np.abs(v).max(initial=0.0) or 1.0)
        length = np.maximum(np.sqrt((c.jacobian * c.jacobian).sum(axis=1)), _SMALL_ROW * floor)
        length[length == 0.0] = 1.0
        return length

    @property
    def _places(self) -> tuple[list[int], list[int]]:
        return self._mass_places, self._jacobian_places


class Batch:
    """Evaluates a System at many states at once; states lie along the last axis.

    Parameters
    ----------
    system : System
    t : (n,) array
    q, v : (n, nq) arrays
    """

    def __init__(self, system: System, t: Array, q: Array, v: Array):
        self.system, self.count = system, len(t)
        self._state = [t, *q.T, *v.T]
        nq = len(system.coordinates)
        self._places = (
            [i * nq + j for i, j in system.mass_pattern],
            [i * nq + j for i, j in system.jacobian_pattern],
        )

    def dynamics(self) -> Dynamics:
        """Return M (nq, nq, n), f (nq, n), B (nc, nq, n), γ (nc, n) and the power (n,)."""
        s = self.system
        out = run_arrays(s.dynamics, [*self._state, *s.parameters], self.count)
        return _dynamics(out, self._places, len(s.coordinates), len(s.constraints))

    def constraints(self) -> Constraints:
        """Return φ (nh, n), B (nc, nq, n), b_0 (nc, n) and the scales."""
        s = self.system
        out = run_arrays(s.constraint, [*self._state, *s.parameters], self.count)
        return _constraints(
            out, self._places, len(s.coordinates), len(s.constraints), len(s.holonomic)
        )

    def report(self, a: Array, multipliers: Array) -> Array:
        """Return the report tape's outputs, (outputs, n); a is (n, nq) and λ (n, nc)."""
        s = self.system
        inputs = [*self._state, *a.T, *multipliers.T, *s.parameters]
        return run_arrays(s.report, inputs, self.count)


def _dynamics(out: Array, places: tuple[list[int], list[int]], nq: int, nc: int) -> Dynamics:
    nm, nb = len(places[0]), len(places[1])
    mass = np.zeros((nq * nq, *out.shape[1:]))
    mass[places[0]] = out[:nm]
    jacobian = np.zeros((nc * nq, *out.shape[1:]))
    jacobian[places[1]] = out[nm + nq : nm + nq + nb]
    return Dynamics(
        mass.reshape(nq, nq, *out.shape[1:]),
        out[nm : nm + nq],
        jacobian.reshape(nc, nq, *out.shape[1:]),
        out[nm + nq + nb : nm + nq + nb + nc],
        out[-1],
    )


def _constraints(
    out: Array, places: tuple[list[int], list[int]], nq: int, nc: int, nh: int
) -> Constraints:
    nb = len(places[1])
    jacobian = np.zeros((nc * nq, *out.shape[1:]))
    jacobian[places[1]] = out[nh : nh + nb]
    at = nh + nb
    return Constraints(
        out[:nh],
        jacobian.reshape(nc, nq, *out.shape[1:]),
        out[at : at + nc],
        out[at + nc : at + nc + nh],
        out[at + nc + nh :],
    )
