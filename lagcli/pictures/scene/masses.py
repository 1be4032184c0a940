"""Masses of a drawing: the points whose velocities occur in the kinetic energy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from symengine import Basic

from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.trees import CallExpr, Name, SumExpr, walk
from lagcli.model.model import Model, coordinate

#: Before the names of definitions in the keys of `Model.trees`.
_DEFINITIONS = "definitions."


def base_name(name: str) -> str:
    """Return a name without its indices."""
    return name.partition("[")[0]


def energy_names(model: Model) -> Iterator[Name]:
    """Yield the names in T, or in L, and in the definitions that these use."""
    trees = {
        base_name(key.removeprefix(_DEFINITIONS)): tree
        for key, tree in model.trees.items()
        if key.startswith(_DEFINITIONS)
    }
    waiting = [tree for key in ("T", "L") if (tree := model.trees.get(key)) is not None]
    known: set[str] = set()
    while waiting:
        for part in walk(waiting.pop()):
            if isinstance(part, Name):
                yield part
                base = base_name(part.text)
                if base not in known and base in trees:
                    waiting.append(trees[base])
                known.add(base)


def bodies_of(model: Model) -> dict[str, str]:
    """Return the position of each rigid body in T by its rotation, both without indices.

    Sums that contain the velocity of one vector and the angular velocity of one rotation, as
    ``body(m, J, r, R)`` does, are the energies of bodies.
    """
    bodies = {}
    for key in ("T", "L", *(_DEFINITIONS + name for name in model.definitions)):
        for part in walk(model.trees[key]) if key in model.trees else ():
            if not isinstance(part, SumExpr):
                continue
            inner = list(walk(part))
            places = {base_name(x.text) for x in inner if isinstance(x, Name) and x.primes}
            turns = {
                base_name(x.arguments[0].text)
                for x in inner
                if isinstance(x, CallExpr) and x.function == "omega"
                if isinstance(x.arguments[0], Name)
            }
            if len(places) == len(turns) == 1:
                bodies[turns.pop()] = places.pop()
    return bodies


def moving_names(model: Model) -> set[str]:
    """Return the names, without indices, whose rates T contains."""
    return {base_name(name.text) for name in energy_names(model) if name.primes}


def masses(model: Model, points: Mapping[str, tuple[Basic, ...]]) -> tuple[str, ...]:
    """Return the points that are masses.

    Parameters
    ----------
    model : Model
    points : mapping of str to expressions
        The points of its view.

    Returns
    -------
    tuple of str
        Points that move, and whose moving components are coordinates or definitions whose rates T
        contains as it is written.
    """
    symbols = {coordinate(name) for name in model.coordinate_names}
    moving = moving_names(model)
    known = {coordinate(name) for name in model.coordinate_names if base_name(name) in moving}
    vectors: set[tuple[Basic, ...]] = set()
    for name, definition in model.definitions.items():
        if base_name(name) in moving:
            value = definition.value
            if isinstance(value, Tensor):
                vectors.add(tuple(value.entries))
            else:
                known.add(value)
    fixed = []
    for name, place in points.items():
        free = [x for x in place if not x.free_symbols.isdisjoint(symbols)]
        if free and (place in vectors or known.issuperset(free)):
            fixed.append(name)
    return tuple(fixed)
