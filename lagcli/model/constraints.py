"""The constraints, and what kind each is."""

from __future__ import annotations

import symengine as se

from lagcli.model import model as symbols
from lagcli.model.declarations import valid_name
from lagcli.model.draft import Draft, Entry, Parsed
from lagcli.model.expansion import count_terms, is_zero, nonlinear_in
from lagcli.model.grammar import parse_equation
from lagcli.model.model import Constraint
from lagcli.model.scope import Context
from lagcli.model.source import Node, Scalar
from lagcli.model.tokens import ExpressionError
from lagcli.model.trees import Comparison, Tree

_EXPANDED = 1000  # terms of a constraint that is written out to see what cancels
_EXAMPLE = "x^2 + y^2 = l^2"


def declare_constraints(draft: Draft, entries: list[Entry]) -> list[Entry]:
    """Enter the names of the constraints; return the entries that have one."""
    named = [e for e in entries if valid_name(draft, e[0], e[1], "constraint")]
    draft.names.constraints = dict.fromkeys(name for name, _, _ in named)
    return named


def read_constraints(draft: Draft, entries: list[Entry]) -> tuple[Constraint, ...]:
    """Return the constraints that can be built."""
    found = []
    for name, key, given in entries:
        what = f"constraint `{name}`"
        node, fields = draft.expression_node(
            key, given, what, later=("unilateral", "restitution"), example=_EXAMPLE
        )
        description = draft.text(fields.get("description"), f"`description` of {what}")
        if node is not None:
            constraint = _constraint(draft, name, key, node, description)
            if constraint is not None:
                found.append(constraint)
    return tuple(found)


def _equation(draft: Draft, node: Node, what: str) -> tuple[Scalar, Tree, Tree | None] | None:
    if not isinstance(node, Scalar) or node.missing:
        draft.report.add(
            "wrong-type",
            f"{what} must be an equation, not {node.what}",
            node.location,
            f"write lhs = rhs, as in `{_EXAMPLE}`",
        )
        return None
    with draft.report.expression(node):
        left, right = parse_equation(node.value)
        if isinstance(left, Comparison) and right is None:
            sign = left.operators[0]
            raise ExpressionError(
                "not-an-equation",
                f"{what} is an equation and has `=`, not `{sign}`",
                start := node.value.index(sign, left.operands[0].end),
                start + len(sign),
                "write a single `=`"
                if sign == "=="
                else "inequalities are not part of this version",
            )
        return node, left, right
    return None


def _constraint(
    draft: Draft, name: str, key: Scalar, given: Node, description: str | None
) -> Constraint | None:
    what = f"constraint `{name}`"
    equation = _equation(draft, given, what)
    if equation is None:
        return None
    node, left, right = equation
    trees = [left] if right is None else [left, right]
    built = [draft.scalar(Parsed(node, tree), Context(what)) for tree in trees]
    draft.trees[f"constraints.{name}.left"] = left
    sides = [side for side in built if side is not None]
    if len(sides) < len(trees):
        return None
    expression = sides[0] if right is None else sides[0] - sides[1]
    small = count_terms(expression) <= _EXPANDED
    written_out = se.expand(expression) if small else expression  # x = x + 1 leaves no x
    free = written_out.free_symbols
    rates = [v for v in map(symbols.velocity, draft.names.coordinates) if v in free]
    if not rates and free.isdisjoint(map(symbols.coordinate, draft.names.coordinates)):
        uses_unknowns = any(
            symbols.coordinate(q) in side.free_symbols or symbols.velocity(q) in side.free_symbols
            for side in sides
            for q in draft.names.coordinates
        )
        draft.report.add(
            "no-unknowns",
            f"{what} contains neither a coordinate nor a velocity"
            if not uses_unknowns
            else f"{what} says {written_out} = 0, whatever the coordinates",
            node.location,
            "it constrains nothing: mend it, or remove it"
            if written_out == 0 or not uses_unknowns
            else "nothing can satisfy it: mend it, or remove it",
        )
        return None
    if is_zero(expression):
        draft.report.add(
            "no-unknowns",
            f"{what} holds for all values of the coordinates",
            node.location,
            "it constrains nothing: mend it, or remove it",
        )
        return None
    bad = nonlinear_in(expression, rates)
    if bad is not None:
        draft.report.add(
            "not-yet",
            f"{what} is not affine in the velocity `{bad.name}`",
            node.location,
            "velocities may stand in sums and be multiplied by coordinates, no more, in this"
            " version",
        )
        return None
    kind: symbols.Kind = "nonholonomic" if rates else "holonomic"
    return Constraint(name, kind, expression, left, right, description, key.location)
