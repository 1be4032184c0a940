"""Partial derivatives of a model's expressions at an operating point, as matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lagcli.arrays import Array, Indices
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.errors import UsageError
from lagcli.model.model import Model
from lagcli.model.spelling import did_you_mean, nearest

if TYPE_CHECKING:
    from symengine import Basic

    from lagcli.engine.system import System
    from lagcli.engine.tape.tape import Tape
    from lagcli.equations.derivation.lagrange import Equations, Row


#: Number of coordinates from which forward differentiation of the equations is faster.
_MANY = 20


class Point(NamedTuple):
    """A point t, q, v, a, λ with the parameters' values, at which expressions are evaluated.

    Parameters
    ----------
    t : float
        s.
    q, v, a : (nq,) arrays
    multipliers : (nc,) array
    p : tuple of float
    """

    t: float
    q: Array
    v: Array
    a: Array
    multipliers: Array
    p: tuple[float, ...]

    def inputs(self) -> list[float]:
        """Return the inputs of tapes: t, q, v, a, λ and parameters."""
        q, v, a, multipliers = self.q, self.v, self.a, self.multipliers
        return [self.t, *q.tolist(), *v.tolist(), *a.tolist(), *multipliers.tolist(), *self.p]


def point_tape(equations: Equations, expressions: Sequence[Basic]) -> Tape:
    """Compile expressions in t, q, v, a, λ and the parameters, the inputs of a `Point`."""
    import symengine as se

    from lagcli.engine.lowering.compiler import compile_tape, input_functions
    from lagcli.model.model import TIME

    eq = equations
    inputs = [TIME, *eq.q, *eq.v, *eq.a, *eq.multipliers]
    parameters = [se.Symbol(name) for name in eq.model.parameters]
    return compile_tape(expressions, inputs, parameters, input_functions(eq.model))


class Gradients:
    """Nonzero partial derivatives of expressions, as a tape.

    Parameters
    ----------
    equations : Equations
    rows : sequence of n rows
        The derivatives of each expression with respect to the symbols, in t, q, v, a, λ and the
        parameters.
    columns : int
        The number of symbols.
    """

    def __init__(self, equations: Equations, rows: Sequence[Row], columns: int):

        eq = equations
        self.shape = len(rows), columns
        self._places = _places([(i, j) for i, row in enumerate(rows) for j in row])
        expressions = [x for row in rows for x in row.values()]
        self._run = ScalarTape(point_tape(eq, expressions)) if expressions else None

    @classmethod
    def of(
        cls, equations: Equations, expressions: Sequence[Basic], symbols: Sequence[Basic]
    ) -> Gradients:
        """Differentiate expressions in t, q, v, a, λ and the parameters with respect to symbols."""
        from lagcli.equations.derivation.motion import Motion

        if not symbols:
            return cls(equations, [{} for _ in expressions], 0)
        motion, columns = Motion.of(equations.model), {x: j for j, x in enumerate(symbols)}
        rows = [motion.row([expression], columns) for expression in expressions]
        return cls(equations, rows, len(symbols))

    def at(self, point: Point) -> Array:
        """Return the matrix of derivatives, (n, m)."""
        if self._run is None:
            return np.zeros(self.shape)
        return _filled(self.shape, self._places, self._run(point.inputs()))


class Reactive:
    """The forces that depend on multipliers, and their derivatives with respect to these."""

    def __init__(self, equations: Equations):

        eq = equations
        self.slopes = Gradients.of(eq, eq.reactive_forces, eq.multipliers)
        self._forces = ScalarTape(point_tape(eq, eq.reactive_forces))

    def forces(self, point: Point) -> Array:
        """Return the forces at a point, (nq,)."""
        return np.array(self._forces(point.inputs()))


class MotionJacobians(NamedTuple):
    """∂G/∂q, ∂G/∂v (nq, nq), ∂Γ/∂q, ∂Γ/∂v (nc, nq), and ∂G/∂t (nq,), ∂Γ/∂t (nc,).

    G = f − M a + Bᵀλ and Γ = γ − B a at fixed a and λ, so that ∂G/∂q contains the geometric
    stiffness Σ λ ∂²φ of the constraints.
    """

    force_position: Array
    force_velocity: Array
    rhs_position: Array
    rhs_velocity: Array
    force_time: Array
    rhs_time: Array


class MotionJacobianTape:
    """The Jacobians of a System's equations of motion.

    Parameters
    ----------
    system : System
        A System with Jacobian tapes.
    """

    def __init__(self, system: System):

        assert system.variation is not None
        tapes = system.variation()
        self.nq, self.nc = len(system.coordinates), len(system.constraints)
        self._run = ScalarTape(tapes.tape)
        forces, rhs = (self.nq, self.nq), (self.nc, self.nq)
        self._matrices = (
            (forces, _places(tapes.force_position)),
            (forces, _places(tapes.force_velocity)),
            (rhs, _places(tapes.rhs_position)),
            (rhs, _places(tapes.rhs_velocity)),
        )
        self._power = len(tapes.power_position) + len(tapes.power_velocity)

    def at(self, point: Point) -> MotionJacobians:
        """Return the Jacobians at a point."""
        numbers = self._run(point.inputs())
        nq, nc = self.nq, self.nc
        matrices: list[Array] = []
        start = 0
        for shape, places in self._matrices:
            end = start + len(places[0])
            matrices.append(_filled(shape, places, numbers[start:end]))
            start = end
        times = np.array(numbers[start + self._power :])
        by_q, by_v, rates_by_q, rates_by_v = matrices
        return MotionJacobians(by_q, by_v, rates_by_q, rates_by_v, times[:nq], times[nq : nq + nc])


class ForwardJacobians:
    """The same Jacobians by forward differentiation along all coordinates at once.

    For many coordinates, compiling the derivatives takes several times as long as compiling the
    equations; one tape for a derivative along any direction takes twice as long. Each evaluation
    takes longer, by operations on arrays.
    """

    def __init__(self, equations: Equations):
        import symengine as se

        from lagcli.engine.tape.differentiation import directional
        from lagcli.equations.derivation.jacobians import residual_terms

        eq = equations
        self.nq = len(eq.q)
        force, rhs = residual_terms(eq)
        self._tape = directional(point_tape(eq, [se.Add(*terms) for terms in (*force, *rhs)]))

    def at(self, point: Point) -> MotionJacobians:
        """Return the Jacobians at a point."""
        from lagcli.engine.tape.interpreter import run_arrays

        nq, inputs = self.nq, point.inputs()
        directions = np.eye(1 + 2 * nq)  # of t, q and v; the other inputs are fixed
        slopes: list[Array | float] = [*directions, *[0.0] * (len(inputs) - len(directions))]
        derivatives = run_arrays(self._tape, [*inputs, *slopes], len(directions))
        force, rhs = derivatives[:nq], derivatives[nq:]
        by_q, by_v = slice(1, 1 + nq), slice(1 + nq, None)
        return MotionJacobians(
            force[:, by_q], force[:, by_v], rhs[:, by_q], rhs[:, by_v], force[:, 0], rhs[:, 0]
        )


def motion_jacobians(equations: Equations, system: System) -> MotionJacobianTape | ForwardJacobians:
    """Return an evaluator of the Jacobians of the equations of motion.

    Parameters
    ----------
    equations : Equations
    system : System
        Their System.
    """
    if len(equations.q) < _MANY:
        return MotionJacobianTape(system)
    return ForwardJacobians(equations)


def _places(pattern: Sequence[tuple[int, int]]) -> tuple[Indices, Indices]:
    """Return the rows and columns of a pattern."""
    rows, columns = np.array(pattern, dtype=np.intp).reshape(-1, 2).T
    return rows, columns


def _filled(
    shape: tuple[int, int], places: tuple[Indices, Indices], numbers: Sequence[float]
) -> Array:
    """Return a matrix with numbers at some places, and zeros."""
    matrix = np.zeros(shape)
    if numbers:
        matrix[places] = numbers
    return matrix


class ParameterPath:
    """The parameters as functions of one of them, including those defined by it.

    Parameters
    ----------
    model : Model
    name : str
        A parameter on which the structure of the model does not depend.

    Attributes
    ----------
    followers : tuple of str
        The parameters that change, ``name`` among them.

    Raises
    ------
    UsageError
        There is no such parameter, or coordinates, constraints or sums depend on it.
    """

    def __init__(self, model: Model, name: str):
        import symengine as se

        from lagcli.engine.lowering.compiler import compile_tape
        from lagcli.model.expression.functions import derivative
        from lagcli.model.values import dependent_values

        if name not in model.parameters:
            known = list(model.parameters)
            listed = f"the parameters are {', '.join(known[:20])}" if known else "it has none"
            raise UsageError(
                f"`{name}` is not a parameter of {model.name};"
                f" {did_you_mean(nearest(name, known)) or listed}"
            )
        if model.parameters[name].structural:
            raise UsageError(
                f"`{name}` cannot be varied continuously: coordinates, constraints or sums of the"
                " model depend on it"
            )
        symbol = se.Symbol(name)
        dependent = dependent_values(model, [name])
        self.name = name
        self.followers = tuple(n for n in model.parameters if n in dependent)
        values = [dependent[n] for n in self.followers]
        self._places = [list(model.parameters).index(n) for n in self.followers]
        slopes = [derivative(value, symbol) for value in values]
        self._tape = ScalarTape(compile_tape([*values, *slopes], [symbol]))

    def values(self, p: tuple[float, ...], value: float) -> tuple[float, ...]:
        """Return p with another value of the parameter and the parameters that depend on it."""
        values = list(p)
        for place, x in zip(self._places, self._tape([value]), strict=False):
            values[place] = x
        return tuple(values)

    def slopes(self, value: float) -> Array:
        """Return the derivatives of the followers with respect to the parameter, (followers,)."""
        return np.array(self._tape([value])[len(self._places) :])
