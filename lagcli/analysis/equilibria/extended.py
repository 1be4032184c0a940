"""R(q, λ, s) = 0: the steady problem with a parameter s as an unknown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lagcli.analysis.local.gradients import Gradients
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.parameter_path import ParameterPath
from lagcli.analysis.local.steady import ACCEPTED, Residual, SteadyProblem
from lagcli.arrays import Array
from lagcli.errors import UsageError

_ITERATIONS = 12
_REACHED = 1e-13  # relative to the magnitudes of the terms


class ModelParameter:
    """A parameter of the model, with the parameters that depend on it.

    Parameters
    ----------
    local : LocalEquations
    name : str

    Raises
    ------
    UsageError
        As `ParameterPath`.
    """

    def __init__(self, local: LocalEquations, name: str):
        from lagcli.equations.derivation.parameter_jacobians import differentiate_parameters

        self.name, self.local = name, local
        self.path = ParameterPath(local.model, name)
        found = differentiate_parameters(local.equations, self.path.followers)
        groups = (found.force, found.rhs, found.position, found.velocity)
        count = len(found.parameters)
        self._gradients = [Gradients(local.equations, rows, count) for rows in groups]

    def problem(self, base: SteadyProblem, value: float) -> tuple[SteadyProblem, tuple[float, ...]]:
        """Return the steady problem and the parameters for a value."""
        return base, self.path.values(self.local.p, value)

    def slope(self, problem: SteadyProblem, found: Residual, value: float) -> Array:
        """Return ∂R/∂s, (nq + nh,)."""
        along = self.path.slopes(value)
        force, rates, position, velocity = (g.at(found.point) @ along for g in self._gradients)
        jac = self.local.jacobians(found.point)
        dv = problem.changed(found, -velocity[:, None])
        da = problem.changed(found, rates[:, None] + jac.rhs_velocity @ dv)
        force = force + (jac.force_velocity @ dv - found.dynamics.mass_matrix @ da)[:, 0]
        return np.concatenate([force, position])


class HeldVelocity:
    """A prescribed velocity as the parameter of steady motions.

    Parameters
    ----------
    local : LocalEquations
    coordinate : str
    """

    def __init__(self, local: LocalEquations, coordinate: str):
        self.name, self.local, self.coordinate = f"{coordinate}'", local, coordinate
        self.index = local.system.coordinates.index(coordinate)

    def problem(self, base: SteadyProblem, value: float) -> tuple[SteadyProblem, tuple[float, ...]]:
        """Return the steady problem and the parameters for a value."""
        names = self.local.system.coordinates
        held = {names[j]: x for j, x in base.held.items()}
        return SteadyProblem(self.local, {**held, self.coordinate: value}), self.local.p

    def slope(self, problem: SteadyProblem, found: Residual, value: float) -> Array:
        """Return ∂R/∂s, (nq + nh,)."""
        if self.index not in found.independent:
            raise UsageError(
                f"--along {self.name}: the constraints determine this velocity; take another one"
            )
        jac = self.local.jacobians(found.point)
        dv = found.basis[:, [found.independent.index(self.index)]]
        da = problem.changed(found, jac.rhs_velocity @ dv)
        force = (jac.force_velocity @ dv - found.dynamics.mass_matrix @ da)[:, 0]
        return np.concatenate([force, np.zeros(len(found.value) - len(force))])


class Place(NamedTuple):
    """A point of a branch, in scaled unknowns z = (q, λ, s).

    Parameters
    ----------
    z : (n,) array
    found : Residual
    matrix : (m, n) array
        The scaled ∂R/∂z.
    """

    z: Array
    found: Residual
    matrix: Array


class ExtendedProblem:
    """R(q, λ, s) = 0 with scaled unknowns and equations.

    Parameters
    ----------
    base : SteadyProblem
    parameter : ModelParameter or HeldVelocity
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
        parameter: ModelParameter | HeldVelocity,
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
        self.columns = np.concatenate([lengths, force / rows, [width]])
        held = list(self.local.system.holonomic)
        self.rows = np.concatenate([lengths / force, 1.0 / rows[held]])

    def scaled(self, found: Residual, value: float) -> Array:
        """Return z of a root."""
        return np.asarray(
            np.concatenate([found.point.q, found.point.multipliers, [value]]) / self.columns
        )

    def value(self, z: Array) -> float:
        """Return s."""
        return float(z[-1] * self.columns[-1])

    def residual(self, z: Array) -> tuple[SteadyProblem, Residual]:
        """Return R at z, and the steady problem at its parameter."""
        unknowns = z * self.columns
        problem, p = self.parameter.problem(self.base, float(unknowns[-1]))
        q, multipliers = unknowns[: self.nq], unknowns[self.nq : -1]
        return problem, problem.residual(q, multipliers, p, self.chosen)

    def place(self, z: Array) -> Place | None:
        """Return the matrix and residual at z; None where they are undefined."""
        problem, found = self.residual(z)
        if not np.isfinite(found.value).all():
            return None
        slope = self.parameter.slope(problem, found, self.value(z))
        matrix = np.column_stack([problem.jacobian(found), slope])
        return Place(z, found, matrix * np.outer(self.rows, self.columns))

    def correct(self, z: Array, tangent: Array, rank: int) -> tuple[Place, int] | None:
        """Return the root in the plane through z normal to a tangent, and the number of Newton
        steps.

        Parameters
        ----------
        z : (n,) array
        tangent : (n,) array
        rank : int
            Rank of ∂R/∂z along the branch.
        """
        target = tangent @ z
        for iteration in range(_ITERATIONS):
            place = self.place(z)
            if place is None:
                return None
            if place.found.relative <= _REACHED and abs(tangent @ z - target) <= 1e-12:
                return place, iteration
            system = np.vstack([place.matrix, tangent])
            right = np.concatenate([self.rows * place.found.value, [tangent @ z - target]])
            step = _solved(system, right, rank + 1)
            if not np.isfinite(step).all() or np.abs(step).max() > 1.0:
                return None
            z = z - step
            if np.abs(step).max() < 1e-14 * max(1.0, np.abs(z).max()):
                break
        place = self.place(z)
        if place is None or not place.found.relative <= ACCEPTED:
            return None
        return place, _ITERATIONS


def _solved(matrix: Array, right: Array, rank: int) -> Array:
    """Return the solution of least norm of a system of given rank."""
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(vt[:rank].T @ ((u[:, :rank].T @ right) / s[:rank]))
