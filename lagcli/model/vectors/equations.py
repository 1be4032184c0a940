"""Equations of vectors and rotations as equations of their components."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.expression.tensors import ShapeError, Tensor, kind_of
from lagcli.model.expression.trees import (
    CallExpr,
    ComponentExpr,
    NumberExpr,
    ProductExpr,
    Tree,
    VectorExpr,
)
from lagcli.model.names.scoping import Value

_LETTERS = ("x", "y", "z")


class ComponentEquation(NamedTuple):
    """One component of an equation.

    Parameters
    ----------
    part : str
        ``.x``, or ``.4`` of a longer vector.
    left, right : Tree
    sides : tuple of expressions
        Their values.
    """

    part: str
    left: Tree
    right: Tree
    sides: tuple[Basic, Basic]


def component_equations(
    left: Tree, right: Tree | None, values: list[Value], build: Callable[[Tree], Value | None]
) -> list[ComponentEquation]:
    """Return the component equations of an equation of vectors or rotations.

    An equation of rotations R₁ = R₂ becomes the three components of axial(R₂ᵀR₁), whose rate at R₁
    = R₂ is the relative angular velocity in the common frame.

    Parameters
    ----------
    left, right : Tree
        Sides of the equation; ``right`` is None for 0.
    values : list of expressions, vectors or matrices
        Values of the given sides.
    build : callable
        Returns the value of a tree; None if it has an error, which has been reported.

    Raises
    ------
    ShapeError
        The sides do not fit, or are matrices that are not rotations.
    """
    place = (left.start, left.end)
    zero: Tree = NumberExpr(*place, Fraction(0))
    if right is None:
        right, values = zero, [*values, se.Integer(0)]
    one, two = values
    for value, other in ((one, two), (two, one)):
        if not isinstance(value, Tensor) and value != 0:
            raise ShapeError(f"{kind_of(other)} cannot be equal to a scalar")
    if isinstance(one, Tensor) and isinstance(two, Tensor):
        if one.shape != two.shape:
            raise ShapeError(f"{one.kind} cannot be equal to {two.kind}")
        if one.is_rotation and two.is_rotation:
            inverse = CallExpr(*place, "transpose", (right,))
            relative = ProductExpr(*place, ((1, inverse), (1, left)))
            left, right = CallExpr(*place, "axial", (relative,)), zero
            built = build(left)
            if built is None:
                return []
            one, two = built, se.Integer(0)
    vector = one if isinstance(one, Tensor) else two
    assert isinstance(vector, Tensor)
    if not vector.is_vector:
        raise ShapeError("an equation of matrices is possible between rotations only")
    count = len(vector.entries)
    parts = _LETTERS[:count] if count <= len(_LETTERS) else map(str, range(1, count + 1))
    return [
        ComponentEquation(
            f".{part}",
            _component(left, one, i, part),
            _component(right, two, i, part),
            (_entry(one, i), _entry(two, i)),
        )
        for i, part in enumerate(parts)
    ]


def _entry(value: Value, i: int) -> Basic:
    return value.entries[i] if isinstance(value, Tensor) else value


def _component(tree: Tree, value: Value, i: int, part: str) -> Tree:
    """Return the tree of a component; the zero of a vector equation is used for each."""
    if not isinstance(value, Tensor):
        return tree
    if isinstance(tree, VectorExpr):
        return tree.items[i]
    if part in _LETTERS:
        return ComponentExpr(tree.start, tree.end, tree, part)
    index = NumberExpr(tree.start, tree.end, Fraction(i + 1))
    return ComponentExpr(tree.start, tree.end, tree, "", (index,))
