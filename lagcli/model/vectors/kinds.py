"""Coordinates of a kind: points ``r.x, r.y, r.z`` and unit quaternions ``e.0, …, e.3``."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import NamedTuple

from lagcli.model.expression.trees import (
    BRACKETS,
    CallExpr,
    Name,
    NumberExpr,
    PowerExpr,
    SumExpr,
    Tree,
    VectorExpr,
)
from lagcli.model.names.families import Declaration


class VectorKind(NamedTuple):
    """A kind of coordinates.

    Parameters
    ----------
    parts : tuple of str
        The names of the components.
    unit : str
        Unit of each component, in a model with units.
    """

    parts: tuple[str, ...]
    unit: str


#: The kinds by their names in model files.
KINDS = {
    "point": VectorKind(("x", "y", "z"), "m"),
    "quaternion": VectorKind(("0", "1", "2", "3"), "1"),
}
_INDICES = ("#i", "#j")  # no name of the grammar begins with #


def components(declared: Declaration, kind: str) -> list[Declaration]:
    """Return the coordinates of a vector or rotation."""
    return [declared._replace(part=f".{part}", kind=kind) for part in KINDS[kind].parts]


def definitions_of(declared: Iterable[Declaration]) -> list[Declaration]:
    """Return the definitions of the vectors and rotations whose components are declared.

    A point denotes the vector of its components, a quaternion its rotation.
    """
    found: dict[int, Declaration] = {}
    for d in declared:
        if d.kind:
            spans = (span for _, span in d.spans)
            named = tuple(zip(_INDICES, spans, strict=False))
            found.setdefault(id(d.key), d._replace(part="", node=d.key, spans=named))
    return list(found.values())


def constraints_of(definitions: Iterable[Declaration]) -> list[Declaration]:
    """Return the declarations of the constraints that normalize quaternions."""
    return [d._replace(part=".unit") for d in definitions if d.kind == "quaternion"]


def value_of(definition: Declaration) -> Tree:
    """Return the vector or rotation that a name denotes, as an expression of its components."""
    parts = tuple(_components(definition))
    place = (0, len(definition.key.value))
    if definition.kind == "quaternion":
        return CallExpr(*place, "quat", parts)
    return VectorExpr(*place, parts)


def unit_length(constraint: Declaration) -> tuple[Tree, Tree]:
    """Return the sides of ``e.0^2 + e.1^2 + e.2^2 + e.3^2 = 1``."""
    place = (0, len(constraint.key.value))
    two = NumberExpr(*place, Fraction(2))
    squares = tuple((1, PowerExpr(*place, part, two)) for part in _components(constraint))
    return SumExpr(*place, squares), NumberExpr(*place, Fraction(1))


def _components(d: Declaration) -> Iterable[Tree]:
    place = (0, len(d.key.value))
    indices = tuple(Name(*place, index, 0) for index in d.indices)
    brackets = BRACKETS.get(len(d.spans), "")
    for part in KINDS[d.kind].parts:
        yield Name(*place, f"{d.name}{brackets}.{part}", 0, indices)
