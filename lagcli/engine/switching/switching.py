"""Switching: the rows of a System that come and go, and its events."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, NamedTuple

from lagcli.engine.tape.tape import Tape

#: What happens to a contact or a limited row; conditions of events name them.
ContactChange = Literal["closes", "opens", "slips", "sticks", "impacts"]


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
        """Whether the row is a force of a given size."""
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
        Whether it is there at the start; events engage and release it.
    closed : bool
        Whether the initial state is solved with it as a constraint.
    unit : str or None
        Unit of φ or ψ; None if unknown.
    """

    row: int
    sign: int = 0
    limit: int | None = None
    normal: int | None = None
    active: bool = True
    closed: bool = False
    unit: str | None = None

    @property
    def holds_at_start(self) -> bool:
        """Whether the initial state is on it, without looking at the state."""
        permanent = not self.sign and self.limit is None
        return self.active and (self.closed or permanent)

    def amount(self, value: float) -> str:
        """Return a value of φ or ψ with its unit."""
        return f"{value:.6g}" + (f" {self.unit}" if self.unit and self.unit != "1" else "")


class EventRule(NamedTuple):
    """An event of the model: when it happens, and its actions in the order in which they are done.

    Parameters
    ----------
    name : str
    condition : int or None
        Number of the function that rises through zero as the condition becomes true: among the
        outputs of ``System.events``, then of ``Switching.force_conditions``.
    either : bool
        Whether it fires in both directions, as an equation does.
    change : (row, ContactChange) or None
        Instead of a condition: what happens to a constraint, an index in ``System.constraints``.
    times : int or None
        How often it happens at most.
    targets : tuple of ("q" | "v" | "p", index)
        The coordinates, velocities and parameters that are set, to values of the actions' tape
        that are all computed before any is set.
    first : int
        Where its values begin among the outputs of the actions' tape: those of ``targets``, then
        of ``impulses``.
    impulses : tuple of int
        Coordinates with a generalized impulse, which constraints and contacts answer.
    release, engage : tuples of int
        Constraints, as indices in ``System.constraints``.
    stop : bool
    record : tuple of str or None
        Names of the columns to write; None for all.
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


@dataclass(frozen=True, eq=False)
class Switching:
    """What of a System switches. All tapes take (t, q, v, a, λ, parameters) unless it is said.

    Parameters
    ----------
    rows : tuple of SwitchedRow
        In the order of their constraints; ns of them. Each row stands in ``System.constraints``
        with φ or ψ = lhs − rhs, whatever the sign between them.
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
    condition_times : tuple of bool
        For each output of ``System.events``: whether it depends on t and parameters alone.
    force_conditions : Tape or None
        → functions of conditions that depend on a or λ.
    actions : Tape or None
        → values that events set, and impulses.
    """

    rows: tuple[SwitchedRow, ...]
    limits: Tape
    impact: Tape
    limit_pattern: tuple[tuple[int, int], ...] = ()
    forces: Tape | None = None
    force_coordinates: tuple[int, ...] = ()
    force_pattern: tuple[tuple[int, int], ...] = ()
    events: tuple[EventRule, ...] = ()
    condition_times: tuple[bool, ...] = ()
    force_conditions: Tape | None = None
    actions: Tape | None = None
