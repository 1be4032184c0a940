"""Absolute tolerances that follow the size of each state variable, for the reference engine.

The rules are those of core/sizes.h; only A, the magnitude of the terms of accelerations, is found
by a small
change of the state instead of by rounding up and down.
"""

from __future__ import annotations

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.contract import IntegrationRequest

#: The constants of core/sizes.h, with the same names.
_FOLLOWING = 0.1
_ROUNDING = 100 * float(np.finfo(float).eps)
_SUMMING = 100 * float(np.finfo(float).eps)
_TIMING = 10 * float(np.finfo(float).eps)
_HIDDEN = 1e-8
_NO_SIZE = 1e-100
_LOOKS = 64
_HORIZON = 1e-4
_BESIDE = 1e-3
#: Relative change of the state that reveals the terms of accelerations.
_PERTURBATION = 1e-7


class Sizes:
    """The sizes of y = (q, v, W) along a run, and the resulting absolute tolerances.

    Parameters
    ----------
    motion : Index1
    request : Request
    y : (2 nq + 1,) array
        The state at the start.

    Attributes
    ----------
    tolerances : (2 nq + 1,) array
        Absolute tolerances for the next step.
    """

    def __init__(self, motion: Index1, request: IntegrationRequest, y: Array):
        self.motion, self.settings = motion, request.settings
        self.given, self.kind = request.tolerances, np.array(request.kind_of, dtype=int)
        self.start, self.nq = request.state.t, len(request.state.q)
        self.size = np.zeros(len(y))
        self.length = self.settings.t_end - self.start
        rate = motion.rate(self.start, y)
        self.acceleration_terms = self._acceleration_terms(self.start, y, rate)
        self.future_acceleration = self._future_acceleration(y, rate)
        self.tolerances = self.given
        self.update(self.start, y, self.first_step(self.start, y, 8.0))

    def restart(self, t: float, y: Array) -> None:
        """Update the terms of accelerations where y' has jumped."""
        found = self._acceleration_terms(t, y, self.motion.rate(t, y))
        self.acceleration_terms = np.fmax(self.acceleration_terms, found)
        if t < self.settings.t_end:
            self.update(t, y, self.first_step(t, y, 8.0))

    def _acceleration_terms(self, t: float, y: Array, rate: Array) -> Array:
        """Return what accelerations are made of, the largest of each kind: A."""
        nq = self.nq
        found = np.abs(rate[nq:-1])
        for sign in (-1, 1):
            part = sign * _PERTURBATION * np.cos(1.0 + np.arange(len(y)))
            change = np.abs(self.motion.rate(t, y * (1 + part)) - rate)[nq:-1] / _PERTURBATION
            found = np.fmax(found, np.where(np.isfinite(change), change, 0.0))
        found = self._of_kind(found)
        # balanced forces: the largest force over the largest inertia
        d = self.motion.evaluator.dynamics(t, *self.motion.split(y))
        inertia = self._of_kind(np.diag(d.mass_matrix))
        forces = np.abs(d.forcing) + np.abs(d.mass_matrix) @ np.abs(rate[nq:-1])
        forces += self.motion.force_terms(t, *self.motion.split(y))
        balanced = self._of_kind(forces) / np.where(inertia > 0, inertia, np.inf)
        hidden = np.isfinite(balanced) & (found < _HIDDEN * balanced)
        return np.where(hidden, balanced, found)

    def _of_kind(self, values: Array) -> Array:
        """Return the largest value of each coordinate's kind."""
        largest = np.zeros(int(self.kind.max(initial=0)) + 1)
        np.maximum.at(largest, self.kind, values)
        return np.asarray(largest[self.kind])

    def _future_acceleration(self, y: Array, rate: Array) -> Array:
        """Return the largest future acceleration of each coordinate that is at rest: R."""
        nq = self.nq
        resting = (y[:nq] == 0) & (y[nq:-1] == 0) & (rate[nq:-1] == 0)
        found = np.zeros(nq)
        for k in range(_LOOKS if resting.any() else 0):
            t = self.start + (k + 0.5) / _LOOKS * self.length
            a = np.abs(self.motion.rate(t, y)[nq:-1])
            found = np.fmax(found, np.where(resting & np.isfinite(a), a, 0.0))
        return found

    def update(self, t: float, y: Array, h: float) -> None:
        """Update the sizes before a step of about size h."""
        nq, size = self.nq, self.size
        mass = self.motion.evaluator.dynamics(t, *self.motion.split(y)).mass_matrix
        v = y[nq:-1]
        if not size.any():  # at the initial state, velocities may be zero
            v = v + np.copysign(h * (self.acceleration_terms + self.future_acceleration), v)
        energy = 0.5 * abs(float(v @ mass @ v))
        np.fmax(size, np.abs(y), out=size)
        if np.isfinite(energy):
            size[-1] = max(size[-1], energy)
        noise = _SUMMING * h * self.acceleration_terms
        noise += _TIMING * self.length * self.future_acceleration
        floor = np.concatenate(
            [
                _ROUNDING * self._of_kind(size[:nq]) + noise * h,
                _ROUNDING * self._of_kind(size[nq:-1]) + noise,
                [0.0],
            ]
        )
        found = _FOLLOWING * self.settings.rtol * size + floor + _NO_SIZE
        self.tolerances = np.where(self.given > 0, self.given, found)

    def largest(self) -> Array:
        """Return the largest size of each coordinate's kind so far, (nq,)."""
        return self._of_kind(self.size[: self.nq])

    def first_step(self, t: float, y: Array, order: float) -> float:
        """Return the first step size; lag_first_step of core/sizes.c."""
        nq = self.nq
        horizon = _HORIZON * (self.settings.t_end - t)
        most = min(self.settings.max_step, self.settings.t_end - t)
        a = self.acceleration_terms + self.future_acceleration
        q, v = np.abs(y[:nq]), np.abs(y[nq:-1])
        w = q + _BESIDE * self._of_kind(q) + horizon * (v + horizon * a)
        w = np.concatenate([w, v + _BESIDE * self._of_kind(v) + horizon * a + np.sqrt(a * w)])
        w = np.where(w > 0, w, np.inf)
        f = self.motion.rate(t, y)
        rate = float(np.linalg.norm(f[:-1] / w))
        h = min(0.01 / rate if rate > 0 else horizon, most)
        change = float(np.linalg.norm((self.motion.rate(t + h, y + h * f) - f)[:-1] / w))
        if not np.isfinite(change):
            return h
        rate = max(rate, np.sqrt(change / h))
        found = (0.01 * self.settings.rtol) ** (1 / order) / rate if rate > 0 else horizon
        return float(min(100 * h, found, most))
