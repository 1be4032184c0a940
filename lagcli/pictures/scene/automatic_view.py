"""Automatic views: points recognized by the names of their coordinates."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from symengine import Basic, Integer, expand

from lagcli.model.expression.tensors import Tensor
from lagcli.model.model import Constraint, Model, Segment, View, coordinate
from lagcli.pictures.scene.rigid_bodies import Position, point_name, rigid_bodies

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

    Parameters
    ----------
    model : Model

    Returns
    -------
    Model
        The same model if it has a view, or if no point is recognized.
    """
    if model.view is not None:
        return model
    found = dict(_points(model)) or dict(_on_a_line(model))
    if not found:
        return model
    dimension = max(map(len, found.values()))
    points = {name: place for name, place in found.items() if len(place) == dimension}
    symbols = {coordinate(q) for q in model.coordinate_names}
    links = list(_rods(model.constraints, points, symbols))
    for link in links:
        if link.fixed is not None:
            points.setdefault(link.ends[0], link.fixed)
    segments = [Segment("rod", link.name, *link.ends) for link in links]
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
        segments += body.edges
    view = View(
        dimension,
        points,
        segments=tuple(segments),
        grounds=fixed,
        trails=tuple(moving) if len(moving) <= _TRAILS else (),
        labels=labels,
    )
    return replace(model, view=view)


class _Link(NamedTuple):
    """A rod between two points, the first of which may be fixed."""

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
            yield point_name(base[1:]), place
    for name, definition in model.definitions.items():
        value = definition.value
        match = _VECTOR.fullmatch(name)
        if match and isinstance(value, Tensor) and value.is_vector and len(value.entries) in (2, 3):
            entries = tuple(value.entries)
            if not any(s.name.endswith("'") for s in _free(entries)):
                yield point_name(match["rest"]), entries


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


def _rods(
    constraints: Sequence[Constraint], points: Mapping[str, Position], symbols: set[Basic]
) -> Iterator[_Link]:
    """Yield the rods given by constraints: φ = a/2 |P − C|² + const.

    For points whose components are coordinates, ∂φ/∂P = a (P − C) gives the other end C: a fixed
    point, or another one of the points.
    """
    owners = {
        symbol: name
        for name, place in points.items()
        if all(x in symbols for x in place)
        for symbol in place
    }
    for constraint in constraints:
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
        pairs = zip(place, slopes, strict=True)
        center = tuple(expand(x - slope / factor) for x, slope in pairs)
        if len(ends) == 2 and _same(points[ends[0]], center):
            yield _Link(constraint.name, (ends[0], ends[1]))
        elif len(ends) == 1 and not _free(center) & symbols:
            name = next((n for n, p in points.items() if _same(p, center)), None)
            origin = all(x == 0 for x in center)
            name = name or ("O" if origin else f"{ends[0]}_0")
            yield _Link(constraint.name, (name, ends[0]), center)


def _same(place: Position, other: Position) -> bool:
    return all(expand(a - b) == 0 for a, b in zip(place, other, strict=True))
