"""The value of a typeset tree, and models to try it on."""

from __future__ import annotations

import contextlib
import functools
import math
import operator
from collections.abc import Mapping
from pathlib import Path

import symengine as se

from lagcli.equations.derivation.lagrange import Equations, derive
from lagcli.equations.presentation.assembly import Contents, shown_steps
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.typesetting import nodes as t
from lagcli.equations.typesetting.nodes import Step
from lagcli.errors import UsageError
from lagcli.model.loader import load, load_text
from lagcli.model.model import as_symbols
from lagcli.simulations.partition import partition

MODELS = sorted((Path(__file__).parents[2] / "models").rglob("*.yaml"))

_RELATIONS = {
    "<=": operator.le,
    "<": operator.lt,
    ">=": operator.ge,
    ">": operator.gt,
    "==": operator.eq,
    "!=": operator.ne,
}
_OWN = {
    "abs": abs,
    "sign": lambda x: (x > 0) - (x < 0),
    "step": lambda x: float(x >= 0),
    "min": min,
    "max": max,
    "ceiling": math.ceil,
    "cbrt": math.cbrt,
}


@functools.cache
def equations_of(path: Path) -> Equations:
    return derive(load(path))


@functools.cache
def formulas_of(path: Path, numeric: bool = False) -> Formulas:
    """Return the formulas of a model, which keep what they have arranged."""
    return Formulas(equations_of(path), numeric)


@functools.cache
def steps_of(path: Path, derivation: bool = False, numeric: bool = False) -> tuple[Step, ...]:
    """Return the steps that are printed, which are the same in every format and width."""
    return shown_steps(formulas_of(path, numeric), Contents(steps=derivation))


@functools.cache
def pages_of(path: Path) -> tuple[tuple[Step, ...], ...]:
    """Return the steps of every page that `derive` prints for a model."""
    e = equations_of(path)
    asked = []
    with contextlib.suppress(UsageError):
        p = partition(e)
        asked += [Contents(("maggi",), p), Contents(("first",), p, solve=True)]
        asked += [Contents(("second",), p), Contents(("first", "second"), p, steps=True)]
    found = [steps_of(path), steps_of(path, True)]
    for contents in asked:
        with contextlib.suppress(UsageError):  # the second kind needs holonomic constraints
            found.append(shown_steps(formulas_of(path), contents))
    return tuple(found)


def model_of(coordinates: str, kinetic: str, potential: str = "0", **rest: str) -> Equations:
    """Return the equations of a small model; every other name is a parameter of value 1.3."""
    names = coordinates.replace(",", " ").split()
    initial = "".join(f"  {q}: 0\n  {q}': 0\n" for q in names)
    parameters = rest.pop("parameters", "m g l")
    values = "".join(f"  {p}: {1.3 + 0.1 * i}\n" for i, p in enumerate(parameters.split()))
    text = f"coordinates: [{', '.join(names)}]\nparameters:\n{values}"
    text += f'T: "{kinetic}"\nV: "{potential}"\ninitial:\n{initial}'
    text += "".join(f"{key}:\n{value}\n" for key, value in rest.items())
    return derive(load_text(text))


def value(node: t.Node, at: Mapping[str, float]) -> float:
    """Evaluate a tree; names as in SymEngine's symbols (x', lambda.rod)."""
    match node:
        case t.Number():
            return float(node.value)
        case t.Symbol():
            if node.kind == "constant":
                return math.pi
            if node.kind == "multiplier":
                return at[f"lambda.{node.name}"]
            return at[node.name + "'" * node.dots]
        case t.Sum():
            return math.fsum(sign * value(term, at) for sign, term in node.terms)
        case t.Product():
            return math.prod(value(f, at) for f in node.factors)
        case t.Quotient():
            return value(node.numerator, at) / value(node.denominator, at)
        case t.Power():
            return value(node.base, at) ** value(node.exponent, at)
        case t.Root():
            return value(node.radicand, at) ** (1 / node.degree)
        case t.Call():
            function = _OWN.get(node.function) or getattr(math, node.function)
            return function(*[value(a, at) for a in node.arguments])
        case t.Cases():
            return value(node.then if value(node.condition, at) else node.otherwise, at)
        case t.Relation():
            return _RELATIONS[node.operator](value(node.left, at), value(node.right, at))
        case t.Logical():
            found = [value(o, at) for o in node.operands]
            return {"not": not found[0], "and": all(found), "or": any(found)}[node.operator]
    raise AssertionError(node)


def size(e: se.Basic, at: Mapping[str, float]) -> float:
    """Return the sum of the magnitudes of a sum's terms, against which rounding is measured."""
    if isinstance(e, se.Add):
        return sum(size(term, at) for term in e.args)
    return abs(number(e, at))


def number(e: se.Basic, at: Mapping[str, float]) -> float:
    """Evaluate a SymEngine expression, cases included, which SymEngine leaves alone."""
    e = as_symbols(e) if e.atoms(se.FunctionSymbol) else e
    if isinstance(e, se.Piecewise):
        for branch, condition in zip(e.args[::2], e.args[1::2], strict=True):
            if condition == se.true or holds(condition, at):
                return number(branch, at)
    if e.atoms(se.Piecewise):
        if isinstance(e, se.Add):
            return math.fsum(number(a, at) for a in e.args)
        if isinstance(e, se.Mul):
            return math.prod(number(a, at) for a in e.args)
        if isinstance(e, se.Pow):
            return number(e.args[0], at) ** number(e.args[1], at)
        return float(e.func(*[se.RealDouble(number(a, at)) for a in e.args]))
    values = {s: se.RealDouble(at[s.name]) for s in e.free_symbols}
    return float(e.xreplace(values).n(53, real=True))


def holds(condition: se.Basic, at: Mapping[str, float]) -> bool:
    name = type(condition).__name__
    if name in ("And", "Or"):
        return (all if name == "And" else any)(holds(c, at) for c in condition.args)
    left, right = (number(side, at) for side in condition.args)
    relations = {"LessThan": "<=", "StrictLessThan": "<", "Equality": "==", "Unequality": "!="}
    return _RELATIONS[relations[name]](left, right)


def point(equations: Equations, source) -> dict[str, float]:
    """Return random values for all symbols of a model; definitions have theirs."""
    at = {"t": source.uniform(0.2, 2)}
    for s in (*equations.q, *equations.v, *equations.a, *equations.multipliers):
        at[s.name] = source.uniform(-2, 2)
    # values of parameters near the model's own, so that roots stay real
    for name, x in equations.model.parameter_values.items():
        at[name] = (x or 1.0) * source.uniform(0.9, 1.1)
    for name in equations.model.inputs:
        at |= {name + "'" * order: source.uniform(-2, 2) for order in range(4)}
    for name, definition in equations.model.definitions.items():
        if isinstance(definition.value, se.Basic):
            try:
                at[name] = number(definition.value, at)
            except KeyError:
                continue
    return at


def expressions(e: Equations) -> dict[str, se.Basic]:
    """Return every expression that a derivation shows."""
    found = {"T": e.kinetic, "V": e.potential, "L": e.lagrangian}
    for i, q in enumerate(e.q):
        found |= {f"p {q}": e.momenta[i], f"dL/d{q}": e.gradient[i]}
        found |= {f"dp/dt {q}": e.momentum_rates[i], f"Q {q}": e.applied_forces[i]}
        found |= {f"eq {q}": e.momentum_rates[i] - e.gradient[i], f"f {q}": e.forcing[i]}
        found |= {f"M {q} {j}": m for j, m in e.mass_matrix[i].items()}
    for c in e.constraints:
        name = c.constraint.name
        found |= {f"{name} {j}": b for j, b in c.row.items()}
        found |= {name: c.constraint.expression, f"{name} γ": c.rhs, f"{name} v": c.velocity}
    return found | {f"output {name}": x for name, x in e.outputs.items()}
