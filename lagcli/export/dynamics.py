"""The dynamics of a model as a function of Python, for many states at once."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.engine.core.batch import BatchTable
from lagcli.engine.evaluator import Evaluator, TapeMatrices
from lagcli.engine.integrate.prepared import find_elimination
from lagcli.engine.layout import UnrolledLayout
from lagcli.engine.linear.elimination import Elimination
from lagcli.engine.system import System
from lagcli.engine.tape.tape import Arithmetic, Tape
from lagcli.errors import UsageError
from lagcli.export.content import Content, content_of
from lagcli.export.elimination import equations_of
from lagcli.model.model import Model, check_is_model
from lagcli.model.spelling import did_you_mean, nearest

#: Residual of the equations, relative to the sum of their terms' magnitudes and added up, above
#: which a state is solved again with pivots of its own.
_ACCURATE = 1e-12
#: Number of states that are evaluated together: their results stay in the cache.
_BLOCK = 4096


class DynamicsSolution(NamedTuple):
    """Accelerations (..., nq) and multipliers (..., nc)."""

    a: Array
    multipliers: Array


class DynamicsDerivatives(NamedTuple):
    """Derivatives of the accelerations and of the multipliers.

    Parameters
    ----------
    a_t, a_q, a_v, a_p : (..., nq), (..., nq, nq), (..., nq, nq), (..., nq, np) arrays
        ∂a/∂t, ∂a/∂q, ∂a/∂v and ∂a/∂p.
    multipliers_t, multipliers_q, multipliers_v, multipliers_p : arrays
        The same of λ: (..., nc), (..., nc, nq), (..., nc, nq), (..., nc, np).
    """

    a_t: Array
    a_q: Array
    a_v: Array
    a_p: Array
    multipliers_t: Array
    multipliers_q: Array
    multipliers_v: Array
    multipliers_p: Array


class DynamicsFunction:
    """The function (t, q, v, p) → a, λ of M a = f + Bᵀλ, B a = γ; see `dynamics`.

    Attributes
    ----------
    coordinates, constraints, parameters : tuples of str
        Names of the entries of q, λ and p.
    columns : tuple of str
        Names of what `outputs` returns.
    t : float
        The time of the initial state, s.
    q, v : (nq,) arrays
        A consistent initial state.
    p : (np,) array
        The values of the parameters, in SI units.
    """

    def __init__(self, content: Content):
        system, state = content.system, content.start.state
        self.coordinates, self.constraints = system.coordinates, system.constraints
        self.parameters, self.columns = system.parameters, content.columns
        self.t, self.q, self.v, self.p = state.t, state.q, state.v, np.array(state.p)
        self._content, self._system = content, system
        self._rows = np.array(content.rows, dtype=np.intp)
        self._matrices = TapeMatrices(system)

    def values(self, **changed: float) -> Array:
        """Return p with other values of some parameters, in SI units.

        Parameters whose value the model computes from others keep it.

        Raises
        ------
        UsageError
            There is no such parameter.
        """
        p = self.p.copy()
        for name, value in changed.items():
            if name not in self.parameters:
                hint = did_you_mean(nearest(name, self.parameters))
                raise UsageError(
                    f"`{name}` is not a parameter of {self._content.model.name}"
                    + (f"; {hint}" if hint else "")
                )
            p[self.parameters.index(name)] = value
        return p

    def __call__(
        self,
        t: float | Array,
        q: Array,
        v: Array,
        p: Array | None = None,
    ) -> DynamicsSolution:
        """Return the accelerations and the multipliers at states.

        The axes before the last one are those of the states; arrays are broadcast.

        Parameters
        ----------
        t : float or (...) array
            s.
        q, v : (..., nq) arrays
        p : (..., np) array, optional
            Values of the parameters; those of the model by default.

        Returns
        -------
        Solution
            NaN where the equations do not determine the accelerations.

        Raises
        ------
        UsageError
            An array has not the right shape.
        """
        rows, shape = self._states(t, q, v, p)
        solved = self._solve(rows)
        nq = len(self.coordinates)
        return DynamicsSolution(
            solved[:, :nq].reshape(*shape, nq),
            solved[:, nq:].reshape(*shape, len(self.constraints)),
        )

    def residuals(
        self, t: float | Array, q: Array, v: Array, p: Array | None = None
    ) -> tuple[Array, Array]:
        """Return φ (..., nh) of the holonomic constraints and ψ (..., nc) at states."""
        rows, shape = self._states(t, q, v, p)
        out, nh = self._constraint_table(rows), self._system.counts.nh
        return out[:, :nh].reshape(*shape, nh), out[:, nh:].reshape(*shape, -1)

    def outputs(
        self, t: float | Array, q: Array, v: Array, p: Array | None = None
    ) -> dict[str, Array]:
        """Return energies, powers and the outputs of the model at states, by name."""
        rows, shape = self._states(t, q, v, p)
        out = self._report_table(self._with_solution(rows, self._solve(rows)))
        return {name: x.reshape(shape) for name, x in zip(self.columns, out.T, strict=True)}

    def derivatives(
        self, t: float | Array, q: Array, v: Array, p: Array | None = None
    ) -> DynamicsDerivatives:
        """Return the derivatives of a and λ at states.

        With redundant constraints they are those of the values that this function has: also where
        the constraints do not hold, so that they are no longer redundant there. Along motions on
        the constraints, they do not depend on the rows that are left out.
        """
        rows, shape = self._states(t, q, v, p)
        nq = len(self.coordinates)
        solved = self._solve(rows)
        a, multipliers = solved[:, :nq], solved[:, nq:]
        mass, _, jacobian, _ = self._equations(rows)
        if self._content.redundant:
            x, of_multipliers = self._least_norm_slopes(rows, a, multipliers, mass, jacobian)
        else:
            right = self._slopes(rows, a, multipliers)
            x, of_multipliers = _solve_dense(mass, right[:, :nq], jacobian, right[:, nq:])
        parts = [
            block.reshape(*shape, *block.shape[1:])
            for whole in (x, of_multipliers)
            for block in (
                whole[:, :, 0],
                whole[:, :, 1 : 1 + nq],
                whole[:, :, 1 + nq : 1 + 2 * nq],
                whole[:, :, 1 + 2 * nq :],
            )
        ]
        return DynamicsDerivatives(*parts)

    # states as rows (t, q, v, p, pieces of tables)

    def _states(
        self, t: float | Array, q: Array, v: Array, p: Array | None
    ) -> tuple[Array, tuple[int, ...]]:
        """Return the states as rows, and the shape of their axes."""
        nq = len(self.coordinates)
        times = np.asarray(t, dtype=float)
        given = {"q": (q, nq), "v": (v, nq), "p": (self.p if p is None else p, len(self.p))}
        arrays = {}
        for name, (array, size) in given.items():
            arrays[name] = values = np.asarray(array, dtype=float)
            if values.shape[-1:] != (size,):
                raise UsageError(
                    f"{name} must have {size} numbers along its last axis; its shape is"
                    f" {values.shape}"
                )
        try:
            shape = np.broadcast_shapes(times.shape, *(x.shape[:-1] for x in arrays.values()))
        except ValueError:
            shapes = ", ".join(f"{name} {x.shape}" for name, x in arrays.items())
            raise UsageError(
                f"the shapes of the states differ: t {times.shape}, {shapes}"
            ) from None
        rows = np.empty((*shape, self._system.dynamics.inputs))
        rows[..., 0] = times
        first = 1
        for array in arrays.values():
            rows[..., first : first + array.shape[-1]] = array
            first += array.shape[-1]
        if first < rows.shape[-1]:
            rows[..., first:] = self._system.functions.pieces(rows[..., 0].ravel()).reshape(
                *shape, -1
            )
        return rows.reshape(-1, rows.shape[-1]), shape

    def _with_solution(self, rows: Array, solved: Array) -> Array:
        """Return rows with a and λ between v and the parameters."""
        state = 1 + 2 * len(self.coordinates)
        return np.hstack([rows[:, :state], solved, rows[:, state:]])

    # tapes

    @cached_property
    def _dynamics_table(self) -> _Table:
        return _Table(self._content.dynamics)

    @cached_property
    def _constraint_table(self) -> _Table:
        return _Table(self._content.constraints)

    @cached_property
    def _report_table(self) -> _Table:
        return _Table(self._content.report)

    @cached_property
    def _slope_table(self) -> _Table:
        return _Table(self._content.slopes.tape)

    @cached_property
    def _eliminated(self) -> _Table | None:
        """The tape of a, λ and their residual with the elimination of the initial state."""
        start = self._content.start
        if self._content.redundant:
            return None
        evaluator = Evaluator(self._system, start.state.p)
        elimination = start.elimination or find_elimination(evaluator, [start.state])
        return None if elimination is None else _Table(solved_tape(self._system, elimination))

    def _solve(self, rows: Array) -> Array:
        """Return a and λ, (n, nq + nc)."""
        unknowns = self._system.counts.unknowns
        if self._eliminated is None:
            return self._solve_each(rows)
        out = self._eliminated(rows)
        solved = out[:, :unknowns]
        inaccurate = np.flatnonzero(~(out[:, unknowns] < _ACCURATE))
        if len(inaccurate):
            solved = solved.copy()
            solved[inaccurate] = self._solve_each(rows[inaccurate])
        return solved

    def _solve_each(self, rows: Array) -> Array:
        """Return a and λ by elimination with pivots of each state."""
        mass, force, jacobian, rhs = self._equations(rows)
        kept = self._rows
        a, multipliers = _solve_dense(mass, force[..., None], jacobian[:, kept], rhs[:, kept, None])
        if len(kept) < len(self.constraints):
            # of all λ with Bᵀλ = B_rᵀμ, the one of least norm
            shares = self._shares(jacobian)
            multipliers = shares @ _solve_stack(_turned(shares) @ shares, multipliers)
        return np.hstack([a[..., 0], multipliers[..., 0]])

    def _shares(self, jacobian: Array) -> Array:
        """Return C of B = C B_r, (n, nc, rank), where B_r are the independent rows."""
        own = jacobian[:, self._rows]
        return _turned(_solve_stack(own @ _turned(own), own @ _turned(jacobian)))

    def _slopes(self, rows: Array, a: Array, multipliers: Array) -> Array:
        """Return the derivatives of G above Γ at fixed a and λ, (n, nq + nc, 1 + 2 nq + np)."""
        pattern = self._content.slopes.pattern
        unknowns, size = a.shape[1] + multipliers.shape[1], 1 + 2 * a.shape[1] + len(self.p)
        out = np.zeros((len(rows), unknowns, size))
        if pattern:
            down, across = np.array(pattern, dtype=np.intp).T
            points = self._with_solution(rows, np.hstack([a, multipliers]))
            out[:, down, across] = self._slope_table(points)
        return out

    def _least_norm_slopes(
        self, rows: Array, a: Array, multipliers: Array, mass: Array, jacobian: Array
    ) -> tuple[Array, Array]:
        """Return the derivatives of a and of λ = C s with Cᵀ C s = μ, by t, q, v and p.

        G and Γ are affine in a and λ, so that differences of their derivatives are ∂(B x) and
        ∂(Bᵀ l) at fixed x and l.
        """
        kept, nq = self._rows, a.shape[1]
        own, shares = jacobian[:, kept], self._shares(jacobian)
        square = own @ _turned(own)
        no_a, none = np.zeros_like(a), np.zeros_like(multipliers)
        plain = self._slopes(rows, no_a, none)

        def of_rows(x: Array) -> Array:
            return np.asarray(plain[:, nq:] - self._slopes(rows, x[..., 0], none)[:, nq:])

        def of_forces(x: Array) -> Array:
            return np.asarray(self._slopes(rows, no_a, x[..., 0])[:, :nq] - plain[:, :nq])

        def spread(x: Array) -> Array:
            out = np.zeros((*multipliers.shape, 1))
            out[:, kept] = x
            return out

        forces = multipliers[..., None]
        mu = _turned(shares) @ forces
        right = self._slopes(rows, a, spread(mu)[..., 0])
        x, of_mu = _solve_dense(mass, right[:, :nq], own, right[:, nq:][:, kept])
        inner = _turned(shares) @ shares
        weights = _solve_stack(square, _solve_stack(inner, mu))
        rest = jacobian - shares @ own  # zero where the constraints hold
        along = of_rows(_turned(own) @ weights)
        turn = along - shares @ along[:, kept] + rest @ of_forces(spread(weights))
        back = own @ of_forces(forces - spread(mu)) + of_rows(_turned(rest) @ forces)[:, kept]
        change = of_mu - _solve_stack(square, back) - _turned(shares) @ turn
        return x, turn + shares @ _solve_stack(inner, change)

    def _equations(self, rows: Array) -> tuple[Array, Array, Array, Array]:
        """Return M (n, nq, nq), f (n, nq), B (n, nc, nq) and γ (n, nc)."""
        out, layout, matrices = (
            self._dynamics_table(rows),
            self._system.dynamics_layout,
            self._matrices,
        )
        nq, nc, n = matrices.nq, matrices.nc, len(rows)
        mass, jacobian = np.zeros((n, nq * nq)), np.zeros((n, nc * nq))
        mass[:, matrices.mass] = out[:, layout.mass_matrix]
        jacobian[:, matrices.jacobian] = out[:, layout.jacobian]
        force, rhs = out[:, layout.forcing], out[:, layout.rhs]
        return mass.reshape(n, nq, nq), force, jacobian.reshape(n, nc, nq), rhs


class _Table:
    """A tape evaluated at rows of its inputs, by the core."""

    def __init__(self, tape: Tape):
        self._outputs = len(tape.outputs)
        self._table = BatchTable.of_rows(tape)

    def __call__(self, rows: Array) -> Array:
        """Return the outputs, (n, outputs)."""
        out = np.empty((len(rows), self._outputs))
        for first in range(0, len(rows), _BLOCK):
            some = rows[first : first + _BLOCK]
            out[first : first + len(some)] = self._table(some[None], np.empty((1, 0)))[0].T
        return out


def solved_tape(system: System, elimination: Elimination) -> Tape:
    """Return the tape (t, q, v, p) → (a, λ, residual) with an unrolled elimination.

    The residual is that of the equations, each relative to the sum of its terms' magnitudes,
    added up.
    """
    given, counts = system.dynamics, system.counts
    builder = Arithmetic(given.inputs, given.parameters, functions=given.functions)
    out, equations = equations_of(builder, system, elimination)
    residual, least = builder.zero, builder.constant(np.finfo(float).tiny)
    for equation in equations:
        total, size = builder.zero, least
        for term in equation:
            total = builder.plus(total, term)
            size = builder.plus(size, builder.magnitude(term))
        residual = builder.plus(
            residual, builder.times(builder.magnitude(total), builder.inverse(size))
        )
    return builder.finish([*out[UnrolledLayout(counts).solution], residual])


def _turned(matrices: Array) -> Array:
    return matrices.transpose(0, 2, 1)


def _solve_dense(mass: Array, force: Array, jacobian: Array, rhs: Array) -> tuple[Array, Array]:
    """Solve [[M, Bᵀ], [B, 0]] [a; −λ] = [f; γ] at many states, for several right sides each."""
    n, nq, nc = len(mass), mass.shape[1], jacobian.shape[1]
    # rows of B are scaled to the magnitude of M, so that pivots are comparable
    length = np.sqrt((jacobian**2).sum(axis=2))
    largest = mass.max(axis=(1, 2)) if nq else np.ones(n)
    largest = np.where(largest > 0, largest, 1.0)
    with np.errstate(all="ignore"):
        weight = np.where(length > 0, largest[:, None] / length, 1.0)[..., None]
    matrix = np.zeros((n, nq + nc, nq + nc))
    matrix[:, :nq, :nq] = mass
    matrix[:, nq:, :nq] = jacobian * weight
    matrix[:, :nq, nq:] = matrix[:, nq:, :nq].transpose(0, 2, 1)
    right = np.concatenate([force, rhs * weight], axis=1)
    x = _solve_stack(matrix, right)
    x += _solve_stack(matrix, right - matrix @ x)
    return x[:, :nq], -x[:, nq:] * weight


def _solve_stack(matrices: Array, right: Array) -> Array:
    """Solve systems of linear equations; NaN where one is singular."""
    try:
        solved = np.asarray(np.linalg.solve(matrices, right), dtype=np.float64)
        return solved
    except np.linalg.LinAlgError:
        out = np.full(right.shape, np.nan)
        for i, (matrix, side) in enumerate(zip(matrices, right, strict=True)):
            try:
                out[i] = np.linalg.solve(matrix, side)
            except np.linalg.LinAlgError:
                continue
        return out


def dynamics(model: Model) -> DynamicsFunction:
    """Return the dynamics of a model as a function (t, q, v, p) → a, λ.

    Parameters
    ----------
    model : Model

    Returns
    -------
    DynamicsFunction
        A callable for one state or many, with derivatives, residuals and outputs. It is used by
        one thread at a time.

    Raises
    ------
    UsageError
        The model switches, or it has more than 400 accelerations and multipliers.
    ModelError, NumericalError
        There is no consistent initial state.
    """
    check_is_model(model, "dynamics")
    return DynamicsFunction(content_of(model))
