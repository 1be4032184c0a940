"""Dry friction: forces with `sign` of a velocity as rows that bear only so much.

−F sign s on the coordinates along which s changes is the force of a constraint s = 0 with the limit
F while it slips; as a row it also sticks, exactly and without chatter.
"""

from __future__ import annotations

from collections.abc import Mapping

import symengine as se
from symengine import Basic

from lagcli.model.draft import Draft
from lagcli.model.expression.constants import number
from lagcli.model.expression.functions import FUNCTIONS, KINKS, derivative
from lagcli.model.expression.grammar import parse_equation
from lagcli.model.expression.linearity import is_zero, nonlinear_in
from lagcli.model.model import SIGN, Constraint, MultiplierLimit, velocity
from lagcli.model.symbols import Symbols

_ZERO = se.Integer(0)
_HELD = se.Symbol("\ufdd0sign")


def dry_friction(
    draft: Draft, forces: Mapping[str, Basic], constants: Symbols
) -> tuple[dict[str, Basic], tuple[Constraint, ...]]:
    """Return the forces without dry friction, and its rows.

    A `sign` is dry friction if its argument s is affine in the velocities and smooth, and if it
    occurs in Q as −F ∂s/∂q' sign(s) with one F for all coordinates, where F has no velocities,
    inputs or multipliers and cannot be negative: a product, a sum or a power of numbers and
    parameters that are not negative, squares and magnitudes.

    Parameters
    ----------
    draft : Draft
    forces : mapping of str to expression
        Q by coordinate.
    constants : Symbols
        The parameters with their values.
    """
    left, found = dict(forces), list[Constraint]()
    for name in forces:
        for kink in sorted(left[name].atoms(se.Piecewise), key=str):
            s = _argument(kink)
            if s is None or not kink.args or kink not in left[name].atoms(se.Piecewise):
                continue
            force = _force(draft, left, kink, s, constants)
            if force is None:
                continue
            for other in left:
                left[other] = left[other].xreplace({kink: _ZERO})
            row = _row(draft, name, s, force, [c.name for c in found])
            found.append(row)
            draft.names.constraints[row.name] = None
    return left, tuple(found)


def _argument(kink: Basic) -> Basic | None:
    """Return s if an expression is sign(s)."""
    condition = kink.args[1]
    if not isinstance(condition, se.StrictLessThan):
        return None
    s = condition.args[1] - condition.args[0]
    return s if FUNCTIONS["sign"].apply(s) == kink else None


def _force(
    draft: Draft, forces: Mapping[str, Basic], kink: Basic, s: Basic, constants: Symbols
) -> Basic | None:
    """Return F of dry friction; None where it is another force."""
    rates = [x for x in sorted(s.free_symbols, key=str) if x.name.endswith("'")]
    if not rates or s.atoms(*KINKS) or nonlinear_in(s, rates) is not None:
        return None
    if s.atoms(se.FunctionSymbol) or any(x.name.startswith("lambda.") for x in s.free_symbols):
        return None
    force: Basic | None = None
    pairs = []
    for name in draft.names.coordinates:
        slope = draft.names.slope(s, velocity(name)) if velocity(name) in rates else _ZERO
        written = forces.get(name, _ZERO)
        held = written.xreplace({kink: _HELD})
        coefficient = derivative(held, _HELD)
        if _HELD in coefficient.free_symbols:
            return None
        pairs.append((coefficient, slope))
        if force is None and slope != _ZERO:
            force = -coefficient / slope
    if force is None or not all(is_zero(c + force * slope) for c, slope in pairs):
        return None
    force = se.expand(force) if force.is_Add else force
    return force if force != _ZERO and _nonnegative(force, constants) else None


def _nonnegative(expression: Basic, constants: Symbols) -> bool:
    """Return whether an expression certainly is not negative, by its form and its parameters."""
    if isinstance(expression, se.Number):
        return bool(number(expression) >= 0)
    if isinstance(expression, se.Symbol):
        known = constants.parameters.get(expression.name)
        return known is not None and bool(number(known()) >= 0)
    if isinstance(expression, (se.Add, se.Mul)):
        return all(_nonnegative(x, constants) for x in expression.args)
    if isinstance(expression, se.Pow):
        base, exponent = expression.args
        even = isinstance(exponent, se.Integer) and int(exponent) % 2 == 0
        moving = any(x.name.endswith("'") for x in base.free_symbols)
        return not moving and (even or _nonnegative(base, constants))
    if isinstance(expression, se.Piecewise):
        argument = expression.args[0]
        names = {x.name for x in argument.free_symbols}
        moving = any(x.endswith("'") or x.startswith("lambda.") for x in names)
        return not moving and FUNCTIONS["abs"].apply(argument) == expression
    return False


def _row(draft: Draft, name: str, s: Basic, force: Basic, taken: list[str]) -> Constraint:
    """Return the row of dry friction on a coordinate."""
    written = str(s).replace("**", "^")
    left, right = parse_equation(f"{written} = 0")
    count = sum(x.startswith(name + SIGN) for x in taken)
    entries = draft.entries("Q") or []
    location = next((key.location for _, key, _ in entries if key.value == name), None)
    return Constraint(
        name + SIGN + (str(count + 1) if count else ""),
        "nonholonomic",
        s,
        left,
        right,
        f"dry friction, from sign({written}) in Q",
        location or (entries[0][1].location if entries else None),
        limit=MultiplierLimit(force, force),
    )
