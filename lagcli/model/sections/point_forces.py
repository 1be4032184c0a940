"""Checks of the force of a constraint at points of a view."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from symengine import Basic

from lagcli.model.diagnostics import Broken
from lagcli.model.draft import Draft
from lagcli.model.expression.algebra import is_zero
from lagcli.model.expression.functions import derivative
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import Name
from lagcli.model.model import Constraint, coordinate, velocity
from lagcli.model.names.members import format_members
from lagcli.model.names.scope import ModelScope
from lagcli.model.sections.pointing import member_name
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.model.yaml.source import YamlNode

_COMPONENTS = {"x", "y", "z", *map(str, range(1, 10))}


def constraint_named(draft: Draft, tree: Name, scope: ModelScope) -> str:
    """Return the constraint that a tree names.

    Raises
    ------
    ExpressionError
        There is no such constraint.
    Broken
        A declaration with an error may be the constraint.
    """
    known = list(draft.names.constraints)
    text = member_name(tree, scope)
    if any(part in draft.names.constraints for part in components_of(text, known)):
        return text
    base = text.partition("[")[0]
    if base in draft.names.suspects or draft.names.may_be_constraint(text):
        raise Broken
    members = [name for name in known if name.startswith(f"{base}[")]
    help_ = f"the members are {format_members(base, members)}" if members else None
    raise ExpressionError(
        "unknown-name",
        f"{scope.context.where} names `{text}`{scope.at()}, which is not a constraint",
        tree.start,
        tree.end,
        help_ or did_you_mean(nearest(text, known) or known[:3]) or "the model has no constraints",
    )


def components_of(constraint: str, known: Collection[str]) -> tuple[str, ...]:
    """Return a constraint, or the components of a vector constraint: ``pin.x`` of ``pin``."""
    if constraint in known:
        return (constraint,)
    parts = (name.removeprefix(f"{constraint}.") for name in known if name != constraint)
    return tuple(f"{constraint}.{part}" for part in parts if part in _COMPONENTS)


def check_force(
    draft: Draft,
    constraint: Constraint,
    at: tuple[str, ...],
    points: Mapping[str, tuple[Basic, ...]],
    node: YamlNode,
) -> bool:
    """Report a constraint that acts on coordinates on which none of the points depends.

    λ b is the force of the constraint on the coordinates, and Jᵀ F that of forces F at points,
    where J contains the derivatives of the points with respect to the coordinates: if J has no
    column for a coordinate, b must not have one.
    """
    coordinates = draft.names.coordinates
    symbols = {s for name in at for x in points[name] for s in x.free_symbols}
    where = " and ".join(f"`{name}`" for name in at)
    moving = sorted(s.name for s in symbols if s.name.rstrip("'") in coordinates)
    rates = [name for name in moving if name.endswith("'")]
    if rates:
        draft.report.add(
            "velocity-in-position",
            f"a force acts at a position, but {where} depends on the velocity `{rates[0]}`",
            node.location,
            "name a point that is a position",
        )
        return False
    symbol = coordinate if constraint.kind == "holonomic" else velocity
    free = constraint.expression.free_symbols
    others = [
        name
        for name in coordinates
        if name not in moving
        and symbol(name) in free
        and not is_zero(derivative(constraint.expression, symbol(name)))
    ]
    if not others:
        return True
    draft.report.add(
        "force-elsewhere",
        f"the constraint `{constraint.name}` also acts on `{others[0]}`, on which {where} does not"
        " depend: its force does not act only there",
        node.location,
        "name all points that it acts on, as in `at: [A, B]`; or, instead of `force`, give the"
        f" vector itself: `components: [lambda.{constraint.name}, 0]`",
        subject=f"{constraint.name.partition('[')[0]} {node.location.line}",
    )
    return False
