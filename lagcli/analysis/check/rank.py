"""The rank of B at the initial state and at random consistent states; unique multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.constraints.initial import (
    ConsistentState,
    NoStart,
    almost_dependent,
    consistent_state,
    coordinate_reach,
)
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import decompose
from lagcli.engine.system import State, System
from lagcli.equations.derivation.degrees_of_freedom import DegreesOfFreedom

#: Number of random consistent states, and the largest number of coordinates for which they are
#: computed: for larger models, each takes seconds.
_STATES, MOST_COORDINATES = 20, 60
#: Their distance from the initial state, relative to the sizes of the coordinates.
_SPREAD = 0.5
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
        rank = self.freedom.rank
        return rank is not None and max(self.random_ranks, default=rank) > rank


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
        Other states, from `random_states`.
    """
    ranks = tuple(state.rank for state in states)
    names = system.constraints
    near: tuple[str, ...] = ()
    if len(start.state.q) <= MOST_COORDINATES:
        near = almost_dependent(system, start.state, start.rank)
    if start.rank == len(names):
        return RankCheck(freedom, ranks, names, (), (), near)
    null = _null_space(system, start)
    loose = np.abs(null).max(axis=1) > _COUNTS
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


def random_states(system: System, start: ConsistentState) -> list[ConsistentState]:
    """Return random consistent states near the initial state, reproducibly.

    A random walk: each state is a step along the position constraints from the previous one,
    projected onto them. Guesses far from the constraints would converge to singular configurations.

    Returns
    -------
    list of ConsistentState
        Up to 20; none for a large system, without constraints, or if these determine all
        positions.
    """
    random, state = np.random.default_rng(8), start.state
    free = np.zeros(len(state.q), dtype=bool)
    if not system.constraints or len(free) > MOST_COORDINATES:
        return []
    size = coordinate_reach(Evaluator(system, state.p), state)
    states: list[ConsistentState] = []
    for _ in range(2 * _STATES):
        tangents = _tangents(system, state)
        if not tangents.shape[1]:
            break
        step = tangents @ random.normal(size=tangents.shape[1])
        step *= _SPREAD * random.uniform() / (np.abs(step / size).max() or 1.0)
        v = state.v + random.normal(size=len(free)) * np.maximum(np.abs(state.v), size)
        try:
            guess = State(state.t, state.q + step, v, state.p)
            states.append(consistent_state(system, guess, free, free))
        except (NoStart, np.linalg.LinAlgError):
            state = start.state
            continue
        state = states[-1].state
        if len(states) == _STATES:
            break
    return states


def _tangents(system: System, state: State) -> Array:
    """Return a basis of the admissible changes of the coordinates, (nq, n)."""
    evaluator = Evaluator(system, state.p)
    sizes = evaluator.sizes(state.t, state.q, state.v)
    if not system.holonomic:
        return np.diag(sizes)
    jacobian = evaluator.constraints(state.t, state.q, state.v).jacobian
    return decompose(jacobian[list(system.holonomic)], sizes=sizes).null


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
