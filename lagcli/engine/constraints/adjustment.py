"""States after an event sets values: the others follow on the constraints, with an impulse.

The given values hold. The other coordinates move as little as possible in the metric of M, as at
the start. Then the other velocities, v_f, change by an impulse Λ of the constraints,

    M_ff Δv_f = B_fᵀ Λ,  B v + b_0 = 0,

the smallest change in the metric of M. Closed contacts are inequalities in both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import ConsistentSearch, NoConsistentState
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear import dense
from lagcli.engine.switching.switching import EventRule, RowMode, Switching

#: Approaches of contacts below this part of the terms of ψ are rounding errors.
_NO_SPEED = 1e-11
#: Multiple of a gap that counts as none, below which a closed contact stays closed.
_TOUCHES = 10

_Found = TypeVar("_Found")


class ClosedContact(NamedTuple):
    """A contact that is closed before an event.

    Parameters
    ----------
    sign : int
        1 for φ ≥ 0, −1 for φ ≤ 0.
    no_gap : float
        Gap that counts as none.
    """

    sign: int
    no_gap: float


class Adjustment(NamedTuple):
    """A state on the constraints, and the impulse that leads to its velocities.

    Parameters
    ----------
    q, v : (nq,) arrays
    impulse : (nc,) array
        Λ of all constraints, in the sign of λ.
    """

    q: Array
    v: Array
    impulse: Array


class HeldRows(NamedTuple):
    """What holds while an event sets values.

    Parameters
    ----------
    positions, velocities : sequence of int
        The constraints that hold, other than contacts; those that the event engages are only among
        the latter.
    contacts : mapping of int to ClosedContact
        By constraint.
    """

    positions: Sequence[int]
    velocities: Sequence[int]
    contacts: Mapping[int, ClosedContact]


def held_during(
    switching: Switching,
    rule: EventRule,
    constraints: int,
    active: Sequence[bool],
    modes: Sequence[int],
    no_gap: Callable[[int], float],
) -> HeldRows:
    """Return what holds while an event sets values.

    Parameters
    ----------
    switching : Switching
    rule : EventRule
        An event that engages constraints and sets velocities sets them on these constraints.
    constraints : int
        The number of constraints.
    active, modes : sequences
        Of ``switching.rows``, before the event.
    no_gap : callable
        Returns the gap of a row that counts as none.
    """
    switched = {row.row for row in switching.rows}
    held = [k for k in range(constraints) if k not in switched]
    engaged, contacts = list[int](), dict[int, ClosedContact]()
    for k, row in enumerate(switching.rows):
        bilateral = not row.sign and row.limit is None
        if bilateral and row.row in rule.engage:
            engaged.append(row.row)
        if not active[k] or row.row in rule.release:
            continue
        if bilateral:
            held.append(row.row)
        elif row.sign and modes[k] == RowMode.HOLDS:
            contacts[row.row] = ClosedContact(row.sign, no_gap(k))
    sets_velocities = any(what == "v" for what, _ in rule.targets)
    velocities = {*held, *engaged} if sets_velocities else held
    return HeldRows(sorted(held), sorted(velocities), contacts)


def adjusted(
    evaluator: Evaluator, t: float, q: Array, v: Array, fixed: Flags, rows: HeldRows
) -> Adjustment:
    """Return the state on the constraints nearest to given values.

    Parameters
    ----------
    evaluator : Evaluator
    t : float
        s.
    q, v : (nq,) arrays
    fixed : (2, nq) array of bool
        The coordinates and the velocities that hold.
    rows : HeldRows

    Raises
    ------
    NoConsistentState, UndefinedStart
        See `adjusted_positions` and `adjusted_velocities`.
    """
    q = adjusted_positions(evaluator, t, q, v, fixed[0], rows.positions, rows.contacts)
    return adjusted_velocities(evaluator, t, q, v, fixed[1], rows.velocities, rows.contacts)


def adjusted_positions(
    evaluator: Evaluator,
    t: float,
    q: Array,
    v: Array,
    fixed: Flags,
    held: Sequence[int],
    contacts: Mapping[int, ClosedContact],
) -> Array:
    """Return the coordinates on the constraints nearest to given ones.

    Parameters
    ----------
    evaluator : Evaluator
    t : float
        s.
    q, v : (nq,) arrays
        v is used only to evaluate the equations.
    fixed : (nq,) array of bool
        The coordinates that are given.
    held : sequence of int
        The constraints that hold.
    contacts : mapping of int to ClosedContact
        By constraint. A contact opens if that needs less change. One that cannot be satisfied
        remains violated.

    Raises
    ------
    NoConsistentState
        The given coordinates do not permit any position on the constraints.
    UndefinedStart
        The equations are not finite on the way.
    """
    nothing = np.ones(len(q), dtype=bool)
    place = {row: k for k, row in enumerate(evaluator.system.holonomic)}

    def solve(rows: Sequence[int]) -> Array:
        return ConsistentSearch(evaluator, t, fixed, nothing, rows).positions(q.copy(), v)

    def violated(found: Array) -> list[int]:
        phi = evaluator.constraints(t, found, v).position
        return [k for k, x in contacts.items() if x.sign * phi[place[k]] < -_TOUCHES * x.no_gap]

    return _with_contacts(held, solve, violated, lambda found: [])


def adjusted_velocities(
    evaluator: Evaluator,
    t: float,
    q: Array,
    v: Array,
    fixed: Flags,
    held: Sequence[int],
    contacts: Mapping[int, ClosedContact],
) -> Adjustment:
    """Return the velocities on the constraints nearest to given ones, and the impulse.

    Parameters
    ----------
    evaluator, t, held
        See `adjusted_positions`.
    q : (nq,) array
        On the constraints.
    v : (nq,) array
    fixed : (nq,) array of bool
        The velocities that are given.
    contacts : mapping of int to ClosedContact
        Those that are open at q have no effect. If one cannot be satisfied, an impact follows.

    Raises
    ------
    NoConsistentState
        The given velocities contradict the constraints.
    UndefinedStart
        The equations are not finite there.
    """
    nothing = np.ones(len(q), dtype=bool)
    place = {row: k for k, row in enumerate(evaluator.system.holonomic)}
    c = evaluator.constraints(t, q, v)
    touching = [k for k, x in contacts.items() if abs(c.position[place[k]]) <= _TOUCHES * x.no_gap]

    def solve(rows: Sequence[int]) -> Adjustment:
        found = ConsistentSearch(evaluator, t, nothing, fixed, rows).velocities(q, v)
        return Adjustment(q, found, impulse_of(evaluator, t, q, found, found - v, rows, ~fixed))

    def violated(found: Adjustment) -> list[int]:
        now = evaluator.constraints(t, q, found.v)
        psi, scale = now.velocity(found.v), now.velocity_scale
        return [k for k in touching if contacts[k].sign * psi[k] < -_NO_SPEED * scale[k]]

    def pulled(found: Adjustment) -> list[int]:
        return [k for k in touching if contacts[k].sign * found.impulse[k] < 0]

    return _with_contacts(held, solve, violated, pulled)


def _with_contacts(
    held: Sequence[int],
    solve: Callable[[Sequence[int]], _Found],
    violated: Callable[[_Found], list[int]],
    pulled: Callable[[_Found], list[int]],
) -> _Found:
    """Return a solution whose contacts are satisfied, if there is one, else without contacts."""
    rows, without = list(held), None
    tried = set[tuple[int, ...]]()
    while tuple(sorted(rows)) not in tried:
        tried.add(tuple(sorted(rows)))
        try:
            found = solve(rows)
        except NoConsistentState:
            if without is None:
                raise
            break
        without = found if without is None else without
        added = [k for k in violated(found) if k not in rows]
        left = pulled(found)
        if not added and not left:
            return found
        rows = [k for k in rows if k not in left] + added
    assert without is not None
    return without


def impulse_of(
    evaluator: Evaluator,
    t: float,
    q: Array,
    v: Array,
    change: Array,
    rows: Sequence[int],
    free: Flags,
    given: Array | None = None,
) -> Array:
    """Return the impulse of constraints that changes velocities.

    Parameters
    ----------
    evaluator : Evaluator
    t : float
        s.
    q, v : (nq,) arrays
        The state after the change.
    change : (nq,) array
        Δv.
    rows : sequence of int
        The constraints.
    free : (nq,) array of bool
        The coordinates without other impulses than those given.
    given : (nq,) array, optional
        A generalized impulse besides.

    Returns
    -------
    (nc,) array
        Λ in the sign of λ, of least norm if the constraints are redundant.
    """
    impulse = np.zeros(len(evaluator.system.constraints))
    some = list(rows)
    if not some or not free.any() or not change.any():
        return impulse
    d = evaluator.dynamics(t, q, v)
    momentum = d.mass_matrix @ change - (0.0 if given is None else given)
    jacobian = evaluator.constraints(t, q, v).jacobian[some][:, free]
    sizes = evaluator.sizes(t, q, v)[free]
    parts = dense.decompose(jacobian, sizes=sizes)
    found = parts.multipliers(momentum[free])
    if parts.dependent.shape[1]:
        loose, _ = np.linalg.qr(parts.dependent / parts.scale[:, None])
        found = found - loose @ (loose.T @ found)
    impulse[some] = found
    return impulse
