"""Matrices of a System as NumPy arrays, at one state or many."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.scales import apart, coordinate_sizes, largest, lengths_of_rows, row_lengths
from lagcli.engine.sparse_rows import SparseRows, entries_of
from lagcli.engine.system import Pattern, State, System
from lagcli.engine.tape.interpreter import ScalarTape

#: Powers of ten searched for the change of a constraint; beyond, its terms are rounding errors.
_DECADES = 20
#: Number of entries of B, zeros among them, above which it is kept as its nonzero ones where only
#: its rows matter.
_LARGE = 250_000


class Dynamics(NamedTuple):
    """M, f, B, γ and the external power at one state (or, with a last axis, at many)."""

    mass_matrix: Array
    forcing: Array
    jacobian: Array
    rhs: Array
    power: Array
    finite: bool


#: B as an array, or as that or its nonzero entries.
Rows = TypeVar("Rows", bound=Array | SparseRows)


class Constraints(NamedTuple, Generic[Rows]):
    """φ, B, b_0 and the constraints' scales at one state (or, with a last axis, at many)."""

    position: Array
    jacobian: Rows
    drift: Array
    position_scale: Array
    velocity_scale: Array

    @property
    def finite(self) -> bool:
        """Whether φ, B and b_0 are finite."""
        parts = self.position, entries_of(self.jacobian), self.drift
        return all(np.isfinite(x).all() for x in parts)

    def velocity(self, v: Array) -> Array:
        """Return ψ = B v + b_0 at one state."""
        return self.jacobian @ v + self.drift


class Entries(NamedTuple):
    """The outputs of the dynamics and constraint tapes at many states, along the last axis.

    M (nm, n) and B (nb, n) are in their entries at the places of the System's patterns; f is
    (nq, n), γ, b_0 and the scale of ψ (nc, n), φ and its scale (nh, n), the power (1, n).
    """

    mass_matrix: Array
    forcing: Array
    jacobian: Array
    rhs: Array
    power: Array
    position: Array
    drift: Array
    position_scale: Array
    velocity_scale: Array


class TapeMatrices:
    """Converts outputs of a System's tapes to matrices, at one state or many."""

    def __init__(self, system: System):
        self.nq, self.nc = len(system.coordinates), len(system.constraints)
        self.of_dynamics = system.dynamics_layout
        self.of_constraint = system.constraint_layout
        self.mass = self._flat(system.mass_pattern)
        self.jacobian = self._flat(system.jacobian_pattern)
        self._diagonal = np.flatnonzero(self.mass % (self.nq + 1) == 0)

    def _flat(self, pattern: Pattern) -> Indices:
        return np.array([i * self.nq + j for i, j in pattern], dtype=np.intp)

    def matrix(self, rows: int, places: Indices, values: Array) -> Array:
        """Return a matrix with nq columns from its nonzero entries."""
        flat = np.zeros((rows * self.nq, *values.shape[1:]))
        flat[places] = values
        return flat.reshape(rows, self.nq, *values.shape[1:])

    def rows(self, values: Array) -> Array | SparseRows:
        """Return B at one state; of a large system, its nonzero entries."""
        if self.nc * self.nq <= _LARGE:
            return self.matrix(self.nc, self.jacobian, values)
        return SparseRows((self.nc, self.nq), *np.divmod(self.jacobian, self.nq), values)

    def scales(self, out: Array) -> tuple[Array, Array | SparseRows]:
        """Return M_jj and `rows` of the dynamics tape."""
        parts, mass_diagonal = self.of_dynamics.split(out), np.zeros(self.nq)
        places = self.mass[self._diagonal] // (self.nq + 1)
        mass_diagonal[places] = parts["mass_matrix"][self._diagonal]
        return mass_diagonal, self.rows(parts["jacobian"])

    def dynamics(self, out: Array, finite: bool) -> Dynamics:
        """Return the matrices of the dynamics tape."""
        parts = self.of_dynamics.split(out)
        parts["mass_matrix"] = self.matrix(self.nq, self.mass, parts["mass_matrix"])
        parts["jacobian"] = self.matrix(self.nc, self.jacobian, parts["jacobian"])
        parts["power"] = parts["power"][0]
        return Dynamics(**parts, finite=finite)

    def constraints(self, out: Array) -> Constraints[Array]:
        """Return the matrices of the constraint tape."""
        parts = self.of_constraint.split(out)
        parts["jacobian"] = self.matrix(self.nc, self.jacobian, parts["jacobian"])
        return Constraints(**parts)

    def constraint_rows(self, out: Array) -> Constraints[Array | SparseRows]:
        """Return the same at one state, with `rows`."""
        parts: dict[str, Any] = self.of_constraint.split(out)
        parts["jacobian"] = self.rows(parts["jacobian"])
        return Constraints(**parts)


@lru_cache(maxsize=4)
def matrices_of(system: System) -> TapeMatrices:
    """Return the matrices of a System, whose places all evaluators and blocks of a run share."""
    return TapeMatrices(system)


class _Bound(NamedTuple):
    """What the evaluators of a System have in common."""

    dynamics: ScalarTape
    constraint: ScalarTape
    tangent: ScalarTape | None
    matrices: TapeMatrices


@lru_cache(maxsize=4)
def _bound(system: System) -> _Bound:
    """Return the tapes and layouts that all evaluators of a System share."""
    return _Bound(
        ScalarTape(system.dynamics),
        ScalarTape(system.constraint),
        None if system.tangent is None else ScalarTape(system.tangent.tape),
        matrices_of(system),
    )


class _OfOneState:
    """A tape that keeps its outputs at the last state: several matrices are asked for there."""

    def __init__(self, tape: ScalarTape):
        self._tape = tape
        self._last: tuple[bytes, tuple[float, ...], list[float]] = b"", (), []

    def __call__(self, t: float, q: Array, v: Array, p: tuple[float, ...]) -> list[float]:
        """Return the outputs."""
        state = np.concatenate(([t], q, v))
        at, with_values, outputs = self._last
        if with_values is not p or at != state.tobytes():
            outputs = self._tape((*state.tolist(), *p))
            self._last = state.tobytes(), p, outputs
        return outputs

    def hold(self, pieces: list[float] | None) -> None:
        """Use given pieces of the known functions of time; None selects those at t."""
        self._last = b"", (), []
        self._tape.hold(pieces)


class Evaluator:
    """Evaluates a System at single states.

    Parameters
    ----------
    system : System
    p : tuple of float
        Values of its parameters.
    """

    def __init__(self, system: System, p: tuple[float, ...]):
        self.system, self.p = system, p
        bound = _bound(system)
        self._dynamics = _OfOneState(bound.dynamics.own())
        self._constraint = _OfOneState(bound.constraint.own())
        self._tangent = None if bound.tangent is None else bound.tangent.own()
        self._matrices = bound.matrices
        self._holonomic = list(system.holonomic)

    def with_parameters(self, p: tuple[float, ...]) -> Evaluator:
        """Return an evaluator of the same System with other values of its parameters."""
        import copy

        other = copy.copy(self)
        other.p = p
        return other

    def hold(self, t: float) -> None:
        """Use the pieces of the known functions of time that hold from a time on."""
        pieces = self.system.functions.pieces_at(t)
        self._dynamics.hold(pieces)
        self._constraint.hold(pieces)
        if self._tangent is not None:
            self._tangent.hold(pieces)

    def state(self, t: float, q: Array, v: Array) -> State:
        """Return a state with these values of the parameters; it keeps copies of q and v."""
        return State(t, q.copy(), v.copy(), self.p)

    def entries(self, t: float, q: Array, v: Array) -> list[float]:
        """Return the outputs of the dynamics tape."""
        return self._dynamics(t, q, v, self.p)

    def dynamics(self, t: float, q: Array, v: Array) -> Dynamics:
        """Return M, f, B, γ and the external power."""
        numbers = self.entries(t, q, v)
        # a sum is finite if its terms are, and is cheap to compute
        return self._matrices.dynamics(np.array(numbers), math.isfinite(sum(numbers)))

    def with_tangent(
        self, d: Dynamics, t: float, q: Array, v: Array, a: Array, multipliers: Array
    ) -> Dynamics:
        """Return the dynamics with f and γ of the derivatives, from a and λ of the motion."""
        assert self._tangent is not None
        motion = self.system.motion
        nq, nc = len(motion.coordinates), len(motion.constraints)
        state = (t, *q.tolist(), *v.tolist())
        out = self._tangent((*state, *a[:nq].tolist(), *multipliers[:nc].tolist(), *self.p))
        sides = np.array(out).reshape(-1, nq + nc)
        forcing, rhs = d.forcing.copy(), d.rhs.copy()
        forcing[nq:], rhs[nc:] = sides[:, :nq].ravel(), sides[:, nq:].ravel()
        return d._replace(forcing=forcing, rhs=rhs, finite=math.isfinite(sum(out)))

    def constraints(self, t: float, q: Array, v: Array) -> Constraints[Array]:
        """Return φ, B, b_0 and scales."""
        numbers = self._constraint(t, q, v, self.p)
        return self._matrices.constraints(np.array(numbers))

    def constraint_rows(self, t: float, q: Array, v: Array) -> Constraints[Array | SparseRows]:
        """Return the same; of a large system, the nonzero entries of B."""
        numbers = self._constraint(t, q, v, self.p)
        return self._matrices.constraint_rows(np.array(numbers))

    def inertia(self, t: float, q: Array, v: Array) -> Array:
        """Return the inertia of each coordinate, (nq,), as in `System.inertia`."""
        return self.system.inertia(self._matrices.scales(np.array(self.entries(t, q, v)))[0])

    def sizes(self, t: float, q: Array, v: Array) -> Array:
        """Return changes of the coordinates that are considered equal in size at a state."""
        mass_diagonal, rows = self._matrices.scales(np.array(self.entries(t, q, v)))
        return coordinate_sizes(self.system.inertia(mass_diagonal), rows)

    def row_lengths(
        self, t: float, q: Array, v: Array, c: Constraints[Rows], sizes: Array
    ) -> Array:
        """Return scales of the rows of B times sizes that do not vanish with the rows, (nc,).

        Parameters
        ----------
        t, q, v
            A state.
        c : Constraints
            Their values there.
        sizes : (nq,) array
            Changes of the coordinates that count as equal.
        """
        if not self.system.constraints:
            return np.empty(0)
        length = row_lengths(c.jacobian, sizes, c.velocity_scale, largest(v, sizes))
        if some := self._holonomic:
            rows, terms = c.jacobian[some], c.position_scale
            reach = np.full(len(some), largest(q, sizes))
            lengths = row_lengths(rows, sizes, terms, reach)
            for k in np.flatnonzero(lengths > lengths_of_rows(rows, sizes)):
                reach[k] = self.reach(t, q, v, some[k], terms[k], sizes, reach[k])
            length[some] = row_lengths(rows, sizes, terms, reach)
        return length

    def reach(
        self, t: float, q: Array, v: Array, row: int, change: float, sizes: Array, least: float
    ) -> float:
        """Return the change of the coordinates that changes a constraint by an amount.

        In multiples of the sizes, by powers of ten. The size of coordinates that are zero except
        for rounding is meaningless, while l in x + l cos φ = l is not.
        """
        for far in least * 10.0 ** np.arange(_DECADES):
            beside = self.constraint_rows(t, q + far * apart(sizes), v)
            length = lengths_of_rows(beside.jacobian[[row]], sizes)[0]
            if not far * length < change:
                break
        return float(far)
