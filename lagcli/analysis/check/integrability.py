"""Which velocity constraints are integrable, which of their combinations, and the integrals."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import symengine as se
from symengine import Basic

from lagcli.analysis.check.combinations import IntegrableCombination, joint_part
from lagcli.analysis.check.derived_system import PathStart, PfaffianSystem, point_at
from lagcli.analysis.check.power_series import NoSeries
from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.integrability import (
    FirstIntegral,
    first_integral,
    form_of,
    has_branches,
    integrable,
)
from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations
from lagcli.equations.derivation.motion import ZERO
from lagcli.model.expression.functions import derivative
from lagcli.model.model import TIME

#: ``alone``: integrable by itself; ``together``: integrable with the other constraints; ``no``: it
#: is not, though a combination with others may be; ``not tested``: the form has branches, or there
#: are too many.
Integrable = Literal["alone", "together", "no", "not tested"]

#: Largest number of entries and derivatives to evaluate.
_LARGEST = 3000
#: Number of points at which constraints are tested together, and differences of their times, s.
_POINTS, _LATER = 3, 0.01


@dataclass(frozen=True, eq=False)
class VelocityConstraint:
    """Integrability of a velocity constraint.

    Parameters
    ----------
    integrable : str
        See `Integrable`.
    integral : FirstIntegral or None
        The integral of an integrable constraint, if it was found.
    value : float or None
        The integral's value at the initial state.
    """

    integrable: Integrable
    integral: FirstIntegral | None = None
    value: float | None = None


@dataclass(frozen=True, eq=False)
class Integrability:
    """Integrability of the velocity constraints of a model.

    Parameters
    ----------
    constraints : mapping of str to VelocityConstraint
        By name, for the constraints that are given in velocities and linear in them.
    combinations : tuple of IntegrableCombination
        With the integrable constraints, they span all that is integrable.
    nonintegrable : int or None
        Number of independent constraints less that of integrable combinations; None if they were
        not tested together.
    """

    constraints: Mapping[str, VelocityConstraint]
    combinations: tuple[IntegrableCombination, ...]
    nonintegrable: int | None


def check_integrability(
    equations: Equations, start: ConsistentState, states: Sequence[ConsistentState]
) -> Integrability:
    """Find what is integrable of the velocity constraints of a model.

    First each one separately, ω∧dω = 0 for ω = Σ b_i dq_i + b_0 dt (Frobenius); then the largest
    integrable part of the system that all constraints span: see `derived_system`.

    Parameters
    ----------
    equations : Equations
    start : ConsistentState
    states : sequence of ConsistentState
        States besides the initial one, at which the constraints are tested together.
    """
    rows: dict[str, VelocityConstraint] = {}
    # the equations of first-order coordinates are no constraints on them
    constraints = tuple(c for c in equations.constraints if not c.constraint.of_coordinate)
    for c in constraints:
        if c.constraint.kind != "nonholonomic":
            continue
        alone = integrable(c, equations)
        variables = (*equations.q, TIME)
        integral = first_integral(form_of(c, equations), variables) if alone else None
        value = None if integral is None else _value(integral.expression, equations, start)
        kind: Integrable = "not tested" if alone is None else "alone" if alone else "no"
        rows[c.constraint.name] = VelocityConstraint(kind, integral, value)
    left = [name for name, x in rows.items() if x.integrable != "alone"]
    linear = all(c.constraint.kind != "nonlinear" for c in constraints)
    if not left:
        return Integrability(rows, (), 0 if linear else None)
    names = [c.constraint.name for c in constraints]
    system = _system(equations, constraints) if linear else None
    part = None
    if system is not None:
        closed = {i for i, name in enumerate(names) if name in rows and name not in left}
        part = joint_part(system, _places(system, equations, states[:_POINTS]), closed)
    if part is None:
        return Integrability(rows | {n: VelocityConstraint("not tested") for n in left}, (), None)
    for name in left:
        rows[name] = VelocityConstraint("together" if names.index(name) in part.together else "no")
    combinations = []
    for found in part.combinations:
        integral = found.integral
        value = None if integral is None else _value(integral.expression, equations, start)
        if len(found.numbers) == 1:
            rows[names[min(found.numbers)]] = VelocityConstraint("together", integral, value)
            continue
        numbers = {names[i]: c for i, c in found.numbers.items()}
        exact = found.factors
        factors = None if exact is None else {names[i]: x for i, x in exact.items()}
        combinations.append(IntegrableCombination(numbers, factors, integral, value))
    return Integrability(rows, tuple(combinations), part.nonintegrable)


def _system(
    equations: Equations, constraints: tuple[ConstraintEquation, ...]
) -> PfaffianSystem | None:
    """Return constraints as forms; None if they have branches, or are too many."""
    if any(has_branches(c, equations) for c in constraints if c.position is None):
        return None
    variables, last = (*equations.q, TIME), len(equations.q)
    forms = [{**c.row, last: c.drift} if c.drift != ZERO else dict(c.row) for c in constraints]
    if sum(map(len, forms)) > _LARGEST:
        return None
    slopes: list[dict[tuple[int, int], Basic]] = []
    for form in forms:
        slopes.append({})
        for i, b in form.items():
            free = b.free_symbols
            slope = {(i, j): derivative(b, x) for j, x in enumerate(variables) if x in free}
            slopes[-1] |= {place: x for place, x in slope.items() if x != ZERO}
        if sum(map(len, slopes)) > _LARGEST:
            return None
    positions = tuple(c.position for c in constraints)
    return PfaffianSystem(variables, tuple(forms), tuple(slopes), positions)


def _places(
    system: PfaffianSystem, equations: Equations, states: Sequence[ConsistentState]
) -> list[PathStart]:
    places = []
    parameters = [se.Symbol(name) for name in equations.model.parameters]
    for k, s in enumerate(state.state for state in states):
        given = dict(zip(parameters, s.p, strict=True))
        with contextlib.suppress(NoSeries):
            places.append(point_at(system, [*s.q.tolist(), s.t + _LATER * k], given))
    return places


def _value(expression: Basic, equations: Equations, start: ConsistentState) -> float:
    parameters = [se.Symbol(n) for n in equations.model.parameters]
    tape = compile_tape(
        [expression], [TIME, *equations.q], parameters, input_functions(equations.model)
    )
    s = start.state
    return float(ScalarTape(tape)((s.t, *s.q.tolist(), *s.p))[0])
