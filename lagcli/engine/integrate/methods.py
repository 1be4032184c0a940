"""Choice of the integration method: the requested one, or one by stiffness.

``auto`` starts with the explicit DOP853. If stability rather than accuracy has limited its steps
for some time, or its step size reaches its minimum, it switches to an implicit method; if that does
not take longer steps either, it switches back, and tests for stiffness less often.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.system import JacobianTapes, System
from lagcli.settings.methods import METHODS

#: Relative tolerance from which Rodas5P takes less time than Radau for the same error.
_LOOSE = 1e-4
#: Number of remaining explicit steps that justifies the cost of the derivatives.
_WORTH = 300
#: Required ratio of implicit to explicit steps if stability limits the explicit ones: an implicit
#: step takes about this many times as long. The ratio is larger for a trial that is due only to the
#: number of steps.
_LONGER = 1.5
_MUCH_LONGER = 5.0
#: Steps after which an implicit method is evaluated.
_TRIAL = 30
#: Explicit steps after which an implicit method is tried in any case, if many more remain: at tight
#: tolerances, accuracy and stability limit them together. Before that, the path over this number of
#: steps, twice, must be smooth enough for an implicit step of that length.
_PATIENCE = 2000
_MANY = 5000
_STRETCH = 3
#: Largest deviation of the path from a smooth step, in tolerances.
_ROUGH = 2.0


class Methods:
    """The methods of one run.

    Parameters
    ----------
    core : Integrator
    system : System
    request : Request
    no_series : str
        Why Taylor's method cannot run; empty if it can.

    Raises
    ------
    ValueError
        An implicit method is requested, and the System has no derivatives.

    Attributes
    ----------
    running : str
    steps : dict of str to int
        The steps that each method has taken.
    changes : list of (float, str)
        Time of the switch to an implicit method, s, and the method; failed trials are omitted.
    refused : str
        Why a method other than the requested one runs.
    """

    def __init__(self, core: Any, system: System, request: IntegrationRequest, no_series: str = ""):
        self.core, self.system, self.request = core, system, request
        self.settings = request.settings
        self.running = "DOP853"
        self.steps: dict[str, int] = {}
        self.changes: list[tuple[float, str]] = []
        self._prepared = False
        self._patience, self._deaf_until = _PATIENCE, 0
        self._next_look = _PATIENCE
        self._trial: tuple[int, float, float] | None = None  # steps, time, least useful step
        self._path: list[tuple[float, Array]] = []  # points that show whether the motion is smooth
        self._vain: set[str] = set()
        self.refused = ""
        if self.settings.method == "Taylor" and no_series:
            self.refused = f"Taylor's method does not suit the equations ({no_series}): used DOP853"
        elif self.settings.method not in ("auto", self.running):
            self._go_on(self.settings.method)

    def may_help(self) -> bool:
        """Return whether another method is left to try."""
        free = self.settings.method == "auto" and self.system.variation is not None
        return free and self.running == "DOP853"

    def count(self) -> None:
        """Count the steps since the last call."""
        new = self.core.counts[0] - sum(self.steps.values())
        if new or not self.steps:
            self.steps[self.running] = self.steps.get(self.running, 0) + new

    def stiff(self, *, forced: bool = False, longer: float = _LONGER) -> None:
        """Switch to an implicit method, unless one failed recently."""
        steps = self.core.counts[0]
        if not forced and (steps < self._deaf_until or self._left() < _WORTH):
            return
        before, now = self.core.step
        self._trial = None if forced else (steps, now, longer * (now - before))
        loose = self.settings.rtol >= _LOOSE and self._jacobians.exact
        method = "Rodas5P" if loose else "Radau"
        self.changes.append((now, method))
        self._go_on(method)

    def most_steps(self) -> int:
        """Return the number of steps until the next review."""
        if self._path:
            return _STRETCH
        if self._trial is None:
            return self.settings.max_steps
        return max(1, self._trial[0] + _TRIAL - self.core.counts[0])

    def review(self) -> None:
        """Switch back to the explicit method if the implicit one takes no longer steps."""
        steps = self.core.counts[0]
        if self.may_help() and (steps >= self._next_look or self._path):
            if self._path or self._left() > _MANY:
                self._path.append((self.core.t, self.core.state))
            if len(self._path) != 1:
                self._next_look = 2 * steps
            if len(self._path) == 3:
                smooth = self._smooth()
                self._path = []
                if smooth:
                    self.stiff(longer=_MUCH_LONGER)
        if self._trial is None or steps < self._trial[0] + _TRIAL:
            return
        before, since, enough = self._trial
        self._trial = None
        if (self.core.t - since) / (steps - before) > enough:
            self._vain.discard(self.running)
            return
        self._vain.add(self.running)
        self._deaf_until = steps + self._patience
        self._next_look = max(self._next_look, self._deaf_until)
        self._patience *= 2
        self.changes.pop()
        self._go_on("DOP853")

    @property
    def used(self) -> tuple[str, ...]:
        """The methods that took steps, without failed trials."""
        return tuple(method for method in self.steps if method not in self._vain)

    def _smooth(self) -> bool:
        """Return whether an implicit step over the last stretches would meet its tolerance.

        Its error is estimated by that of the cubic through the positions and velocities at the ends
        of a step: both are of fourth order. During fast motion the cubic deviates. Deriving the
        Jacobians of an implicit method takes longer than many explicit steps.
        """
        (t0, y0), (t1, y1), (t2, y2) = self._path
        nq = len(self.request.state.q)
        h, x = t2 - t0, (t1 - t0) / (t2 - t0)
        q0, v0, q2, v2 = y0[:nq], h * y0[nq:-1], y2[:nq], h * y2[nq:-1]
        rise = q2 - q0
        q = q0 + x * (v0 + x * (3 * rise - 2 * v0 - v2 + x * (v0 + v2 - 2 * rise)))
        v = (v0 + x * (2 * (3 * rise - 2 * v0 - v2) + 3 * x * (v0 + v2 - 2 * rise))) / h
        rtol, y = self.settings.rtol, y1[:-1]
        looser = 1.0 if rtol >= _LOOSE else 0.1 * rtol ** (-1 / 3)  # as core/methods/radau5.c
        allowed = looser * (self.core.absolute_tolerances[:-1] + rtol * np.abs(y))
        return bool(np.linalg.norm((np.concatenate([q, v]) - y) / allowed) <= _ROUGH)

    def _left(self) -> float:
        """Return the number of remaining steps of the last size."""
        before, now = self.core.step
        return (self.settings.t_end - now) / (now - before)

    def order(self) -> None:
        """Choose an order of pivots for the implicit method's matrix."""
        from lagcli.engine.linear.sparse import pivot_order

        self.core.order(pivot_order)

    def message(self) -> str:
        """Return the message on the chosen method."""
        if not self.changes:
            return self.refused
        t, method = self.changes[-1]
        return f"the motion is stiff: continued with {method} at t = {t:.9g} s"

    @cached_property
    def _jacobians(self) -> JacobianTapes:
        """The derivatives for implicit methods."""
        assert self.system.variation is not None
        return self.system.variation()

    def _go_on(self, method: str) -> None:
        if METHODS[method].implicit and not self._prepared:
            if self.system.variation is None:
                raise ValueError(f"the System has no derivatives, which {method} needs")
            if METHODS[method].exact and not self._jacobians.exact:
                raise ValueError(f"the System has no exact derivatives, which {method} needs")
            # imported when it is needed: most runs are explicit
            from lagcli.engine.linear.sparse import matrix_pattern

            pattern = matrix_pattern(self.system, self._jacobians, self.request.rank)
            self.core.prepare(self._jacobians, pattern)
            self._prepared = True
        self.core.switch(method)
        self.running = method
