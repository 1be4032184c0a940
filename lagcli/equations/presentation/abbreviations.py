"""Common subexpression elimination for display: z₁ = …, in order of use."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.names.members import family_of

_LETTERS = ("z", "s", "u", "h", "zeta", "xi", "eta")


class Abbreviations(NamedTuple):
    """Expressions with named common subexpressions.

    Parameters
    ----------
    named : mapping of str to expression
        Value of each abbreviation, in symbols of the model and earlier abbreviations.
    expressions : tuple of expressions
        The expressions with abbreviations substituted.
    """

    named: Mapping[str, Basic]
    expressions: tuple[Basic, ...]


def abbreviate(
    expressions: Sequence[Basic], taken: Collection[str], known: Mapping[Basic, str] | None = None
) -> Abbreviations:
    """Name common subexpressions.

    Parameters
    ----------
    expressions : sequence of expressions
    taken : collection of str
        Names that are in use.
    known : mapping of expression to str, optional
        Definitions of the model by value; they keep their names.

    Returns
    -------
    Abbreviations
    """
    known = known or {}
    parts, shortened = se.cse(list(expressions))
    uses = _uses([x for _, x in parts], shortened)
    whole: dict[Basic, Basic] = {}  # expanded, for comparison with definitions
    replaced: dict[Basic, Basic] = {}
    named: dict[str, Basic] = {}
    letter = _free_letter(taken)
    count = 0
    for symbol, part in parts:
        if known:
            whole[symbol] = _replaced(part, whole)
        value = _replaced(part, replaced)
        definition = known.get(whole.get(symbol, symbol))
        if definition is not None and definition not in named:
            named[definition] = value
            replaced[symbol] = se.Symbol(definition)
        elif uses[symbol] < 2 or _short(value) or (uses[symbol] < 4 and _pair(value)):
            replaced[symbol] = value
        else:
            count += 1
            name = f"{letter}_{count}"
            named[name] = value
            replaced[symbol] = se.Symbol(name)
    return _needed(named, tuple(_replaced(x, replaced) for x in shortened))


def _replaced(expression: Basic, values: Mapping[Basic, Basic]) -> Basic:
    """Substitute values for the symbols that occur; SymEngine copies the whole mapping."""
    return expression.xreplace({s: values[s] for s in expression.free_symbols if s in values})


def _needed(named: Mapping[str, Basic], expressions: tuple[Basic, ...]) -> Abbreviations:
    """Drop unused abbreviations."""
    used = {s.name for x in expressions for s in x.free_symbols}
    needed: dict[str, Basic] = {}
    for name, value in reversed(list(named.items())):
        if name in used:
            needed[name] = value
            used.update(s.name for s in value.free_symbols)
    return Abbreviations(dict(reversed(list(needed.items()))), expressions)


def _uses(parts: Sequence[Basic], expressions: Sequence[Basic]) -> Counter[Basic]:
    """Count how often each symbol occurs."""
    found: Counter[Basic] = Counter()
    stack = [*parts, *expressions]
    while stack:
        e = stack.pop()
        if isinstance(e, se.Symbol):
            found[e] += 1
        else:
            stack.extend(e.args)
    return found


def _short(value: Basic) -> bool:
    """Whether an expression is as short as a name: x, sin x, x², 2 x, −x."""
    if isinstance(value, se.Symbol | se.Number):
        return True
    if isinstance(value, se.Pow):
        base, exponent = value.args
        return isinstance(exponent, se.Integer) and int(exponent) > 0 and _short(base)
    if isinstance(value, se.Mul):
        return sum(not isinstance(x, se.Number) for x in value.args) == 1 and all(
            map(_short, value.args)
        )
    if isinstance(value, se.Add | se.Piecewise):
        return False
    return len(value.args) == 1 and isinstance(value.args[0], se.Symbol)


def _pair(value: Basic) -> bool:
    """Whether an expression is a product of two short ones."""
    return isinstance(value, se.Mul) and len(value.args) == 2 and all(map(_short, value.args))


def _free_letter(taken: Collection[str]) -> str:
    """Return a letter for abbreviations that no name of the model starts with."""
    used = {family_of(name).rstrip("[]").partition("_")[0].rstrip("0123456789") for name in taken}
    return next((x for x in _LETTERS if x not in used), "abbreviation")
