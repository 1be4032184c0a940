"""Pseudo-arclength continuation of one branch, and the location of its special points."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from lagcli.analysis.equilibria.stability import Stability, Verdict, stability_of
from lagcli.analysis.local.contacts import ZERO, ContactEnd
from lagcli.analysis.local.gradients import Gradients, ParameterPath
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.steady import ACCEPTED, RANK, Condition, Residual, SteadyProblem
from lagcli.arrays import Array
from lagcli.errors import UsageError

_ITERATIONS = 12
_REACHED = 1e-13  # relative to the magnitudes of the terms


class ModelParameter:
    """A parameter of the model, with the parameters that depend on it.

    Raises
    ------
    UsageError
        As `ParameterPath`.
    """

    def __init__(self, local: LocalEquations, name: str):
        from lagcli.equations.derivation.jacobians import differentiate_parameters

        self.name, self.local = name, local
        self.path = ParameterPath(local.model, name)
        derivatives = differentiate_parameters(local.equations, self.path.followers)
        groups = (derivatives.force, derivatives.rhs, derivatives.position, derivatives.velocity)
        count = len(derivatives.parameters)
        self._gradients = [Gradients(local.equations, rows, count) for rows in groups]
        self._of_conditions: dict[str, Gradients] = {}

    def problem(self, base: SteadyProblem, value: float) -> tuple[SteadyProblem, tuple[float, ...]]:
        """Return the steady problem and the parameters for a value."""
        return base, self.path.values(self.local.p, value)

    def slope(self, problem: SteadyProblem, residual: Residual, value: float) -> Array:
        """Return ∂R/∂s, (nq + nh,)."""
        along = self.path.slopes(value)
        force, rates, position, velocity = (g.at(residual.point) @ along for g in self._gradients)
        jac = self.local.jacobians(residual.point)
        dv, da = problem.by_parameter(residual, jac, velocity, rates)
        force = force + (jac.force_velocity @ dv - residual.dynamics.mass_matrix @ da)[:, 0]
        more = [
            self._by_parameter(condition).at(residual.point)[0] @ along
            + condition.slopes(residual.point, residual.speeds)[1] @ dv[:, 0]
            for condition in problem.conditions
        ]
        return np.concatenate([force, position, more])

    def _by_parameter(self, condition: Condition) -> Gradients:
        """Return the derivatives of a condition with respect to the parameters that change."""
        import symengine as se

        if condition.text not in self._of_conditions:
            measured = condition.measured
            expression = se.Integer(0) if measured is None else measured.expression
            symbols = [se.Symbol(name) for name in self.path.followers]
            gradients = Gradients.of(self.local.equations, [expression], symbols)
            self._of_conditions[condition.text] = gradients
        return self._of_conditions[condition.text]


class HeldVelocity:
    """A prescribed velocity as the parameter of steady motions."""

    def __init__(self, local: LocalEquations, coordinate: str):
        self.name, self.local, self.coordinate = f"{coordinate}'", local, coordinate
        self.index = local.system.coordinates.index(coordinate)

    def problem(self, base: SteadyProblem, value: float) -> tuple[SteadyProblem, tuple[float, ...]]:
        """Return the steady problem and the parameters for a value."""
        names = self.local.system.coordinates
        held = {names[j]: x for j, x in base.held.items()}
        problem = SteadyProblem(
            self.local, {**held, self.coordinate: value}, base.unknown, base.conditions
        )
        return problem, self.local.p

    def slope(self, problem: SteadyProblem, residual: Residual, value: float) -> Array:
        """Return ∂R/∂s, (nq + nh,)."""
        if self.index not in residual.independent:
            raise UsageError(
                f"--along {self.name}: the constraints determine this velocity; take another one"
            )
        jac = self.local.jacobians(residual.point)
        dv = residual.basis[:, [residual.independent.index(self.index)]]
        da = problem.changed(residual, jac.rhs_velocity @ dv)
        force = (jac.force_velocity @ dv - residual.dynamics.mass_matrix @ da)[:, 0]
        slopes = [
            c.slopes(residual.point, residual.speeds)[1] @ dv[:, 0] for c in problem.conditions
        ]
        return np.concatenate([force, np.zeros(len(problem.holonomic)), slopes])


class ConditionValue:
    """The value of a condition on steady motions.

    Parameters
    ----------
    local : LocalEquations
    name : str
    number : int
        The place of the condition.
    """

    def __init__(self, local: LocalEquations, name: str, number: int):
        self.local, self.name, self.number = local, name, number

    def problem(self, base: SteadyProblem, value: float) -> tuple[SteadyProblem, tuple[float, ...]]:
        """Return the steady problem and the parameters for a value."""
        return base.with_target(self.number, value), self.local.p

    def slope(self, problem: SteadyProblem, residual: Residual, value: float) -> Array:
        """Return ∂R/∂s, (nq + nh + conditions,)."""
        slope = np.zeros(len(residual.value))
        slope[problem.nq + len(problem.holonomic) + self.number] = -1.0
        return slope


class Place(NamedTuple):
    """A point of a branch, in scaled unknowns z = (q, λ, s).

    Parameters
    ----------
    z : (n,) array
    residual : Residual
    matrix : (m, n) array
        The scaled ∂R/∂z.
    """

    z: Array
    residual: Residual
    matrix: Array


class ExtendedProblem:
    """R(q, λ, s) = 0 with scaled unknowns and equations.

    Unknown speeds are between λ and the parameter s.

    Parameters
    ----------
    base : SteadyProblem
    parameter : ModelParameter, HeldVelocity or ConditionValue
    width : float
        Scale of changes of s.
    first : Residual
        A root, which defines the scales.
    value : float
        s there.
    """

    def __init__(
        self,
        base: SteadyProblem,
        parameter: ModelParameter | HeldVelocity | ConditionValue,
        width: float,
        first: Residual,
        value: float,
    ):
        self.base, self.parameter, self.local = base, parameter, base.local
        self.nq, self.chosen = base.nq, first.independent
        problem, _ = parameter.problem(base, value)
        lengths, matrix = self.local.lengths, problem.jacobian(first)
        stiffness = np.abs(matrix[: self.nq, : self.nq] * np.outer(lengths, lengths)).max()
        rows = np.abs(first.dynamics.jacobian) @ lengths
        rows = np.where(rows > 0.0, rows, 1.0)
        force = max(
            float(stiffness), float((rows * np.abs(first.point.multipliers)).max(initial=0))
        )
        force = force or 1.0
        speeds = problem.speed_scales(first) if len(first.speeds) else np.empty(0)
        self.columns = np.concatenate([lengths, force / rows, speeds, [width]])
        held = list(self.local.system.holonomic)
        more = np.abs(matrix[self.nq + len(held) :] * self.columns[:-1]).max(axis=1, initial=0.0)
        more = 1.0 / np.where(more > 0.0, more, 1.0)
        self.rows = np.concatenate([lengths / force, 1.0 / rows[held], more])

    def scaled(self, residual: Residual, value: float) -> Array:
        """Return z of a root."""
        return np.asarray(
            np.concatenate([residual.point.q, residual.point.multipliers, residual.speeds, [value]])
            / self.columns
        )

    def value(self, z: Array) -> float:
        """Return s."""
        return float(z[-1] * self.columns[-1])

    def residual(self, z: Array) -> tuple[SteadyProblem, Residual]:
        """Return R at z, and the steady problem at its parameter."""
        unknowns = z * self.columns
        problem, p = self.parameter.problem(self.base, float(unknowns[-1]))
        end = self.nq + len(self.local.system.constraints)
        q, multipliers, speeds = unknowns[: self.nq], unknowns[self.nq : end], unknowns[end:-1]
        return problem, problem.residual(q, multipliers, p, self.chosen, speeds)

    def place(self, z: Array) -> Place | None:
        """Return the matrix and residual at z; None where they are undefined."""
        problem, residual = self.residual(z)
        if not np.isfinite(residual.value).all():
            return None
        slope = self.parameter.slope(problem, residual, self.value(z))
        matrix = np.column_stack([problem.jacobian(residual), slope])
        with np.errstate(over="ignore"):
            matrix = matrix * np.outer(self.rows, self.columns)
        return Place(z, residual, matrix) if np.isfinite(matrix).all() else None

    def correct(
        self, z: Array, tangent: Array, rank: int, frame: Frame | None = None
    ) -> tuple[Place, int] | None:
        """Return the root in the plane through z normal to a tangent, and the number of Newton
        steps.

        Parameters
        ----------
        z : (n,) array
        tangent : (n,) array
        rank : int
            Rank of ∂R/∂z along the branch.
        frame : Frame, optional
            Null spaces next to the root: steps are normal to the neutral motions. Without it, they
            have the least norm, and beside a branch point a neutral motion may be stiffer than the
            one that loses its stiffness there.
        """
        target = tangent @ z
        for iteration in range(_ITERATIONS):
            place = self.place(z)
            if place is None:
                return None
            near = 1e-12 * max(1.0, np.abs(z).max())
            if place.residual.relative <= _REACHED and abs(tangent @ z - target) <= near:
                return place, iteration
            right = np.concatenate([self.rows * place.residual.value, [tangent @ z - target]])
            if frame is None or not frame.right.size:
                step = _solved(np.vstack([place.matrix, tangent]), right, rank + 1)
            else:
                more = np.zeros(frame.right.shape[1])
                system = _bordered(place.matrix, tangent, frame)
                try:
                    step = np.linalg.solve(system, np.concatenate([right, more]))[: len(z)]
                except np.linalg.LinAlgError:
                    return None
            if not np.isfinite(step).all() or np.abs(step).max() > 1.0:
                return None
            z = z - step
            if np.abs(step).max() < 1e-14 * max(1.0, np.abs(z).max()):
                break
        place = self.place(z)
        if place is None or not place.residual.relative <= ACCEPTED:
            return None
        return place, _ITERATIONS


def _bordered(matrix: Array, tangent: Array, frame: Frame) -> Array:
    """Return ∂R/∂z with a tangent and null spaces as further rows and columns: a square matrix."""
    below = np.vstack([tangent, frame.right.T])
    corner = np.zeros((len(below), frame.left.shape[1]))
    return np.vstack([np.hstack([matrix, frame.left]), np.hstack([below, corner])])


def _solved(matrix: Array, right: Array, rank: int) -> Array:
    """Return the solution of least norm of a system of given rank."""
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(vt[:rank].T @ ((u[:, :rank].T @ right) / s[:rank]))


SpecialKind = Literal[
    "fold",
    "branch point",
    "Hopf point",
    "flutter",
    "divergence",
    "stability change",
    ContactEnd,
]

#: Lengths of steps in scaled unknowns: first, longest and shortest. The longest is this part of the
#: distance travelled, if that is more than 1, where the size of coordinates is not known.
_FIRST, _LONGEST, _SHORTEST = 5e-3, 2e-2, 1e-7
_TURN = 0.9  # smallest cosine of the angle between successive tangents
_MOST = 2000  # largest number of points of a branch
#: Components of the tangent along the parameter that are rounding errors, and the number of
#: successive points with such tangents from which on a branch is a line of equilibria, unless the
#: parameter changes within this distance.
_VERTICAL, LINE, _FAR = 1e-9, 50, 1e4
#: Special points closer than this part of the step explain a change of stability; a verdict that
#: changes closer than this to a point holds at this point alone.
_EXPLAINED, _SINGLE = 1e-2, 1e-6
_BESIDE = 1e-3  # distance of the points for interpolating special points, relative to the step
#: Halvings that locate a change: to rounding errors, and to a part of `_EXPLAINED`.
_BISECTIONS, _ROUGH = 60, 10


class Traced(NamedTuple):
    """A point of a branch, with the quantities monitored along it.

    Parameters
    ----------
    place : Place
    tangent : (n,) array
        Tangent of length 1.
    frame : Frame
    """

    place: Place
    tangent: Array
    frame: Frame


class Frame(NamedTuple):
    """Null spaces of the scaled ∂R/∂z: neutral motions without the tangent, dependent equations."""

    right: Array
    left: Array


class _Stretch(NamedTuple):
    """Successive points of a branch, and the distance of the second along the tangent of the
    first."""

    before: Traced
    after: Traced
    length: float

    def guess(self, distance: float) -> Array:
        """Return z at a distance by Hermite's cubic.

        Beside a branch point, the tangent of the first point may lead to the other branch.
        """
        x, along = distance / self.length, self.before.tangent
        slope = self.after.tangent / (along @ self.after.tangent)
        chord = (self.after.place.z - self.before.place.z) / self.length
        bend = (1 - x) * (along - chord) + x * (chord - slope)
        return np.asarray(self.before.place.z + distance * (chord + (1 - x) * bend))


class _Bracket(NamedTuple):
    """Distances from a point of a branch before and after a change, and the point of the former."""

    low: float
    high: float
    point: Traced


class LocatedPoint(NamedTuple):
    """A special point of a branch, the point of the branch there, and the contact that changes.

    `change` are the verdicts of stability before and after it, where they differ.
    """

    kind: SpecialKind
    point: Traced
    contact: str | None = None
    change: tuple[Verdict, Verdict] | None = None


class Tracer:
    """Tracer of the branches of one extended problem.

    Parameters
    ----------
    problem : ExtendedProblem
    limits : (float, float)
        Range of the parameter.
    rank : int
        Rank of ∂R/∂z along the branches.
    """

    def __init__(self, problem: ExtendedProblem, limits: tuple[float, float], rank: int):
        self.problem, self.limits, self.rank = problem, limits, rank
        self.neutral = len(problem.columns) - rank - 1

    @classmethod
    def at(cls, problem: ExtendedProblem, limits: tuple[float, float], first: Array) -> Tracer:
        """Return a tracer for branches of the rank at a root, in scaled unknowns."""
        place = problem.place(first)
        assert place is not None
        s = np.linalg.svd(place.matrix, compute_uv=False)
        return cls(problem, limits, int((s > RANK * s.max(initial=0.0)).sum()))

    def with_rank(self, rank: int) -> Tracer:
        """Return a tracer for branches of another rank."""
        return self if rank == self.rank else Tracer(self.problem, self.limits, rank)

    # single points

    def framed(self, place: Place, along: Array, before: Frame | None = None) -> Traced:
        """Return the point with its tangent close to a direction.

        The tangent and the null spaces are those of the previous point, projected. Beside a branch
        point singular values do not tell a neutral motion from the one that loses its stiffness;
        the bordered matrix does.
        """
        if before is not None and self.neutral:
            bordered = self._framed_by_border(place, along, before)
            if bordered is not None:
                return bordered
        u, _, vt = np.linalg.svd(place.matrix)
        null, left = vt[self.rank :].T, u[:, self.rank :]
        tangent = null @ (null.T @ along)
        tangent /= np.linalg.norm(tangent)
        rest = null - np.outer(tangent, tangent @ null)
        right, _, _ = np.linalg.svd(rest, full_matrices=False)
        right = right[:, : self.neutral]
        if before is not None:
            right, left = _nearest(right, before.right), _nearest(left, before.left)
        return Traced(place, tangent, Frame(right, left))

    def _framed_by_border(self, place: Place, along: Array, before: Frame) -> Traced | None:
        """Return the point with its tangent and null spaces; None where the border leaves the
        matrix singular."""
        system = _bordered(place.matrix, along, before)
        rows, columns = place.matrix.shape
        one: Array = np.eye(len(system))
        try:
            null = np.linalg.solve(system, one[:, rows:])[:columns]
            left = np.asarray(np.linalg.solve(system.T, one[:, columns:])[:rows], dtype=float)
        except np.linalg.LinAlgError:
            return None
        tangent = null[:, 0] / np.linalg.norm(null[:, 0])
        right = np.asarray(null[:, 1:] - np.outer(tangent, tangent @ null[:, 1:]), dtype=float)
        frame = Frame(_nearest(right, before.right), _nearest(left, before.left))
        return Traced(place, tangent, frame)

    def start(self, z: Array, direction: float) -> Traced:
        """Return a root with the tangent along which the parameter changes in a direction."""
        place = self.problem.place(z)
        assert place is not None
        _, _, vt = np.linalg.svd(place.matrix)
        null = vt[self.rank :].T
        # the branch has no component along motions that are neutral at a fixed parameter
        along = null @ null[-1]
        if not np.linalg.norm(along) > 1e-12:
            along = null[:, 0]
        return self.framed(place, direction * along)

    def advanced(
        self, point: Traced, length: float, guess: Array | None = None
    ) -> tuple[Traced, int] | None:
        """Return the next point of a branch, and the number of Newton steps; None if there is
        none.

        Newton's method begins on the tangent, or with a guess.
        """
        z = point.place.z + length * point.tangent if guess is None else guess
        corrected = self.problem.correct(z, point.tangent, self.rank, point.frame)
        if corrected is None:
            return None
        place, steps = corrected
        return self.framed(place, point.tangent, point.frame), steps

    def stability(self, point: Traced) -> Stability:
        """Return the stability of a point."""
        local, residual = self.problem.local, point.place.residual
        operating = self.problem.base.operating_point(residual, "the equilibrium")
        if (
            operating.frame is None
            and np.any(residual.point.v)
            and not local.is_steady(residual.point, operating.tangent)
        ):
            # a vehicle that turns: x' is held, but other velocities are constant
            constant = local.constant_velocities(residual.point)
            operating = replace(operating, tangent=local.tangent(residual.point, constant))
        # along a line of equilibria its tangent is neutral, too
        dimension = self.neutral + int(vertical(point))
        return stability_of(local, operating, dimension)

    # branches

    def follow(self, point: Traced) -> Iterator[tuple[Traced, Stability, list[LocatedPoint]]]:
        """Yield the points of a branch, each with the special points before it.

        It ends when the parameter leaves its range, when a contact changes, when no further point
        is found, when the branch closes, or when it is a line of equilibria at one value of the
        parameter.
        """
        before, stability = point, self.stability(point)
        yield point, stability, []
        length, origin, travelled, upright = _FIRST, point, 0.0, 0
        for _ in range(_MOST):
            moved = self._step(before, length)
            if moved is None:
                return
            after, used, steps = moved
            last = self._leaves(after)
            if last:
                after, used = self._at_limit(_Stretch(before, after, used))
            ended = self._contact_end(_Stretch(before, after, used))
            if ended is not None:
                after, used = (
                    ended.point,
                    float(before.tangent @ (ended.point.place.z - before.place.z)),
                )
            following = self.stability(after)
            special = list(self._changes(_Stretch(before, after, used), stability, following))
            if ended is not None:
                yield after, following, [*special, ended]
                return
            yield after, following, special
            upright = upright + 1 if vertical(before) and vertical(after) else 0
            travelled += used
            if upright == LINE and not self.turned(after, after.place.z[-1]):
                return
            closed = np.linalg.norm(after.place.z - origin.place.z) < used / 2
            if last or (closed and travelled > 4 * _LONGEST and after.tangent @ origin.tangent > 0):
                return
            before, stability = after, following
            longest = _LONGEST * max(1.0, travelled) if self.problem.local.unsized else _LONGEST
            length = min(longest, used * (1.5 if steps <= 4 else 1.0))

    def _contact_end(self, stretch: _Stretch) -> LocatedPoint | None:
        """Return the point at which the first contact changes between two points, if one does."""
        local = self.problem.local

        def margins(x: Traced) -> Array:
            return local.margins(x.place.residual.point)

        after = margins(stretch.after)
        if not (after < -ZERO).any():
            return None
        _, last = self._bisected(stretch, lambda x: bool((margins(x) < 0.0).any()))
        row = int(np.argmin(after / np.maximum(margins(last) - after, ZERO)))
        kind, name = local.contact_end(row)
        return LocatedPoint(kind, last, name)

    def _step(self, point: Traced, length: float) -> tuple[Traced, float, int] | None:
        while length >= _SHORTEST:
            moved = self.advanced(point, length)
            if moved is not None and moved[0].tangent @ point.tangent >= _TURN:
                return moved[0], length, moved[1]
            length /= 2
        return None

    def turned(self, point: Traced, start: float) -> float:
        """Return the change of the scaled parameter along a branch, 0 for a line of equilibria.

        Where all coordinates are zero their size is not known, and the branch may bend little
        beside the point.
        """
        if not self.problem.local.unsized:
            return 0.0
        travelled, length = 0.0, _LONGEST
        while travelled < _FAR:
            moved = self._step(point, length)
            if moved is None:
                break
            point, used, _ = moved
            change = float(point.place.z[-1] - start)
            if abs(change) > 2 * _VERTICAL:
                return change
            travelled += used
            length = 2 * used
        return 0.0

    def _leaves(self, point: Traced) -> bool:
        low, high = sorted(self.limits)
        # on a line of equilibria at a limit, rounding errors do not leave the range
        margin = _VERTICAL * (high - low) if vertical(point) else 0.0
        return not low - margin <= self.problem.value(point.place.z) <= high + margin

    def _between(self, stretch: _Stretch, distance: float) -> Traced | None:
        """Return the point at a distance along the first point's tangent; None if there is none."""
        moved = self.advanced(stretch.before, distance, stretch.guess(distance))
        return None if moved is None else moved[0]

    def _at_limit(self, stretch: _Stretch) -> tuple[Traced, float]:
        """Return the point at which the parameter reaches its limit."""
        inside, last = self._bisected(stretch, self._leaves)
        return last, inside

    def _bisected(
        self, stretch: _Stretch, changed: Callable[[Traced], bool]
    ) -> tuple[float, Traced]:
        """Return the position of a change by bisection, and the point there."""
        whole = _Bracket(0.0, stretch.length, stretch.before)
        last = self._halved(stretch, whole, changed, _BISECTIONS)
        return last.low, last.point

    def _halved(
        self, stretch: _Stretch, bracket: _Bracket, changed: Callable[[Traced], bool], times: int
    ) -> _Bracket:
        """Return the part of a bracket in which a change is, after some halvings."""
        low, high, last = bracket
        for _ in range(times):
            middle = (low + high) / 2
            if middle in (low, high):
                break
            point = self._between(stretch, middle)
            if point is not None and not changed(point):
                low, last = middle, point
            else:
                high = middle
        return _Bracket(low, high, last)

    # special points

    def _changes(
        self, stretch: _Stretch, stable: Stability, following: Stability
    ) -> Iterator[LocatedPoint]:
        """Yield the special points between two points, located, in their order."""
        located = sorted(
            self._special(stretch, stable, following),
            key=lambda x: float(stretch.before.tangent @ x.point.place.z),
        )
        verdict = stable.verdict
        for number, special in enumerate(located):
            if number + 1 < len(located):
                middle = self._halfway(stretch, special, located[number + 1])
                reached = verdict if middle is None else self.stability(middle).verdict
            else:
                reached = following.verdict
            yield special._replace(change=None if reached == verdict else (verdict, reached))
            verdict = reached

    def _halfway(self, stretch: _Stretch, one: LocatedPoint, other: LocatedPoint) -> Traced | None:
        """Return the point of the branch halfway between two special points."""
        middle = (one.point.place.z + other.point.place.z) / 2
        before = stretch.before
        return self._between(stretch, float(before.tangent @ (middle - before.place.z)))

    def _special(
        self, stretch: _Stretch, stable: Stability, following: Stability
    ) -> list[LocatedPoint]:
        """Return the special points between two points, located."""
        located: list[LocatedPoint] = []
        before, after, _ = stretch
        level = vertical(before) and vertical(after)
        if not level and before.tangent[-1] * after.tangent[-1] < 0:
            sign = np.sign(before.tangent[-1])
            turned = self._bisected(stretch, lambda x: sign * x.tangent[-1] < 0)
            located.append(LocatedPoint("fold", turned[1]))
        crossing = self._determinant(before)
        if not level and crossing(after) < 0:
            located.append(LocatedPoint("branch point", self._root(stretch, crossing)))
        was, now = _growing(stable), _growing(following)
        # where real eigenvalues coincide, an oscillation begins that grew before
        if np.isfinite(was) and np.isfinite(now) and (was > 0) != (now > 0):
            if min(was, now) == 0.0:
                _, changed = self._bisected(
                    stretch, lambda x: (_growing(self.stability(x)) > 0) != (was > 0)
                )
                refined = self._refined(stretch, changed, 1 if now > 0 else -1)
                located.append(LocatedPoint("flutter", refined))
            else:
                point = self._root(stretch, lambda x: _growth(self.stability(x)))
                located.append(LocatedPoint("Hopf point", point))
        if stable.verdict != following.verdict:
            located += self._verdict_changes(stretch, stable, following, located)
        return located

    def _verdict_changes(
        self,
        stretch: _Stretch,
        stable: Stability,
        following: Stability,
        known: list[LocatedPoint],
    ) -> list[LocatedPoint]:
        """Return where the verdict changes between two points without a known special point."""
        changes: list[LocatedPoint] = []
        before, _, length = stretch
        # the first and the last change; a narrow range between them may be undecided
        for verdict, same in ((stable.verdict, True), (following.verdict, False)):

            def changed(x: Traced, verdict: Verdict = verdict, same: bool = same) -> bool:
                return (self.stability(x).verdict == verdict) != same

            near = [x.point.place.z for x in (*known, *changes)]
            rough = self._halved(stretch, _Bracket(0.0, length, before), changed, _ROUGH)
            # what follows moves it by less than the other half
            z = rough.point.place.z
            if any(np.linalg.norm(z - other) < _EXPLAINED / 2 * length for other in near):
                continue
            point = self._halved(stretch, rough, changed, _BISECTIONS - _ROUGH).point
            if "unstable" in (stable.verdict, following.verdict):
                side = 1 if following.verdict == "unstable" else -1
                point = self._refined(stretch, point, side)
            far = all(np.linalg.norm(point.place.z - z) > _EXPLAINED * length for z in near)
            # the verdict of the first point alone, if it is an exceptional one, is no change
            if far and np.linalg.norm(point.place.z - before.place.z) > _SINGLE * length:
                growing = "unstable" in (stable.verdict, following.verdict)
                real = growing and not any(_oscillates(x) for x in (stable, following))
                kind: SpecialKind = "divergence" if real else "stability change"
                changes.append(LocatedPoint(kind, point))
        return changes

    def _refined(self, stretch: _Stretch, point: Traced, side: int) -> Traced:
        """Return the point at which the growth rate vanishes, extrapolated from one side.

        Beside it, rounding errors of eigenvalues are larger than these. The growth rate, or its
        square where a pair of eigenvalues meets, is a smooth function of the distance.
        """
        before, _, length = stretch
        near = float(before.tangent @ (point.place.z - before.place.z))
        beside = [near + side * k * _BESIDE * length for k in (1, 2, 3, 4)]
        points = [x for x in (self._between(stretch, d) for d in beside) if x is not None]
        if len(points) < 4:
            return point
        stability = [self.stability(x) for x in points]
        rates = np.array([x.eigenvalues.real.max(initial=-np.inf) for x in stability])
        if not (rates > max(x.rounding for x in stability)).all():
            return point
        power = round(1 / np.log2(rates[3] / rates[1])) if rates[3] > rates[1] else 0
        if power not in (1, 2):
            return point
        z = _at_zero((rates**power).tolist(), np.array([x.place.z for x in points]))
        place = self.problem.place(z)
        if place is None or np.linalg.norm(z - point.place.z) > _BESIDE * length:
            return point
        return Traced(place, points[0].tangent, points[0].frame)

    def _determinant(self, before: Traced) -> Callable[[Traced], float]:
        """Return the determinant of the bordered ∂R/∂z, relative to its value at a point.

        The border is the same for all points, so that it is a smooth function along the branch:
        null spaces computed at each point could be exchanged at a branch point.
        """

        def parts(matrix: Array) -> tuple[float, float]:
            bordered = _bordered(matrix, before.tangent, before.frame)
            sign, logarithm = np.linalg.slogdet(bordered)
            return float(sign), float(logarithm)

        sign, logarithm = parts(before.place.matrix)

        def relative(point: Traced) -> float:
            s, x = parts(point.place.matrix)
            return sign * s * float(np.exp(x - logarithm))

        return relative

    def _root(self, stretch: _Stretch, function: Callable[[Traced], float]) -> Traced:
        """Return the point near another one at which a smooth function changes its sign.

        Newton's method is ill-conditioned at a branch point. The point is interpolated from
        points on both sides.
        """
        from scipy.optimize import brentq

        length = stretch.length

        def value(distance: float) -> float:
            point = self._between(stretch, distance)
            return function(point) if point is not None else 0.0

        near = brentq(value, 0.0, length, xtol=_BESIDE * length)
        beside = [near + k * _BESIDE * length for k in (-3, -1, 1, 3)]
        points = [x for x in (self._between(stretch, d) for d in beside) if x is not None]
        if len(points) < 2:  # no step converges near it
            sign = np.sign(function(stretch.before))
            return self._bisected(stretch, lambda x: sign * function(x) < 0)[1]
        z = _at_zero([function(x) for x in points], np.array([x.place.z for x in points]))
        tangent = np.asarray(sum(x.tangent for x in points))
        place = self.problem.place(z)
        assert place is not None
        # At a branch point, the null space also contains the branch's own direction, which cannot
        # be separated from the neutral ones.
        beside_it = points[len(points) // 2].frame
        return Traced(place, tangent / np.linalg.norm(tangent), beside_it)


def _at_zero(values: list[float], curve: Array) -> Array:
    """Return where the values vanish along a curve through some points, by Lagrange
    interpolation."""
    weights = [
        np.prod([b / (b - a) for j, b in enumerate(values) if j != i]) for i, a in enumerate(values)
    ]
    return np.asarray(np.array(weights) @ curve)


def vertical(point: Traced) -> bool:
    """Whether the parameter does not change along the branch at a point."""
    return bool(abs(point.tangent[-1]) < _VERTICAL)


def _oscillates(stability: Stability) -> bool:
    """Whether it is unstable, and the eigenvalue of largest real part is complex."""
    values = stability.eigenvalues
    unstable = stability.verdict == "unstable"
    return bool(unstable and values[np.argmax(values.real)].imag > 0)


def _growth(stability: Stability) -> float:
    """Return the largest growth rate of an oscillation."""
    values = stability.eigenvalues
    return float(values.real[values.imag > 0].max(initial=-np.inf))


def _growing(stability: Stability) -> float:
    """Return the largest growth rate of an oscillation; 0 where it is a rounding error."""
    largest = _growth(stability)
    if not np.isfinite(largest):
        return largest
    return largest if abs(largest) > stability.rounding else 0.0


def _nearest(basis: Array, before: Array) -> Array:
    """Return the orthonormal basis of a space that is closest to a previous one."""
    if not basis.shape[1]:
        return basis
    orthonormal, _ = np.linalg.qr(basis)
    u, _, vt = np.linalg.svd(orthonormal.T @ before)
    return np.asarray(orthonormal @ (u @ vt))
