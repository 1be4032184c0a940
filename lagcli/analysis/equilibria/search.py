"""Search for all equilibria: deflation from Sobol points, in all modes of contacts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from lagcli.analysis.local.active_set import ActiveSet, ModeChange, distributed
from lagcli.analysis.local.contact_mode import ModeEquations, Modes, SwitchedModel
from lagcli.analysis.local.contacts import Acting
from lagcli.analysis.local.gradients import Point
from lagcli.analysis.local.steady import Residual, SteadyProblem, SteadyState, completed, none_found
from lagcli.arrays import Array, Flags
from lagcli.engine.constraints.initial import NoStart
from lagcli.errors import LagcliError, NumericalError, UsageError
from lagcli.sweeps.plan.factors import unit_points

#: Roots closer than this, relative to the coordinates' lengths and the largest multiplier,
#: coincide.
_SAME = 1e-6
#: Distance up to which roots may be one degenerate root, located with rounding errors.
_CLOSE = 1e-2
_REACH = 2.0  # of the coordinates' lengths: distance of starting points
_RELAXED = 4  # number of starting points with relaxation instead of Newton's method
_STEPS, _SEED = 40, 1
#: Longest step, relative to the coordinates' lengths; residual near a root, relative to the
#: magnitudes of the terms.
_LIMIT, _NEAR = 0.5, 1e-9
#: Distances of starting points beside a root, relative to the coordinates' lengths, and the largest
#: number of directions.
_DISTANCES, _DIRECTIONS = (0.02, 0.1, 0.4), 4
_LEAST = 0.05  # smallest divisor of a deflated step


class _Known(NamedTuple):
    """A known root, and the coordinates that distinguish it from others."""

    state: SteadyState
    compared: Flags


def search_steady_states(problem: SteadyProblem, starts: int) -> list[SteadyState]:
    """Return the equilibria, or steady motions, found from many starting points.

    Parameters
    ----------
    problem : SteadyProblem
    starts : int
        Number of points of a Sobol sequence: angles in a full turn, other coordinates within twice
        the size of the mechanism. Then at most as many beside the roots found. Each is brought
        onto the constraints first.

    Raises
    ------
    UsageError
        The constraints determine a prescribed velocity.
    NumericalError
        None was found.
    """
    local, known = problem.local, list[_Known]()
    q = local.start.state.q
    for number, guess in enumerate((q, *_points(problem, starts - 1))):
        placed = q if number == 0 else problem.on_constraints(guess)
        if placed is not None:
            _try(problem, placed, known, relaxed=number < _RELAXED)
    left, visited = starts - 1, 0
    while left > 0 and visited < len(known):
        for guess in _beside(problem, known[visited].state)[:left]:
            left -= 1
            placed = problem.on_constraints(guess)
            if placed is not None:
                _try(problem, placed, known, relaxed=False)
        visited += 1
    if not known:
        raise none_found(local, problem, q)
    return [root.state for root in known]


def _try(problem: SteadyProblem, q: Array, known: list[_Known], relaxed: bool) -> None:
    """Add the roots to which iterations lead from a point on the constraints."""
    searches = [partial(_deflated, problem, q, known)]
    if relaxed:
        searches.append(partial(problem.solve, q, problem.local.p))
    for search in searches:
        try:
            root = search()
        except NumericalError:
            continue  # the equations are singular, or not smooth, where it leads
        if root is not None:
            _keep(problem, root, known)


def _beside(problem: SteadyProblem, state: SteadyState) -> list[Array]:
    """Return points beside a root, along the motions with the least change of force.

    Roots lie close together beside singularities, such as Lagrange's points beside a small mass,
    where few points of a sequence fall.
    """
    matrix, nq = problem.jacobian(state.residual), problem.nq
    rows, columns = problem.scales(state.residual, matrix)
    _, values, vt = np.linalg.svd(matrix * np.outer(rows, columns))
    least = np.argsort(np.concatenate([values, np.zeros(len(vt) - len(values))]), kind="stable")
    q = state.operating_point.point.q
    guesses = []
    for row in least:
        along = columns[:nq] * vt[row, :nq]
        reach = np.abs(along / problem.local.lengths).max()
        if reach > _SAME:  # not a change of multipliers alone
            guesses += [q + x / reach * along for d in _DISTANCES for x in (d, -d)]
    return guesses[: 2 * len(_DISTANCES) * _DIRECTIONS]


def _points(problem: SteadyProblem, count: int) -> Array:
    """Return points of a Sobol sequence in the range of the coordinates, (count, nq)."""
    local = problem.local
    unit = unit_points("sobol", count, len(local.lengths), _SEED, np.arange(count))
    reach = np.where(local.angles, np.pi, _REACH * local.lengths)
    centre = np.where(local.angles, 0.0, local.start.state.q)
    return np.asarray(centre + (2 * unit - 1) * reach)


def _keep(problem: SteadyProblem, root: Residual, known: list[_Known]) -> None:
    """Add a root to the known ones, unless it repeats one or is not steady."""
    if root.decomposition.rank > problem.local.start.rank:
        return  # near a singular configuration, where rounding hides dependent rows
    if any(_repeats(problem, root.point, other) for other in known):
        return  # known before its neutral changes, which take long
    try:
        state = completed(problem, root)
    except UsageError:
        raise
    except LagcliError:
        return
    folded = fold(state, problem.local.angles)
    moved = np.abs(state.neutral).max(axis=1, initial=0.0) / problem.local.lengths
    candidate = _Known(folded, moved <= _SAME * moved.max(initial=0.0))
    if not any(_alike(problem, candidate, other) for other in known):
        known.append(candidate)


def fold(state: SteadyState, angles: Flags) -> SteadyState:
    """Return a root with its angles in (−π, π]."""
    point = state.operating_point.point
    q = point.q.copy()
    q[angles] = -((-q[angles] + np.pi) % (2 * np.pi) - np.pi)
    return state._replace(operating_point=replace(state.operating_point, point=point._replace(q=q)))


def _repeats(problem: SteadyProblem, point: Point, known: _Known) -> bool:
    """Whether a point is that of a known root, in all coordinates and multipliers."""
    far, same_forces = _compared(problem, point, known.state.operating_point.point)
    return bool(far.max() < _SAME) and same_forces


def _alike(problem: SteadyProblem, a: _Known, b: _Known) -> bool:
    compared = a.compared & b.compared
    far, same_forces = _compared(problem, *(x.state.operating_point.point for x in (a, b)))
    if (a.state.neutral.shape[1] == 0) != (b.state.neutral.shape[1] == 0):
        return False
    if compared.any():
        farthest = far[compared].max()
        return bool(farthest < _SAME) or (farthest < _CLOSE and _balanced_between(problem, a, b))
    if any(contact.state == "sticks" for contact in a.state.operating_point.contacts):
        return True  # λ varies along a set that friction holds
    return same_forces


def _compared(problem: SteadyProblem, a: Point, b: Point) -> tuple[Array, bool]:
    """Return the distances of coordinates over their lengths, and whether multipliers agree."""
    far = np.abs(_difference(problem, a.q, b.q) / problem.local.lengths)
    scale = max(np.abs(x.multipliers).max(initial=0.0) for x in (a, b))
    forces = np.abs(a.multipliers - b.multipliers).max(initial=0.0)
    return far, bool(forces <= _SAME * scale)


def _balanced_between(problem: SteadyProblem, a: _Known, b: _Known) -> bool:
    """Whether forces vanish halfway between two roots as well as there: a degenerate root."""
    first, second = (x.state.operating_point.point for x in (a, b))
    halfway = second.q + _difference(problem, first.q, second.q) / 2
    reached = max(a.state.rounding, b.state.rounding)
    return not problem.speed_names and problem.unbalanced(halfway, first.p) <= reached


def _difference(problem: SteadyProblem, q: Array, other: Array) -> Array:
    """Return q − other, with angles reduced to (−π, π]."""
    difference = q - other
    turns = np.where(problem.local.angles, np.round(difference / (2 * np.pi)), 0.0)
    return np.asarray(difference - 2 * np.pi * turns)


def _deflated(problem: SteadyProblem, q: Array, known: list[_Known]) -> Residual | None:
    """Return an unknown root, by Newton steps for m(q) R(q, λ), or None.

    m = Π (1 + 1/d²) grows near the known roots, so that steps do not lead there. Steps are limited
    but not damped: undamped iterations find more roots than those that end at a minimum of |R|.
    """
    local = problem.local
    residual = problem.begun(q, local.p)
    if not np.isfinite(residual.value).all():
        return None
    for _ in range(_STEPS):
        if residual.relative <= _NEAR:
            return problem.polished(residual)
        step = problem.newton_step(residual)
        change = _slope(problem, residual.point.q, known) @ step[: problem.nq]
        # the step for m R, by the Sherman–Morrison formula
        step = step / (1.0 - change) if abs(1.0 - change) > _LEAST else step / _LEAST
        residual = problem.moved(residual, problem.limited(step / _LIMIT) * _LIMIT)
        if not np.isfinite(residual.value).all():
            return None
    return None


def _slope(problem: SteadyProblem, q: Array, known: list[_Known]) -> Array:
    """Return ∇m/m."""
    slope, lengths = np.zeros(len(q)), problem.local.lengths
    for root in known:
        far = _difference(problem, q, root.state.operating_point.point.q) / lengths
        far = np.where(root.compared, far, 0.0)
        square = float(far @ far)
        if square:
            slope -= 2 * far / lengths / (square * (square + 1.0))
    return slope


#: Contacts up to which all sets of closed ones are tried.
_MOST = 8


def search_in_all_modes(
    switched: SwitchedModel, held: Mapping[str, float], starts: int
) -> list[SteadyState]:
    """Return the states found in all sets of closed contacts that satisfy 0 ≤ φ ⊥ λ ≥ 0.

    Friction sticks, or slides where the velocities that are held demand it; where it would exceed
    its limit, states at the limit are looked for.

    Parameters
    ----------
    switched : SwitchedModel
    held : mapping of str to float
        Velocities that are held, by coordinate.
    starts : int
        Points in each mode.

    Raises
    ------
    UsageError
        The constraints determine a velocity that is held, or there are too many contacts.
    NumericalError
        None was found.
    """
    active = ActiveSet(switched, held)
    start = active.start
    waiting = [active.sliding(start, modes) for modes in _closed_sets(switched)]
    seen, roots = set[Modes](), list[SteadyState]()
    for modes in waiting:  # it grows
        if modes in seen:
            continue
        seen.add(modes)
        local = switched.local(modes, start)
        try:
            states = search_steady_states(SteadyProblem(local, held), starts)
        except (NumericalError, NoStart):
            continue
        for state in states:
            root = distributed(local, SteadyProblem(local, held), state.residual)
            if root is not state.residual:
                state = fold(completed(SteadyProblem(local, held), root), local.angles)
            point = state.operating_point.point
            changes = active.contradictions(local, point)
            if not changes:
                _add(state, roots)
            for k, mode in changes:
                if mode.at_limit:
                    waiting.append(active.changed(modes, ModeChange(k, mode, point.q)))
    if not roots:
        what = "steady motion" if held else "equilibrium"
        raise NumericalError(
            f"no {what} of {switched.model.name} was found in {len(seen)} modes of its contacts;"
            " give initial values nearer to one (--set-initial), or more starts (--starts)"
        )
    return roots


def _closed_sets(switched: SwitchedModel) -> Iterator[Modes]:
    """Yield the modes in which some contacts are closed, few first; friction sticks there."""
    rows = switched.rows
    contacts = [k for k, row in enumerate(rows) if row.sign and row.active]
    if len(contacts) > _MOST:
        raise UsageError(
            f"--all tries all sets of closed contacts, at most {_MOST} contacts;"
            f" {switched.model.name} has {len(contacts)}: leave out --all, and choose initial"
            " values"
        )
    for size in range(len(contacts) + 1):
        for closed in combinations(contacts, size):
            modes = [
                Acting.HOLDS if (k in closed or not row.sign) and row.active else Acting.OPEN
                for k, row in enumerate(rows)
            ]
            yield switched.with_friction(tuple(modes))


def _add(state: SteadyState, known: list[SteadyState]) -> None:
    """Add a state, unless another mode has it too: where a contact touches without a force."""
    local, q = state.local, state.operating_point.point.q
    assert isinstance(local, ModeEquations)
    for other in known:
        far = q - other.operating_point.point.q
        turns = np.where(local.angles, np.round(far / (2 * np.pi)), 0.0)
        if (np.abs(far - 2 * np.pi * turns) <= _SAME * local.lengths).all():
            return
    known.append(state)
