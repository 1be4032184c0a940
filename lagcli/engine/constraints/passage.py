"""Passage through a singular configuration, on the branch that conserves momentum.

In the configuration itself, the constraints do not determine the accelerations, and nearby the
accelerations have large rounding errors, although the motion is smooth. Therefore a, λ and the
power are interpolated between states on both sides: those before are known; those after follow from
the integral of a itself, by iteration. Accelerations are computed only at regular states, and only
the first guess is extrapolated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.polynomial.polynomial import polyint, polyval, polyvander

from lagcli.arrays import Array
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.contract import Stop

Project = Callable[[float, Array, Array], tuple[Array, Array]]

_ITERATIONS = 6
#: The iteration ends when the states after the configuration change by less than this, relatively
#: and as far as they affect the passage. It contracts with the square of the passage's duration, so
#: that only rounding errors remain.
_SETTLED = 1e-12
#: Largest change at the end of the iteration; beyond it, the motion continues on another branch.
_CONTINUED = 1e-6


class Crossing:
    """The motion across a singular configuration.

    Parameters
    ----------
    motion : Index1
    project : callable
        (t, q, v) → the nearest consistent state.
    before : sequence of (t, y)
        The last states before the configuration.
    singular : float
        Its time, s.
    guess : callable
        t → q, v: a first continuation.

    Raises
    ------
    Stop
        There is no smooth continuation.
    """

    def __init__(
        self,
        motion: Index1,
        project: Project,
        before: Sequence[tuple[float, Array]],
        singular: float,
        guess: Callable[[float], tuple[Array, Array]],
    ):
        self.motion, self.project, self.singular = motion, project, singular
        self.since, y = before[-1]
        self.end = 2 * singular - self.since
        self.q, self.v = motion.split(y)
        self.work = float(y[-1])
        known = [self._unknowns(t, *motion.split(y)) for t, y in before]
        # mirrored in time, nearest first
        times = [2 * singular - t for t, _ in reversed(before)]
        places = [self._scaled(t) for t in [*(t for t, _ in before), *times]]
        matrix = polyvander(places, len(places) - 1)
        states = [project(t, *guess(t)) for t in times]
        # Between the nearest states, the polynomials of the others are about (nearest/distance)².
        # Without these factors, a step that ends by chance next to the configuration would stop the
        # run: the farther states multiply the rounding errors of its a by distance/nearest.
        effects = [((self.end - singular) / (t - singular)) ** 2 for t in times]
        for _ in range(_ITERATIONS):
            values = known + [self._unknowns(t, *s) for t, s in zip(times, states, strict=True)]
            self._integrate(np.asarray(np.linalg.solve(matrix, np.array(values)), dtype=float))
            last, states = states, [project(t, *self(t)[:2]) for t in times]
            moved = max(
                effect * _distance(a, b, motion.sizes)
                for effect, a, b in zip(effects, states, last, strict=True)
            )
            if moved <= _SETTLED:
                break
        if not moved <= _CONTINUED:
            raise self._no_continuation()
        self.state = np.concatenate([*states[0], [self(self.end)[4]]])

    def _scaled(self, t: float) -> float:
        return (t - self.since) / (self.singular - self.since)

    def _unknowns(self, t: float, q: Array, v: Array) -> Array:
        """Return a, λ and the power at a state."""
        a, multipliers, power = self.motion.accelerations(t, q, v)
        if not np.isfinite(a).all():
            raise self._no_continuation()
        return np.concatenate([a, multipliers, [power]])

    def _integrate(self, coefficients: Array) -> None:
        nq, unit = self.motion.nq, self.singular - self.since
        a, power = coefficients[:, :nq], coefficients[:, -1:]
        v = polyint(a, k=[0], scl=unit, axis=0)
        v[0] += self.v
        q = polyint(v, scl=unit, axis=0)
        q[0] += self.q
        w = polyint(power, scl=unit, axis=0)
        w[0] += self.work
        self._polynomials = q, v, a, coefficients[:, nq:-1], w

    def __call__(self, t: float) -> tuple[Array, Array, Array, Array, float]:
        """Return q, v, a, λ and the work at a time between the states."""
        s = self._scaled(t)
        q, v, a, multipliers, work = (
            np.asarray(polyval(s, c), dtype=float) for c in self._polynomials
        )
        return q, v, a, multipliers, float(work[0])

    def _no_continuation(self) -> Stop:
        return Stop(
            "the motion cannot be continued through the singular configuration at"
            f" t = {self.singular:.9g} s; try a smaller --rtol"
        )


def _distance(one: tuple[Array, Array], other: tuple[Array, Array], sizes: Array) -> float:
    """Return the largest difference of q and v, relative to the largest of all."""
    return max(
        float(np.abs((a - b) / sizes).max() / (np.abs(b / sizes).max() or 1.0))
        for a, b in zip(one, other, strict=True)
    )
