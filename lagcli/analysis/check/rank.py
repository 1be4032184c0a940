"""The rank of B at the initial state and at random consistent states; unique multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import (
    ConsistentState,
    almost_dependent,
)
from lagcli.engine.constraints.random_states import MOST_COORDINATES
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import decompose
from lagcli.engine.system import System
from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom
from lagcli.model.model import RATE

#: Entries of normalized combinations above this count: vanishing ones are about 1e-8, the tolerance
#: of the rank.
_COUNTS = 1e-6
_LARGEST_DENOMINATOR = 1000


@dataclass(frozen=True)
class Combination:
    """A combination Σ c_β λ_β of multipliers that is unique.

    Parameters
    ----------
    factors : mapping of str to float
        The nonzero c_β by constraint; the first is 1.
    """

    factors: dict[str, float]


@dataclass(frozen=True)
class RankCheck:
    """The rank of B.

    Parameters
    ----------
    freedom : DegreesOfFreedom
        Degrees of freedom at the initial state, with the sets of dependent constraints.
    random_ranks : tuple of int
        Ranks at random consistent states near the initial state.
    unique : tuple of str
        Constraints whose multiplier is unique: their row of the null space of Bᵀ is zero.
    not_unique : tuple of str
        Constraints whose multiplier is not unique.
    combinations : tuple of Combination
        A basis of the unique combinations of these multipliers, at the initial state.
    near_singular : tuple of str
        Constraints that are almost dependent at the initial state, but not around it.
    """

    freedom: DegreesOfFreedom
    random_ranks: tuple[int, ...]
    unique: tuple[str, ...]
    not_unique: tuple[str, ...]
    combinations: tuple[Combination, ...]
    near_singular: tuple[str, ...] = ()

    @property
    def special(self) -> bool:
        """Whether the rank at the initial state is less than at the random states."""
        return self.freedom.singular is not None


def check_rank(
    system: System,
    start: ConsistentState,
    freedom: DegreesOfFreedom,
    states: Sequence[ConsistentState],
) -> RankCheck:
    """Return the rank of B and the uniqueness of the multipliers.

    Parameters
    ----------
    system : System
    start : ConsistentState
    freedom : DegreesOfFreedom
        Degrees of freedom at the initial state.
    states : sequence of ConsistentState
        Other states, from `lagcli.engine.constraints.random_states`.
    """
    ranks = tuple(state.rank for state in states)
    names = system.constraints
    freedom = freedom._replace(nearby=max(ranks, default=None))
    near: tuple[str, ...] = ()
    if len(start.state.q) <= MOST_COORDINATES:
        near = almost_dependent(system, start.state, start.rank)
    if start.rank == len(names):
        return RankCheck(freedom, ranks, names, (), (), near)
    null = _null_space(system, start)
    of_coordinate = np.array([name.endswith(RATE) for name in names])  # whose λ is 0
    loose = (np.abs(null).max(axis=1) > _COUNTS) & ~of_coordinate
    unique = tuple(n for n, x in zip(names, loose, strict=True) if not x)
    sets = [[names.index(n) for n in x.constraints] for x in freedom.redundant]
    return RankCheck(
        freedom,
        ranks,
        unique,
        tuple(n for n, x in zip(names, loose, strict=True) if x),
        tuple(c for members in sets for c in _combinations(null, members, names)),
        near,
    )


def _null_space(system: System, start: ConsistentState) -> Array:
    """Return a basis of the null space of Bᵀ, (nc, nc − rank), with columns of length 1."""
    evaluator, s = Evaluator(system, start.state.p), start.state
    c = evaluator.constraints(s.t, s.q, s.v)
    sizes = evaluator.sizes(s.t, s.q, s.v)
    lengths = evaluator.row_lengths(s.t, s.q, s.v, c, sizes)
    d = decompose(c.jacobian, start.rank, scale=lengths, sizes=sizes)
    null = d.dependent / d.scale[:, None]
    return np.asarray(null / np.linalg.norm(null, axis=0))


def _combinations(null: Array, members: list[int], names: tuple[str, ...]) -> list[Combination]:
    """Return the combinations of a dependent set that are orthogonal to the null space."""
    inside = null[members]
    _, values, rows = np.linalg.svd(inside.T)
    rank = int((values > _COUNTS).sum())
    reduced = _reduced(rows[rank:])
    return [
        Combination({names[i]: x for i, x in zip(members, row, strict=True) if x})
        for row in reduced.tolist()
    ]


def _reduced(rows: Array) -> Array:
    """Return the reduced row echelon form, with entries rounded to nearby simple fractions."""
    rows, pivot = rows.copy(), 0
    for column in range(rows.shape[1]):
        if pivot == len(rows):
            break
        best = pivot + int(np.abs(rows[pivot:, column]).argmax())
        if abs(rows[best, column]) <= _COUNTS:
            continue
        rows[[pivot, best]] = rows[[best, pivot]]
        rows[pivot] /= rows[pivot, column]
        for other in range(len(rows)):
            if other != pivot:
                rows[other] -= rows[other, column] * rows[pivot]
        pivot += 1
    return np.vectorize(_simple, otypes=[float])(rows) if rows.size else rows


def _simple(value: float) -> float:
    nearest = float(Fraction(value).limit_denominator(_LARGEST_DENOMINATOR))
    return nearest if abs(nearest - value) < 1e-9 else value
