"""Units of SymEngine expressions in a model's symbols, such as conserved quantities."""

from __future__ import annotations

from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.columns import read_column_name, read_dotted_name
from lagcli.model.dimensions.model_units import conjugate, find, text_of
from lagcli.model.expression.dimension import (
    ANGLE,
    NUMBER,
    ONE,
    SECOND,
    UNKNOWN,
    ZERO,
    Dimension,
    Scalar,
    TensorDimension,
    power,
    product,
    rate_of,
    same,
    whole,
)
from lagcli.model.inputs import read_input
from lagcli.model.model import TIME, Model

_ANGLES = (se.asin, se.acos, se.atan, se.atan2)


def symbolic_unit(model: Model, expression: Basic) -> str | None:
    """Return the SI unit of an expression; None if it is unknown.

    Parameters
    ----------
    model : Model
        A model with consistent units: only one term of a sum is evaluated.
    expression : Basic
        Expression in t, q, q', q'', parameters, λ and constraint forces.
    """
    if not model.units.stated:
        return None
    found = _dimension(model, expression, {})
    return text_of(ONE if found is NUMBER and model.units.throughout else found)


def _dimension(model: Model, expression: Basic, seen: dict[Basic, Scalar]) -> Scalar:
    found = seen.get(expression)
    if found is None:
        found = seen[expression] = _evaluated(model, expression, seen)
    return found


def _evaluated(model: Model, expression: Basic, seen: dict[Basic, Scalar]) -> Scalar:
    if isinstance(expression, se.Symbol):
        return _symbol(model, expression.name)
    if (read := read_input(expression)) is not None:
        return _symbol(model, read[0] + "'" * read[1])
    if not expression.free_symbols:
        if expression == 0:
            return ZERO
        # a number may have taken a unit
        return NUMBER if not model.units.numbers or _is_small(expression) else UNKNOWN
    parts = expression.args
    if isinstance(expression, se.Mul):
        total: Scalar = NUMBER
        for part in parts:
            total = product(total, _dimension(model, part, seen))
        return total
    if isinstance(expression, se.Pow):
        base, exponent = _dimension(model, parts[0], seen), parts[1]
        if not isinstance(base, Dimension):
            return base
        if isinstance(exponent, se.Rational):
            return power(base, whole(Fraction(*map(int, exponent.get_num_den()))))
        return ONE if same(base, ONE) else UNKNOWN
    if isinstance(expression, (se.Add, se.Piecewise, se.Abs, se.Max, se.Min)):
        values = parts[0::2] if isinstance(expression, se.Piecewise) else parts
        terms = [_dimension(model, part, seen) for part in values]
        known = [x for x in terms if isinstance(x, Dimension)]
        return next((x for x in known if x.rad), known[0] if known else terms[0])
    return ANGLE if isinstance(expression, _ANGLES) else ONE


def _is_small(number: Basic) -> bool:
    return isinstance(number, se.Rational) and max(map(abs, map(int, number.get_num_den()))) <= 12


def _symbol(model: Model, name: str) -> Scalar:
    units, column = model.units, read_dotted_name(name)
    if column is not None and column.coordinate:
        column = read_column_name(name, model.coordinate_names, model.constraint_names)
    if name == TIME.name:
        return SECOND
    if column is None:
        base = name.rstrip("'")
        value = rate_of(find(units.names, base), len(name) - len(base))
    elif column.quantity == "multipliers":
        value = find(units.multipliers, column.constraint)
    else:
        value = find(units.names, column.coordinate)
        value = UNKNOWN if isinstance(value, TensorDimension) else conjugate(value)
    return UNKNOWN if isinstance(value, TensorDimension) else value
