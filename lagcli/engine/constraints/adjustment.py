"""Nearest states on the constraints: to a target, or after an event has set values.

Values that an event sets hold. The other coordinates move as little as possible in the metric of M,
as at the start. Then the other velocities, v_f, change by an impulse Λ of the constraints,

    M_ff Δv_f = B_fᵀ Λ,  B v + b_0 = 0,

the smallest change in the metric of M. Closed contacts are inequalities in both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple, NoReturn

import numpy as np

from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import (
    ConsistentSearch,
    UndefinedStart,
    programs_of_search,
)
from lagcli.engine.core.start_search import CoreAdjustment, HeldRows
from lagcli.engine.core.status import StartStatus
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.switching.switching import EventRule, RowMode, Switching
from lagcli.engine.system import System


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
    sign, gaps = np.zeros(constraints, dtype=np.int32), np.zeros(constraints)
    positions = np.ones(constraints, dtype=np.int32)
    positions[[row.row for row in switching.rows]] = 0
    engaged = []
    for k, row in enumerate(switching.rows):
        bilateral = not row.sign and row.limit is None
        if bilateral and row.row in rule.engage:
            engaged.append(row.row)
        if not active[k] or row.row in rule.release:
            continue
        if bilateral:
            positions[row.row] = 1
        elif row.sign and modes[k] == RowMode.HOLDS:
            sign[row.row], gaps[row.row] = row.sign, no_gap(k)
    velocities = positions.copy()
    if any(what == "v" for what, _ in rule.targets):
        velocities[engaged] = 1
    return HeldRows(positions, velocities, sign, gaps)


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
        A contact opens if that needs less change. One that cannot be satisfied remains violated; an
        impact follows.
    accuracy : (nq,) array
        Errors that velocities may have.

    Raises
    ------
    NoConsistentState
        The given values contradict the constraints.
    UndefinedStart
        The equations are not finite on the way.
    """
    y = np.concatenate([q, v])
    status, found, impulse = _adjustment(evaluator.system).adjust(
        t, evaluator.p, rows, fixed, y, accuracy
    )
    new_q, new_v = np.split(found, 2)
    if status == StartStatus.UNDEFINED:
        raise UndefinedStart(evaluator.state(t, new_q, new_v))
    if status == StartStatus.CONTRADICTED:
        _explain(evaluator, t, y, new_q, fixed, rows)
    return Adjustment(new_q, new_v, impulse)


def supplied_energy(evaluator: Evaluator, t: float, y: Array, impulse: Array) -> float:
    """Return the energy that moving constraints supply by an impulse, −Λᵀ b_0.

    Parameters
    ----------
    evaluator : Evaluator
    t : float
        s.
    y : (2 nq,) array
        The state after the impulse.
    impulse : (nc,) array
        Λ.

    Returns
    -------
    float
        J.
    """
    return _adjustment(evaluator.system).supplied(t, evaluator.p, y, impulse)


@lru_cache(maxsize=4)
def _adjustment(system: System) -> CoreAdjustment:
    return CoreAdjustment(system, *programs_of_search(system))


def _explain(
    evaluator: Evaluator, t: float, given: Array, q: Array, fixed: Flags, rows: HeldRows
) -> NoReturn:
    """Raise the error of the search for positions, or of that for velocities at q."""
    first, v = np.split(given, 2)
    for_positions, for_velocities = (
        ConsistentSearch(evaluator, t, fixed[0], fixed[1], np.flatnonzero(held).tolist())
        for held in (rows.positions, rows.velocities)
    )
    for_positions.positions(first, v)
    for_velocities.velocities(q, v)
    raise AssertionError("the core finds no state where both searches succeed")


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
