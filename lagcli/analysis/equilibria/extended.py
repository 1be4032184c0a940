"""R(q, λ, s) = 0: the steady problem with a parameter s as an unknown."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lagcli.analysis.local.conditions import Condition
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
        self._of_conditions: dict[str, Gradients] = {}

    def problem(self, base: SteadyProblem, value: float) -> tuple[SteadyProblem, tuple[float, ...]]:
        """Return the steady problem and the parameters for a value."""
        return base, self.path.values(self.local.p, value)

    def slope(self, problem: SteadyProblem, found: Residual, value: float) -> Array:
        """Return ∂R/∂s, (nq + nh,)."""
        along = self.path.slopes(value)
        force, rates, position, velocity = (g.at(found.point) @ along for g in self._gradients)
        jac = self.local.jacobians(found.point)
        dv, da = problem.by_parameter(found, jac, velocity, rates)
        force = force + (jac.force_velocity @ dv - found.dynamics.mass_matrix @ da)[:, 0]
        more = [
            self._by_parameter(condition).at(found.point)[0] @ along
            + condition.slopes(found.point, found.speeds)[1] @ dv[:, 0]
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
            found = Gradients.of(self.local.equations, [expression], symbols)
            self._of_conditions[condition.text] = found
        return self._of_conditions[condition.text]


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
        problem = SteadyProblem(
            self.local, {**held, self.coordinate: value}, base.unknown, base.conditions
        )
        return problem, self.local.p

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
        slopes = [c.slopes(found.point, found.speeds)[1] @ dv[:, 0] for c in problem.conditions]
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

    def slope(self, problem: SteadyProblem, found: Residual, value: float) -> Array:
        """Return ∂R/∂s, (nq + nh + conditions,)."""
        slope = np.zeros(len(found.value))
        slope[problem.nq + len(problem.holonomic) + self.number] = -1.0
        return slope


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

    def scaled(self, found: Residual, value: float) -> Array:
        """Return z of a root."""
        return np.asarray(
            np.concatenate([found.point.q, found.point.multipliers, found.speeds, [value]])
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
