"""Frobenius' theorem for velocity constraints: which are integrable, and their integrals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import symengine as se
from symengine import Basic

from lagcli.engine.constraints.initial import ConsistentState
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.equations.derivation.integrability import (
    FirstIntegral,
    first_integral,
    has_branches,
    integrable,
)
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ZERO
from lagcli.model.expression.functions import derivative
from lagcli.model.model import TIME

#: ``alone``: integrable by itself; ``together``: integrable with the other constraints; ``no``: not
#: integrable; ``not tested``: the form has too many variables, or branches.
Integrability = Literal["alone", "together", "no", "not tested"]

#: Largest number of derivative entries to evaluate.
_LARGEST = 20_000
#: Relative size of dω on the admissible motions that counts as zero.
_ZERO = 1e-8


@dataclass(frozen=True, eq=False)
class VelocityConstraint:
    """Integrability of a velocity constraint by Frobenius' theorem.

    Parameters
    ----------
    integrable : str
        See `Integrability`.
    integral : FirstIntegral or None
        The integral of a constraint that is integrable by itself, if it was found.
    value : float or None
        The integral's value at the initial state.
    """

    integrable: Integrability
    integral: FirstIntegral | None = None
    value: float | None = None


def check_integrability(
    equations: Equations, start: ConsistentState, states: Sequence[ConsistentState]
) -> dict[str, VelocityConstraint]:
    """Test the velocity constraints of a model by Frobenius' theorem.

    First each one separately, ω∧dω = 0 for ω = Σ b_i dq_i + b_0 dt; then all together at consistent
    states: they are integrable if dω vanishes on all motions that the constraints allow.

    Parameters
    ----------
    equations : Equations
    start : ConsistentState
    states : sequence of ConsistentState
        States besides the initial one at which the constraints are tested together.

    Returns
    -------
    dict of str to VelocityConstraint
        By name, for the constraints that are given in velocities and linear in them.
    """
    results: dict[str, VelocityConstraint] = {}
    for c in equations.constraints:
        if c.constraint.of_coordinate:
            continue
        if c.constraint.kind != "nonholonomic":
            continue
        alone = integrable(c, equations)
        integral = first_integral(c, equations) if alone else None
        value = None if integral is None else _value(integral.expression, equations, start)
        kind: Integrability = "not tested" if alone is None else "alone" if alone else "no"
        results[c.constraint.name] = VelocityConstraint(kind, integral, value)
    left = [name for name, x in results.items() if x.integrable != "alone"]
    linear = all(c.constraint.kind != "nonlinear" for c in equations.constraints)
    if (
        left
        and linear
        and not any(has_branches(c, equations) for c in equations.constraints if c.position is None)
        and len(equations.constraints) > 1
        and _together(equations, [start, *states])
    ):
        results |= {name: VelocityConstraint("together") for name in left}
    return results


def _value(expression: Basic, equations: Equations, start: ConsistentState) -> float:
    parameters = [se.Symbol(n) for n in equations.model.parameters]
    tape = compile_tape(
        [expression], [TIME, *equations.q], parameters, input_functions(equations.model)
    )
    s = start.state
    return float(ScalarTape(tape)((s.t, *s.q.tolist(), *s.p))[0])


def _together(equations: Equations, states: Sequence[ConsistentState]) -> bool:
    """Whether dω of every constraint vanishes on the motions that all of them allow."""
    variables = (*equations.q, TIME)
    forms = [{**c.row, len(equations.q): c.drift} for c in equations.constraints]
    entries, places = [], []
    for beta, (form, c) in enumerate(zip(forms, equations.constraints, strict=True)):
        for i, b in form.items():
            entries.append(b)
            places.append((beta, i, -1))
            if c.position is None:  # d² = 0 of the others
                slopes = [(j, derivative(b, x)) for j, x in enumerate(variables)]
                entries += [slope for _, slope in slopes if slope != ZERO]
                places += [(beta, i, j) for j, slope in slopes if slope != ZERO]
    if len(entries) > _LARGEST:
        return False
    parameters = [se.Symbol(n) for n in equations.model.parameters]
    tape = ScalarTape(
        compile_tape(entries, [TIME, *equations.q], parameters, input_functions(equations.model))
    )
    return all(_closed_at(tape, places, len(forms), len(variables), s) for s in states)


def _closed_at(
    tape: ScalarTape,
    places: Sequence[tuple[int, int, int]],
    forms: int,
    variables: int,
    start: ConsistentState,
) -> bool:
    s = start.state
    rows = np.zeros((forms, variables))
    slopes = np.zeros((forms, variables, variables))
    for (beta, i, j), x in zip(places, tape((s.t, *s.q.tolist(), *s.p)), strict=True):
        if j < 0:
            rows[beta, i] = x
        else:
            slopes[beta, i, j] = x
    _, values, vectors = np.linalg.svd(rows)
    free = vectors[int((values > _ZERO * values.max(initial=0.0)).sum()) :]
    curls = slopes - slopes.transpose(0, 2, 1)
    on_motions = np.einsum("ai,cij,bj->cab", free, curls, free)
    return bool(np.abs(on_motions).max(initial=0.0) <= _ZERO * np.abs(slopes).max(initial=0.0))
