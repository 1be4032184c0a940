"""Equilibria of models with contacts: the active set of those that hold, by complementarity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from lagcli.analysis.local.contact_mode import ModeEquations, Modes, RowValues, SwitchedModel
from lagcli.analysis.local.contacts import ZERO, Acting
from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.steady import Residual, SteadyProblem, SteadyState, completed, none_found
from lagcli.arrays import Array
from lagcli.engine.constraints.initial import NoStart
from lagcli.engine.system import State
from lagcli.errors import NumericalError

#: Changes of the active set after which none is found, and those that a message lists.
_CHANGES, _LISTED = 60, 8


class ModeChange(NamedTuple):
    """A row whose mode contradicts the solution, and the mode that it takes.

    Parameters
    ----------
    row : int
        Number of the switched row.
    mode : Acting
    q : (nq,) array
        Where the iteration goes on.
    """

    row: int
    mode: Acting
    q: Array


class ActiveSet:
    """The search for an equilibrium or steady motion that satisfies 0 ≤ φ ⊥ λ ≥ 0.

    Begins with the modes of the start. A root of the equations in a mode is a candidate: a contact
    that would be violated on the way there is closed, one that would pull is opened, friction
    beyond its limit slips, or stays at its limit if it is at rest there.

    Parameters
    ----------
    switched : SwitchedModel
    held : mapping of str to float
        Velocities that are held, by coordinate.
    """

    def __init__(self, switched: SwitchedModel, held: Mapping[str, float]):
        self.switched, self.held = switched, held
        self.start = switched.start.state

    def nearest(self, p: tuple[float, ...] | None = None) -> SteadyState:
        """Return the state to which the search leads from the start.

        Newton's method leads from each active set to the next. Where the sets repeat, the search
        begins again and follows the overdamped motion instead.

        Parameters
        ----------
        p : tuple of float, optional
            Values of the parameters; those of the model without.

        Raises
        ------
        UsageError
            A velocity cannot be held.
        ModelError, NumericalError
            There is no consistent start, or no equilibrium is found.
        """
        start = self.start if p is None else self.start._replace(p=p)
        changes: list[tuple[str, Acting]] = []
        for relaxed in (False, True):
            result = self._search(start, relaxed)
            if isinstance(result, SteadyState):
                return result
            changes = result
        raise self._cycle(changes)

    def _search(self, start: State, relaxed: bool) -> SteadyState | list[tuple[str, Acting]]:
        """Return the state found, or the changes that repeat."""
        q, modes = start.q, self.sliding(start, self.switched.first_modes())
        seen, changes = set[Modes](), list[tuple[str, Acting]]()
        while modes not in seen and len(changes) < _CHANGES:
            seen.add(modes)
            local = self.switched.local(modes, start._replace(q=q))
            problem = SteadyProblem(local, self.held)
            root, passed = self._root(problem, relaxed)
            change = passed
            if root is not None:
                root = distributed(local, problem, root)
                change = self.contradiction(local, local.start.state.q, root.point)
                if change is None:
                    return completed(problem, root)
            if change is None:
                raise none_found(local, problem, local.start.state.q)
            changes.append((self.switched.names[change.row], change.mode))
            modes = self.sliding(start._replace(q=change.q), self.changed(modes, change))
            q = change.q
        return changes

    def _root(
        self, problem: SteadyProblem, relaxed: bool
    ) -> tuple[Residual | None, ModeChange | None]:
        """Return the root in a mode, or the change of mode that stops the motion towards it."""
        local = problem.local
        assert isinstance(local, ModeEquations)
        try:
            q = local.start.state.q
        except NoStart:
            raise NumericalError(self._contradicting(local)) from None
        residual = problem.begun(q, local.p)
        if not np.isfinite(residual.value).all():
            return None, None
        if not relaxed:
            root = problem.polished(residual)
            if root is not None:
                return root, None
        passed: list[ModeChange] = []

        def ends(before: Residual, after: Residual) -> bool:
            change = self.closing(local, before.point.q, after.point)
            passed.extend([change] if change is not None else [])
            return change is not None

        residual = problem.relaxed(residual, ends)
        return (None, passed[0]) if passed else (problem.polished(residual), None)

    def changed(self, modes: Modes, change: ModeChange) -> Modes:
        """Return the modes with one row changed, and with the friction of it."""
        changed = list(modes)
        changed[change.row] = change.mode
        row = self.switched.rows[change.row]
        if row.sign and change.mode == Acting.HOLDS:
            for k, other in enumerate(self.switched.rows):
                if other.normal == row.row and other.active:
                    changed[k] = Acting.HOLDS
        return self.switched.with_friction(tuple(changed))

    def sliding(self, state: State, modes: Modes) -> Modes:
        """Return the modes in which rows that slide at the velocities of steady motion do so."""
        rows = self.switched.rows
        limited = [
            k for k, row in enumerate(rows) if row.limit is not None and modes[k] == Acting.HOLDS
        ]
        if not limited:
            return modes
        without = tuple(Acting.OPEN if k in limited else m for k, m in enumerate(modes))
        local = self.switched.local(without, state)
        try:
            problem = SteadyProblem(local, self.held)
            point = problem.residual(local.start.state.q, np.zeros(_count(local)), local.p).point
        except NoStart:
            return modes
        values, sliding = local.values(point), list(modes)
        for k in limited:
            if abs(values.rate[k]) > ZERO * values.rate_scale[k]:
                sliding[k] = Acting.FORWARD if values.rate[k] > 0 else Acting.BACKWARD
        return tuple(sliding)

    # what contradicts a mode

    def contradiction(self, local: ModeEquations, q: Array, point: Point) -> ModeChange | None:
        """Return the worst contradiction between a candidate and its mode; None if there is none.

        Parameters
        ----------
        local : ModeEquations
        q : (nq,) array
            Where the iteration came from.
        point : Point
            The candidate.
        """
        closing = self.closing(local, q, point)
        if closing is not None:
            return closing
        contradictions = self.contradictions(local, point)
        return ModeChange(*contradictions[0], point.q) if contradictions else None

    def contradictions(self, local: ModeEquations, point: Point) -> list[tuple[int, Acting]]:
        """Return the rows whose modes contradict a candidate, and the modes they should have.

        Violated contacts come first, then those that pull, the worst first, then friction.
        """
        values = local.values(point)
        return [
            *((k, Acting.HOLDS) for k in self._violated(local, values)),
            *((k, Acting.OPEN) for k in self._pulling(local, values)),
            *self._beyond(local, values),
        ]

    def closing(self, local: ModeEquations, q: Array, point: Point) -> ModeChange | None:
        """Return the contact that closes first on the straight line to a candidate."""
        values = local.values(point)
        below = self._violated(local, values)
        if not below:
            return None
        before = local.values(point._replace(q=q)).gap[below].clip(0.0)
        parts = before / (before - values.gap[below])
        first = int(np.argmin(parts))
        return ModeChange(below[first], Acting.HOLDS, q + parts[first] * (point.q - q))

    def _violated(self, local: ModeEquations, values: RowValues) -> list[int]:
        return [
            k
            for k, mode in enumerate(local.modes)
            if mode == Acting.OPEN
            and self.switched.rows[k].active
            and values.gap[k] < -ZERO * values.gap_scale[k]
        ]

    def _pulling(self, local: ModeEquations, values: RowValues) -> list[int]:
        sizes = values.multiplier / values.multiplier_scale
        pulls = [
            k
            for k, mode in enumerate(local.modes)
            if self.switched.rows[k].sign and mode == Acting.HOLDS and sizes[k] < -ZERO
        ]
        return sorted(pulls, key=lambda k: float(sizes[k]))

    def _beyond(self, local: ModeEquations, values: RowValues) -> list[tuple[int, Acting]]:
        rows = []
        for k, mode in enumerate(local.modes):
            if self.switched.rows[k].limit is None or mode == Acting.OPEN:
                continue
            rate = values.rate[k]
            rests = abs(rate) <= ZERO * values.rate_scale[k]
            if mode == Acting.HOLDS:
                excess = abs(values.multiplier[k]) - values.static[k]
                if excess > ZERO * values.multiplier_scale[k]:
                    upper = values.multiplier[k] > 0
                    rows.append((k, Acting.AT_UPPER if upper else Acting.AT_LOWER))
            elif not mode.at_limit and rests:
                rows.append((k, Acting.HOLDS))
            elif not rests and (rate > 0) != (mode in (Acting.FORWARD, Acting.AT_LOWER)):
                rows.append((k, Acting.FORWARD if rate > 0 else Acting.BACKWARD))
        return rows

    # messages

    def _cycle(self, changes: list[tuple[str, Acting]]) -> NumericalError:
        listed = ", ".join(f"`{name}` {_WORDS[mode]}" for name, mode in changes[-_LISTED:])
        what = "steady motion" if self.held else "equilibrium"
        return NumericalError(
            f"no {what} of {self.switched.model.name} was found: its contacts change again and"
            f" again ({listed}); give initial values nearer to one (--set-initial), with contacts"
            " closed that are closed there, or search for all (--all)"
        )

    def _contradicting(self, local: ModeEquations) -> str:
        closed = [
            f"`{name}`"
            for name, row, mode in zip(
                self.switched.names, self.switched.rows, local.modes, strict=True
            )
            if row.sign and mode == Acting.HOLDS
        ]
        return (
            f"{self.switched.model.name}: the contacts {', '.join(closed)} cannot all be closed"
            " together; give initial values nearer to an equilibrium (--set-initial)"
        )


_WORDS = {
    Acting.OPEN: "opens",
    Acting.HOLDS: "closes",
    Acting.FORWARD: "slips",
    Acting.BACKWARD: "slips",
    Acting.AT_LOWER: "reaches its limit",
    Acting.AT_UPPER: "reaches its limit",
}


def distributed(local: ModeEquations, problem: SteadyProblem, root: Residual) -> Residual:
    """Return a root with the λ of redundant contacts within the laws, if some are.

    The forces do not change: of a table on four legs, λ of least norm may pull at one of them.
    """
    dependent, scale = root.decomposition.dependent, root.decomposition.scale
    if not dependent.shape[1] or local.reactive is not None:
        return root

    free = dependent / scale[:, None]
    names = local.system.constraints
    values, rows, bounds = local.values(root.point), list[Array](), list[float]()
    for k, (row, name) in enumerate(zip(local.switched.rows, local.switched.names, strict=True)):
        if name not in names:
            continue
        i = names.index(name)
        own = free[i]
        if np.abs(dependent[i]).max() <= ZERO:  # it has its own force, whatever the others bear
            continue
        if row.sign:
            rows.append(row.sign * own)
            bounds.append(-float(values.multiplier[k]))
        elif row.limit is not None:
            for side in (1.0, -1.0):
                rows.append(side * own)
                bounds.append(-float(values.static[k] + side * values.multiplier[k]))
    if not rows or max(bounds) <= 0.0:
        return root
    multipliers = least_norm_within(root.point.multipliers, free, np.array(rows), np.array(bounds))
    if multipliers is None:
        return root
    return problem.residual(root.point.q, multipliers, root.point.p, root.independent)


def _count(local: LocalEquations) -> int:
    return len(local.system.constraints)


#: If the residual is below this, relative to the right side 1, the inequalities are infeasible.
_INFEASIBLE = 1e-11


def least_norm_within(start: Array, free: Array, rows: Array, bounds: Array) -> Array | None:
    """Return the x = start + free z of least norm with rows z ≥ bounds, or None.

    Parameters
    ----------
    start : (n,) array
    free : (n, k) array
        Independent columns.
    rows, bounds : (m, k) and (m,) arrays
    """
    q, r = np.linalg.qr(free)
    inverse = np.linalg.inv(r)
    across = q.T @ start  # w = r z + across is the variable part of x
    g = rows @ inverse
    w = _least_distance(g, bounds + g @ across)
    return None if w is None else start + free @ (inverse @ (w - across))


def _least_distance(matrix: Array, bounds: Array) -> Array | None:
    """Return the w of least norm with matrix w ≥ bounds, or None.

    Lawson & Hanson, Solving Least Squares Problems, 1974, chapter 23: least distance programming.
    """
    if (bounds <= 0).all():
        return np.zeros(matrix.shape[1])
    from scipy.optimize import nnls

    scale = float(np.abs(bounds).max())
    stacked = np.vstack([matrix.T, bounds / scale])
    goal = np.zeros(len(stacked))
    goal[-1] = 1.0
    try:
        factors, _ = nnls(stacked, goal)
    except RuntimeError:  # no convergence
        return None
    residual = stacked @ factors - goal
    if -residual[-1] <= _INFEASIBLE:
        return None
    return np.asarray(-residual[:-1] / residual[-1] * scale)
