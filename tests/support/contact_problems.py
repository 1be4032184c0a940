"""Solution of contact problems: Newton's iteration over modes, enumeration, Lemke's algorithm.

Given the modes of all rows, a contact problem is linear. The modes are found by a semismooth Newton
iteration from several initial modes; if that fails, or if friction may allow a second motion, all
modes are tried, if they are not too many; otherwise Lemke's algorithm provides the initial modes.

References: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996; Cottle, Pang &
Stone, The Linear Complementarity Problem, 1992.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import product

import numpy as np

from lagcli.analysis.local.active_set import least_norm_within
from lagcli.arrays import Array, Flags, Indices
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem, ContactSolution
from lagcli.engine.switching.switching import RowMode
from tests.support.lemke import lemke

#: Largest number of rows for which all modes are tried, with friction and without.
_MOST_WITH_FRICTION, _MOST_WITHOUT = 6, 10
#: Largest number of combinations of modes that are tried if all else fails.
_MOST_MODES = 10_000
#: Relative size of forces and motions of one unit that counts as zero; difference of distinct
#: motions.
_ZERO, _APART = 1e-9, 1e-7
#: Singular values below this make forces redundant.
_REDUNDANT = 1e-9
_ITERATIONS = 30
#: A row is active with a negative force, in contrast to `RowMode.HOLDS`. Only for rows that limit
#: others.
_NEGATIVE = 4


def solve_contacts(problem: ContactProblem) -> ContactSolution | None:
    """Return a solution of a contact problem.

    Parameters
    ----------
    problem : ContactProblem

    Returns
    -------
    ContactSolution or None
        For redundant contacts, the forces of least norm among those that satisfy the laws. None:
        there is no solution, or, beyond the bounds of enumeration, none was found.
    """
    return next(_Normalized(problem).solutions(None), None)


def contact_motions(
    problem: ContactProblem, present: Indices | None = None
) -> tuple[ContactSolution, ...]:
    """Return solutions of a contact problem with different motions y.

    Without friction the motion is unique. With friction on at most 6 rows, all motions are
    returned; otherwise those found by the iterations. If the static limit exceeds the kinetic one,
    a row sticks if it can.

    Parameters
    ----------
    problem : ContactProblem
    present : (n,) array of int, optional
        Initial modes; the first solution has them if possible.
    """
    normalized = _Normalized(problem)
    found: list[ContactSolution] = []
    for solution in normalized.solutions(present):
        if not any(normalized.alike(solution, other) for other in found):
            found.append(solution)
        if not (normalized.has_friction or normalized.stronger.any()):
            break
    return tuple(x for x in found if not any(normalized.sticks_more(y, x) for y in found))


class _Normalized:
    """A contact problem scaled so that every diagonal entry of A is 1, or 0."""

    def __init__(self, problem: ContactProblem):
        self.laws = laws = np.asarray(problem.laws)
        self.n = len(laws)
        diagonal = np.diag(problem.matrix)
        self.unit = d = np.where(
            diagonal > 0.0, 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1)), 1.0
        )
        self.matrix = d[:, None] * problem.matrix * d
        self.offset = d * problem.offset
        self.unilateral = laws == ContactLaw.UNILATERAL
        self.limited = laws == ContactLaw.LIMITED
        self.bounded = self.limited | (laws == ContactLaw.FORWARD) | (laws == ContactLaw.BACKWARD)
        part = d / d[:, None]
        self.static, self.kinetic = (
            np.where(self.bounded, x / d, 0.0) for x in (problem.static, problem.kinetic)
        )
        self.static_slopes, self.kinetic_slopes = (
            np.where(self.bounded[:, None], x * part, 0.0)
            for x in (problem.static_slopes, problem.kinetic_slopes)
        )
        self.scaled = ContactProblem(
            self.matrix,
            self.offset,
            laws,
            self.static,
            self.kinetic,
            self.static_slopes,
            self.kinetic_slopes,
        )
        self.carries: Flags = ((self.static_slopes != 0) | (self.kinetic_slopes != 0)).any(axis=0)
        self.signed = self.carries & ~self.unilateral
        self.has_friction = bool(self.carries.any())
        #: rows whose static limit exceeds the kinetic one
        self.stronger: Flags = self.limited & (
            (self.static > self.kinetic) | (self.static_slopes > self.kinetic_slopes).any(axis=1)
        )

    # solutions

    def solutions(self, present: Indices | None) -> Iterator[ContactSolution]:
        """Yield solutions, the first as soon as possible."""
        if self.n == 0:
            nothing = np.zeros(0)
            yield ContactSolution(nothing, nothing, np.zeros(0, dtype=int))
            return
        for modes in self._beginnings(present):
            found = self._iterate(modes)
            if found is not None:
                yield found
        if self.n <= (_MOST_WITH_FRICTION if self.has_friction else _MOST_WITHOUT):
            yield from self._enumerated()
            return
        found = self._by_lemke()
        if found is not None:
            yield found
        elif np.prod([len(self._choices(i)) for i in range(self.n)]) <= _MOST_MODES:
            yield from self._enumerated()

    def alike(self, one: ContactSolution, other: ContactSolution) -> bool:
        """Return whether two solutions have the same motion."""
        y, z = self.unit * one.motion, self.unit * other.motion
        return bool(np.abs(y - z).max() <= _APART * self._size(y, z))

    def sticks_more(self, one: ContactSolution, other: ContactSolution) -> bool:
        """Return whether a solution has more sticking rows among those with a larger static
        limit."""
        holds, holds_other = (self.stronger & (x.modes == RowMode.HOLDS) for x in (one, other))
        return bool((holds >= holds_other).all() and holds.sum() > holds_other.sum())

    def _size(self, *values: Array) -> float:
        return float(max(np.abs(x).max() for x in (self.offset, *values))) or 1.0

    def _beginnings(self, present: Indices | None) -> Iterator[Indices]:
        hold = np.full(self.n, int(RowMode.HOLDS))
        hold[self.laws == ContactLaw.FORWARD] = RowMode.FORWARD
        hold[self.laws == ContactLaw.BACKWARD] = RowMode.BACKWARD
        if present is not None:
            # a limited row that was open or inactive is first assumed to stick
            absent = ~self.unilateral & (present == RowMode.OPEN)
            yield np.where(absent | (self.bounded & ~self.limited), hold, present)
        yield hold
        yield np.where(self.unilateral, int(RowMode.OPEN), hold)
        slips = np.where(self.offset > 0, int(RowMode.FORWARD), int(RowMode.BACKWARD))
        yield np.where(self.limited, slips, hold)

    def _choices(self, row: int) -> tuple[int, ...]:
        law, negative = ContactLaw(int(self.laws[row])), (_NEGATIVE,) * bool(self.signed[row])
        return {
            ContactLaw.UNILATERAL: (RowMode.HOLDS, RowMode.OPEN),
            ContactLaw.LIMITED: (RowMode.HOLDS, *negative, RowMode.FORWARD, RowMode.BACKWARD),
            ContactLaw.FREE: (RowMode.HOLDS, *negative),
            ContactLaw.FORWARD: (RowMode.FORWARD,),
            ContactLaw.BACKWARD: (RowMode.BACKWARD,),
        }[law]

    def _enumerated(self) -> Iterator[ContactSolution]:
        for combination in product(*map(self._choices, range(self.n))):
            modes = np.array(combination)
            # without force, all modes of friction are equivalent
            if (modes[self._idle(modes) & self.limited] == RowMode.FORWARD).all():
                found = self._accept(modes, *self._linear(modes))
                if found is not None:
                    yield found

    # one set of modes

    def _iterate(self, modes: Indices) -> ContactSolution | None:
        """Return the solution of Newton's iteration from initial modes, or None."""
        seen = set()
        for _ in range(_ITERATIONS):
            key = modes.tobytes()
            if key in seen:
                return None
            seen.add(key)
            x, free = self._linear(modes)
            found = self._accept(modes, x, free)
            if found is not None:
                return found
            modes = self._next(modes, x)
        return None

    def _linear(self, modes: Indices) -> tuple[Array, Array]:
        """Return the forces of least norm for given modes, and a basis of their null space, (n, k).

        The norm is that of the unscaled problem, as for redundant bilateral constraints.
        """
        held = np.flatnonzero((modes == RowMode.HOLDS) | (modes == _NEGATIVE))
        slips = np.flatnonzero((modes == RowMode.FORWARD) | (modes == RowMode.BACKWARD))
        # x = known + follows x_held
        known, follows = np.zeros(self.n), np.zeros((self.n, len(held)))
        follows[held, np.arange(len(held))] = 1.0
        if len(slips):
            direction = np.where(modes[slips] == RowMode.FORWARD, -1.0, 1.0)
            signs = np.where((modes == _NEGATIVE) | (modes == RowMode.FORWARD), -1.0, 1.0)
            slopes = direction[:, None] * self.kinetic_slopes[slips] * signs
            known[slips] = direction * self.kinetic[slips]
            follows[slips] = slopes[:, held]
            among = slopes[:, slips]
            if among.any():
                solved = np.linalg.lstsq(
                    np.eye(len(slips)) - among,
                    np.column_stack([known[slips], follows[slips]]),
                    rcond=None,
                )[0]
                known[slips], follows[slips] = solved[:, 0], solved[:, 1:]
        if not len(held):
            return known, follows
        rows = self.matrix[held]
        u, s, vt = np.linalg.svd(rows @ follows)
        rank = int((s > _REDUNDANT * max(s[0], _REDUNDANT)).sum())
        rhs = -(self.offset[held] + rows @ known)
        forces = vt[:rank].T @ ((u[:, :rank].T @ rhs) / s[:rank])
        x, free = known + follows @ forces, follows @ vt[rank:].T
        if free.shape[1]:
            across = np.linalg.lstsq(self.unit[:, None] * free, self.unit * x, rcond=None)[0]
            x = x - free @ across
        return x, free

    def _accept(self, modes: Indices, x: Array, free: Array) -> ContactSolution | None:
        """Return the solution for forces and modes if they satisfy the laws."""
        y = self.matrix @ x + self.offset
        allowed = _ZERO * self._size(x)
        if self.scaled.violation(x, y) > allowed:
            if not free.shape[1]:
                return None
            within = self._within(modes, x, y, free, allowed)
            if within is None:
                return None
            x = within
            y = self.matrix @ x + self.offset
            if self.scaled.violation(x, y) > allowed:
                return None
        modes = np.where(modes == _NEGATIVE, int(RowMode.HOLDS), modes)
        # with a limit of zero, both directions have the same force
        slips = self.limited & (modes != RowMode.HOLDS) & (np.abs(y) > allowed)
        modes[slips] = np.where(y > 0, int(RowMode.FORWARD), int(RowMode.BACKWARD))[slips]
        y[modes == RowMode.HOLDS] = 0.0  # zero except for rounding
        return ContactSolution(
            x * self.unit, y / self.unit, np.where(self._idle(modes), int(RowMode.OPEN), modes)
        )

    def _within(
        self, modes: Indices, x: Array, y: Array, free: Array, allowed: float
    ) -> Array | None:
        """Return the forces of least norm among x + free z that satisfy the laws, or None."""
        held = (modes == RowMode.HOLDS) | (modes == _NEGATIVE)
        signs = np.where((modes == _NEGATIVE) | (modes == RowMode.FORWARD), -1.0, 1.0)
        motions, idle = self.matrix @ free, self._idle(modes)
        rows: list[Array] = []
        bounds: list[float] = []
        for i in range(self.n):
            if held[i] and (self.unilateral[i] or self.signed[i]):
                rows.append(signs[i] * free[i])
                bounds.append(-signs[i] * x[i])
            if held[i] and self.limited[i]:
                slope, limit = self.static_slopes[i] * signs, self.static[i]
                for side in (-1.0, 1.0):
                    rows.append(slope @ free + side * free[i])
                    bounds.append(-(limit + slope @ x + side * x[i]))
            if not held[i] and (self.unilateral[i] or self.limited[i]) and not idle[i]:
                side = -1.0 if modes[i] == RowMode.BACKWARD else 1.0
                rows.append(side * motions[i])
                bounds.append(-side * y[i])
        u = self.unit
        found = least_norm_within(
            u * x, u[:, None] * free, np.array(rows), np.array(bounds) - 0.1 * allowed
        )
        return None if found is None else found / u

    def _next(self, modes: Indices, x: Array) -> Indices:
        """Return the modes of the next iteration."""
        y = self.matrix @ x + self.offset
        size = np.where(self.unilateral, x.clip(0), np.abs(x))
        static = self.static + self.static_slopes @ size
        pull = x - y
        after = modes.copy()
        after[self.unilateral] = np.where(pull > 0, int(RowMode.HOLDS), int(RowMode.OPEN))[
            self.unilateral
        ]
        slips = np.where(pull > 0, int(RowMode.BACKWARD), int(RowMode.FORWARD))
        holds = np.where(self.signed & (x < 0), _NEGATIVE, int(RowMode.HOLDS))
        after[self.limited] = np.where(np.abs(pull) <= static, holds, slips)[self.limited]
        free = self.laws == ContactLaw.FREE
        after[free] = holds[free]
        return after

    @cached_property
    def _only_carried(self) -> Flags:
        """Return which rows are limited only by the forces of unilateral rows."""
        by_others = (self.static_slopes[:, ~self.unilateral] != 0).any(axis=1)
        some = (self.static_slopes != 0).any(axis=1)
        return self.bounded & some & ~by_others & (self.static == 0)

    def _idle(self, modes: Indices) -> Flags:
        """Return which rows are limited only by the forces of open contacts."""
        closed = self.unilateral & (modes != RowMode.OPEN)
        return self._only_carried & ~(self.static_slopes[:, closed] != 0).any(axis=1)

    # Lemke

    def _by_lemke(self) -> ContactSolution | None:
        """Return a solution by Lemke's algorithm, or None.

        Rows with y = 0 and a force of any sign are eliminated; x_t of a limited row is x_R − limit:
        0 ≤ x_R ⊥ y_R ≥ 0, 0 ≤ 2 limit − x_R ⊥ y_L ≥ 0, y_t = y_R − y_L. Limits are kinetic, and
        assume positive forces; the iteration over modes, which starts from the result, treats both
        exactly.
        """
        contacts, limited = np.flatnonzero(self.unilateral), np.flatnonzero(self.limited)
        nc, nl = len(contacts), len(limited)
        slopes = np.where(self.unilateral, self.kinetic_slopes, 0.0)
        # x = start + along (x_N, x_R) + by_free x_free
        start, along = np.zeros(self.n), np.zeros((self.n, nc + nl))
        along[contacts, np.arange(nc)] = 1.0
        along[limited, nc + np.arange(nl)] = 1.0
        for k in np.flatnonzero(self.bounded).tolist():
            side = 1.0 if self.laws[k] == ContactLaw.BACKWARD else -1.0
            start[k] = side * self.kinetic[k]
            along[k, :nc] += side * slopes[k, contacts]
        free = np.flatnonzero(self.laws == ContactLaw.FREE)
        if len(free):
            inverse = np.linalg.pinv(self.matrix[np.ix_(free, free)], hermitian=True)
            start[free] = -inverse @ (self.offset[free] + self.matrix[free] @ start)
            along[free] = -inverse @ (self.matrix[free] @ along)
        motion, offset = self.matrix @ along, self.matrix @ start + self.offset
        size = nc + 2 * nl
        matrix, vector = np.zeros((size, size)), np.zeros(size)
        rows = np.concatenate([contacts, limited])
        matrix[: nc + nl, : nc + nl], vector[: nc + nl] = motion[rows], offset[rows]
        for k, row in enumerate(limited.tolist()):
            right, left = nc + k, nc + nl + k
            matrix[right, left] = 1.0
            matrix[left, :nc] = 2 * slopes[row, contacts]
            matrix[left, right] = -1.0
            vector[left] = 2 * self.kinetic[row]
        solved = lemke(matrix, vector)
        if solved is None:
            return None
        modes = np.full(self.n, int(RowMode.HOLDS))
        modes[self.laws == ContactLaw.FORWARD] = RowMode.FORWARD
        modes[self.laws == ContactLaw.BACKWARD] = RowMode.BACKWARD
        small = _ZERO * self._size(solved)
        other = matrix @ solved + vector
        modes[contacts] = np.where(solved[:nc] > small, int(RowMode.HOLDS), int(RowMode.OPEN))
        forward, backward = other[nc : nc + nl] > small, solved[nc + nl :] > small
        modes[limited[forward]] = RowMode.FORWARD
        modes[limited[backward & ~forward]] = RowMode.BACKWARD
        return self._iterate(modes)
