"""Equilibria and steady motions of a model, with their multipliers and stability."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lagcli.analysis.equilibria.search import search_steady_states
from lagcli.analysis.equilibria.stability import Stability, stability_of
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.analysis.local.steady import SteadyProblem
from lagcli.analysis.local.steady_states import (
    SteadyState,
    held_velocities,
    nearest_steady_state,
)
from lagcli.arrays import Array
from lagcli.errors import UsageError
from lagcli.model.model import Model

_TAKES_PART = 1e-6


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One equilibrium or steady motion; SI units.

    Parameters
    ----------
    operating_point : OperatingPoint
        With q, v, a and λ in its ``point``.
    constraint_forces : (nc, nq) array
        λ_β b_β, the generalized forces of each constraint.
    potential : float
        V, J.
    stability : Stability
    neutral : (nq, dimension) array
        Changes of q that lead to other equilibria; its columns span a tangent space.
    """

    operating_point: OperatingPoint
    constraint_forces: Array
    potential: float
    stability: Stability
    neutral: Array

    @property
    def dimension(self) -> int:
        """Dimension of the set of equilibria that it belongs to; 0 where it is isolated."""
        return int(self.neutral.shape[1])

    @property
    def neutral_coordinates(self) -> tuple[int, ...]:
        """Coordinates that differ among the equilibria next to it."""
        part = np.abs(self.neutral).max(axis=1, initial=0.0)
        return tuple(np.flatnonzero(part > _TAKES_PART * part.max(initial=0.0)).tolist())


@dataclass(frozen=True, eq=False)
class Equilibria:
    """The equilibria of a model that were found.

    Parameters
    ----------
    model : str
        Its name.
    coordinates, constraints : tuples of str
    steady : mapping of str to float
        Velocities that are held, by name (``phi'``).
    starts : int
        Number of points from which they were looked for.
    equilibria : tuple of Equilibrium
        By increasing V.
    """

    model: str
    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    steady: Mapping[str, float]
    starts: int
    equilibria: tuple[Equilibrium, ...]


def equilibrium(
    model: Model,
    *,
    steady: Mapping[str, float] | None = None,
    all: bool = False,
    starts: int = 64,
) -> Equilibria:
    """Find equilibria, or steady motions with given velocities.

    Solves ∂V/∂q − Q = Bᵀλ, φ = 0 with v = 0 by Newton's method on (q, λ) from the consistent
    start. With ``steady``, the velocities that are given are held, other independent ones are
    zero, and centrifugal and gyroscopic forces are balanced too: f − M a + Bᵀλ = 0, B a = γ.

    Parameters
    ----------
    model : Model
    steady : mapping of str to float, optional
        Velocities, SI: ``{"phi'": 10}``.
    all : bool
        Look for all of them: from points of a Sobol sequence, with deflation of those that are
        known. Coordinates with the period 2π are reduced to (−π, π].
    starts : int
        Number of points for ``all``.

    Returns
    -------
    Equilibria

    Raises
    ------
    UsageError
        A velocity is unknown, or the constraints determine it.
    ModelError, NumericalError
        There is no consistent start, or no equilibrium is found.

    Notes
    -----
    No method finds all roots for certain; more starts find more.

    References
    ----------
    .. [1] P. E. Farrell, Á. Birkisson, S. W. Funke, "Deflation techniques for finding distinct
       solutions of nonlinear partial differential equations", SIAM J. Sci. Comput. 37 (2015)
       A2026, doi:10.1137/140984798.
    """
    if starts < 1:
        raise UsageError(f"--starts {starts}: give at least 1")
    local = LocalEquations(model)
    held = held_velocities(local, steady or {})
    if all:
        states = search_steady_states(SteadyProblem(local, held), starts)
    else:
        states = [nearest_steady_state(local, steady or {})]
    found = sorted((described(local, state) for state in states), key=_order)
    return Equilibria(
        model.name,
        local.system.coordinates,
        local.system.constraints,
        {f"{name}'": value for name, value in held.items()},
        starts if all else 1,
        tuple(found),
    )


def _order(found: Equilibrium) -> tuple[float, ...]:
    q = found.operating_point.point.q
    return (float(f"{found.potential:.9e}"), *(float(f"{x:.6e}") for x in q))


def described(local: LocalEquations, state: SteadyState) -> Equilibrium:
    """Return an equilibrium with its forces and stability."""
    from lagcli.engine.tape.interpreter import ScalarTape
    from lagcli.equations.derivation.column_expressions import REPORTED

    point = state.operating_point.point
    d = local.evaluator(point.p).dynamics(point.t, point.q, point.v)
    report = ScalarTape(local.system.report)(point.inputs())
    return Equilibrium(
        state.operating_point,
        point.multipliers[:, None] * d.jacobian,
        report[REPORTED.index("energy_potential")],
        stability_of(local, state.operating_point, state.neutral.shape[1]),
        state.neutral,
    )
