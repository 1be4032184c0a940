"""Consistent initialization of many runs together: the regular case of `initial`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lagcli.arrays import Array, Flags, Indices
from lagcli.engine.constraints.initial import REGULAR, Spin, programs_of_search
from lagcli.engine.core.batch import BatchTable
from lagcli.engine.core.start_search import CoreSearch
from lagcli.engine.core.status import StartStatus
from lagcli.engine.evaluator import Constraints
from lagcli.engine.scales import coordinate_sizes
from lagcli.engine.system import Pattern, System

_RANK = 1e-6  # singular values of independent rows
#: Singular values of redundant rows between these may count as zero or not.
_DOUBTFUL = (1e-9, 1e-5)
#: Smallest length of a row of B relative to that implied by its constraint's terms.
_SHORT = 1e-5
#: Size of the matrices of rows that are processed together: 16 MB.
_NUMBERS = 1 << 21


class Starts(NamedTuple):
    """Initial states of n runs.

    Parameters
    ----------
    q, v : (n, nq) arrays
        Consistent states, valid where ``found``.
    found : (n,) array of bool
        Whether the row is regular: consistent, B of the common rank, also beside the state, and no
        motion without inertia. The others are handled by `lagcli.simulations.start.find_start`,
        which finds an initial state or reports why there is none.
    """

    q: Array
    v: Array
    found: Flags


class StartSearch:
    """Solves for initial states that satisfy φ = 0 and ψ = 0, as `initial.consistent_state` does.

    The result of a row does not depend on the other rows. Not thread-safe.

    Parameters
    ----------
    system : System
        The System, whose tapes are assembled once.
    rank : int, optional
        Rank of B of rows that are found; by default all constraints are independent.
    """

    def __init__(self, system: System, rank: int | None = None):
        self.system = system
        self.rank = len(system.constraints) if rank is None else rank
        # each row has its own parameters
        self.tables = tuple(
            BatchTable.of_rows(tape) for tape in (system.constraint, system.dynamics)
        )
        self.core = CoreSearch(system, *programs_of_search(system))

    def __call__(
        self,
        t: float,
        parameters: Array,
        q: Array,
        v: Array,
        fixed_q: Flags,
        fixed_v: Flags,
        spins: Sequence[Spin] = (),
    ) -> Starts:
        """Compute the initial states of n runs.

        Parameters
        ----------
        t : float
            s.
        parameters : (n, np) array
        q, v : (n, nq) arrays
            Fixed values and guesses; a row that is not finite is not found.
        fixed_q, fixed_v : (nq,) arrays of bool
        spins : sequence of Spin, optional
            As for `initial.consistent_state`. Unless an orientation is fixed, and all components of
            its angular velocity are either fixed or guesses, no row is found.
        """
        system = self.system
        search = _StartSearch(system, self.tables, self.core, t, fixed_q, fixed_v, self.rank)
        q, v = np.array(q, dtype=float), np.array(v, dtype=float)
        found = np.isfinite(np.hstack([parameters, q, v]).sum(axis=1))
        found &= not (system.switching or system.nonlinear)
        found &= all(
            fixed_q[list(spin.places)].all() and len(set(spin.fixed)) == 1 for spin in spins
        )
        together = max(1, _NUMBERS // (len(system.coordinates) + len(system.constraints) + 1) ** 2)
        for first in range(0, len(q), together):
            rows = first + np.flatnonzero(found[first : first + together])
            if len(rows):
                q[rows], v[rows], found[rows] = search(parameters[rows], q[rows], v[rows])
        return Starts(q, v, found)


class _StartSearch:
    """The search for initial states with the same free entries."""

    def __init__(
        self,
        system: System,
        tables: tuple[Any, ...],
        core: CoreSearch,
        t: float,
        fixed_q: Flags,
        fixed_v: Flags,
        rank: int,
    ):
        self.system, self.core, self.t = system, core, t
        self.fixed_q, self.fixed_v = fixed_q, fixed_v
        self.rank, self.redundant = rank, rank < len(system.constraints)
        self.constraint, self.dynamics = tables
        self.nq, self.nc = len(system.coordinates), len(system.constraints)
        self.holonomic = np.array(system.holonomic, dtype=np.intp)

    def __call__(self, parameters: Array, q: Array, v: Array) -> tuple[Array, Array, Flags]:
        """Return q, v and which rows were found."""
        with np.errstate(all="ignore"):
            q, converged = self.positions(self.fixed_q, parameters, q, v)
            v, met = self.velocities(parameters, q, v)
            return q, v, converged & met & self.regular(parameters, q, v)

    # values

    def inputs(self, parameters: Array, q: Array, v: Array) -> Array:
        pieces = self.system.functions.pieces_at(self.t)
        held = np.hstack([parameters, np.tile(pieces, (len(q), 1))])
        return np.hstack([np.full((len(q), 1), self.t), q, v, held])[None]

    def constraints(self, parameters: Array, q: Array, v: Array) -> Constraints[Array]:
        """Return φ (n, nh), B (n, nc, nq), b_0 (n, nc) and scales."""
        out = self.constraint(self.inputs(parameters, q, v), np.empty((1, 0)))[0]
        parts = {k: x.T for k, x in self.system.constraint_layout.split(out).items()}
        pattern = self.system.jacobian_pattern
        parts["jacobian"] = _matrices(parts["jacobian"], pattern, self.nc, self.nq)
        return Constraints(**parts)

    def entries(self, parameters: Array, q: Array, v: Array) -> Array:
        """Return the outputs of the dynamics tape, (n, outputs)."""
        out: Array = self.dynamics(self.inputs(parameters, q, v), np.empty((1, 0)))[0].T
        return out

    def sizes(self, mass: Array, jacobian: Array) -> Array:
        """Return the sizes of the coordinates, (n, nq)."""
        inertia = self.system.inertia(np.diagonal(mass, axis1=1, axis2=2))
        if (inertia > 0.0).all():
            return np.sqrt(1.0 / inertia)
        return np.array([coordinate_sizes(m, b) for m, b in zip(inertia, jacobian, strict=True)])

    def matrices(self, out: Array) -> tuple[Array, Array]:
        """Return M and B from outputs of the dynamics tape."""
        s, layout = self.system, self.system.dynamics_layout
        return (
            _matrices(out[:, layout.mass_matrix], s.mass_pattern, self.nq, self.nq),
            _matrices(out[:, layout.jacobian], s.jacobian_pattern, self.nc, self.nq),
        )

    def positions(self, fixed: Flags, parameters: Array, q: Array, v: Array) -> tuple[Array, Flags]:
        """Return q on φ = 0, and which rows were found."""
        if not self.system.holonomic:
            return q, np.ones(len(q), dtype=bool)
        statuses, found = self.core.positions(self.t, parameters, range(self.nc), fixed, q, v)
        return found, statuses == StartStatus.FOUND

    def velocities(self, parameters: Array, q: Array, v: Array) -> tuple[Array, Flags]:
        """Return v on ψ = 0, and which rows were found."""
        if not self.nc:
            return v, np.ones(len(v), dtype=bool)
        held, fixed = range(self.nc), self.fixed_v
        statuses, found = self.core.velocities(self.t, parameters, held, fixed, q, v)
        return found, statuses == StartStatus.FOUND

    def regular(self, parameters: Array, q: Array, v: Array) -> Flags:
        """Return which rows are finite and have a well-conditioned scaled [[M, Bᵀ], [B, 0]]."""
        entries = self.entries(parameters, q, v)
        mass, jacobian = self.matrices(entries)
        finite = _finite(entries)
        if self.redundant:
            mass[~finite], jacobian[~finite] = 0.0, 0.0
            finite &= self.keeps_rank(parameters, q, v, mass, jacobian)
            sizes = np.where(finite[:, None], self.sizes(mass, jacobian), 1.0)
            left, _, _ = _decomposed(jacobian * sizes[:, None])
            jacobian = left[:, :, : self.rank].swapaxes(1, 2) @ jacobian
        matrix = _saddle(mass, jacobian)
        matrix[~finite] = 0.0
        for _ in range(4):  # Ruiz, as in `elimination`
            scale = np.sqrt(np.abs(matrix).max(axis=2, initial=0.0))
            scale[scale == 0.0] = 1.0
            matrix /= scale[:, :, None] * scale[:, None, :]
        inverse = _inverses(matrix)
        return finite & (np.abs(inverse).max(axis=(1, 2), initial=0.0) < 1 / REGULAR)

    # redundant constraints

    def keeps_rank(
        self, parameters: Array, q: Array, v: Array, mass: Array, jacobian: Array
    ) -> Flags:
        """Return where B has its rank, at the state and beside it: `RankWatch.check_start`."""
        from lagcli.engine.constraints.singular import ASIDE

        sizes, rank = self.sizes(mass, jacobian), self.rank
        c = self.constraints(parameters, q, v)
        reach, reach_of_rates = (np.abs(x / sizes).max(axis=1)[:, None] for x in (q, v))
        lengths = _lengths_of_rows(jacobian * sizes[:, None])
        terms = c.velocity_scale * _SHORT
        kept = ((terms <= lengths * reach_of_rates) | (reach_of_rates == 0.0)).all(axis=1)
        terms = c.position_scale * _SHORT
        kept &= (terms <= lengths[:, self.holonomic] * reach).all(axis=1) & (reach[:, 0] > 0.0)
        kept &= (lengths > 0.0).all(axis=1)
        lengths = np.where(kept[:, None], lengths, 1.0)
        scaled = jacobian * sizes[:, None] / lengths[:, :, None]
        scaled[~kept] = 0.0
        _, values, right = np.linalg.svd(scaled)
        kept &= self.has_rank(values)
        free = sizes[:, :, None] * right[:, rank:].swapaxes(1, 2)
        mixture = free @ np.cos(1.0 + np.arange(free.shape[2]))
        none = np.zeros(self.nq, dtype=bool)
        for direction in (*np.moveaxis(free, 2, 0), mixture):
            for side in (-ASIDE, ASIDE):
                aside = q + side * reach * direction
                beside, reached = self.positions(none, parameters, aside, v)
                near = self.constraints(parameters, beside, v).jacobian * sizes[:, None]
                kept &= reached & _finite(near)
                near[~kept] = 0.0
                scaled = near / lengths[:, :, None]
                kept &= self.has_rank(np.asarray(np.linalg.svd(scaled, compute_uv=False), float))
        return kept

    def has_rank(self, values: Array) -> Flags:
        """Return where singular values are those of a B that clearly has the rank."""
        ranks: Indices = (values > _RANK).sum(axis=1)
        return _are_clear(values) & (ranks == self.rank)


# linear algebra of many small matrices, each computed independently


def _finite(x: Array) -> Flags:
    """Return which rows, or matrices, are finite: those with a finite sum."""
    return np.isfinite(x.reshape(len(x), -1).sum(axis=1))


def _matrices(entries: Array, pattern: Pattern, rows: int, columns: int) -> Array:
    """Return matrices (n, rows, columns) from their nonzero entries (n, entries)."""
    flat = np.zeros((len(entries), rows * columns))
    flat[:, [i * columns + j for i, j in pattern]] = entries
    return flat.reshape(len(entries), rows, columns)


def _saddle(mass: Array, jacobian: Array) -> Array:
    """Return [[M, Bᵀ], [B, 0]]."""
    count, nc, nq = jacobian.shape
    matrix = np.zeros((count, nq + nc, nq + nc))
    matrix[:, :nq, :nq] = mass
    matrix[:, nq:, :nq] = jacobian
    matrix[:, :nq, nq:] = jacobian.transpose(0, 2, 1)
    return matrix


def _inverses(matrix: Array) -> Array:
    """Return inverses; ∞ for singular matrices."""
    inverse = np.full(matrix.shape, np.inf)
    sign, _ = np.linalg.slogdet(matrix)
    rows = np.flatnonzero(np.isfinite(sign) & (sign != 0.0))
    inverse[rows] = np.linalg.inv(matrix[rows])
    return inverse


def _lengths_of_rows(jacobian: Array) -> Array:
    return np.sqrt((jacobian * jacobian).sum(axis=2))


def _decomposed(jacobian: Array) -> tuple[Array, Array, Array]:
    """Return U, the singular values of rows of equal length, and their lengths; 1 for zeros."""
    lengths = _lengths_of_rows(jacobian)
    lengths = np.where(np.isfinite(lengths) & (lengths > 0.0), lengths, 1.0)
    scaled = jacobian / lengths[:, :, None]
    scaled[~_finite(scaled)] = 0.0
    left, values, _ = np.linalg.svd(scaled, full_matrices=False)
    return left, values, lengths


def _are_clear(values: Array) -> Flags:
    """Return where no singular value may count as zero or not."""
    low, high = _DOUBTFUL
    clear: Flags = np.all((values <= low) | (values >= high), axis=1)
    return clear
