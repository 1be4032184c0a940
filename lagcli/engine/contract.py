"""Requests to integrate a System, blocks of samples, and outcomes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.layout import SampleLayout
from lagcli.engine.system import State, System
from lagcli.prose import counted
from lagcli.settings.settings import Settings

if TYPE_CHECKING:
    from lagcli.engine.event_entries import EventEntries
    from lagcli.engine.integrate.prepared import Prepared
    from lagcli.engine.linear.elimination import Elimination

Status = Literal["completed", "stopped-by-event", "failed", "interrupted"]


class OneSidedLimits(NamedTuple):
    """One-sided limits of the motion at an instant at which one of the model's events occurs.

    Parameters
    ----------
    entry : int
        Entry of the event in ``Outcome.events``.
    left, right : (width,) arrays
        Sample rows before and after the instant: `SampleLayout`. a and λ are NaN on the left of the
        initial time, and if the run ends during the instant.
    left_p, right_p : tuples of float
        Values of the parameters.
    """

    entry: int
    left: Array
    right: Array
    left_p: tuple[float, ...]
    right_p: tuple[float, ...]


class IntegrationRequest(NamedTuple):
    """A request to integrate a System.

    Parameters
    ----------
    state : State
        The consistent initial state, at ``settings.t_start``.
    rank : int
        Rank of B there; below nc, the constraints are redundant.
    settings : Settings
        Complete settings: interval, method, tolerances and limits.
    times : (nt,) array
        Sample times, increasing, within the interval.
    atol : float or (2 nq + 1,) array
        Absolute tolerances of q, v and the work; 0 if they follow the size of the entry, as defined
        in core/sizes.h.
    kinds : tuple of int, optional
        Kind of each coordinate, from 0: coordinates of the same unit have the same number; by
        default all are of one kind.
    block_rows : int
        The largest number of samples in a block.
    elimination : Elimination, optional
        The order of elimination found at this state, if it is already known.
    prepared : Prepared, optional
        Prepared programs of a run with other values, used if they are suitable.
    on_parameters : callable, optional
        Called with the values of all parameters when an event sets some, after the previous samples
        were emitted.
    breaks : (nb,) array
        Times at which the right side is not smooth, increasing, s: steps end there, the integration
        restarts, and a sample at such a time is taken after it. The knots of the System's functions
        of time are added: see `breaks_of`.
    """

    state: State
    rank: int
    settings: Settings
    times: Array
    atol: float | Array
    kinds: tuple[int, ...] = ()
    block_rows: int = 4096
    elimination: Elimination | None = None
    prepared: Prepared | None = None
    on_parameters: Callable[[tuple[float, ...]], None] | None = None
    breaks: Array = np.empty(0)

    @property
    def tolerances(self) -> Array:
        """The given absolute tolerances on q, v and the work, (2 nq + 1,)."""
        return np.full(2 * len(self.state.q) + 1, 1.0) * self.atol

    @property
    def kind_of(self) -> tuple[int, ...]:
        """The kind of each coordinate."""
        return self.kinds or (0,) * len(self.state.q)


def breaks_of(system: System, request: IntegrationRequest) -> Array:
    """Return the times of a run at which the right side is not smooth, increasing, s."""
    settings, given = request.settings, request.breaks
    return system.functions.breaks(request.state.t, settings.t_end, given)


class Block(NamedTuple):
    """Consecutive samples of a run; `np.column_stack` makes sample rows of them.

    Parameters
    ----------
    time : (n,) array
    q, v, a : (n, nq) arrays
    multipliers : (n, nc) array
    work : (n,) array
        The integral of all power since ``t_start``, J.
    """

    time: Array
    q: Array
    v: Array
    a: Array
    multipliers: Array
    work: Array

    @classmethod
    def of_rows(cls, rows: Array, layout: SampleLayout) -> Block:
        """Return the block of sample rows."""
        return cls(
            time=rows[:, layout.t.start],
            q=rows[:, layout.q],
            v=rows[:, layout.v],
            a=rows[:, layout.a],
            multipliers=rows[:, layout.multipliers],
            work=rows[:, layout.work.start],
        )


@dataclass(eq=False)
class Outcome:
    """Result of an integration: how the run ended, and statistics.

    ``undefined`` is the state at which the equations were not finite, if that ended the run;
    ``constraints`` are the constraints that ended it because they have no gradient at the
    initial state. ``methods`` are the methods that took steps, and ``choice`` states why `auto`
    changed them. ``tolerances`` are the final absolute tolerances of q, v and the work, (2 nq +
    1,). ``events`` are the log entries, in order, of a System that switches, and ``modes`` the
    modes of the switched rows at the initial state: those at a sample are the modes after the last
    entry up to its time.
    ``limits`` are those of the model's events that record columns. ``kinks`` is the number of
    changes of branches: `lagcli.engine.switching.kinks`. ``notes`` state where derivatives of
    the motion end.
    """

    status: Status
    message: str = ""
    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    undefined: State | None = None
    constraints: tuple[str, ...] = ()
    methods: tuple[str, ...] = ()
    choice: str = ""
    tolerances: Array | None = None
    events: EventEntries | None = None
    modes: tuple[int, ...] = ()
    limits: list[OneSidedLimits] = field(default_factory=list)
    kinks: int = 0
    notes: tuple[str, ...] = ()

    @property
    def counts(self) -> dict[str, int]:
        """Statistics by name; kinks if there were any."""
        counts = {"steps": self.steps, "rejected": self.rejected, "evaluations": self.evaluations}
        return {**counts, "kinks": self.kinks} if self.kinks else counts


class Stop(Exception):
    """Ends a run early.

    Parameters
    ----------
    message : str
        Message: what happened, when, and a remedy.
    undefined : State, optional
    constraints : tuple of str
        As in Outcome.
    """

    def __init__(
        self, message: str, undefined: State | None = None, constraints: tuple[str, ...] = ()
    ):
        super().__init__(message)
        self.undefined, self.constraints = undefined, constraints


class Undefined(Stop):
    """Ends a run at a state at which the equations are not finite."""

    def __init__(self, state: State):
        super().__init__(f"the equations have no finite value at t = {state.t:.9g} s", state)


class Interrupted(Exception):
    """Ends a run that the user cancels; raised by the callback ``progress``."""


class Limits:
    """Limits of steps and wall time; the clock starts at construction.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings):
        self.steps, self.timeout = settings.max_steps, settings.timeout
        self.began = time.monotonic()

    def check(self, t: float, steps: int, why: Callable[[], str] = str) -> None:
        """Stop a run that takes more steps or time than allowed.

        ``why`` returns what limits the steps, as the end of a sentence.
        """
        if steps >= self.steps:
            taken = counted(steps, "step")
            raise Stop(f"stopped after {taken} at t = {t:.9g} s; --max-steps allows more{why()}")
        self.check_time(t)

    def check_time(self, t: float) -> None:
        """Stop a run that takes more time than allowed."""
        if time.monotonic() - self.began > self.timeout:
            raise Stop(
                f"stopped after {self.timeout:g} s of computing time at t = {t:.9g} s;"
                " --timeout allows more"
            )


def outcome(integrate: Callable[[], None]) -> Outcome:
    """Integrate, and return how it ended."""
    try:
        integrate()
    except Stop as stop:
        return Outcome("failed", str(stop), undefined=stop.undefined, constraints=stop.constraints)
    except Interrupted:
        return Outcome("interrupted", "interrupted; the samples so far are kept")
    return Outcome("completed")
