"""Integration of formulations that the engines do not have, by SciPy's DOP853."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from lagcli.analysis.compare.reduced import Formulation
from lagcli.arrays import Array
from lagcli.engine.contract import Block, IntegrationRequest, Limits, Outcome, Stop, outcome
from lagcli.engine.layout import SampleLayout

if TYPE_CHECKING:
    from scipy.integrate import DOP853

#: The absolute tolerance, relative to rtol times the largest entry of y.
_ABSOLUTE = 0.1
#: SciPy raises smaller relative tolerances to this value, with a warning.
_LEAST_RTOL = 100 * float(np.finfo(float).eps)

#: Factor of the step after a change of coordinates; shortest step, relative to the time.
_SHORTER, _SHORTEST = 0.5, 1e-12


def integrate(
    formulation: Formulation, request: IntegrationRequest, layout: SampleLayout
) -> tuple[Block, Outcome]:
    """Integrate a formulation.

    Parameters
    ----------
    formulation : Formulation
    request : IntegrationRequest
    layout : SampleLayout

    Returns
    -------
    samples : Block
        The samples up to the end of the run.
    outcome : Outcome
    """
    run = _SampledRun(formulation, request)
    with np.errstate(all="ignore"):
        found = outcome(run.integrate)
    found.steps, found.evaluations = run.steps, run.evaluations
    return Block.of_rows(np.array(run.rows).reshape(-1, layout.size), layout), found


class _SampledRun:
    def __init__(self, formulation: Formulation, request: IntegrationRequest):
        self.formulation, self.request = formulation, request
        self.rows: list[Array] = []
        self.steps = self.evaluations = 0
        self._limits = Limits(request.settings)

    def integrate(self) -> None:
        """Integrate until all samples are computed."""
        state, times = self.request.state, self.request.times
        y = self.formulation.start(state)
        if self._reached(times, state.t):
            self._sample(state.t, y)
        solver = self._solver(state.t, y)
        while len(self.rows) < len(times):
            self._limits.check(solver.t, self.steps)
            before, y = solver.t, solver.y.copy()
            message = solver.step()
            changed = self.formulation.restarted(before, y)
            if changed is not None:
                if solver.t - before < _SHORTEST * abs(solver.t):
                    raise Stop(f"no coordinates determine the others at t = {before:.9g} s")
                solver = self._solver(before, changed, _SHORTER * (solver.t - before))
                continue
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                raise Stop(f"{message or 'no finite value'} at t = {solver.t:.9g} s")
            self.steps += 1
            if self._reached(times, solver.t):
                inside = solver.dense_output()
                while self._reached(times, solver.t):
                    at = float(times[len(self.rows)])
                    self._sample(at, inside(at))

    def _reached(self, times: Array, t: float) -> bool:
        return len(self.rows) < len(times) and bool(times[len(self.rows)] <= t)

    def _solver(self, t: float, y: Array, first_step: float | None = None) -> DOP853:
        from scipy.integrate import DOP853

        settings = self.request.settings
        strict = 1 / math.sqrt(len(y))  # limits the largest component, not the root mean square
        size = float(np.abs(y).max()) or 1.0
        return DOP853(
            self._rate,
            t,
            y,
            settings.t_end,
            rtol=max(strict * settings.rtol, _LEAST_RTOL),
            atol=strict * settings.rtol * _ABSOLUTE * size,
            max_step=settings.max_step,
            first_step=first_step,
        )

    def _rate(self, t: float, y: Array) -> Array:
        self.evaluations += 1
        # an earlier stage may be undefined; then repeat the step with a shorter length
        return self.formulation.rate(t, y) if np.isfinite(y).all() else np.full_like(y, np.nan)

    def _sample(self, t: float, y: Array) -> None:
        q, v = self.formulation.state(t, y)
        a, multipliers = self.formulation.accelerations(t, y)
        self.rows.append(np.concatenate([[t], q, v, a, multipliers, y[-1:]]))
