"""The terms of an equation of motion as printed, with their values as expressions."""

from __future__ import annotations

from typing import Literal, NamedTuple

from symengine import Basic

from lagcli.equations.presentation.written import scope_of
from lagcli.equations.typesetting.nodes import ZERO, Line, Node, Sum, Symbol, children, signed
from lagcli.equations.typesetting.text import grammar_text
from lagcli.model.expression.grammar import parse
from lagcli.model.model import Model
from lagcli.model.names.building import build

TermKind = Literal["inertia", "potential", "applied", "constraint"]


class EquationTerm(NamedTuple):
    """A term of an equation of motion.

    Parameters
    ----------
    side : int
        0 on the left of the equals sign, 1 on the right.
    sign : int
        1 or −1, the sign printed before the term.
    node : Node
        The term without its sign.
    kind : str
        ``inertia`` if it contains accelerations or velocities, ``potential`` for the other terms on
        the left, ``constraint`` if it contains multipliers, ``applied`` for the other terms on the
        right.
    constraints : tuple of str
        The constraints whose multipliers it contains.
    """

    side: int
    sign: int
    node: Node
    kind: TermKind
    constraints: tuple[str, ...]


def equation_terms(line: Line) -> tuple[EquationTerm, ...]:
    """Return the terms of an equation of motion, in the printed order.

    Parameters
    ----------
    line : Line
        From `Formulas.equation_line`.
    """
    return tuple(
        EquationTerm(side, sign, node, *_kind(side, node))
        for side, whole in enumerate(line.sides)
        for sign, node in _side_terms(whole)
    )


def _side_terms(side: Node) -> tuple[tuple[int, Node], ...]:
    """Return the terms of one side of an equation with their signs; none if it is zero.

    `FormulaWriter.term_tokens` divides a side in the same way.
    """
    if side == ZERO:
        return ()
    return side.terms if isinstance(side, Sum) else (signed(side),)


def term_expressions(terms: tuple[EquationTerm, ...], model: Model) -> tuple[Basic, ...]:
    """Return the values of terms with their signs, as expressions in t, q, v, a, λ and parameters.

    They are read from the printed formulas, so that a formula and its value cannot differ.

    Parameters
    ----------
    terms : tuple of EquationTerm
    model : Model
        The model of the terms.
    """
    scope = scope_of(model)
    return tuple(term.sign * build(parse(grammar_text(term.node)), scope).value for term in terms)


def _kind(side: int, node: Node) -> tuple[TermKind, tuple[str, ...]]:
    moving, constraints = False, dict[str, None]()
    stack = [node]
    while stack:
        item = stack.pop()
        if isinstance(item, Symbol):
            moving |= item.dots > 0
            if item.kind == "multiplier":
                constraints[item.name] = None
        stack.extend(reversed(children(item)))
    if constraints:
        return "constraint", tuple(constraints)
    if side:
        return "applied", ()
    return ("inertia" if moving else "potential"), ()
