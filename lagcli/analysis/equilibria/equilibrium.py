"""Equilibria and steady motions of a model, with their multipliers and stability."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lagcli.analysis.equilibria.search import search_in_all_modes, search_steady_states
from lagcli.analysis.equilibria.stability import NO_LINEAR_MODEL, Stability, stability_of
from lagcli.analysis.local.contact_mode import SwitchedModel
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.operating_point import OperatingPoint
from lagcli.analysis.local.steady import SteadyState, ignored_velocities
from lagcli.analysis.local.steady_terms import (
    Given,
    SteadyTerms,
    check_switching,
    nearest_steady_state,
)
from lagcli.arrays import Array
from lagcli.errors import UsageError
from lagcli.model.model import Model, check_is_model

_TAKES_PART = 1e-6


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One equilibrium or steady motion; SI units.

    Parameters
    ----------
    operating_point : OperatingPoint
        The operating point; its ``point`` contains q, v, a and λ, its ``contacts`` the states of
        contacts, limits and friction.
    constraints : tuple of nc str
        The active constraints: closed contacts, friction and limits that stick, and all that
        hold permanently.
    constraint_forces : (nc, nq) array
        λ_β b_β, the generalized forces of each constraint, SI units.
    potential : float
        V, J.
    stability : Stability
    neutral : (nq, dimension) array
        A basis of the tangent space of the set of equilibria.
    speeds : mapping of str to float
        Of a steady motion: unknown velocities (``phi'``), and rates of symmetries (``rate(J_1)``).
    """

    operating_point: OperatingPoint
    constraints: tuple[str, ...]
    constraint_forces: Array
    potential: float
    stability: Stability
    neutral: Array
    speeds: Mapping[str, float] = field(default_factory=dict)

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
    model : Model
    coordinates, constraints : tuples of str
        All of the model.
    steady : mapping of str to float or None
        What is held, by name (``phi'``); None for what was looked for.
    starts : int
        Number of starting points of the search.
    equilibria : tuple of Equilibrium
        The equilibria, ordered by V.
    ignored : mapping of str to float
        Initial velocities that the model file gives and that the motion found does not have.
    """

    model: Model
    coordinates: tuple[str, ...]
    constraints: tuple[str, ...]
    steady: Mapping[str, float | None]
    starts: int
    equilibria: tuple[Equilibrium, ...]
    ignored: Mapping[str, float] = field(default_factory=dict)


def equilibrium(
    model: Model,
    *,
    steady: Given | None = None,
    all: bool = False,
    starts: int = 64,
) -> Equilibria:
    """Find equilibria, or steady motions with given velocities.

    Solves ∂V/∂q − Q = Bᵀλ, φ = 0 with v = 0 by Newton's method on (q, λ) from the consistent
    initial state. With ``steady``, the given velocities are prescribed, other independent ones are
    zero, and centrifugal and gyroscopic forces are balanced too: f − M a + Bᵀλ = 0, B a = γ.

    Contacts are closed or open so that 0 ≤ φ ⊥ λ ≥ 0, friction and limits at rest do not exceed
    their static limit. Stability is that of motions on which the closed contacts stay closed, and
    what sticks sticks. Events are not looked at.

    Parameters
    ----------
    model : Model
    steady : mapping of str to float or None, optional
        Velocities, SI: ``{"phi'": 10}``. Motions along symmetries of the model have any expression
        with a value, ``{"omega(e).z": 10}``, the rate of a symmetry that `lagcli.check` finds,
        ``{"rate(J_1)": 10}``, or its momentum, ``{"J_1": 3}``. A velocity or a rate that is None
        is an unknown: ``{"theta": 1, "phi'": None}``.
    all : bool
        Search for all of them, from points of a Sobol sequence, with deflation of the known ones.
        Coordinates with the period 2π are reduced to (−π, π].
    starts : int
        Number of points for ``all``, in each mode of the contacts.

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
    check_is_model(model, "equilibrium")
    if starts < 1:
        raise UsageError(f"--starts {starts}: give at least 1")
    terms = SteadyTerms(model, steady or {})
    if not all:
        states = [nearest_steady_state(model, steady or {})]
    elif model.switches:
        check_switching(model, terms)
        states = search_in_all_modes(SwitchedModel(model), terms.held, starts)
    else:
        states = search_steady_states(terms.problem(LocalEquations(model)), starts)
    equilibria = sorted(map(described, states), key=_order)
    return Equilibria(
        model,
        model.coordinate_names,
        model.constraint_names,
        terms.named,
        starts if all else 1,
        tuple(equilibria),
        ignored_velocities(model, equilibria[0].operating_point.point),
    )


def _order(one: Equilibrium) -> tuple[float, ...]:
    q = one.operating_point.point.q
    return (float(f"{one.potential:.9e}"), *(float(f"{x:.6e}") for x in q))


def described(state: SteadyState) -> Equilibrium:
    """Return an equilibrium with its forces and stability."""
    from lagcli.engine.tape.interpreter import ScalarTape
    from lagcli.equations.derivation.column_expressions import REPORTED

    local, point = state.local, state.operating_point.point
    d = local.evaluator(point.p).dynamics(point.t, point.q, point.v)
    report = ScalarTape(local.system.report)(point.inputs())
    stability = NO_LINEAR_MODEL
    if not any(contact.indeterminate for contact in state.operating_point.contacts):
        dimension = state.neutral.shape[1]
        stability = stability_of(local, state.operating_point, dimension, state.flat)
    return Equilibrium(
        state.operating_point,
        local.system.constraints,
        point.multipliers[:, None] * d.jacobian,
        report[REPORTED.index("energy_potential")],
        stability,
        state.neutral,
        state.speeds,
    )
