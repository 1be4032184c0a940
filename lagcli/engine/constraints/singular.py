"""Singular configurations, in which dependent constraints do not determine the motion.

The rank of B is determined from the singular values of its scaled rows. The value that vanishes at
a singular configuration is monitored inside each step and along the extrapolated path.

A passage is on the branch that conserves momentum. In the configuration itself, the constraints do
not determine the accelerations, and nearby the accelerations have large rounding errors, although
the motion is smooth. Therefore a, λ and the power are interpolated between states on both sides:
those before are known; those after follow from the integral of a itself, by iteration.
Accelerations are computed only at regular states, and only the first guess is extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyint, polyval, polyvander

from lagcli.arrays import Array
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.constraints.minimum import minimum
from lagcli.engine.constraints.projection import Projection
from lagcli.engine.contract import Stop
from lagcli.engine.evaluator import Constraints
from lagcli.engine.linear import dense
from lagcli.engine.scales import lengths_of_rows
from lagcli.engine.sparse_rows import SparseRows

Path = Callable[[float], Array]  # time → (q, v, …)
Project = Callable[[float, Array, Array], tuple[Array, Array]]

#: The weakest singular value at which a configuration counts as singular.
SINGULAR = 1e-5
#: Part of the usual weakest value at which the states before a singular configuration inside a step
#: are: the one below which the core lets the path ahead be examined.
_LOOK = 0.04
#: Largest residual of a state that is on the constraints, relative to the coordinates' sizes.
_OFF = 1e-9
#: Rounding errors of the weakest value of nonzero entries, the root of an eigenvalue.
_ROUNDING = 2e-7
#: A weakest value that is clearly not zero, relative to its errors.
_CLEAR = 3.0
#: Relative accuracy of a time that is stated with its digits alone.
_ACCURATE = 1e-6
#: Number of parts of a path in which a singular configuration is searched for ...
_PARTS = 16
#: ... and length of B's path in a part relative to its chord.
_CURVED = 1.25
#: Number of states on each side used for a passage, ...
_NODES = 4
#: ... three at least, not farther than so many times the distance that is left.
_FEWEST, _REACH = 3, 8.0
#: Rows below this part of their scale, which is one millionth of their usual length, count as zero.
_VANISHING = 0.1
#: Displacement of an initial state, relative to the coordinates' size, to test for a singularity,
#: ...
ASIDE = 1e-3
#: ... of which consistent states beside a regular one keep all but its square.
_MOVES = 0.5


@dataclass(frozen=True)
class _Point:
    """A point of a path: the scaled B there, its weakest singular value and its least value on the
    constraints."""

    t: float
    scaled: Array  # or its nonzero entries
    weakest: float
    least: float


class SingularTime(NamedTuple):
    """The time at which a path is singular, or nearest to it.

    Parameters
    ----------
    time : float
        s.
    within : float
        The time that it is located to, s: at this distance, the weakest value is clearly not zero.
        Infinity if it is not certain.
    certain : bool
        Whether the path is on the constraints there. If not, the constraints may exclude the
        singular configuration, and the motion turns away before it.
    """

    time: float
    within: float
    certain: bool

    def stated(self, since: float | None = None) -> str:
        """Return the time as a text, with the digits that are known.

        Parameters
        ----------
        since : float, optional
            The time of the state that the path is extrapolated from, s.
        """
        size = math.log10(self.within)
        time = round(self.time, -math.ceil(size))
        if self.within + abs(time - self.time) <= _ACCURATE * abs(self.time):
            return f"t = {time:.9g} s"
        time = round(self.time, -math.floor(size))
        within = self.within + abs(time - self.time)
        last = -math.floor(math.log10(within))
        within = math.ceil(within * 10.0**last) / 10.0**last
        how = "" if since is None else f", extrapolated from t = {since:.9g} s"
        return f"t = {time:.9g} s (to within {within:.1g} s{how})"


class _State(NamedTuple):
    """A consistent state of the last steps, with the accelerations there."""

    t: float
    y: Array
    a: Array


@dataclass(frozen=True)
class Ahead:
    """A singular configuration that the motion approaches.

    Parameters
    ----------
    singular : SingularTime
    before : tuple of (t, y)
        The last states before it.
    path : callable
        t → q, v: their continuation, which conserves momentum.
    """

    singular: SingularTime
    before: tuple[tuple[float, Array], ...]
    path: Callable[[float], tuple[Array, Array]]


class RankWatch:
    """Examines where B loses rank, where the core says that it may.

    Parameters
    ----------
    motion : Index1
    """

    def __init__(self, motion: Index1):
        self.motion, self.rank = motion, motion.rank
        self.names = motion.evaluator.system.constraints

    def values(self, t: float, q: Array, v: Array) -> Array | None:
        """Return the singular values of the scaled B, largest first; None if undefined."""
        return self._values(self.motion.evaluator.constraints(t, q, v).jacobian)

    def _values(self, jacobian: Array) -> Array | None:
        if not np.isfinite(jacobian).all():
            return None
        return dense.singular_values(jacobian, self.motion.lengths, self.motion.sizes)

    def weakest(self, t: float, y: Array) -> float:
        """Return the singular value that vanishes at a singular configuration."""
        return self._weakest(self._rows(t, y).jacobian) if self.rank else 1.0

    def _weakest(self, jacobian: Array | SparseRows) -> float:
        """Return the same of a B; 1 if it is undefined."""
        if isinstance(jacobian, SparseRows) and not self.motion.redundant:
            scaled = self._scaled(jacobian)
            if not np.isfinite(scaled).all():
                return 1.0
            return jacobian.with_values(scaled).least_singular_value()
        values = self._values(np.asarray(jacobian))
        return 1.0 if values is None else float(values[self.rank - 1])

    def _rows(self, t: float, y: Array) -> Constraints[Array | SparseRows]:
        return self.motion.evaluator.constraint_rows(t, *self.motion.split(y))

    def _scaled(self, jacobian: Array | SparseRows) -> Array:
        """Return B times sizes over lengths, or its nonzero entries."""
        sizes, lengths = self.motion.sizes, self.motion.lengths
        if isinstance(jacobian, SparseRows):
            return jacobian.values * sizes[jacobian.column] / lengths[jacobian.row]
        return jacobian * sizes / lengths[:, None]

    # inside a step

    def singular_time(
        self, path: Path, low: float, high: float, other: Path | None = None
    ) -> SingularTime | None:
        """Return the first time between two times at which a path is singular, or None.

        No singular value changes by more than B does (Weyl). Two states between which B changes by
        less than the sum of their weakest values have no singular one between them; others are
        bisected.

        Parameters
        ----------
        path : callable
        low, high : float
            s.
        other : callable, optional
            A path from which this one differs by more than it is wrong.
        """
        resolution = _resolution(low, high)
        later = self._parts(path, low, high)
        before = now = later.pop()
        while later and now.least >= SINGULAR:
            then = later[-1]
            length = _CURVED * float(np.linalg.norm(then.scaled - now.scaled))
            if length < now.least + then.least or then.t - now.t <= resolution:
                before, now = now, later.pop()
            else:
                later.append(self._at(path, (now.t + then.t) / 2))
        if now.least >= SINGULAR:
            return None
        while later and later[-1].weakest < now.weakest:
            before, now = now, later.pop()
        now = self._nearest(path, before, now, later[-1] if later else now)
        return self._singular(path, low, high, now, other)

    def time_of_least(
        self, path: Path, low: float, high: float, other: Path | None = None
    ) -> SingularTime:
        """Return the time of the weakest state of a path between two times.

        It is that of the least of a few states. A path with several singular states has others.
        The parameters are those of `singular_time`.
        """
        points = self._parts(path, low, high)[::-1]
        i = min(range(len(points)), key=lambda i: points[i].weakest)
        before, after = points[max(0, i - 1)], points[min(i + 1, _PARTS)]
        return self._singular(path, low, high, self._nearest(path, before, points[i], after), other)

    def inside(
        self, singular: SingularTime, path: Path, since: float, usual: float, project: Project
    ) -> Ahead:
        """Return a singular configuration inside a step, with states before it.

        Parameters
        ----------
        singular : SingularTime
        path : callable
        since : float
            The time at which the step begins, s.
        usual : float
            The weakest value far from singular configurations.
        project : callable
            (t, q, v) → the nearest consistent q and v.
        """
        begin = max(self.weakest(since, path(since)), SINGULAR)
        part = min(1.0, _LOOK * max(usual, begin) / begin)
        width = max(part * (singular.time - since), singular.within)
        before = self._consistent(path, _times(singular.time, width), project)
        return Ahead(singular, tuple(before), lambda t: self.motion.split(path(t)))

    def _consistent(
        self, path: Path, times: Sequence[float], project: Project
    ) -> list[tuple[float, Array]]:
        """Return consistent states at some times of a path."""
        states = []
        for t in times:
            y = path(t)
            states.append((t, np.concatenate([*project(t, *self.motion.split(y)), y[-1:]])))
        return states

    def _parts(self, path: Path, low: float, high: float) -> list[_Point]:
        """Return equally spaced points of a path, the last one first."""
        return [self._at(path, t) for t in np.linspace(high, low, _PARTS + 1)]

    def _nearest(self, path: Path, before: _Point, now: _Point, after: _Point) -> _Point:
        """Return the weakest state of a path between two points, near a weak one."""
        # from the time found so far: the tolerance is also relative to the unknown
        since = now.t
        place, value = minimum(
            lambda x: self.weakest(since + x, path(since + x)),
            before.t - since,
            after.t - since,
            _resolution(before.t, after.t),
        )
        return self._at(path, since + place) if value < now.weakest else now

    def _singular(
        self, path: Path, low: float, high: float, at: _Point, other: Path | None
    ) -> SingularTime:
        """Return the time of the weakest state of a path between two times, with its accuracy."""
        if at.weakest >= SINGULAR or self._residual(self._rows(at.t, path(at.t))) >= _OFF:
            return SingularTime(at.t, math.inf, certain=False)
        errors = [at.weakest, _OFF if at.scaled.ndim == 2 else _ROUNDING]
        if other is not None:
            errors.append(self.weakest(at.t, other(at.t)))
        level, within = _CLEAR * max(errors), _resolution(low, high)
        while any(
            self.weakest(t, path(t)) < level
            for t in (at.t - within, at.t + within)
            if low <= t <= high
        ):
            within *= 2.0
        return SingularTime(at.t, within, certain=True)

    def _at(self, path: Path, t: float) -> _Point:
        c = self._rows(t, path(t))
        scaled = self._scaled(c.jacobian)
        weakest = self._weakest(c.jacobian) if np.isfinite(scaled).all() else math.inf
        return _Point(t, scaled, weakest, weakest - math.sqrt(2.0 * self._residual(c)))

    def _residual(self, c: Constraints[Array | SparseRows]) -> float:
        """Return the largest residual of the position constraints, as a change of the coordinates
        over their sizes.

        Where two branches of the motion miss each other by this, the weakest value is about the
        square root of its double.
        """
        lengths = self.motion.lengths[list(self.motion.evaluator.system.holonomic)]
        return float(np.abs(c.position / lengths).max(initial=0.0))

    # ahead of the last step

    def _continued(self, states: list[_State]) -> Callable[[float], tuple[Array, Array]]:
        """Return t → q, v on the polynomial through up to three states.

        Higher polynomials would amplify the rounding errors of a.
        """
        rows: list[Array] = []
        for state in states:
            rows += [*self.motion.split(state.y), state.a]
        times = [state.t for state in states for _ in range(3)]
        # of Newton's form: Σ c_k Π (t − t_j), j < k, and a last one of zero
        coefficients = [*_divided_differences(times, rows), np.zeros_like(rows[0])]

        def path(t: float) -> tuple[Array, Array]:
            product = slope = 1.0
            q, v = coefficients[:2]
            for k in range(1, len(times)):
                product *= t - times[k - 1]
                slope = (t - times[k]) * slope + product
                q = q + product * coefficients[k]
                v = v + slope * coefficients[k + 1]
            return q, v

        return path

    def ahead(
        self, states: Sequence[tuple[float, Array]], last_step: Path, project: Project
    ) -> Ahead | None:
        """Examine the path for a singular configuration that the last steps approach.

        Parameters
        ----------
        states : sequence of (t, y)
            Those at the ends of the last steps, two at least.
        last_step : callable
            The motion in the last step.
        project : callable
            (t, q, v) → the nearest consistent q and v.
        """
        (since, earlier), (t, now) = states[-2:]
        weakest = self.weakest(t, now)
        rate = (self.weakest(since, earlier) - weakest) / (t - since)
        if not rate > 0.0:
            return None
        reach = _REACH * weakest / rate
        recent = [state for state in states if t - state[0] <= reach]
        if len(recent) < _FEWEST:  # after long steps
            span = min(t - since, reach)
            inside = self._consistent(last_step, (t - span, t - span / 2), project)
            recent = [*inside, (t, now)]
        last = [
            _State(at, y, self.motion.accelerations(at, *self.motion.split(y))[0])
            for at, y in recent
        ]
        path = self._continued(last[-3:])
        other = self._continued(last[:-1])

        # in a large system, a bound of the change of B is so small that hundreds of states would be
        # examined after each step; what is missed here is found inside the step
        large = isinstance(self._rows(t, now).jacobian, SparseRows)
        search = self.time_of_least if large else self.singular_time
        singular = search(
            lambda at: np.concatenate(path(at)),
            t,
            t + 3 * weakest / rate,
            lambda at: np.concatenate(other(at)),
        )
        if singular is None or not singular.certain:
            return None
        if singular.within > singular.time - t:
            return None  # a state that is nearer will tell the time better
        times = _times(singular.time, _NODES * (singular.time - t))
        before = self._consistent(last_step, times, project) if since <= times[0] else recent
        return Ahead(singular, tuple(before), path)

    # messages of stopped runs

    def stop(
        self, singular: SingularTime, q: Array, v: Array, advice: str, since: float | None = None
    ) -> Stop:
        """Return the end of a run at a singular configuration.

        Parameters
        ----------
        singular : SingularTime
        q, v : (nq,) arrays
            The state there.
        advice : str
        since : float, optional
            As for `SingularTime.stated`.
        """
        why = _dependency(self._dependent(singular.time, q, v), "become")
        at = singular.stated(since)
        return Stop(f"singular configuration at {at}: {why} the motion; {advice}")

    def floor(self, t: float, y: Array) -> Stop:
        """Return the end of a run whose step size fell to the floor near a singular
        configuration."""
        why = _dependency(self._dependent(t, *self.motion.split(y)), "become")
        return Stop(
            f"the step size fell to its minimum at t = {t:.9g} s, next to a singular"
            f" configuration: {why} the motion"
        )

    def check_redundancy(self, t: float, y: Array) -> None:
        """Stop if redundant constraints contradict each other at a state on them."""
        worst = self.motion.contradicting(t, *self.motion.split(y))
        if worst is not None:
            raise Stop(
                f"the redundant constraints contradict each other at t = {t:.9g} s: they cannot"
                f" all hold with `{self.names[worst]}`; correct or remove one of them"
            )

    def check_start(self, t: float, q: Array, v: Array, project: Projection) -> None:
        """Stop if the initial state is singular.

        B has a higher rank at nearby consistent states, or there are none where B allows a motion:
        constraints that touch have equal gradients, but hold only together. Otherwise the
        constraints are redundant everywhere.
        """
        c = self.motion.evaluator.constraints(t, q, v)
        if self.rank == self.motion.nc or not c.finite:
            return
        gone = self._vanishing(c.jacobian)
        free = self.motion.decompose(c.jacobian).null  # of unit size, each direction
        size = ASIDE * (np.abs(q / self.motion.sizes).max(initial=0.0) or self._length(c))
        # branches may lie between the directions, so a mixture of all is tried too
        mixture = free @ np.cos(1.0 + np.arange(free.shape[1]))
        for direction in (*free.T, mixture):
            along = direction / self.motion.sizes
            length = along @ along
            moved = 0.0  # part of the displacement that the constraints allow
            for side in (-size, size):
                try:
                    beside, _ = project(t, q + side * direction, v)
                except Stop:
                    continue
                kept = along @ ((beside - q) / self.motion.sizes)
                moved = max(moved, float(kept / (side * length))) if length else 1.0
                values = self.values(t, beside, v)
                jacobian = self.motion.evaluator.constraints(t, beside, v).jacobian
                gone &= self._vanishing(jacobian)
                # near a singular point the weakest value is proportional to the distance
                if values is not None and self.rank < len(values) and values[self.rank] > SINGULAR:
                    raise _start_stop(self._dependent(t, q, v, self.rank))
            if moved < _MOVES:
                raise _touching(self._dependent(t, q, v, self.rank))
        if gone:
            raise _start_stop([self.names[i] for i in sorted(gone)], _no_gradient)

    def _vanishing(self, jacobian: Array) -> set[int]:
        """Return the rows of B that are zero except for rounding errors."""
        own = lengths_of_rows(jacobian, self.motion.sizes)
        return set(np.flatnonzero((own == 0.0) | (own < _VANISHING * self.motion.lengths)).tolist())

    def _length(self, c: Constraints[Array]) -> float:
        """Return the size of the constraints' terms as a change of the coordinates."""
        lengths = self.motion.lengths[list(self.motion.evaluator.system.holonomic)]
        return float((c.position_scale / lengths).max(initial=0.0)) or 1.0

    def _dependent(self, t: float, q: Array, v: Array, rank: int | None = None) -> list[str]:
        """Return the constraints that depend on each other at a state, by default one where the
        rank falls by one."""
        rank = max(0, self.rank - 1) if rank is None else rank
        jacobian = self.motion.evaluator.constraints(t, q, v).jacobian
        scaled = self._scaled(jacobian)
        u, _, _ = np.linalg.svd(scaled)
        parts = np.abs(u[:, rank:]).max(axis=1)
        return [name for name, x in zip(self.names, parts, strict=True) if x > 0.05]


def _divided_differences(times: Sequence[float], rows: Sequence[Array]) -> list[Array]:
    """Return the coefficients of the polynomial in Newton's form with given values and derivatives.

    Parameters
    ----------
    times : (n,) sequence of float
        Each as often as there are rows of it.
    rows : (n,) sequence of arrays
        Value, first and second derivative at each time.
    """
    first = [times.index(t) for t in times]  # the row of the value
    column = [rows[i] for i in first]
    found = [column[0]]
    for k in range(1, len(rows)):
        column = [
            rows[first[i] + k] / math.factorial(k)
            if times[i] == times[i + k]
            else (column[i + 1] - column[i]) / (times[i + k] - times[i])
            for i in range(len(rows) - k)
        ]
        found.append(column[0])
    return found


def _times(singular: float, width: float) -> list[float]:
    """Return times at equal distances before a singular configuration."""
    return [singular - width * k / _NODES for k in range(_NODES, 0, -1)]


def _resolution(low: float, high: float) -> float:
    """Return the smallest difference of times between two that matters."""
    return 1e-12 * max(abs(high), high - low)


def _listed(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _no_gradient(names: list[str]) -> str:
    if len(names) == 1:
        return f"the constraint {_listed(names)} has no gradient there and does not determine"
    return f"the constraints {_listed(names)} have no gradient there and do not determine"


def _dependency(names: list[str], verb: str = "are") -> str:
    if len(names) == 1:
        return _no_gradient(names)
    return f"the constraints {_listed(names)} {verb} dependent there and do not determine"


def _start_stop(names: list[str], why: Callable[[list[str]], str] = _dependency) -> Stop:
    return Stop(
        f"the start is a singular configuration: {why(names)} how the motion begins;"
        " start away from it",
        constraints=tuple(names),
    )


def _touching(names: list[str]) -> Stop:
    if len(names) == 1:
        return _start_stop(names)
    return Stop(
        f"the start is a singular configuration: the constraints {_listed(names)} are dependent"
        " there, but do not allow the motion that their gradients allow, so that their forces"
        " cannot be computed; change a length, or remove one of them",
        constraints=tuple(names),
    )


#: Largest number of iterations, ...
_ITERATIONS = 30
#: ... which end when the states after the configuration change by less than this, relatively and as
#: far as they affect the passage, ...
_SETTLED = 1e-12
#: ... or, after the first ones, no longer by less than this part of the change before: what is left
#: are rounding errors. The iteration contracts with the square of the passage's duration.
_CONTRACTS = 0.5
_FIRST = 2
#: Largest change at the end of the iteration; beyond it, the motion continues on another branch.
_CONTINUED = 1e-6


class Crossing:
    """The motion across a singular configuration.

    Parameters
    ----------
    motion : Index1
    project : callable
        (t, q, v) → the nearest consistent state.
    before : sequence of (t, y)
        The last states before the configuration.
    singular : float
        Its time, s.
    guess : callable
        t → q, v: a first continuation.

    Raises
    ------
    Stop
        There is no smooth continuation.
    """

    def __init__(
        self,
        motion: Index1,
        project: Project,
        before: Sequence[tuple[float, Array]],
        singular: float,
        guess: Callable[[float], tuple[Array, Array]],
    ):
        self.motion, self.project, self.singular = motion, project, singular
        self.since, y = before[-1]
        self.end = 2 * singular - self.since
        self.q, self.v = motion.split(y)
        self.work = float(y[-1])
        known = [self._unknowns(t, *motion.split(y)) for t, y in before]
        # mirrored in time, nearest first
        times = [2 * singular - t for t, _ in reversed(before)]
        places = [self._scaled(t) for t in [*(t for t, _ in before), *times]]
        matrix = polyvander(places, len(places) - 1)
        states = [project(t, *guess(t)) for t in times]
        # Between the nearest states, the polynomials of the others are about (nearest/distance)².
        # Without these factors, a step that ends by chance next to the configuration would stop the
        # run: the farther states multiply the rounding errors of its a by distance/nearest.
        effects = [((self.end - singular) / (t - singular)) ** 2 for t in times]
        moved = math.inf
        for k in range(_ITERATIONS):
            values = known + [self._unknowns(t, *s) for t, s in zip(times, states, strict=True)]
            self._integrate(np.asarray(np.linalg.solve(matrix, np.array(values)), dtype=float))
            last, states = states, [project(t, *self(t)[:2]) for t in times]
            moved_before = moved
            moved = max(
                effect * _distance(a, b, motion.sizes)
                for effect, a, b in zip(effects, states, last, strict=True)
            )
            ends = k >= _FIRST and not moved <= _CONTRACTS * moved_before
            if ends or moved <= _SETTLED:
                break
        if not moved <= _CONTINUED:
            raise self._no_continuation()
        self.state = np.concatenate([*states[0], [self(self.end)[4]]])

    def _scaled(self, t: float) -> float:
        return (t - self.since) / (self.singular - self.since)

    def _unknowns(self, t: float, q: Array, v: Array) -> Array:
        """Return a, λ and the power at a state."""
        a, multipliers, power = self.motion.accelerations(t, q, v)
        if not np.isfinite(a).all():
            raise self._no_continuation()
        return np.concatenate([a, multipliers, [power]])

    def _integrate(self, coefficients: Array) -> None:
        nq, unit = self.motion.nq, self.singular - self.since
        a, power = coefficients[:, :nq], coefficients[:, -1:]
        v = polyint(a, k=[0], scl=unit, axis=0)
        v[0] += self.v
        q = polyint(v, scl=unit, axis=0)
        q[0] += self.q
        w = polyint(power, scl=unit, axis=0)
        w[0] += self.work
        self._polynomials = q, v, a, coefficients[:, nq:-1], w

    def __call__(self, t: float) -> tuple[Array, Array, Array, Array, float]:
        """Return q, v, a, λ and the work at a time between the states."""
        s = self._scaled(t)
        q, v, a, multipliers, work = (
            np.asarray(polyval(s, c), dtype=float) for c in self._polynomials
        )
        return q, v, a, multipliers, float(work[0])

    def _no_continuation(self) -> Stop:
        return Stop(
            "the motion cannot be continued through the singular configuration at"
            f" t = {self.singular:.9g} s; try a smaller --rtol"
        )


def _distance(one: tuple[Array, Array], other: tuple[Array, Array], sizes: Array) -> float:
    """Return the largest difference of q and v, relative to the largest of all."""
    return max(
        float(np.abs((a - b) / sizes).max() / (np.abs(b / sizes).max() or 1.0))
        for a, b in zip(one, other, strict=True)
    )
