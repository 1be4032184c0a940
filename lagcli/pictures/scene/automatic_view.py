"""Automatic views: points recognized by the names of their coordinates, and rigid bodies."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import Literal, NamedTuple

import numpy as np
from symengine import Basic, DenseMatrix, Integer, Lambdify, Symbol, expand, pi, sqrt

from lagcli.arrays import Array
from lagcli.model.expression.tensors import Tensor, angular_velocity, quaternion
from lagcli.model.model import Model, Plate, Segment, View, coordinate, velocity
from lagcli.pictures.scene.masses import base_name, bodies_of, masses, moving_names

#: Matches x, x_A, x1, xA, x[2]; the other coordinates differ only in the first letter.
_FIRST = re.compile(r"(?P<letter>[xX])(?P<rest>|_\w+|\d+|[A-Z]\w*|\[\d+\])")
_OTHERS = {"x": "yz", "X": "YZ"}
_HEIGHT = re.compile(r"[yYzZ](?:|_\w+|\d+|[A-Z]\w*|\[\d+\])")
#: Matches definitions of position vectors: r, r_A, rA.
_VECTOR = re.compile(r"[rR](?P<rest>|_\w+|\d+|[A-Z]\w*|\[\d+\])")
_TRAILS = 4  # largest number of trails; more would cover the picture
_LABELS = 12


def with_view(model: Model) -> Model:
    """Return a model with its view, or with an automatic one.

    Points are pairs or triples of coordinates or definitions such as ``x_A, y_A``, and vector
    definitions such as ``r_A``; without any, coordinates ``x`` along the horizontal, or one ``y``
    or ``z`` along the vertical. Holonomic constraints that keep a distance are drawn as rods.
    A rigid body, a point with a quaternion or three angles, is the homogeneous box of its mass and
    inertia, with rods to the vector definitions that are fixed in it.

    Returns
    -------
    Model
        The same model if it has a view, or if no point is recognized.
    """
    if model.view is not None:
        return model
    places = dict(_points(model)) or dict(_on_a_line(model))
    if not places:
        return model
    dimension = max(map(len, places.values()))
    points = {name: place for name, place in places.items() if len(place) == dimension}
    symbols = {coordinate(q) for q in model.coordinate_names}
    links = list(_rods(model, points, symbols))
    for link in links:
        if link.fixed is not None:
            points.setdefault(link.ends[0], link.fixed)
    segments = [Segment(link.kind, link.name, *link.ends) for link in links]
    bodies = rigid_bodies(model, points)
    for body in bodies:
        for name, place in body.fixed.items():
            known = next((n for n, p in points.items() if _same(p, place)), None)
            points.setdefault(known or name, place)
            segments.append(Segment("rod", body.centre, body.centre, known or name))
    fixed = tuple(n for n, place in points.items() if not _free(place) & symbols)
    moving = [name for name in points if name not in fixed]
    labels = dict.fromkeys(points) if len(points) <= _LABELS else {}
    for body in bodies:
        points.update(body.corners)
    view = View(
        dimension,
        points,
        segments=tuple(segments),
        plates=tuple(face for body in bodies for face in body.faces),
        grounds=fixed,
        trails=tuple(moving) if len(moving) <= _TRAILS else (),
        labels=labels,
        masses=masses(model, {name: points[name] for name in places if name in points}),
    )
    return replace(model, view=view)


class _Link(NamedTuple):
    """A rod or a rope between two points, the first of which may be fixed."""

    kind: Literal["rod", "rope"]
    name: str
    ends: tuple[str, str]
    fixed: Position | None = None


def _points(model: Model) -> Iterator[tuple[str, Position]]:
    """Yield the points by name."""
    scalars = dict(_scalars(model))
    for name, value in scalars.items():
        match = _FIRST.fullmatch(name)
        if match is None:
            continue
        rest = match["rest"]
        partners = [scalars.get(letter + rest) for letter in _OTHERS[match["letter"]]]
        second, third = partners
        if second is not None:
            yield point_name(rest), (value, second) if third is None else (value, second, third)
    for name in model.coordinate_names:
        base, dot, _ = name.rpartition(".x")
        place = tuple(scalars[f"{base}.{axis}"] for axis in "xyz" if f"{base}.{axis}" in scalars)
        if dot and len(place) > 1:
            yield _point_of(base), place
    used = moving_names(model)
    for name, definition in model.definitions.items():
        value = definition.value
        known = _VECTOR.fullmatch(name) or base_name(name) in used
        if known and isinstance(value, Tensor) and value.is_vector and len(value.entries) in (2, 3):
            entries = tuple(value.entries)
            if not any(s.name.endswith("'") for s in _free(entries)):
                yield _point_of(name), entries


def _on_a_line(model: Model) -> Iterator[tuple[str, Position]]:
    """Yield the points of a model whose bodies move along one line.

    For several heights, their horizontal positions are unknown.
    """
    zero = Integer(0)
    lengths = [q.name for q in model.coordinates if q.unit in (None, "", "m")]
    across = [name for name in lengths if _FIRST.fullmatch(name)]
    upright = [name for name in lengths if _HEIGHT.fullmatch(name)]
    if across and not upright:
        for name in across:
            yield point_name(name[1:]), (coordinate(name), zero)
    elif len(upright) == 1 and not across:
        yield point_name(upright[0][1:]), (zero, coordinate(upright[0]))


def _scalars(model: Model) -> Iterator[tuple[str, Basic]]:
    """Yield lengths by name: coordinates in m or without a unit, and scalar definitions."""
    for q in model.coordinates:
        if q.unit in (None, "", "m"):
            yield q.name, coordinate(q.name)
    for name, definition in model.definitions.items():
        value = definition.value
        if not isinstance(value, Tensor) and not any(
            s.name.endswith("'") for s in value.free_symbols
        ):
            yield name, value


def _free(place: Position) -> set[Basic]:
    return set().union(*(x.free_symbols for x in place))


def _rods(model: Model, points: Mapping[str, Position], symbols: set[Basic]) -> Iterator[_Link]:
    """Yield the rods given by constraints, φ = a/2 |P − C|² + const, and the ropes.

    For points whose components are coordinates, ∂φ/∂P = a (P − C) gives the other end C: a fixed
    point, or another one of the points.
    """
    owners = {
        symbol: name
        for name, place in points.items()
        if all(x in symbols for x in place)
        for symbol in place
    }
    values = {Symbol(name): value for name, value in model.parameter_values.items()}
    for constraint in model.constraints:
        phi = constraint.expression
        used = phi.free_symbols & symbols
        ends = list(dict.fromkeys(owners.get(s, "") for s in sorted(used, key=str)))
        if constraint.kind != "holonomic" or "" in ends or len(ends) not in (1, 2):
            continue
        place = points[ends[-1]]
        slopes = [phi.diff(x) for x in place]
        factor = expand(slopes[0].diff(place[0]))
        if factor == 0 or factor.free_symbols & symbols:
            continue
        if constraint.sign * float(factor.subs(values)) > 0:  # the points may move apart
            continue
        kind: Literal["rod", "rope"] = "rope" if constraint.sign else "rod"
        pairs = zip(place, slopes, strict=True)
        center = tuple(expand(x - slope / factor) for x, slope in pairs)
        if len(ends) == 2 and _same(points[ends[0]], center):
            yield _Link(kind, constraint.name, (ends[0], ends[1]))
        elif len(ends) == 1 and not _free(center) & symbols:
            name = next((n for n, p in points.items() if _same(p, center)), None)
            origin = all(x == 0 for x in center)
            name = name or ("O" if origin else f"{ends[0]}_0")
            yield _Link(kind, constraint.name, (name, ends[0]), center)


def _same(place: Position, other: Position) -> bool:
    return all(expand(a - b) == 0 for a, b in zip(place, other, strict=True))


#: Largest numbers of bodies, and of vectors that may be points of these.
_BODIES, _VECTORS = 20, 120
_STATES = 3  # random ones, in which a fixed point has the same position in its body
_SAME = 1e-9  # relative

Position = tuple[Basic, ...]


class _Orientation(NamedTuple):
    """The rotation of a body, and a state in which its angular velocity determines all its rates.

    Parameters
    ----------
    matrix : Tensor
    state : dict of Symbol to Basic
        Values of the coordinates of the rotation.
    rates : tuple of 3 Symbol
        Velocities of three of these coordinates.
    inverse : DenseMatrix
        Matrix from the angular velocity in the body frame to these rates, in that state.
    """

    matrix: Tensor
    state: dict[Basic, Basic]
    rates: tuple[Basic, ...]
    inverse: DenseMatrix


class RigidBody(NamedTuple):
    """The drawing of a body: additional points, and lines between them.

    Parameters
    ----------
    centre : str
        The point that is its centre of mass.
    fixed : dict of str to positions
        Points of the model that are fixed in the body, by name.
    corners : dict of str to positions
        Corners of its box.
    faces : tuple of Plate
        Faces of the box, between its corners; one if it is thin.
    """

    centre: str
    fixed: dict[str, Position]
    corners: dict[str, Position]
    faces: tuple[Plate, ...]


def rigid_bodies(model: Model, centres: Mapping[str, Position]) -> list[RigidBody]:
    """Return the drawings of bodies whose rotation is a quaternion, or one of three angles.

    Parameters
    ----------
    model : Model
    centres : mapping of str to positions
        Points that may be centres of mass; that of R or e in ``body(m, J, r, R)`` is r, that of any
        other R_A or e_A is the point A, that of R[2] is P[2], that of R or e is P.

    Returns
    -------
    list of RigidBody
        Empty if there are more than can be distinguished.
    """
    given = bodies_of(model)
    turns = {}
    for name, turn in _rotations(model):
        base = base_name(name)
        known = base in given
        turns[_point_of(given[base] + name[len(base) :]) if known else point_name(name[1:])] = turn
    located = {name: turn for name, turn in turns.items() if len(centres.get(name, ())) == 3}
    if len(located) > _BODIES:
        return []
    vectors = _vectors(model) if located else {}
    return [_body(model, name, centres[name], turn, vectors) for name, turn in located.items()]


def _point_of(vector: str) -> str:
    """Return the name of the point of a position vector: A for r_A; others have their own names."""
    match = _VECTOR.fullmatch(vector)
    return point_name(match["rest"]) if match else vector


def point_name(rest: str) -> str:
    """Return the name of a point: A for x_A, P1 for x1, P[2] for x[2]."""
    letters = rest.lstrip("_")
    return letters if letters[:1].isalpha() else f"P{letters}"


def _rotations(model: Model) -> Iterator[tuple[str, _Orientation]]:
    """Yield the rotations of bodies, with their names."""
    names = set(model.coordinate_names)
    for name in model.coordinate_names:
        base = name.removesuffix(".0")
        parts = [f"{base}.{i}" for i in range(4)]
        if base != name and names.issuperset(parts):
            yield base, _by_quaternion(*map(coordinate, parts))
    known = {coordinate(q) for q in model.coordinate_names}
    for name, definition in model.definitions.items():
        value = definition.value
        turns = value.factors if isinstance(value, Tensor) else ()
        if not turns or not all(turn.parameters for turn in turns):
            continue
        assert isinstance(value, Tensor)
        given = [x for turn in turns for x in turn.parameters]
        if len(turns) == 1 and len(given) == 4 and known.issuperset(given):
            yield name, _by_quaternion(*given)
        elif all(turn.axis is not None for turn in turns):
            orientation = _by_angles(model, value)
            if orientation is not None:
                yield name, orientation


def _by_quaternion(*parts: Basic) -> _Orientation:
    """Return the orientation (e0, e1, e2, e3), with ω = 2 (e1', e2', e3') at (1, 0, 0, 0)."""
    state = dict(zip(parts, map(Integer, (1, 0, 0, 0)), strict=True))
    rates = tuple(velocity(str(x)) for x in parts[1:])
    half = [Integer(int(i == j)) / 2 for i, j in product(range(3), repeat=2)]
    return _Orientation(quaternion(*parts), state, rates, DenseMatrix(3, 3, half))


def _by_angles(model: Model, matrix: Tensor) -> _Orientation | None:
    """Return an orientation that depends on three coordinates, such as Euler angles, or None."""
    free = set().union(*(x.free_symbols for x in matrix.entries))
    angles = [q for q in map(coordinate, model.coordinate_names) if q in free]
    if len(angles) != 3 or not free <= {*angles, *map(Symbol, model.parameters)}:
        return None
    columns = [_angular_velocity_along(matrix, q) for q in angles]
    for values in product((Integer(0), pi / 2), repeat=3):
        state = dict(zip(angles, values, strict=True))
        rows = [expand(column[i].subs(state)) for i in range(3) for column in columns]
        from_rates = DenseMatrix(3, 3, rows)
        if expand(from_rates.det()) != 0:
            rates = tuple(velocity(str(q)) for q in angles)
            return _Orientation(matrix, state, rates, from_rates.inv())
    return None


def _angular_velocity_along(matrix: Tensor, angle: Basic) -> tuple[Basic, ...]:
    """Return the angular velocity if only one angle changes, per unit of its rate."""

    def derivative(x: Basic) -> Basic:
        return x.diff(angle)

    return angular_velocity(matrix, derivative).entries


def _vectors(model: Model) -> dict[str, Position]:
    """Return vectors of the configuration that may be points."""
    known = {coordinate(q) for q in model.coordinate_names}
    known |= {Symbol(name) for name in model.parameters}
    vectors = {}
    for name, definition in model.definitions.items():
        value = definition.value
        if isinstance(value, Tensor) and value.is_vector and len(value.entries) == 3:
            free = set().union(*(x.free_symbols for x in value.entries))
            if free <= known and not free.isdisjoint(map(coordinate, model.coordinate_names)):
                vectors[name] = tuple(value.entries)
    return vectors if len(vectors) <= _VECTORS else {}


def _body(
    model: Model,
    name: str,
    centre: Position,
    turn: _Orientation,
    vectors: Mapping[str, Position],
) -> RigidBody:
    rotation = turn.matrix
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
    faces = [Plate(f"{name} box", tuple(called[x] for x in face)) for face in _faces(signs)]
    corners = {called[corner]: place for corner, place in places.items()}
    return RigidBody(name, fixed, corners, tuple(faces))


def _faces(signs: Sequence[Sequence[int]]) -> Iterator[list[tuple[int, ...]]]:
    """Yield the corners around each face of a box, whose thin sides have the sign 0 alone."""
    thin = [axis for axis, sides in enumerate(signs) if len(sides) == 1]
    if len(thin) > 1:
        ends = list(product(*signs))
        if len(ends) > 1:
            yield ends
        return
    for normal in thin or range(3):
        first, second = (axis for axis in range(3) if axis != normal)
        for side in signs[normal]:
            around = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            face = []
            for a, b in around:
                corner = [side] * 3
                corner[first], corner[second] = a, b
                face.append(tuple(corner))
            yield face


def _fixed(
    model: Model, centre: Position, rotation: Tensor, vectors: Mapping[str, Position]
) -> Iterator[tuple[str, Position]]:
    """Yield the vectors with constant components in the body frame."""
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


def _half_sizes(model: Model, centre: Position, turn: _Orientation) -> tuple[Basic, ...]:
    """Return half the sides of the homogeneous box with the mass and the inertia of a body.

    With ω = W v, the inertia is W⁻ᵀ ∂²T/∂v² W⁻¹. Zeros if there is no such box: the axes are not
    principal axes, or the inertia refers to another point.
    """
    none = (Integer(0),) * 3
    if model.kinetic is None or not all(isinstance(x, Symbol) for x in centre):
        return none
    rates = [*(velocity(str(x)) for x in centre), *turn.rates]
    slopes = [model.kinetic.diff(x) for x in rates]
    second = [[expand(slope.diff(x).subs(turn.state)) for x in rates] for slope in slopes]
    of_angles = DenseMatrix(3, 3, [x for row in second[3:] for x in row[3:]])
    tensor = [expand(x) for x in (turn.inverse.T * of_angles * turn.inverse)]
    mass, inertia = second[0][0], tensor[::4]
    mixed = [tensor[3 * i + j] for i, j in combinations(range(3), 2)]
    mixed += [second[i][j] for i, j in combinations(range(6), 2) if i < 3]
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
