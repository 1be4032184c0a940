"""Lowering: Equations → System, and the derivatives for implicit methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import symengine as se

from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.lowering.right_sides import (
    long_constraints,
    residuals,
    right_sides,
    rows_of,
    sources_of,
)
from lagcli.engine.system import JacobianTapes, ParameterTapes, Pattern, System
from lagcli.engine.tape.inputs import NO_FUNCTIONS, InputFunctions
from lagcli.engine.tape.tape import Tape

if TYPE_CHECKING:
    from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations


def lower(equations: Equations) -> System:
    """Compile the equations of motion to tapes.

    Parameters
    ----------
    equations : Equations

    Returns
    -------
    System
    """
    from lagcli.equations.derivation.column_expressions import reported

    eq, model = equations, equations.model
    state, parameters = _inputs(eq)
    functions = input_functions(model)
    rows = [c.row for c in eq.constraints]
    holonomic = tuple(i for i, c in enumerate(eq.constraints) if c.position is not None)
    mass_pattern = tuple((i, j) for i, row in enumerate(eq.mass_matrix) for j in sorted(row))
    jacobian_pattern = tuple((i, j) for i, row in enumerate(rows) for j in sorted(row))
    mass = [eq.mass_matrix[i][j] for i, j in mass_pattern]
    jacobian = [rows[i][j] for i, j in jacobian_pattern]

    positions = [c.position for c in eq.constraints if c.position is not None]
    switching, conditions = None, None
    if eq.switches:
        from lagcli.engine.lowering.switching import lower_switching

        switching, conditions = lower_switching(eq)
    dynamics, constraint = _tapes(eq, mass, jacobian, positions, functions)
    return System(
        coordinates=model.coordinate_names,
        constraints=model.constraint_names,
        holonomic=holonomic,
        parameters=tuple(model.parameters),
        mass_pattern=mass_pattern,
        jacobian_pattern=jacobian_pattern,
        dynamics=dynamics,
        constraint=constraint,
        report=compile_tape(
            [*reported(eq), *eq.outputs.values()],
            [*state, *eq.a, *eq.multipliers],
            parameters,
            functions,
        ),
        outputs=tuple(eq.outputs),
        events=conditions,
        switching=switching,
        nonlinear=tuple(
            i for i, c in enumerate(eq.constraints) if c.constraint.kind == "nonlinear"
        ),
        variation=partial(lower_jacobians, eq, functions),
        parameter_variation=partial(lower_parameter_jacobians, eq, functions),
        same_unit=_same_unit(positions, eq.q),
        functions=functions,
        recursive_form=partial(lower_recursive, eq, functions) if eq.recursive else None,
    )


def _inputs(equations: Equations) -> tuple[list[se.Basic], list[se.Basic]]:
    """Return the symbols of t, q, v, and of the parameters."""
    from lagcli.model.model import TIME

    parameters = [se.Symbol(name) for name in equations.model.parameters]
    return [TIME, *equations.q, *equations.v], parameters


def _tapes(
    eq: Equations,
    mass: Sequence[se.Basic],
    jacobian: Sequence[se.Basic],
    positions: Sequence[se.Basic],
    functions: InputFunctions,
) -> tuple[Tape, Tape]:
    """Compile M, f, B, γ, and the power of applied forces and of time; and φ, B, b_0 and scales."""
    from lagcli.equations.derivation.column_expressions import power_free

    power = power_free(eq) + eq.time_power
    long, before = long_constraints(eq), [*mass, *eq.forcing, *jacobian]
    right = [se.Integer(0) if i in long else c.rhs for i, c in enumerate(eq.constraints)]
    dynamics = [*before, *right, power, *sources_of(long)]
    drifts = [c.drift for c in eq.constraints]
    scales = [*map(magnitude, positions), *(magnitude(c.velocity) for c in eq.constraints)]
    whole = compile_tape([*dynamics, *positions, *drifts, *scales], *_inputs(eq), functions)
    tape = whole.selected(range(len(dynamics)))
    every = range(len(whole.outputs))
    of_positions = every[len(dynamics) :][: len(positions)]
    of_jacobian = every[len(before) - len(jacobian) : len(before)]
    constraint = whole.selected([*of_positions, *of_jacobian, *every[of_positions.stop :]])
    if not long:
        return tape, constraint
    from lagcli.engine.tape.differentiation import DerivativeBuilder

    given, nq = len(before) + len(right) + 1, len(eq.q)
    builder, outputs = DerivativeBuilder.of(tape)
    found = right_sides(builder, long, iter(outputs[given:]), range(1 + nq, 1 + 2 * nq))
    for i, register in zip(long, found, strict=True):
        outputs[len(before) + i] = register
    return builder.finish(outputs).selected(range(given)), constraint


def lower_recursive(equations: Equations, functions: InputFunctions = NO_FUNCTIONS) -> System:
    """Compile the recursive form of equations to a tape.

    Parameters
    ----------
    equations : Equations
    functions : InputFunctions, optional
        The model's inputs.

    Returns
    -------
    System
        See `System.recursive`; it has no tapes besides the dynamics.
    """
    from lagcli.equations.derivation.motion import Motion
    from lagcli.equations.derivation.recursion import in_velocities

    eq, recursive = equations, equations.recursive
    assert recursive is not None
    nq, velocities = len(eq.q), recursive.velocities
    mass = {(i, j): x for i, row in enumerate(recursive.mass_matrix) for j, x in row.items()}
    jacobian: dict[tuple[int, int], se.Basic] = {}
    for k, w in enumerate(velocities):
        mass[nq + k, nq + k] = w.factor
        jacobian |= {(k, j): -x for j, x in w.difference.row.items()}
        if w.before is not None:
            jacobian[k, nq + w.before] = se.Integer(-1)
        jacobian[k, nq + k] = se.Integer(1)
    rows = in_velocities(eq.constraints, velocities, Motion.of(eq.model))
    for i, row in enumerate(rows, len(velocities)):
        jacobian |= {(i, j): x for j, x in row.rest.items()}
        jacobian |= {(i, nq + k): x for k, x in row.factors.items()}
    zero = se.Integer(0)
    rates = [w.difference.rate for w in velocities]
    outputs = [*mass.values(), *recursive.forcing, *[zero] * len(velocities)]
    outputs += [*jacobian.values(), *rates, *[zero] * len(rows), zero]
    names = tuple(f"velocity[{k}]" for k in range(len(velocities)))
    nothing = Tape(0, (), (), ())
    return System(
        coordinates=(*eq.model.coordinate_names, *names),
        constraints=(*names, *eq.model.constraint_names),
        holonomic=(),
        parameters=tuple(eq.model.parameters),
        mass_pattern=tuple(mass),
        jacobian_pattern=tuple(jacobian),
        dynamics=compile_tape(outputs, *_inputs(eq), functions),
        constraint=nothing,
        report=nothing,
        functions=functions,
    )


def lower_jacobians(
    equations: Equations, functions: InputFunctions = NO_FUNCTIONS
) -> JacobianTapes:
    """Compile the derivatives of the equations to a tape.

    Parameters
    ----------
    equations : Equations
    functions : InputFunctions, optional
        The model's inputs.

    Returns
    -------
    JacobianTapes
    """
    from lagcli.equations.derivation.jacobians import differentiate

    eq, long = equations, long_constraints(equations)
    jacobians = differentiate(eq, without=long)
    blocks: list[list[Mapping[int, Any]]] = [
        [g.position for g in jacobians.force],
        [g.velocity for g in jacobians.force],
        [g.position for g in jacobians.rhs],
        [g.velocity for g in jacobians.rhs],
        [jacobians.power.position],
        [jacobians.power.velocity],
    ]
    state, parameters = _inputs(eq)
    entries = [x for block in blocks for row in block for x in row.values()]
    times = [g.time for g in (*jacobians.force, *jacobians.rhs, jacobians.power)]
    tape = compile_tape(
        [*entries, *times, *sources_of(long), *rows_of(long)],
        [*state, *eq.a, *eq.multipliers],
        parameters,
        functions,
    )
    if long:
        tape = _with_gradients(eq, tape, blocks, long)
    force_position, force_velocity, rhs_position, rhs_velocity = map(_pattern, blocks[:4])
    return JacobianTapes(
        force_position=force_position,
        force_velocity=force_velocity,
        rhs_position=rhs_position,
        rhs_velocity=rhs_velocity,
        power_position=tuple(jacobians.power.position),
        power_velocity=tuple(jacobians.power.velocity),
        tape=tape,
    )


def _with_gradients(
    eq: Equations,
    tape: Tape,
    blocks: list[list[Mapping[int, Any]]],
    long: Mapping[int, ConstraintEquation],
) -> Tape:
    """Add the gradients of Γ of constraints with a long γ, which the tape has no entries of.

    Parameters
    ----------
    eq : Equations
    tape : Tape
        Of the entries, the derivatives with respect to t, `sources_of` and `rows_of` these
        constraints.
    blocks : lists of rows by column
        Of the entries; rows of the gradients are added.
    long : mapping of int to ConstraintEquation
    """
    from lagcli.engine.tape.differentiation import DerivativeBuilder

    nq = len(eq.q)
    builder, outputs = DerivativeBuilder.of(tape)
    registers = iter(outputs)
    places = [[{j: next(registers) for j in row} for row in block] for block in blocks]
    times = [next(registers) for _ in range(nq + len(eq.constraints) + 1)]
    v, a = range(1 + nq, 1 + 2 * nq), range(1 + 2 * nq, 1 + 3 * nq)
    gradients = builder.gradients(residuals(builder, long, registers, v, a), range(a.start))
    for i, gradient in zip(long, gradients, strict=True):
        blocks[2][i] = places[2][i] = {x - 1: r for x, r in gradient.items() if 1 <= x <= nq}
        blocks[3][i] = places[3][i] = {x - 1 - nq: r for x, r in gradient.items() if x > nq}
        times[nq + i] = gradient.get(0, builder.zero)
    every = [x for block in places for row in block for x in row.values()]
    return builder.finish([*every, *times])


def lower_parameter_jacobians(
    equations: Equations, functions: InputFunctions, names: Sequence[str]
) -> ParameterTapes:
    """Compile the derivatives of the equations with respect to parameters to a tape.

    Parameters
    ----------
    equations : Equations
    functions : InputFunctions
        The model's inputs.
    names : sequence of str
        Names of the model's parameters.

    Returns
    -------
    ParameterTapes

    Raises
    ------
    KeyError
        The model has no such parameter.
    """
    from lagcli.equations.derivation.jacobians import differentiate_parameters

    eq, derivatives = equations, differentiate_parameters(equations, names)
    blocks = [
        derivatives.force,
        derivatives.rhs,
        derivatives.position,
        derivatives.velocity,
        [*derivatives.outputs.values()],
    ]
    force, rhs, position, velocity, outputs = map(_pattern, blocks)
    state, parameters = _inputs(eq)
    tape = compile_tape(
        [x for block in blocks for row in block for x in row.values()],
        [*state, *eq.a, *eq.multipliers],
        parameters,
        functions,
    )
    return ParameterTapes(derivatives.parameters, force, rhs, position, velocity, outputs, tape)


def _same_unit(
    expressions: Sequence[se.Basic], q: Sequence[se.Basic]
) -> tuple[tuple[int, ...], ...]:
    """Return coordinates known to have the same unit: those of a sum c x² + c y² + ...

    Without units in the model, no more is known; it suffices for quaternions.
    """
    number = {x: i for i, x in enumerate(q)}
    groups: dict[int, set[int]] = {}
    for expression in expressions:
        numbers: dict[tuple[se.Basic, se.Basic], set[int]] = {}
        for term in expression.args if isinstance(expression, se.Add) else ():
            factors = term.args if isinstance(term, se.Mul) else (term,)
            powers = [x.args if isinstance(x, se.Pow) else (x, se.Integer(1)) for x in factors]
            bases = [(base, exponent) for base, exponent in powers if base in number]
            if len(bases) == 1:
                base, exponent = bases[0]
                coefficient = se.Abs(term / base**exponent)
                numbers.setdefault((coefficient, exponent), set()).add(number[base])
        for same in numbers.values():
            merged = same.union(*(groups.get(i, ()) for i in same))
            groups.update(dict.fromkeys(merged, merged))
    unique = {min(g): tuple(sorted(g)) for g in groups.values() if len(g) > 1}
    return tuple(unique[i] for i in sorted(unique))


def magnitude(expression: se.Basic) -> se.Basic:
    """Return the sum of the magnitudes of an expression's terms, with products of sums expanded.

    The rounding error of the expression is proportional to it.
    """
    if isinstance(expression, se.Add):
        return se.Add(*[magnitude(x) for x in expression.args])
    if isinstance(expression, se.Mul):
        return se.Mul(*[magnitude(x) for x in expression.args])
    if isinstance(expression, se.Pow):
        base, exponent = expression.args
        if isinstance(exponent, se.Integer) and exponent > 0:
            return magnitude(base) ** exponent
    return se.Abs(expression)


def _pattern(rows: Iterable[Mapping[int, Any]]) -> Pattern:
    return tuple((i, j) for i, row in enumerate(rows) for j in row)
