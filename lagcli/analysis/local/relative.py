"""Relative equilibria: steady motions along the symmetries of a model.

A symmetry moves all positions with q̇ = ξ(q), ξ = A q + b, and changes neither L nor the
constraints. A motion with v = Σ s ξ(q) and constant rates s is steady if forces balance with the
accelerations a = (Σ s A) v at one instant. For an observer who moves along, it is at rest, and
small deviations have constant coefficients.

References
----------
.. [1] J. E. Marsden, "Lectures on Mechanics", 1992, ch. 4, doi:10.1017/CBO9780511624001.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lagcli.analysis.local.gradients import MotionJacobians, Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.analysis.local.steady import Condition, IndependentVelocities, Residual, SteadyProblem
from lagcli.arrays import Array
from lagcli.equations.symmetry.conserved import ConservedQuantity, conserved_quantities
from lagcli.equations.symmetry.linear import QUICK
from lagcli.errors import NumericalError

#: Singular values of the fields below this part of the largest are rounding errors.
_DEPENDENT = 1e-9
#: Differences of velocities and accelerations, relative to the largest, that are rounding errors.
_STEADY = 1e-9


class SymmetryField(NamedTuple):
    """A symmetry q̇ = A q + b, with the name of its rate."""

    name: str
    matrix: Array
    shift: Array

    @classmethod
    def of(cls, local: LocalEquations, quantity: ConservedQuantity) -> SymmetryField:
        """Return the field of a conserved quantity."""
        q = local.equations.q
        matrix, shift = np.zeros((len(q), len(q))), np.zeros(len(q))
        for i, x in quantity.field.items():
            for j, symbol in enumerate(q):
                matrix[i, j] = float(x.diff(symbol))
            shift[i] = float(x.subs(dict.fromkeys(q, 0)))
        return cls(f"rate({quantity.name})", matrix, shift)

    def at(self, q: Array) -> Array:
        """Return ξ(q)."""
        return np.asarray(self.matrix @ q + self.shift)


def rates_along(local: LocalEquations, point: Point) -> dict[str, float]:
    """Return the rates of symmetries along which a motion is steady; none if there are no such.

    Parameters
    ----------
    local : LocalEquations
    point : Point
        With its accelerations.
    """
    quantities = conserved_quantities(local.equations, QUICK).quantities
    fields = [SymmetryField.of(local, x) for x in quantities if x.kind == "momentum"]
    if not fields or not point.v.any():
        return {}
    columns = np.array([field.at(point.q) for field in fields]).T
    rates, *_ = np.linalg.lstsq(columns, point.v, rcond=_DEPENDENT)
    frame = sum(s * field.matrix for s, field in zip(rates, fields, strict=True))
    for along, found in ((columns @ rates, point.v), (frame @ point.v, point.a)):
        off, size = (np.abs(x / local.lengths).max() for x in (along - found, found))
        if off > _STEADY * size:
            return {}
    least = _STEADY * np.abs(rates).max()
    return {x.name: float(s) for x, s in zip(fields, rates, strict=True) if abs(s) > least}


class RelativeProblem(SteadyProblem):
    """The steady problem of motions along symmetries, with their rates as unknown speeds.

    Parameters
    ----------
    local : LocalEquations
    fields : sequence of SymmetryField
        The symmetries with unknown rates.
    conditions : sequence of Condition
    every : sequence of SymmetryField
        All symmetries: motions along them are neutral.
    """

    def __init__(
        self,
        local: LocalEquations,
        fields: Sequence[SymmetryField],
        conditions: Sequence[Condition],
        every: Sequence[SymmetryField],
    ):
        super().__init__(local, conditions=conditions)
        self.fields, self.every = tuple(fields), tuple(every)

    @property
    def speed_names(self) -> tuple[str, ...]:
        """The names of the rates."""
        return tuple(field.name for field in self.fields)

    @property
    def is_along_symmetries(self) -> bool:
        """Whether velocities are those along symmetries."""
        return True

    @property
    def is_motion(self) -> bool:
        """Whether steady motions are looked for."""
        return True

    def first_speeds(self, q: Array, p: tuple[float, ...]) -> Array:
        """Return the rates nearest to the velocities of the file that meet the conditions."""
        start = self.local.start.state
        fields = self._columns(q)
        speeds, *_ = np.linalg.lstsq(self._columns(start.q), start.v, rcond=_DEPENDENT)
        zero = np.zeros(len(self.local.system.constraints))
        for kick in (0.0, self.local.rate):
            result: Array = np.asarray(speeds if np.any(speeds) else speeds + kick, float)
            rows, off = [], []
            for condition in self.conditions:
                point = self.local.start_point(q, fields @ result, zero, p)
                _, by_v, by_s = condition.slopes(point, result)
                rows.append(by_v @ fields + by_s)
                off.append(condition.residual(point, result, self.local)[0])
            if rows:
                step, *_ = np.linalg.lstsq(np.array(rows), np.array(off), rcond=_DEPENDENT)
                result = np.asarray(result - step, float)
            if np.any(result):
                return np.asarray(result)
        return np.asarray(result)

    def _columns(self, q: Array) -> Array:
        return np.array([field.at(q) for field in self.fields]).reshape(-1, self.nq).T

    def solve(
        self, q: Array, p: tuple[float, ...], multipliers: Array | None = None
    ) -> Residual | None:
        """Return a root, if possible one with nonzero speeds along the symmetries.

        For the parameters see `SteadyProblem.solve`.
        """
        root = super().solve(q, p, multipliers)
        if root is None or _moves(root):
            return root
        begun = self.begun(q, p, multipliers)
        try:
            other = self.polished(self.relaxed(begun))
        except NumericalError:
            return root
        return other if other is not None and _moves(other) else root

    def frame(self, speeds: Array) -> Array:
        """Return Σ s A, (nq, nq)."""
        frame = np.zeros((self.nq, self.nq))
        for s, field in zip(speeds, self.fields, strict=True):
            frame += s * field.matrix
        return frame

    def _velocity(
        self, q: Array, speeds: Array, drift: Array, free: IndependentVelocities
    ) -> Array:
        return np.asarray(self._columns(q) @ speeds)

    def _acceleration(
        self, v: Array, speeds: Array, rhs: Array, free: IndependentVelocities
    ) -> Array:
        return np.asarray(self.frame(speeds) @ v)

    def _by_position(self, residual: Residual, jac: MotionJacobians) -> tuple[Array, Array]:
        frame = self.frame(residual.speeds)
        return frame, frame @ frame

    def by_speeds(self, residual: Residual, jac: MotionJacobians) -> tuple[Array, Array]:
        """Return ∂v/∂s and ∂a/∂s, (nq, ns) each."""
        point, columns = residual.point, self._columns(residual.point.q)
        turned = np.array([field.matrix @ point.v for field in self.fields])
        return columns, turned.reshape(-1, self.nq).T + self.frame(residual.speeds) @ columns

    def by_parameter(
        self, residual: Residual, jac: MotionJacobians, velocity: Array, rates: Array
    ) -> tuple[Array, Array]:
        """Return ∂v and ∂a by a parameter: none, (nq, 1) each."""
        return np.zeros((self.nq, 1)), np.zeros((self.nq, 1))

    def speed_scales(self, residual: Residual) -> Array:
        """Return scales of the rates, (ns,)."""
        moved = np.abs(self._columns(residual.point.q)) / self.local.lengths[:, None]
        largest = np.maximum(moved.max(axis=0, initial=0.0), 1e-3)
        return np.asarray(self.local.rate / largest)

    def is_steady(self, residual: Residual) -> bool:
        """Whether the accelerations turn with the motion, up to rounding errors."""
        local, point = self.local, residual.point
        tangent = local.tangent(point)
        j = list(tangent.velocities)
        if not j:
            return True
        jerk, bound = local.jerk(point, tangent, local.force_scale(point))
        return bool((np.abs(jerk - self.frame(residual.speeds) @ point.a)[j] <= bound[j]).all())

    def operating_point(self, residual: Residual, name: str) -> OperatingPoint:
        """Return a root as an operating point, in axes that move along."""
        point = residual.point
        orbit = np.array([field.at(point.q) for field in self.every]) / self.local.lengths
        s = np.linalg.svd(orbit, compute_uv=False)
        return OperatingPoint(
            name,
            point,
            self.local.tangent(point),
            True,
            frame=self.frame(residual.speeds),
            neutral=int((s > _DEPENDENT * s.max(initial=0.0)).sum()),
        )


def _moves(root: Residual) -> bool:
    """Whether a root is not at rest, apart from rounding errors."""
    v = np.abs(root.point.v / root.decomposition.sizes).max(initial=0.0)
    speed = np.abs(root.speeds).max(initial=0.0)
    return bool(v > _DEPENDENT * speed * np.abs(root.point.q / root.decomposition.sizes).max())
