"""Choice of the integration method: the requested one, or an implicit one for stiff motion.

``auto`` starts with the explicit DOP853. If stability rather than accuracy limits its steps, or the
step size reaches its minimum, an implicit method is tried, unless few steps are left; if it does
not take longer steps either, the explicit method continues, and stiffness is tested less often. The
choice depends on counted steps, never on a clock: the same run always takes the same methods.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.system import JacobianTapes, System
from lagcli.settings.methods import METHODS

if TYPE_CHECKING:
    from lagcli.engine.core.structures import lag_report

#: Relative tolerance from which Rodas5P takes less time than Radau for the same error.
_LOOSE = 1e-4
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
_STRETCH = 3
#: Largest deviation of the path from a smooth step, in tolerances.
_ROUGH = 2.0
#: Explicit steps that take as long as the Jacobians of an implicit method and its trial: 150 to
#: 10000 on 56 models, 1300 in the median.
_PREPARATION = 1300
#: Preparations that the remaining steps must be worth at least: whether an implicit method suits is
#: not known yet. From the second number on, it is tried without looking at the path first.
_WORTH, _CLEARLY_WORTH = 1.5, 10.0


class Change(NamedTuple):
    """A change of the method.

    Parameters
    ----------
    t : float
        s.
    method : str
    why : str
        The reason, as a phrase.
    """

    t: float
    method: str
    why: str

    def __str__(self) -> str:
        """Return the change as a phrase."""
        return f"{self.method} from t = {self.t:.4g} s ({self.why})"


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
    changes : list of Change
        Changes of the method, without failed trials.
    refused : str
        Why a method other than the requested one runs.
    """

    def __init__(
        self,
        core: Any,
        system: System,
        request: IntegrationRequest,
        no_series: str = "",
    ):
        self.core, self.system, self.request = core, system, request
        self.settings = request.settings
        self.running = "DOP853"
        self.steps: dict[str, int] = {}
        self.changes: list[Change] = []
        self._prepared = False
        self._patience, self._deaf_until = _PATIENCE, 0
        self._next_look = _PATIENCE
        self._trial: tuple[int, float, float] | None = None  # steps, time, least useful step
        self._suspected = False  # whether stability seems to limit the steps
        self._path: list[tuple[float, Array]] = []  # points that show whether the motion is smooth
        self._vain: set[str] = set()
        self.refused = ""
        if self.settings.method == "Taylor" and no_series:
            self.refused = f"Taylor's method does not suit the equations ({no_series}): used DOP853"
        elif self.settings.method not in ("auto", self.running):
            self._go_on(self.settings.method)

    @property
    def free(self) -> bool:
        """Whether the method may be changed."""
        return self.settings.method == "auto"

    def may_help(self) -> bool:
        """Return whether an implicit method is left to try."""
        differentiable = self.free and self.system.variation is not None
        return differentiable and self.running == "DOP853"

    def count(self, steps: int) -> None:
        """Count the steps since the last call, given those of the run."""
        new = steps - sum(self.steps.values())
        if new or not self.steps:
            self.steps[self.running] = self.steps.get(self.running, 0) + new

    def stiff(self, *, forced: bool = False) -> None:
        """Try a method for stiff motion, unless one failed recently or does not pay.

        Parameters
        ----------
        forced : bool
            Whether the running method cannot continue.
        """
        report = self.core.report
        steps: int = report.steps
        if forced:
            self._trial = None
            self._go_on_implicitly(report)
        elif steps >= self._deaf_until and self._pays(report):
            if self._prepared or self._pays(report, _CLEARLY_WORTH):
                self._try(report, _LONGER)
            else:
                self._suspected, self._path, self._next_look = True, [], steps

    def _try(self, report: lag_report, longer: float) -> None:
        """Continue with an implicit method if its steps are so many times as long."""
        self._trial = report.steps, report.t, longer * (report.t - report.t_old)
        self._go_on_implicitly(report)

    def _go_on_implicitly(self, report: lag_report) -> None:
        loose = self.settings.rtol >= _LOOSE and self._jacobians.exact
        method = "Rodas5P" if loose else "Radau"
        self.changes.append(Change(report.t, method, "stiff motion"))
        self._go_on(method)

    def most_steps(self, steps: int) -> int:
        """Return the number of steps until the next review, after those of the run so far."""
        due = [self.settings.max_steps]
        if self._trial is not None:
            due.append(self._trial[0] + _TRIAL - steps)
        elif self.may_help():
            due.append(self._next_look - steps)
        return max(1, min(due))

    def review(self, report: lag_report) -> None:
        """Change the method if another one pays, or if the running one does not."""
        steps: int = report.steps
        if self.may_help() and steps >= self._next_look:
            self._look(report)
        if self._trial is None or steps < self._trial[0] + _TRIAL:
            return
        before, since, enough = self._trial
        self._trial = None
        if (report.t - since) / (steps - before) > enough:
            self._vain.discard(self.running)
            return
        self._vain.add(self.running)
        self._deaf_until = steps + self._patience
        self._next_look = max(self._next_look, self._deaf_until)
        self._patience *= 2
        self.changes.pop()
        self._go_on("DOP853")

    def _look(self, report: lag_report) -> None:
        """Try an implicit method if some steps are left and their path is smooth."""
        steps: int = report.steps
        if self._path or self._pays(report):
            self._path.append((report.t, self.core.state))
        if len(self._path) in (1, 2):
            self._next_look = steps + _STRETCH
            return
        smooth = len(self._path) == 3 and self._smooth()
        suspected = self._suspected
        self._suspected, self._path, self._next_look = False, [], max(_PATIENCE, 2 * steps)
        if smooth:
            self._try(report, _LONGER if suspected else _MUCH_LONGER)
        elif suspected:
            self._deaf_until = 2 * steps

    def _pays(self, report: lag_report, worth: float = _WORTH) -> bool:
        """Return whether the remaining steps cost so many times as much as the Jacobians of an
        implicit method, and its trial."""
        return self._left(report) > worth * _PREPARATION

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

    def _left(self, report: lag_report) -> float:
        """Return the number of remaining steps of the last size."""
        left: float = (self.settings.t_end - report.t) / (report.t - report.t_old)
        return left

    def order(self) -> None:
        """Choose an order of pivots for the implicit method's matrix."""
        from lagcli.engine.linear.sparse import pivot_order

        self.core.order(pivot_order)

    def message(self) -> str:
        """Return the message on the chosen method."""
        if not self.changes or METHODS[self.changes[-1].method].implicit is False:
            return self.refused
        last = self.changes[-1]
        return f"the motion is stiff: continued with {last.method} at t = {last.t:.9g} s"

    def choice(self) -> str:
        """Return which methods `auto` went on with, and why; empty if it kept DOP853."""
        return "; ".join(map(str, self.changes)) if self.free else ""

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
