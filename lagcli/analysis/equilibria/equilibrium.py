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
        The operating point; its ``point`` contains q, v, a and λ.
    constraint_forces : (nc, nq) array
        λ_β b_β, the generalized forces of each constraint, SI units.
    potential : float
        V, J.
    stability : Stability
    neutral : (nq, dimension) array
        A basis of the tangent space of the set of equilibria.
    """

    operating_point: OperatingPoint
    constraint_forces: Array
    potential: float
    stability: Stability
    neutral: Array

    @property
    def dimension(self) -> int:
        """Dimension of the set of equilibria; 0 for an isolated equilibrium."""
        return int(self.neutral.shape[1])

    @property
    def neutral_coordinates(self) -> tuple[int, ...]:
        """Coordinates that vary along the set of equilibria."""
        part = np.abs(self.neutral).max(axis=1, initial=0.0)
        return tuple(np.flatnonzero(part > _TAKES_PART * part.max(initial=0.0)).tolist())


@dataclass(frozen=True, eq=False)
class Equilibria:
    """The equilibria found for a model.

    Parameters
    ----------
    model : str
        Name of the model.
    coordinates, constraints : tuples of str
    steady : mapping of str to float
        Prescribed velocities, by name (``phi'``).
    starts : int
        Number of starting points of the search.
    equilibria : tuple of Equilibrium
        The equilibria, ordered by V.
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
    initial state. With ``steady``, the given velocities are prescribed, other independent ones are
    zero, and centrifugal and gyroscopic forces are balanced too: f − M a + Bᵀλ = 0, B a = γ.

    Parameters
    ----------
    model : Model
    steady : mapping of str to float, optional
        Velocities, SI: ``{"phi'": 10}``.
    all : bool
        Search for all of them, from points of a Sobol sequence, with deflation of the known ones.
        Coordinates with the period 2π are reduced to (−π, π].
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
        There is no consistent initial state, or no equilibrium is found.

    Notes
    -----
    No method is guaranteed to find all roots; more starting points find more.

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
