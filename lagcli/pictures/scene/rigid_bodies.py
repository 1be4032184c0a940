"""Rigid bodies of models without a view: the box of their inertia, and points fixed in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from symengine import Basic, Integer, Lambdify, Symbol, expand, sqrt

from lagcli.arrays import Array
from lagcli.model.expression.tensors import Tensor, quaternion
from lagcli.model.model import Model, Segment, coordinate, velocity

#: Bodies, and vectors that may be points of theirs, beyond which none is sought.
_BODIES, _VECTORS = 20, 120
_STATES = 3  # random ones, in which a fixed point has the same place in its body
_SAME = 1e-9  # relative

Position = tuple[Basic, ...]


class RigidBody(NamedTuple):
    """The drawing of a body: more points, and lines between them.

    Parameters
    ----------
    centre : str
        The point that is its centre of mass.
    fixed : dict of str to positions
        Points of the model that are fixed in the body, by name.
    corners : dict of str to positions
        Corners of its box.
    edges : tuple of Segment
        Edges of the box, between its corners.
    """

    centre: str
    fixed: dict[str, Position]
    corners: dict[str, Position]
    edges: tuple[Segment, ...]


def rigid_bodies(model: Model, centres: Mapping[str, Position]) -> list[RigidBody]:
    """Return the drawings of bodies whose rotation is a quaternion.

    Parameters
    ----------
    model : Model
    centres : mapping of str to positions
        Points that may be centres of mass; that of R_A or e_A is the point A, that of R[2] is
        P[2], that of R or e is P.

    Returns
    -------
    list of RigidBody
        None of more than can be distinguished.
    """
    turns = {point_name(name[1:]): turn for name, turn in _rotations(model)}
    found = {name: turn for name, turn in turns.items() if len(centres.get(name, ())) == 3}
    if len(found) > _BODIES:
        return []
    vectors = _vectors(model) if found else {}
    return [_body(model, name, centres[name], turn, vectors) for name, turn in found.items()]


def point_name(rest: str) -> str:
    """Return the name of a point: A for x_A, P1 for x1, P[2] for x[2]."""
    letters = rest.lstrip("_")
    return letters if letters[:1].isalpha() else f"P{letters}"


def _rotations(model: Model) -> Iterator[tuple[str, tuple[Basic, ...]]]:
    """Yield the quaternions of bodies, with the names of the rotations."""
    names = set(model.coordinate_names)
    for name in model.coordinate_names:
        base = name.removesuffix(".0")
        parts = [f"{base}.{i}" for i in range(4)]
        if base != name and names.issuperset(parts):
            yield base, tuple(map(coordinate, parts))
    for name, definition in model.definitions.items():
        value = definition.value
        turns = value.factors if isinstance(value, Tensor) else ()
        if len(turns) == 1 and len(turns[0].parameters) == 4:
            parameters = turns[0].parameters
            if all(isinstance(e, Symbol) for e in parameters):
                yield name, parameters


def _vectors(model: Model) -> dict[str, Position]:
    """Return vectors of the configuration that may be points."""
    known = {coordinate(q) for q in model.coordinate_names}
    known |= {Symbol(name) for name in model.parameters}
    found = {}
    for name, definition in model.definitions.items():
        value = definition.value
        if isinstance(value, Tensor) and value.is_vector and len(value.entries) == 3:
            free = set().union(*(x.free_symbols for x in value.entries))
            if free <= known and not free.isdisjoint(map(coordinate, model.coordinate_names)):
                found[name] = tuple(value.entries)
    return found if len(found) <= _VECTORS else {}


def _body(
    model: Model,
    name: str,
    centre: Position,
    turn: tuple[Basic, ...],
    vectors: Mapping[str, Position],
) -> RigidBody:
    rotation = quaternion(*turn)
    fixed = dict(_fixed(model, centre, rotation, vectors))
    half = _half_sizes(model, centre, turn)
    signs = [(-1, 1) if x != 0 else (0,) for x in half]
    places = {
        corner: tuple(
            c + sum(s * x * entry for s, x, entry in zip(corner, half, row, strict=True))
            for c, row in zip(centre, rotation.rows, strict=True)
        )
        for corner in product(*signs)
        if any(corner)
    }
    called = {corner: f"{name} corner {i}" for i, corner in enumerate(places, 1)}
    edges = [
        Segment("edge", f"{name} box", called[a], called[b])
        for a, b in combinations(places, 2)
        if sum(x != y for x, y in zip(a, b, strict=True)) == 1
    ]
    corners = {called[corner]: place for corner, place in places.items()}
    return RigidBody(name, fixed, corners, tuple(edges))


def _fixed(
    model: Model, centre: Position, rotation: Tensor, vectors: Mapping[str, Position]
) -> Iterator[tuple[str, Position]]:
    """Yield the vectors whose components in the body are the same in all states."""
    if not vectors:
        return
    values = model.parameter_values
    arguments = [*map(coordinate, model.coordinate_names), *map(Symbol, values)]
    entries = [x for place in (centre, *vectors.values()) for x in place]
    evaluate = Lambdify(arguments, [*rotation.entries, *entries])
    states = np.random.default_rng(0).normal(size=(_STATES, len(model.coordinate_names)))
    seen = []
    for q in states:
        numbers = np.asarray(evaluate([*q, *values.values()]), dtype=float)
        places: Array = numbers[9:].reshape(-1, 3)
        seen.append(np.linalg.solve(numbers[:9].reshape(3, 3), (places[1:] - places[0]).T).T)
    every = np.array(seen)
    size = np.abs(every).max(axis=(0, 2))
    spread = np.ptp(every, axis=0).max(axis=1)
    for i, (name, place) in enumerate(vectors.items()):
        if np.isfinite(size[i]) and size[i] > _SAME and spread[i] <= _SAME * size[i]:
            yield name, place


def _half_sizes(model: Model, centre: Position, turn: Sequence[Basic]) -> tuple[Basic, ...]:
    """Return half the sides of the homogeneous box with the mass and the inertia of a body.

    With e = (1, 0, 0, 0), ω = 2 ė: the inertia is a quarter of ∂²T/∂ė². Zeros where there is no
    such box: the axes are not principal ones, or the inertia is that of another point.
    """
    none = (Integer(0),) * 3
    if model.kinetic is None or not all(isinstance(x, Symbol) for x in centre):
        return none
    upright = dict(zip(turn, (1, 0, 0, 0), strict=True))
    rates = [velocity(str(x)) for x in (*centre, *turn[1:])]
    slopes = [model.kinetic.diff(x) for x in rates]
    second = [[expand(slope.diff(x).subs(upright)) for x in rates] for slope in slopes]
    mass, inertia = second[0][0], [second[i][i] / 4 for i in (3, 4, 5)]
    mixed = [second[i][j] for i, j in combinations(range(6), 2)]
    parameters = set(map(Symbol, model.parameters))
    if mass == 0 or any(x != 0 for x in mixed) or second[1][1] != mass or second[2][2] != mass:
        return none
    if not all(x.free_symbols <= parameters for x in (mass, *inertia)):
        return none
    squares = [expand(3 * (sum(inertia) - 2 * x) / (2 * mass)) for x in inertia]
    values = {Symbol(name): value for name, value in model.parameter_values.items()}
    numbers = [float(x.subs(values)) for x in squares]
    if min(numbers) < -_SAME * max(numbers, default=0.0) or max(numbers) <= 0:
        return none
    thin = [abs(x) <= _SAME * max(numbers) for x in numbers]
    return tuple(Integer(0) if flat else sqrt(x) for x, flat in zip(squares, thin, strict=True))
