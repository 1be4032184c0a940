"""Name the expression of a model that has no finite value at a state."""

from __future__ import annotations

import math
from collections.abc import Iterator

import symengine as se
from symengine import Basic

from lagcli.engine.compilation import compile_tape
from lagcli.engine.interpreter import ScalarTape
from lagcli.equations.lagrange import Equations
from lagcli.model.model import TIME


def undefined_expression(equations: Equations, t: float, q: list[float], v: list[float]) -> str:
    """Say which expression of the model is not finite at a state, and what the state is.

    Parameters
    ----------
    equations : Equations
    t : float
        s.
    q, v : lists of nq float

    Returns
    -------
    str
        A clause such as "`log(x)` in `V` has no finite value at x = -0.2".
    """
    model = equations.model
    state: dict[Basic, float] = {TIME: t}
    state.update(zip(equations.q, q, strict=True))
    state.update(zip(equations.v, v, strict=True))
    parameters = {se.Symbol(n): p.value for n, p in model.parameters.items()}
    every = {**state, **parameters}
    for place, expression in _expressions(equations):
        part = _culprit(expression, every)
        if part is not None:
            used = sorted(s.name for s in part.free_symbols if s in state)
            at = ", ".join(f"{n} = {state[se.Symbol(n)]:.6g}" for n in used)
            return f"`{part}` in {place} has no finite value at {at or f't = {t:.6g}'}"
    at = ", ".join(f"{s.name} = {x:.6g}" for s, x in state.items() if s in equations.q)
    return (
        "the mass matrix does not determine the accelerations, with the constraints as they are,"
        f" at {at}"
    )


def _culprit(expression: Basic, values: dict[Basic, float]) -> Basic | None:
    """Return the smallest part that makes an expression undefined; None if it is not."""
    if math.isfinite(_numbers([expression], values)[0]):
        return None
    parts = list(_parts(expression))
    for part, value in zip(parts, _numbers(parts, values), strict=True):
        if math.isfinite(value):
            continue
        if isinstance(part, se.Piecewise):
            # only the case that is taken matters
            cases, conditions = part.args[0::2], part.args[1::2]
            holds = _numbers(list(conditions), values)
            taken = [case for case, truth in zip(cases, holds, strict=True) if truth]
            return _culprit(taken[0], values) if taken else part
        return part
    return expression


def _numbers(expressions: list[Basic], values: dict[Basic, float]) -> list[float]:
    return ScalarTape(compile_tape(expressions, list(values)))(values.values())


def _expressions(equations: Equations) -> Iterator[tuple[str, Basic]]:
    """Yield what the model states, then what is derived from it."""
    model = equations.model
    if model.kinetic is None:
        yield "`L`", equations.lagrangian
    else:
        yield "`T`", equations.kinetic
        yield "`V`", equations.potential
    for name, force in model.applied_forces.items():
        yield f"the force on `{name}`", force
    if model.dissipation is not None:
        yield "`D`", model.dissipation
    for c in equations.constraints:
        yield f"constraint `{c.constraint.name}`", c.constraint.expression
    for name, row, force in zip(
        model.coordinate_names, equations.mass_matrix, equations.forcing, strict=True
    ):
        yield f"the equation of `{name}`", se.Add(*row.values(), force)
    for c in equations.constraints:
        derived = se.Add(*c.row.values(), c.rhs)
        yield f"the derivatives of constraint `{c.constraint.name}`", derived


def _parts(expression: Basic) -> Iterator[Basic]:
    """Yield the numeric subexpressions, parts before wholes."""
    seen: set[Basic] = set()
    stack: list[tuple[Basic, bool]] = [(expression, False)]
    while stack:
        e, ready = stack.pop()
        if not isinstance(e, se.Expr) or (not ready and e in seen):
            continue
        if ready:
            yield e
            continue
        seen.add(e)
        stack.append((e, True))
        # an undefined branch that is not taken is no fault: the cases are judged as a whole
        if not isinstance(e, se.Piecewise):
            stack.extend((a, False) for a in reversed(e.args))
