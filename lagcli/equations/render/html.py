"""Formulas in HTML: MathML pieces with possible line breaks.

Browsers do not break lines in MathML. A formula is split at its `Break` tokens into nested
``<span class="formula">``, laid out as inline blocks: a term that fits on a line stays together,
and a wider one is broken inside, as in a textbook.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from lagcli.equations.presentation.formulas import Line
from lagcli.equations.presentation.typeset import Node
from lagcli.equations.render.breaking import Break, Token
from lagcli.equations.render.formula_mathml import MathmlFormula, operator, width
from lagcli.equations.render.formula_text import TextFormula

#: Characters on a line of the narrowest screen; shorter formulas are not split.
_PIECE = 26
#: Maximum characters of a side that stays on the line of the equality sign.
_SHORT = 8


def equation(line: Line, formula: MathmlFormula, text: TextFormula) -> str:
    """Return a formula or an equation as a block element.

    Parameters
    ----------
    line : Line
    formula : MathmlFormula
    text : TextFormula
        Writer of the text for screen readers.

    Returns
    -------
    str
        ``<div class="equation">``.
    """
    first, *others = map(formula.tokens, line.sides)
    parts: list[list[Token]] = [first]
    for side in others:
        if _width(side) <= _SHORT or _width(parts[-1]) <= _SHORT:
            # x = … and … = 0 are not broken at the equality sign
            parts[-1] += [operator("="), *side]
        else:
            parts.append([operator("="), *side])
    spoken = " = ".join(map(text.text, line.sides))
    return (
        f'<div class="equation" role="math" aria-label="{escape(spoken)}">'
        + "<wbr>".join(map(_pieces, parts))
        + "</div>"
    )


def inline(node: Node, formula: MathmlFormula) -> str:
    """Return an inline formula."""
    return f'<math displaystyle="true">{formula.mathml(node)}</math>'


def _width(tokens: Sequence[Token]) -> int:
    return width("".join(x for x in tokens if isinstance(x, str)))


def _pieces(tokens: Sequence[Token]) -> str:
    """Return a formula split at its best breaks, and recursively its parts."""
    whole = "".join(x for x in tokens if isinstance(x, str))
    depths = [x.depth for x in tokens if isinstance(x, Break)]
    if not depths or width(whole) <= _PIECE:
        return f'<math displaystyle="true">{whole}</math>'
    best, parts = min(depths), [[]]  # type: tuple[int, list[list[Token]]]
    for token in tokens:
        if isinstance(token, Break) and token.depth == best:
            parts.append([])
        else:
            parts[-1].append(token)
    return f'<span class="formula">{"<wbr>".join(map(_pieces, parts))}</span>'
