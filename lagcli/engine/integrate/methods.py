"""Choice of the integration method: the requested one, or one by what each costs on the model.

``auto`` starts with the explicit DOP853, and reviews it after 32 steps, 64, and so on. Taylor's
method continues if its program and its steps cost less than the remaining steps of DOP853. If
stability rather than accuracy limits the steps, or the step size reaches its minimum, an implicit
method is tried, unless its Jacobians cost more than the remaining steps; if it does not take longer
steps either, the explicit method continues, and stiffness is tested less often.

Prices are those of `lagcli.engine.integrate.prices`: the same run always takes the same methods.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.contract import IntegrationRequest
from lagcli.engine.system import JacobianTapes, System
from lagcli.settings.methods import METHODS

if TYPE_CHECKING:
    from lagcli.engine.core.structures import lag_report
    from lagcli.engine.integrate.prices import Prices

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
_MANY = 5000
_STRETCH = 3
#: Largest deviation of the path from a smooth step, in tolerances.
_ROUGH = 2.0
#: Steps after which DOP853 is reviewed first. Those before half of them may be shorter than usual.
_REVIEW = 32
#: Number of remaining steps of DOP853 from which Taylor's method is considered: its program costs
#: as much as some hundreds of them, and on small models as thousands.
_FEWEST = 200
#: How many times as long as those of DOP853 Taylor's steps are in smooth motion.
_SMOOTH = 2.0
#: The largest step of Taylor's method times the largest eigenvalue, at the boundary of stability.
_STABLE = 8.0
#: How many times as long as those of DOP853 Taylor's steps are at most, where nothing limits them.
_FARTHEST = 100.0
#: A method replaces another only if it is expected to cost less than this part.
_CHEAPER = 0.9
#: What an implicit method must save at least, in preparations: whether it suits is not known yet.
#: Where it may save more than the second number, it is tried without looking at the path first.
_WORTH, _CLEARLY_WORTH = 1.5, 10.0
_EXPLICIT = ("DOP853", "Taylor")


class Change(NamedTuple):
    """A change of the method.

    Parameters
    ----------
    t : float
        s.
    method : str
    why : str
        The reason, as a phrase.
    order : int, optional
        Of Taylor's method.
    """

    t: float
    method: str
    why: str
    order: int = 0

    def __str__(self) -> str:
        """Return the change as a phrase."""
        order = f" of order {self.order}" if self.order else ""
        return f"{self.method}{order} from t = {self.t:.4g} s ({self.why})"


class _Mark(NamedTuple):
    """Where a run stood at the last review: steps, time, evaluations, examined states."""

    steps: int
    t: float
    evaluations: int
    examined: int


_TOO_SHORT = "too few steps for the preparation of another method"


class Methods:
    """The methods of one run.

    Parameters
    ----------
    core : Integrator
    system : System
    request : Request
    prices : callable
        Returns the prices of the methods on the System.
    no_series : str
        Why Taylor's method cannot run; empty if it can.
    expand : callable, optional
        Prepares Taylor's method during the run; returns why it does not suit the equations, or an
        empty text. None: the run does not change to it.

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
        prices: Callable[[], Prices],
        no_series: str = "",
        expand: Callable[[], str] | None = None,
    ):
        self.core, self.system, self.request = core, system, request
        self.settings = request.settings
        self.running = "DOP853"
        self.steps: dict[str, int] = {}
        self.changes: list[Change] = []
        self._prices, self._expand = prices, expand
        self._prepared = False
        self._explicit = self.running  # the one that continues if an implicit one does not pay
        self._patience, self._deaf_until = _PATIENCE, 0
        self._next_look = _PATIENCE
        self._next_review = _REVIEW // 2
        self._mark = _Mark(0, request.state.t, 0, 0)
        self._ratio = _SMOOTH  # of steps of Taylor's method to those of DOP853
        self._why = _TOO_SHORT
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
        return differentiable and self.running in _EXPLICIT

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
        elif not self._reaches_farther(report) and steps >= self._deaf_until and self._pays(report):
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
        if self._expand is not None and self.running in _EXPLICIT:
            due.append(self._next_review - steps)
        return max(1, min(due))

    def review(self, report: lag_report) -> None:
        """Change the method if another one pays, or if the running one does not."""
        steps: int = report.steps
        if self._expand is not None and self.running in _EXPLICIT and steps >= self._next_review:
            self._compare(report)
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
        self._go_on(self._explicit)

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
        if smooth and not self._reaches_farther(report):
            self._try(report, _LONGER if suspected or self.running == "Taylor" else _MUCH_LONGER)
        elif suspected:
            self._deaf_until = 2 * steps

    def _compare(self, report: lag_report) -> None:
        """Compare the explicit methods, by the last steps of the one that runs."""
        mark, t = self._mark, report.t
        taken, evaluations, examined = self._taken(report)
        self._note_place(report)
        self._next_review = 2 * report.steps
        if self.running == "Taylor":
            prices = self._prices()
            price = prices.taylor + max(0.0, evaluations - prices.usual) * prices.evaluation
            if _CHEAPER * (price + examined * prices.examining) > self._ratio * prices.explicit:
                self._expand = None
                self._explicit = "DOP853"
                self.changes.append(Change(t, "DOP853", "steps of Taylor's method cost more"))
                self._go_on("DOP853")
        elif mark.steps and t > mark.t:
            left = (self.settings.t_end - t) / (t - mark.t) * taken
            reach = min(_SMOOTH, self._reach(report))
            self._consider(report, left, reach, examined, "smooth motion")

    def _reaches_farther(self, report: lag_report) -> bool:
        """Change to Taylor's method if stiff forces limit the accuracy of DOP853, but not the
        stability of Taylor's method; return whether it has."""
        if self.running != "DOP853" or self._expand is None:
            return False
        reach, examined = self._reach(report), self._taken(report)[2]
        if reach < _SMOOTH:
            return False
        return self._consider(report, self._left(report), reach, examined, "stiff forces")

    def _reach(self, report: lag_report) -> float:
        """Return how many times as long as the last step of DOP853 stable steps of Taylor's method
        may be."""
        rate: float = report.rate * (report.t - report.t_old)
        return _STABLE / max(rate, _STABLE / _FARTHEST)

    def _taken(self, report: lag_report) -> tuple[int, float, float]:
        """Return the number of steps since the last review, and the evaluations and examined states
        in each."""
        mark = self._mark
        taken = max(1, report.steps - mark.steps)
        examined = report.examined - mark.examined
        return taken, (report.evaluations - mark.evaluations) / taken, examined / taken

    def _note_place(self, report: lag_report) -> None:
        """Count from here to the next review."""
        self._mark = _Mark(report.steps, report.t, report.evaluations, report.examined)

    def _consider(
        self, report: lag_report, left: float, ratio: float, examined: float, motion: str
    ) -> bool:
        """Change to Taylor's method if it costs less; return whether it has.

        Parameters
        ----------
        report : lag_report
        left : float
            Number of steps that DOP853 would take.
        ratio : float
            How many times as long those of Taylor's method are expected to be.
        examined : float
            Number of states in a step that are examined for singular configurations.
        motion : str
        """
        if left < _FEWEST:
            return False
        prices = self._prices()
        cost = _CHEAPER * prices.steps(left)
        if cost <= prices.least_expanding:
            return False
        price = prices.taylor + examined * prices.examining
        relative = left * price / (ratio * prices.steps(left))
        if relative >= _CHEAPER:
            self._why = f"Taylor's method would cost {_rounded(relative)} times as much per second"
            return False
        if cost <= prices.expanding + left / ratio * price:
            return False
        assert self._expand is not None
        refused = self._expand()
        if refused:
            self._why, self._expand = f"no power series: {refused}", None
            return False
        self._ratio, self._explicit = ratio, "Taylor"
        gain = f"about {_rounded(1 / relative)} times cheaper per second than DOP853"
        self.changes.append(Change(report.t, "Taylor", f"{motion}: {gain}", prices.order))
        self._go_on("Taylor")
        self._note_place(self.core.report)  # with the evaluation of the change
        self._next_review = self._next_look = report.steps + _TRIAL
        return True

    def _pays(self, report: lag_report, worth: float = _WORTH) -> bool:
        """Return whether the remaining steps cost so many times as much as the Jacobians of an
        implicit method, and its trial."""
        prices = self._prices()
        step = prices.taylor if self.running == "Taylor" else prices.explicit
        trying = prices.differentiating + _TRIAL * prices.implicit
        return self._left(report) * step > worth * trying

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
        """Return which method was chosen, and why; empty if it was requested."""
        if not self.free:
            return ""
        if not self.changes:
            return f"DOP853 ({self._why})"
        return "; ".join(map(str, self.changes))

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


def _rounded(x: float) -> str:
    """Return a ratio with two digits."""
    return f"{x:.0f}" if x >= 10 else f"{x:.2g}"
