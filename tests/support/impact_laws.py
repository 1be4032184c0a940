"""Impact laws: Poisson's, Newton's, and sequential impacts of single contacts.

References: Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chapter 8;
Glocker, Set-Valued Force Laws, 2001.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Indices
from lagcli.engine.core.contact_problem import ContactLaw, ContactProblem, ContactSolution
from tests.support.contact_problems import solve_contacts

ImpactLaw = Literal["poisson", "newton", "sequential"]

#: Number of impacts of a sequence, per contact, after which the remaining ones occur together.
_SEQUENCE = 200
#: Relative difference of the energies of approaches that count as equal.
_EQUAL = 2e-12
#: Approach velocities below this part of the velocities are rounding errors.
_RESTS = 1e-12


class ImpactProblem(NamedTuple):
    """An impact: relative velocities before it, and the laws of the contacts.

    Its rows are the participating contacts, their friction, and bilateral rows that limit friction;
    all other bilateral rows are eliminated from the matrix.

    Parameters
    ----------
    matrix : (n, n) array
        A: after = before + A impulse.
    before : (n,) array
        Velocities before the impact; those of contacts are not positive.
    laws : (n,) array of int
        `ContactLaw`: unilateral, limited or free.
    restitution : (n,) array
        Coefficients of restitution of unilateral rows.
    friction : (n, n) array
        Friction of limited rows: |impulse_k| ≤ Σ_j friction_kj |impulse_j|.
    """

    matrix: Array
    before: Array
    laws: Array
    restitution: Array
    friction: Array

    def of_rows(self, rows: Indices, before: Array) -> ImpactProblem:
        """Return the impact of some of the rows, with other velocities."""
        block = np.ix_(rows, rows)
        return ImpactProblem(
            self.matrix[block],
            before[rows],
            self.laws[rows],
            self.restitution[rows],
            self.friction[block],
        )


class ImpactStage(NamedTuple):
    """One linear phase of an impact, with constant modes.

    Parameters
    ----------
    rows : (m,) array of int
        The participating rows; the others have no impulse.
    modes : (m,) array of int
        `RowMode` of each row. Active rows have velocity 0, or −e times the previous velocity in
        Newton's law; slipping rows have the limit as impulse; open ones have no impulse, or e times
        that of the compression in an expansion.
    impulse : (m,) array
    part : "compression", "expansion" or "newton"
    """

    rows: Indices
    modes: Indices
    impulse: Array
    part: Literal["compression", "expansion", "newton"]


class ImpactResult(NamedTuple):
    """Result of an impact, by row.

    Parameters
    ----------
    impulse, after : (n,) arrays
    loss : (n,) array
        Energy absorbed by the row, −Λ (before + after)/2, or its sum over a sequence.
    stages : tuple of ImpactStage
        Phases in order; an expansion follows its compression.
    """

    impulse: Array
    after: Array
    loss: Array
    stages: tuple[ImpactStage, ...] = ()


def resolve_impact(impact: ImpactProblem, law: ImpactLaw) -> ImpactResult | None:
    """Return the result of an impact, or None if its law has no solution.

    Poisson's law: compression 0 ≤ γ_C ⊥ Λ_C ≥ 0, then expansion 0 ≤ γ ⊥ Λ_E − e Λ_C ≥ 0. Newton's
    law: 0 ≤ γ + e γ⁻ ⊥ Λ ≥ 0. Sequential: Poisson's law for one contact at a time, always the one
    whose approach has the largest energy. Coulomb friction in each phase.

    Newton's law with friction may increase the energy, as in the double pendulum of Kane and
    Levinson; so may Poisson's if contacts have different coefficients.
    """
    step = {"poisson": _poisson, "newton": _newton, "sequential": _sequence}[law]
    return step(impact)


def _result(impact: ImpactProblem, impulse: Array, stages: tuple[ImpactStage, ...]) -> ImpactResult:
    after = impact.before + impact.matrix @ impulse
    return ImpactResult(impulse, after, -impulse * (impact.before + after) / 2, stages)


def _solve(impact: ImpactProblem, offset: Array, limits: Array) -> ContactSolution | None:
    friction = impact.friction
    return solve_contacts(
        ContactProblem(impact.matrix, offset, impact.laws, limits, limits, friction, friction)
    )


def _poisson(impact: ImpactProblem) -> ImpactResult | None:
    nothing = np.zeros(len(impact.before))
    compression = _solve(impact, impact.before, nothing)
    if compression is None:
        return None
    every = np.arange(len(impact.before))
    first = ImpactStage(every, compression.modes, compression.force, "compression")
    returned = np.where(_unilateral(impact), impact.restitution * compression.force, 0.0).clip(0)
    if not returned.any():
        return _result(impact, compression.force, (first,))
    # active rows have exactly y = 0: the next phase is then larger than rounding, or zero
    offset = compression.motion + impact.matrix @ returned
    size = np.abs(impact.matrix) @ (np.abs(compression.force) + returned) + np.abs(impact.before)
    offset[np.abs(offset) <= _RESTS * size] = 0.0
    expansion = _solve(impact, offset, impact.friction @ returned)
    if expansion is None:
        return None
    second = ImpactStage(every, expansion.modes, returned + expansion.force, "expansion")
    return _result(impact, first.impulse + second.impulse, (first, second))


def _newton(impact: ImpactProblem) -> ImpactResult | None:
    shift = np.where(_unilateral(impact), impact.restitution * impact.before, 0.0)
    found = _solve(impact, impact.before + shift, np.zeros(len(shift)))
    if found is None:
        return None
    stage = ImpactStage(np.arange(len(shift)), found.modes, found.force, "newton")
    return _result(impact, found.force, (stage,))


def _sequence(impact: ImpactProblem) -> ImpactResult | None:
    contacts = np.flatnonzero(_unilateral(impact))
    on_others = impact.friction[:, contacts] != 0
    diagonal = np.diag(impact.matrix)[contacts]
    weight = np.where(diagonal > 0, 1 / np.where(diagonal > 0, diagonal, 1.0), 0.0)
    velocity = impact.before
    total = ImpactResult(*np.zeros((3, len(velocity))))
    rest = _RESTS * float(np.abs(velocity).max())
    for _ in range(_SEQUENCE * len(contacts)):
        approach = np.minimum(velocity[contacts], 0.0)
        approach[approach > -rest] = 0.0
        if not approach.any():
            return total._replace(after=velocity)
        energy = weight * approach**2
        chosen = int(np.argmax(energy >= (1 - _EQUAL) * energy.max()))  # the first of equal ones
        others = np.arange(len(contacts)) != chosen
        taking = ~on_others[:, others].any(axis=1)
        taking[contacts[others]] = False
        added = _add(total, impact, np.flatnonzero(taking), velocity)
        if added is None:
            return None
        total, velocity = added, added.after
    # the remainder of an infinite sequence
    return _add(total, impact, np.arange(len(velocity)), velocity)


def _add(
    total: ImpactResult, impact: ImpactProblem, rows: Indices, velocity: Array
) -> ImpactResult | None:
    """Add an impact of some rows by Poisson's law."""
    found = _poisson(impact.of_rows(rows, velocity))
    if found is None:
        return None
    impulse, loss = total.impulse.copy(), total.loss.copy()
    impulse[rows] += found.impulse
    loss[rows] += found.loss
    stages = tuple(stage._replace(rows=rows[stage.rows]) for stage in found.stages)
    after = impact.before + impact.matrix @ impulse
    return ImpactResult(impulse, after, loss, total.stages + stages)


def _unilateral(impact: ImpactProblem) -> Flags:
    return np.asarray(impact.laws == ContactLaw.UNILATERAL)
