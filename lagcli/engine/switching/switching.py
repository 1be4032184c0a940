"""Switching: rows of a System that become active and inactive, and its events.

Clocks of events count instants: offset + k·period.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence, Set
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, NamedTuple

from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.engine.tape.tape import Tape

#: Changes of a contact or a limited row, as named in conditions of events.
ContactChange = Literal["closes", "opens", "slips", "sticks", "impacts"]


class TimeIn(IntEnum):
    """How the function of a condition depends on t (``lag_time_in``)."""

    NONE = 0
    WITH_STATE = 1
    #: On t and parameters.
    ALONE = 2


class RowMode(IntEnum):
    """The mode of a switched row; it is fixed within a step.

    OPEN: λ = 0. HOLDS: the row is a constraint (a closed contact, a limited row that sticks).
    FORWARD and BACKWARD: the row slips with ψ > 0 or ψ < 0, and λ is −limit or +limit.
    """

    OPEN = 0
    HOLDS = 1
    FORWARD = 2
    BACKWARD = 3

    @property
    def slips(self) -> bool:
        """Whether the row is a force of given magnitude."""
        return self in (RowMode.FORWARD, RowMode.BACKWARD)


class SwitchedRow(NamedTuple):
    """A constraint that does not always hold.

    Parameters
    ----------
    row : int
        Its index in ``System.constraints``.
    sign : int
        For a unilateral constraint, 1 for φ ≥ 0, λ ≥ 0, and −1 for φ ≤ 0, λ ≤ 0; 0 for other rows.
    limit : int or None
        Index of the limit of a limited row.
    normal : int or None
        For friction, the index in ``System.constraints`` of the constraint whose multiplier limits
        it. Where that one is unilateral, the row is open with it, and takes part in its impacts.
    active : bool
        Whether it is enabled initially; events engage and release it.
    closed : bool
        Whether the initial state satisfies it as a constraint.
    unit : str or None
        Unit of φ or ψ; None if unknown.
    weight : int or None
        The parameter that is its weight in M while it holds, of a constraint that a coordinate
        without inertia needs.
    """

    row: int
    sign: int = 0
    limit: int | None = None
    normal: int | None = None
    active: bool = True
    closed: bool = False
    unit: str | None = None
    weight: int | None = None

    @property
    def holds_at_start(self) -> bool:
        """Whether the initial state is on it by declaration, regardless of the state."""
        permanent = not self.sign and self.limit is None
        return self.active and (self.closed or permanent)

    def amount(self, value: float) -> str:
        """Return a value of φ or ψ with its unit."""
        return f"{value:.6g}" + (f" {self.unit}" if self.unit and self.unit != "1" else "")


class EventRule(NamedTuple):
    """An event of the model: its condition, and its actions in order.

    Parameters
    ----------
    name : str
    condition : int or None
        Index of the function that rises through zero when the condition becomes true: among the
        outputs of ``System.events``, then of ``Switching.force_conditions``.
    either : bool
        Whether it triggers in both directions, as an equation does.
    change : (row, ContactChange) or None
        Instead of a condition: a change of a constraint, an index in ``System.constraints``.
    clock : int or None
        Instead of a condition: the index of a clock.
    times : int or None
        Maximum number of occurrences.
    targets : tuple of ("q" | "v" | "p", index)
        Coordinates, velocities and parameters to set, to values from the actions' tape, which are
        all computed before any is set.
    first : int
        Index of its first value among the outputs of the actions' tape: those of ``targets``, then
        of ``impulses``.
    impulses : tuple of int
        Coordinates with a generalized impulse, to which constraints and contacts respond.
    release, engage : tuples of int
        Constraints, as indices in ``System.constraints``.
    stop : bool
    record : tuple of str or None
        Names of the columns to record; None for all.
    """

    name: str
    condition: int | None = None
    either: bool = False
    change: tuple[int, ContactChange] | None = None
    times: int | None = None
    targets: tuple[tuple[Literal["q", "v", "p"], int], ...] = ()
    first: int = 0
    impulses: tuple[int, ...] = ()
    release: tuple[int, ...] = ()
    engage: tuple[int, ...] = ()
    stop: bool = False
    record: tuple[str, ...] | None = None
    clock: int | None = None

    def displaces(self, constraining: Set[int]) -> bool:
        """Return whether values that it sets may violate constraints.

        Parameters
        ----------
        constraining : set of int
            The parameters on which constraints depend.
        """
        return any(what != "p" or index in constraining for what, index in self.targets)


@dataclass(frozen=True, eq=False)
class Switching:
    """The switching part of a System. All tapes take (t, q, v, a, λ, parameters) unless stated
    otherwise.

    Parameters
    ----------
    rows : tuple of SwitchedRow
        Switched rows in the order of their constraints; ns of them. Each row is in
        ``System.constraints`` with φ or ψ = lhs − rhs, regardless of the relation.
    limits : Tape
        → static limit of each of nl limited rows, then kinetic limit of each, then ∂static/∂λ and
        ∂kinetic/∂λ by ``limit_pattern``. Limits are not negative. λ of a unilateral constraint
        enters without absolute value, by its sign.
    limit_pattern : tuple of (limit, constraint)
    impact : Tape
        (t, q, v, parameters) → coefficient of restitution of each unilateral row, in the order of
        ``rows``; then coefficient of friction of each limited row in impacts, 0 where its limit is
        a finite force.
    forces : Tape or None
        → generalized forces that depend on λ, beyond ``System.dynamics``, one for each of
        ``force_coordinates``; then their ∂/∂λ by ``force_pattern``.
    force_coordinates : tuple of int
    force_pattern : tuple of (force, constraint)
    events : tuple of EventRule
        In the order of the file.
    condition_times : tuple of TimeIn
        For each output of ``System.events``.
    force_conditions : Tape or None
        → functions of conditions that depend on a or λ.
    actions : Tape or None
        → values that events set, and impulses.
    clocks : Tape or None
        parameters → period and offset of each clock, s, in the order of the events.
    """

    rows: tuple[SwitchedRow, ...]
    limits: Tape
    impact: Tape
    limit_pattern: tuple[tuple[int, int], ...] = ()
    forces: Tape | None = None
    force_coordinates: tuple[int, ...] = ()
    force_pattern: tuple[tuple[int, int], ...] = ()
    events: tuple[EventRule, ...] = ()
    condition_times: tuple[TimeIn, ...] = ()
    force_conditions: Tape | None = None
    actions: Tape | None = None
    clocks: Tape | None = None


#: Smallest period, relative to |t|: four times the difference of times that coincide
#: (core/breaks.c).
_LEAST_PERIOD = 64 * sys.float_info.epsilon


class Clock(NamedTuple):
    """A clock in a run.

    Parameters
    ----------
    name : str
        Name of the event.
    period, offset : float
        s.
    most : int
        Largest number of ticks; 0 without a limit.
    """

    name: str
    period: float
    offset: float
    most: int

    def fault(self, span: tuple[float, float]) -> str:
        """Return why the clock cannot tick in a run between two times; empty if it can."""
        largest = max(*map(abs, span), abs(self.offset))
        if not math.isfinite(self.offset):
            return f"the offset of event `{self.name}` is {self.offset:.6g}, but must be finite"
        if not 0 < self.period < math.inf:
            return f"the period of event `{self.name}` is {self.period:.6g} s, but must be positive"
        if self.period < _LEAST_PERIOD * largest:
            return (
                f"the period of event `{self.name}`, {self.period:.6g} s, is below the rounding"
                f" errors of times near {largest:.6g} s"
            )
        return ""


def clocks_of(switching: Switching, p: Sequence[float]) -> list[Clock]:
    """Return the clocks of the events, for values of the parameters."""
    if switching.clocks is None:
        return []
    values = ScalarTape(switching.clocks)(p[: switching.clocks.parameters])
    return [
        Clock(rule.name, values[2 * rule.clock], values[2 * rule.clock + 1], rule.times or 0)
        for rule in switching.events
        if rule.clock is not None
    ]
