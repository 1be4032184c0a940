"""Nearest states on the constraints: to a target, or after an event has set values.

Values that an event sets hold. The other coordinates move as little as possible in the metric of M,
as at the start. Then the other velocities, v_f, change by an impulse Λ of the constraints,

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

_Adjusted = TypeVar("_Adjusted")


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
    """Constraints and contacts that hold while an event sets values.

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
    """Return the constraints and contacts that hold while an event sets values.

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
    evaluator: Evaluator,
    t: float,
    q: Array,
    v: Array,
    fixed: Flags,
    rows: HeldRows,
    accuracy: Array,
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
    accuracy : (nq,) array
        Errors that velocities may have.

    Raises
    ------
    NoConsistentState, UndefinedStart
        See `adjusted_positions` and `adjusted_velocities`.
    """
    q = adjusted_positions(evaluator, t, q, v, fixed[0], rows.positions, rows.contacts)
    return adjusted_velocities(
        evaluator, t, q, v, fixed[1], rows.velocities, rows.contacts, accuracy
    )


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

    def violated(positions: Array) -> list[int]:
        phi = evaluator.constraints(t, positions, v).position
        return [k for k, x in contacts.items() if x.sign * phi[place[k]] < -_TOUCHES * x.no_gap]

    return _with_contacts(held, solve, violated, lambda adjusted: [])


def adjusted_velocities(
    evaluator: Evaluator,
    t: float,
    q: Array,
    v: Array,
    fixed: Flags,
    held: Sequence[int],
    contacts: Mapping[int, ClosedContact],
    accuracy: Array,
) -> Adjustment:
    """Return the velocities on the constraints nearest to given ones, and the impulse.

    Parameters
    ----------
    evaluator, t, held
        See `adjusted_positions`.
    accuracy : (nq,) array
        See `adjusted`.
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
        search = ConsistentSearch(evaluator, t, nothing, fixed, rows, accuracy=accuracy)
        after = search.velocities(q, v)
        return Adjustment(q, after, impulse_of(evaluator, t, q, after, after - v, rows, ~fixed))

    def violated(candidate: Adjustment) -> list[int]:
        now = evaluator.constraints(t, q, candidate.v)
        psi, scale = now.velocity(candidate.v), now.velocity_scale
        return [k for k in touching if contacts[k].sign * psi[k] < -_NO_SPEED * scale[k]]

    def pulled(candidate: Adjustment) -> list[int]:
        return [k for k in touching if contacts[k].sign * candidate.impulse[k] < 0]

    return _with_contacts(held, solve, violated, pulled)


def _with_contacts(
    held: Sequence[int],
    solve: Callable[[Sequence[int]], _Adjusted],
    violated: Callable[[_Adjusted], list[int]],
    pulled: Callable[[_Adjusted], list[int]],
) -> _Adjusted:
    """Return a solution whose contacts are satisfied, if there is one, else without contacts."""
    rows, without = list(held), None
    tried = set[tuple[int, ...]]()
    while tuple(sorted(rows)) not in tried:
        tried.add(tuple(sorted(rows)))
        try:
            candidate = solve(rows)
        except NoConsistentState:
            if without is None:
                raise
            break
        without = candidate if without is None else without
        added = [k for k in violated(candidate) if k not in rows]
        left = pulled(candidate)
        if not added and not left:
            return candidate
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
    if not some or not free.any() or (given is None and not change.any()):
        return impulse
    d = evaluator.dynamics(t, q, v)
    momentum = d.mass_matrix @ change - (0.0 if given is None else given)
    jacobian = evaluator.constraints(t, q, v).jacobian[some][:, free]
    sizes = evaluator.sizes(t, q, v)[free]
    parts = dense.decompose(jacobian, sizes=sizes)
    impulses = parts.multipliers(momentum[free])
    if parts.dependent.shape[1]:
        loose, _ = np.linalg.qr(parts.dependent / parts.scale[:, None])
        impulses = impulses - loose @ (loose.T @ impulses)
    impulse[some] = impulses
    return impulse


#: Function that returns a deviation (m,) at a position and its derivatives (m, nq).
Deviation = Callable[[Array], tuple[Array, Array]]

_STEPS = 60  # of a descent; moving a point by a fraction of the model takes about ten
_CORRECTIONS = 30  # of a projection; Newton's method needs three or four
REACHED = 1e-14  # of a constraint's scale: end of a projection
ACCEPTED = 1e-11  # of a constraint's scale: accepted if rounding ends the projection earlier
_SMALL = 1e-6  # of the length: deviations and steps that are not visible
LONGEST = 0.25  # of the length: longest step, so that no branch of solutions is skipped
_PROBE = 1e-7  # of a step: for its derivative
_DAMPING = 1e-4  # initial value, of the derivatives' size
_HARDEST = 1e8  # damping at which the search ends
_REGULAR = 1e-13  # relative to rows of length one: regularization for redundant constraints


def nearest_position(
    evaluator: Evaluator,
    t: float,
    q: Array,
    v: Array,
    deviation: Deviation,
    places: Callable[[Array], Array],
    length: float,
) -> Array | None:
    """Return a position on the constraints with a locally least deviation.

    Levenberg–Marquardt steps along the constraint manifold, each followed by a projection onto it.
    Unilateral constraints stay open or closed: a step that would violate one closes it.

    Parameters
    ----------
    evaluator : Evaluator
    t : float
        s.
    q : (nq,) array
        Near the constraints: the search starts from its projection.
    v : (nq,) array
        Velocities at which the equations can be evaluated.
    deviation : callable
        The deviation to be minimized.
    places : callable
        Returns lengths that distinguish configurations, (n,). If a deviation hardly depends on the
        position, as at a dead point, they bound the steps.
    length : float
        Scale of deviations; steps change deviations and positions by at most a quarter of it.

    Returns
    -------
    (nq,) array or None
        None if q has no projection.
    """
    search = _Search(evaluator, t, v)
    start = search.projected(q)
    if start is None:
        return None
    q, damping = start, _DAMPING
    rest, slopes = deviation(q)
    for _ in range(_STEPS):
        if np.linalg.norm(rest) <= _SMALL * length or damping > _HARDEST:
            break
        step = search.step(q, rest, slopes, damping)
        change = np.abs(places(q + _PROBE * step) - places(q)).max(initial=0.0) / _PROBE
        change = max(change, np.linalg.norm(slopes @ step))
        if not change > _SMALL * length:
            break
        trial = search.projected(q + step * min(1.0, LONGEST * length / change))
        tried = None if trial is None else deviation(trial)
        if tried is None or not np.linalg.norm(tried[0]) < np.linalg.norm(rest):
            damping *= 8
            continue
        assert trial is not None
        gain = np.linalg.norm(rest) - np.linalg.norm(tried[0])
        q, (rest, slopes), damping = trial, tried, max(damping / 8, _DAMPING)
        if gain <= _SMALL * length:
            break
    return q


class _Search:
    """Steps along the constraints of a System at one time."""

    def __init__(self, evaluator: Evaluator, t: float, v: Array):
        self.evaluator, self.t, self.v = evaluator, t, v
        system = evaluator.system
        rows = system.switching.rows if system.switching else ()
        self.signs = {
            system.holonomic.index(row.row): row.sign for row in rows if row.sign and row.active
        }
        held = set(system.held_at_start)
        self.places = [k for k, i in enumerate(system.holonomic) if i in held]
        self.holonomic = list(system.holonomic)

    def constraints(self, q: Array) -> tuple[Array, Array, Array]:
        """Return φ of the holonomic constraints, its scales and its Jacobian."""
        c = self.evaluator.constraints(self.t, q, self.v)
        scale = np.where(c.position_scale > 0, c.position_scale, 1.0)
        return c.position, scale, c.jacobian[self.holonomic]

    def projected(self, q: Array) -> Array | None:
        """Return a position on the constraints near another; None if there is none."""
        while True:
            corrected = self.corrected(q)
            if corrected is None:
                return None
            phi, scale, _ = self.constraints(corrected)
            violated = [
                k
                for k, sign in self.signs.items()
                if k not in self.places and sign * phi[k] < -ACCEPTED * scale[k]
            ]
            if not violated:
                return corrected
            self.places += violated

    def corrected(self, q: Array) -> Array | None:
        """Project by Newton's method onto the constraints that hold."""
        sizes, places = self.sizes(q), self.places
        worst = np.inf
        for _ in range(_CORRECTIONS):
            phi, scale, jacobian = self.constraints(q)
            if not (np.isfinite(phi).all() and np.isfinite(jacobian).all()):
                return None
            before, worst = worst, np.abs(phi[places] / scale[places]).max(initial=0.0)
            if worst <= REACHED or (worst <= ACCEPTED and worst >= before):
                return q
            rows, lengths = _unit_rows(jacobian[places] * sizes)
            gram = rows @ rows.T + _REGULAR * np.eye(len(rows))
            q = q - sizes * (rows.T @ np.linalg.solve(gram, phi[places] / lengths))
        return q if worst <= ACCEPTED else None

    def step(self, q: Array, rest: Array, slopes: Array, damping: float) -> Array:
        """Return the damped step along the constraints that reduces a deviation."""
        sizes = self.sizes(q)
        along = slopes * sizes
        size = np.linalg.norm(along) or 1.0
        along = along / size
        rows, _ = _unit_rows(self.constraints(q)[2][self.places] * sizes)
        n, m = len(q), len(rows)
        matrix = np.zeros((n + m, n + m))
        matrix[:n, :n] = along.T @ along + damping * np.eye(n)
        matrix[:n, n:], matrix[n:, :n] = rows.T, rows
        matrix[n:, n:] = -_REGULAR * np.eye(m)
        right = np.concatenate([-along.T @ rest / size, np.zeros(m)])
        return np.asarray(sizes * np.linalg.solve(matrix, right)[:n])

    def sizes(self, q: Array) -> Array:
        """Return changes of the coordinates that are considered equal in size."""
        sizes = self.evaluator.sizes(self.t, q, self.v)
        return np.where(np.isfinite(sizes) & (sizes > 0), sizes, 1.0)


def _unit_rows(rows: Array) -> tuple[Array, Array]:
    """Return the rows of a matrix as unit vectors, and their lengths; zero rows are unchanged."""
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0] = 1.0
    return rows / lengths[:, None], lengths
