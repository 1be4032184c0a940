"""Recognition of constants by sin² + cos² = 1."""

from __future__ import annotations

import symengine as se
from symengine import Basic

_MOST = 400  # maximum number of terms of an expansion


def constant_value(expression: Basic) -> Basic | None:
    """Return the value of an expression that is constant by sin² a + cos² a = 1, else None.

    Every cos² a is replaced by 1 − sin² a and the result is expanded; in a constant, all other
    terms cancel.

    Parameters
    ----------
    expression : SymEngine expression

    Returns
    -------
    SymEngine number or None
    """
    if isinstance(expression, se.Number):
        return expression
    angles = {x.args[0] for x in expression.atoms(se.sin)} & {
        x.args[0] for x in expression.atoms(se.cos)
    }
    if not angles:
        return None
    found = se.expand(expression)
    for angle in angles:
        if isinstance(found, se.Add) and len(found.args) > _MOST:
            return None
        found = se.expand(_without_squares(found, angle))
    return found if isinstance(found, se.Number) else None


def _without_squares(expression: Basic, angle: Basic) -> Basic:
    """Replace each cos² a of a sum by 1 − sin² a."""
    cosine, rest = se.cos(angle), 1 - se.sin(angle) ** 2
    powers = {
        p: rest ** (int(p.args[1]) // 2) * cosine ** (int(p.args[1]) % 2)
        for p in expression.atoms(se.Pow)
        if p.args[0] == cosine and isinstance(p.args[1], se.Integer) and int(p.args[1]) > 1
    }
    return expression.xreplace(powers)
