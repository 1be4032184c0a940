"""Evaluation of the view of a model: samples → Scene, with the forces of constraints at points."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from symengine import Basic

from lagcli.arrays import Array, Indices
from lagcli.equations.typesetting.notation import Notation
from lagcli.errors import Diagnostic, UsageError
from lagcli.model.dimensions.deriving import symbolic_unit
from lagcli.model.expression.functions import derivative
from lagcli.model.locations import ExpressionLocations
from lagcli.model.model import Arrow, Model, coordinate, multiplier
from lagcli.pictures.column_evaluator import ColumnEvaluator
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.automatic_view import with_view
from lagcli.pictures.scene.masses import masses
from lagcli.pictures.scene.scene import (
    DrawnDisc,
    DrawnVector,
    Scene,
    extent_of,
    scaled,
    with_contacts,
)
from lagcli.trajectory.samples import Terms


def scene_of(
    run: RunFile, samples: Indices | None = None, model: Model | None = None
) -> Scene | None:
    """Return the scene of a run; None if its model has no view and no point is recognized.

    Parameters
    ----------
    run : Run
    samples : (m,) array of int, optional
        Indices of the samples, increasing; all by default.
    model : Model, optional
        The run's model with its view, from `with_view`, if it is known.

    Raises
    ------
    UsageError
        There is no model, or the force of a constraint cannot act at the points of the view.
    ModelError, FileError
        As `RunFile.model`.
    """
    model = model or with_view(run.model)
    if model.view is None:
        return None
    evaluator = ViewEvaluator(model)
    scene = evaluator.scene(run.columns(evaluator.needs, samples), run.terms)
    return with_contacts(scene, run.record.events, run.constraints)


class ViewEvaluator:
    """Evaluates the view of a model.

    Parameters
    ----------
    model : Model
        Model with a view.

    Attributes
    ----------
    needs : tuple of str
        The fields of `Samples` that `scene` needs.
    expressions : list of expressions
        What is evaluated: the following are indices into it.
    points : dict of str to list of int
        Components of the points.
    discs : list of (int, int or None, list of int or None)
        Radius, angle and normal of the discs.
    arrows : list of list of int
        Components of the vectors; empty for forces of constraints.
    forces : list of (PointForce, list of int) or None
        Forces of constraints, and their entries; None for other vectors.
    """

    def __init__(self, model: Model):
        assert model.view is not None
        self._model, self._view = model, model.view
        view = self._view
        self.expressions: list[Basic] = []
        self.points = {name: self._put(place) for name, place in view.points.items()}
        self.discs = [
            (
                self._put([d.radius])[0],
                None if d.angle is None else self._put([d.angle])[0],
                None if d.normal is None else self._put(d.normal),
            )
            for d in view.discs
        ]
        self.arrows = [self._put(a.components) for a in view.vectors]
        self.forces: list[tuple[PointForce, list[int]] | None] = []
        for arrow in view.vectors:
            force = point_force(model, arrow) if arrow.constraint is not None else None
            self.forces.append(None if force is None else (force, self._put(force.entries)))
        discs = {disc.center for disc in view.discs}
        bare = {name: place for name, place in view.points.items() if name not in discs}
        self._masses = masses(model, bare) if view.masses is None else view.masses
        self._evaluator = ColumnEvaluator(model, self.expressions)
        needs = dict.fromkeys(self._evaluator.needs)
        if any(self.forces):
            needs["constraint_force_by"] = None
        self.needs: tuple[str, ...] = tuple(needs)

    def _put(self, expressions: Sequence[Basic]) -> list[int]:
        """Add expressions to evaluate; return their indices."""
        self.expressions.extend(expressions)
        return list(range(len(self.expressions) - len(expressions), len(self.expressions)))

    def scene(
        self,
        columns: Mapping[str, Array],
        terms: Terms,
        parameters: Mapping[str, float] | None = None,
    ) -> Scene:
        """Return the scene at some samples.

        Parameters
        ----------
        columns : mapping of str to arrays
            The fields of `Samples` in ``needs``.
        terms : Terms
            Terms of ``constraint_force_by``.
        parameters : mapping of str to float, optional
            Parameter values in SI; by default those of the model, which structural ones must equal.

        Raises
        ------
        UsageError
            The force of a constraint cannot act at the points of the view.
        """
        view, model = self._view, self._model
        given = parameters or model.parameter_values
        values: list[Any] = list(self._evaluator.values(columns, terms, given))
        points = {name: tuple(values[i] for i in at) for name, at in self.points.items()}
        discs = tuple(
            DrawnDisc(
                d.name,
                d.center,
                values[radius],
                None if angle is None else values[angle],
                None if normal is None else tuple(values[i] for i in normal),
            )
            for d, (radius, angle, normal) in zip(view.discs, self.discs, strict=True)
        )
        vectors: list[DrawnVector] = []
        for arrow, places, force in zip(view.vectors, self.arrows, self.forces, strict=True):
            unit = self.unit_of(arrow)
            if force is None:
                components = tuple(values[i] for i in places)
                at = arrow.points[0]
                shown = multipliers_in(arrow.components, model)
                vectors.append(
                    DrawnVector(arrow.name, arrow.quantity, at, components, unit, parts=shown)
                )
                continue
            drawn, slots = force
            by = columns["constraint_force_by"]
            rows = map(model.constraint_names.index, arrow.parts)
            work = sum((terms.dense(by, row) for row in rows), start=np.zeros(1))
            vectors += [
                DrawnVector(
                    *(arrow.name, arrow.quantity, at, components, unit),
                    constraint=arrow.constraint,
                    parts=arrow.parts,
                )
                for at, components in drawn.at(work, [values[i] for i in slots], points)
            ]
        names = Notation(model)
        labels = {at: names.text(at) if t is None else t for at, t in view.labels.items()}
        return Scene(
            view.dimension,
            columns["time"],
            points,
            view.segments,
            discs,
            scaled(vectors, extent_of(points, discs)),
            view.grounds,
            view.trails,
            labels,
            "m" if model.units.stated else "",
            plates=view.plates,
            sliders=view.sliders,
            masses=self._masses,
        )

    def unit_of(self, arrow: Arrow) -> str:
        """Return the unit of a vector: for points in metres, if the model has units."""
        if arrow.unit is not None:
            return arrow.unit
        if arrow.quantity == "vector":
            units = {symbolic_unit(self._model, x) for x in arrow.components if x != 0}
            return (units.pop() or "") if len(units) == 1 else ""
        stated = self._model.units.stated
        return {"velocity": "m/s", "force": "N"}[arrow.quantity] if stated else ""


def multipliers_in(components: Sequence[Basic], model: Model) -> tuple[str, ...]:
    """Return the constraints whose multipliers occur in the components of a vector."""
    free: set[Basic] = set().union(*(x.free_symbols for x in components))
    return tuple(name for name in model.constraint_names if multiplier(name) in free)


#: Largest residual of the equations for F, relative to the largest force along the run.
_LEFT = 1e-6
#: Numbers from which no force is drawn: squares of their quotients overflow.
_HUGE = 1e75
#: Directions in which the points move less than this, relatively, count as fixed.
_SINGULAR, _NEVER = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class PointForce:
    """The force of a constraint at points, from their derivatives with respect to the coordinates.

    Jᵀ F = λ b determines the forces if the points can move in every direction. Otherwise, forces at
    several points follow if they are balanced: a constraint that acts at these points alone exerts
    forces whose sum and whose moment are 0.

    Parameters
    ----------
    model : Model
    arrow : Arrow
        A force.
    columns : list of int
        Coordinates of the columns of J: those on which the points depend.
    entries : list of expressions
        Entries of J, by rows: points in the order of the arrow, and the axes of each.
    """

    model: Model
    arrow: Arrow
    columns: list[int]
    entries: list[Basic]

    def at(
        self, work: Array, entries: Sequence[Array], points: dict[str, tuple[Array, ...]]
    ) -> Iterator[tuple[str, tuple[Array, ...]]]:
        """Yield the points and the components of the force at each.

        Parameters
        ----------
        work : (nt, nq) array
            λ b of the constraint.
        entries : sequence of (nt,) or (1,) arrays
            Values of ``entries``.
        points : dict of str to tuples of (nt,) or (1,) arrays
            Positions of all points of the view, by name and axis.

        Raises
        ------
        UsageError
            No force at these points, or more than one, does the work of the constraint.
        """
        names = list(dict.fromkeys(self.arrow.points))
        count, dimension = len(work), len(points[names[0]])
        place = np.stack([np.broadcast_to(x, (count,)) for n in names for x in points[n]], axis=-1)
        jacobian = np.empty((count, len(self.columns), place.shape[1]))  # transposed
        for i, values in enumerate(entries):
            row, column = divmod(i, len(self.columns))
            jacobian[:, column, row] = values
        work = work[:, self.columns]
        finite = (np.abs(jacobian) < _HUGE).all(axis=(1, 2)) & (np.abs(work) < _HUGE).all(axis=1)
        finite &= np.isfinite(place).all(axis=1)
        force = np.full(place.shape, np.nan)
        # lengths relative to the whole view: points of a joint differ by rounding only
        extent = extent_of(points, ())
        place /= max((high - low for low, high in extent), default=0.0) or 1.0
        force[finite] = self._solved(jacobian[finite], work[finite], place[finite], dimension)
        for i, name in enumerate(names):
            yield name, tuple(force[:, i * dimension : (i + 1) * dimension].T)

    def _solved(self, jacobian: Array, work: Array, place: Array, dimension: int) -> Array:
        """Return F with Jᵀ F = λ b, of least norm where points are momentarily at a dead point."""
        if not len(work):
            return np.empty(place.shape)
        size = np.sqrt((jacobian**2).sum(axis=2)).max(axis=0, initial=0.0)
        size[size < 1 / _HUGE] = 1.0
        # each equation in the unit of a force
        matrix, right = jacobian / size[:, None], work / size
        force, left, unique = _least_norm(matrix, right)
        if left > _LEFT:
            raise self._error(
                "cannot produce λ b (no F satisfies Jᵀ F = λ b): the points are written using the"
                " constraint, or the constraint also acts at other points"
            )
        if unique:
            return force
        if place.shape[1] > dimension:
            balance = _resultants(place, dimension)
            zero = np.zeros(balance.shape[:2])
            force, left, unique = _least_norm(
                np.concatenate((matrix, balance), axis=1), np.concatenate((right, zero), axis=1)
            )
            if unique and left <= _LEFT:
                return force
        raise self._error(
            "is not unique there: the points cannot move in every direction, and components of"
            " the force along the other directions do not appear in λ b"
            + (
                "; forces at these points whose sum and moment are 0 do not produce λ b either"
                if unique
                else ""
            )
        )

    def _error(self, why: str) -> UsageError:
        at = " and ".join(f"`{name}`" for name in self.arrow.points)
        places = ExpressionLocations(self.model)
        view = self.model.view
        dimension = len(view.points[self.arrow.points[0]]) if view is not None else 2
        first = ", ".join([f"lambda.{self.arrow.parts[0]}", *["0"] * (dimension - 1)])
        return UsageError(
            Diagnostic(
                "force-at-point",
                f"vector `{self.arrow.name}` of the view: the force of `{self.arrow.constraint}` at"
                f" {at} {why}",
                places.location(places.inside("view", "vectors", self.arrow.name)),
                "name all points between which the constraint acts, fixed ones too, as in"
                " `at: [O, A]`, or give the vector\nby `components`, for instance"
                f" [{first}] (docs/view.md); draw the result with the corrected model file:"
                " --model FILE",
            )
        )


def _least_norm(matrix: Array, right: Array) -> tuple[Array, float, bool]:
    """Return x with A x = b for each sample, its largest relative residual, and if it is unique.

    It is unique if A has full rank at any of the samples; elsewhere, x has the least norm.
    """
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    largest = s[:, :1]
    rows, columns = matrix.shape[1:]
    unique = rows >= columns and bool((s[:, -1:] > _NEVER * largest).any())
    inverse = np.divide(1.0, s, out=np.zeros_like(s), where=s > _SINGULAR * largest)
    x = np.einsum("nji,nj->ni", vt, inverse * np.einsum("nij,ni->nj", u, right))
    residual = np.abs(np.einsum("nij,nj->ni", matrix, x) - right).max(initial=0.0)
    scale = np.abs(right).max(initial=0.0)
    return x, float(residual / scale) if scale > 0 else 0.0, unique


def _resultants(place: Array, dimension: int) -> Array:
    """Return the matrices that give the sum and the moment of forces at points.

    The moment is about the middle of the points.

    Parameters
    ----------
    place : (nt, npoints dimension) array
        Positions, by point and axis.
    dimension : int
        2 or 3.

    Returns
    -------
    (nt, 3 or 6, npoints dimension) array
    """
    count, size = place.shape
    arms = place.reshape(count, -1, dimension)
    arms = arms - arms.mean(axis=1, keepdims=True)
    total = np.broadcast_to(np.tile(np.eye(dimension), size // dimension), (count, dimension, size))
    turns = [(0, 1)] if dimension == 2 else [(1, 2), (2, 0), (0, 1)]
    moment = np.zeros((count, len(turns), *arms.shape[1:]))
    for row, (i, j) in enumerate(turns):
        moment[:, row, :, j], moment[:, row, :, i] = arms[:, :, i], -arms[:, :, j]
    return np.concatenate((total, moment.reshape(count, len(turns), size)), axis=1)


def point_force(model: Model, arrow: Arrow) -> PointForce:
    """Return the force of an arrow, with the derivatives of its points."""
    assert model.view is not None
    components = [x for name in dict.fromkeys(arrow.points) for x in model.view.points[name]]
    names = model.coordinate_names
    free = {s.name for x in components for s in x.free_symbols}
    columns = [j for j, name in enumerate(names) if name in free]
    entries = [derivative(x, coordinate(names[j])) for x in components for j in columns]
    return PointForce(model, arrow, columns, entries)
