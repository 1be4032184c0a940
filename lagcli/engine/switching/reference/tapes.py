"""Evaluation of the tapes of a Switching at one state: limits, forces, coefficients, and others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.switching.switching import Switching
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Tape


class RowLimits(NamedTuple):
    """Limits of limited rows, and their derivatives with respect to λ: (nl,) and (nl, nc)
    arrays."""

    static: Array
    kinetic: Array
    static_slopes: Array
    kinetic_slopes: Array


class ReactiveForces(NamedTuple):
    """Generalized forces that depend on λ, (nf,), and their derivatives, (nf, nc)."""

    values: Array
    slopes: Array


class SwitchingTapes:
    """Evaluates the tapes of a System's Switching.

    Parameters
    ----------
    system : System
        With ``switching``.
    """

    def __init__(self, system: System):
        assert system.switching is not None
        self.switching: Switching = system.switching
        s = self.switching
        self.nc = len(system.constraints)
        self._limits, self._impact = ScalarTape(s.limits), ScalarTape(s.impact)
        self._forces, self._actions = _bound(s.forces), _bound(s.actions)
        self._states, self._of_forces = _bound(system.events), _bound(s.force_conditions)
        self.conditions_on_forces = s.force_conditions is not None
        self.limited = sum(row.limit is not None for row in s.rows)
        self.unilateral = sum(bool(row.sign) for row in s.rows)

    def limits(self, inputs: tuple[float, ...]) -> RowLimits:
        """Return limits at (t, q, v, a, λ, parameters)."""
        out, nl = np.array(self._limits(inputs)), self.limited
        pattern = self.switching.limit_pattern
        static, kinetic = np.zeros((2, nl, self.nc))
        for k, (i, j) in enumerate(pattern):
            static[i, j] = out[2 * nl + k]
            kinetic[i, j] = out[2 * nl + len(pattern) + k]
        return RowLimits(out[:nl], out[nl : 2 * nl], static, kinetic)

    def forces(self, inputs: tuple[float, ...]) -> ReactiveForces:
        """Return forces that depend on λ at (t, q, v, a, λ, parameters)."""
        nf = len(self.switching.force_coordinates)
        slopes = np.zeros((nf, self.nc))
        if self._forces is None:
            return ReactiveForces(np.zeros(0), slopes)
        out = np.array(self._forces(inputs))
        for k, (i, j) in enumerate(self.switching.force_pattern):
            slopes[i, j] = out[nf + k]
        return ReactiveForces(out[:nf], slopes)

    def impact(self, inputs: tuple[float, ...]) -> tuple[Array, Array]:
        """Return restitution by unilateral row and friction by limited row.

        At (t, q, v, parameters).
        """
        out = np.array(self._impact(inputs))
        return out[: self.unilateral], out[self.unilateral :]

    def conditions(self, state: tuple[float, ...], forces: tuple[float, ...] | None) -> Array:
        """Return the functions of all conditions, at (t, q, v, parameters) and with a and λ."""
        found = self._states(state) if self._states is not None else []
        if self._of_forces is not None:
            assert forces is not None
            found = [*found, *self._of_forces(forces)]
        return np.array(found)

    def actions(self, inputs: tuple[float, ...]) -> list[float]:
        """Return the values of all actions at (t, q, v, a, λ, parameters)."""
        return list(self._actions(inputs)) if self._actions is not None else []


def _bound(tape: Tape | None) -> ScalarTape | None:
    return None if tape is None else ScalarTape(tape)
