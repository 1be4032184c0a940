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
    """

    def __init__(self, model: Model):
        assert model.view is not None
        self._model, self._view = model, model.view
        view = self._view
        self._slots: list[Basic] = []
        self._points = {name: self._put(place) for name, place in view.points.items()}
        self._discs = [
            (
                self._put([d.radius])[0],
                None if d.angle is None else self._put([d.angle])[0],
                None if d.normal is None else self._put(d.normal),
            )
            for d in view.discs
        ]
        self._arrows = [self._put(a.components) for a in view.vectors]
        self._forces: list[tuple[PointForce, list[int]] | None] = []
        for arrow in view.vectors:
            force = point_force(model, arrow) if arrow.constraint is not None else None
            self._forces.append(None if force is None else (force, self._put(force.entries)))
        self._evaluator = ColumnEvaluator(model, self._slots)
        needs = dict.fromkeys(self._evaluator.needs)
        if any(self._forces):
            needs["constraint_force_by"] = None
        self.needs: tuple[str, ...] = tuple(needs)

    def _put(self, expressions: Sequence[Basic]) -> list[int]:
        """Add expressions to evaluate; return their indices."""
        self._slots.extend(expressions)
        return list(range(len(self._slots) - len(expressions), len(self._slots)))

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
        points = {name: tuple(values[i] for i in at) for name, at in self._points.items()}
        discs = tuple(
            DrawnDisc(
                d.name,
                d.center,
                values[radius],
                None if angle is None else values[angle],
                None if normal is None else tuple(values[i] for i in normal),
            )
            for d, (radius, angle, normal) in zip(view.discs, self._discs, strict=True)
        )
        vectors: list[DrawnVector] = []
        for arrow, places, force in zip(view.vectors, self._arrows, self._forces, strict=True):
            unit = self._unit(arrow)
            if force is None:
                components = tuple(values[i] for i in places)
                at = arrow.points[0]
                shown = _multipliers_in(arrow.components, model)
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
                for at, components in drawn.at(work, [values[i] for i in slots])
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
        )

    def _unit(self, arrow: Arrow) -> str:
        """Return the unit of a vector: for points in metres, if the model has units."""
        if arrow.unit is not None:
            return arrow.unit
        if arrow.quantity == "vector":
            units = {symbolic_unit(self._model, x) for x in arrow.components if x != 0}
            return (units.pop() or "") if len(units) == 1 else ""
        stated = self._model.units.stated
        return {"velocity": "m/s", "force": "N"}[arrow.quantity] if stated else ""


def _multipliers_in(components: Sequence[Basic], model: Model) -> tuple[str, ...]:
    """Return the constraints whose multipliers occur in the components of a vector."""
    free: set[Basic] = set().union(*(x.free_symbols for x in components))
    return tuple(name for name in model.constraint_names if multiplier(name) in free)


#: Largest residual of Jᵀ F − λ b, relative to the largest λ b along the run.
_LEFT = 1e-6
#: Directions in which the points move less than this, relatively, count as fixed.
_SINGULAR, _NEVER = 1e-9, 1e-6


@dataclass(frozen=True, eq=False)
class PointForce:
    """The force of a constraint at points, from their derivatives with respect to the coordinates.

    Parameters
    ----------
    model : Model
    arrow : Arrow
        A force.
    rows : list of (str, int)
        Point and axis of each row of J: the directions in which the points can move.
    columns : list of int
        Coordinates of the columns of J: those on which the points depend.
    entries : list of expressions
        Entries of J, by rows.
    """

    model: Model
    arrow: Arrow
    rows: list[tuple[str, int]]
    columns: list[int]
    entries: list[Basic]

    def at(self, work: Array, entries: Sequence[Array]) -> Iterator[tuple[str, tuple[Array, ...]]]:
        """Yield the points and the components of the force at each.

        Parameters
        ----------
        work : (nt, nq) array
            λ b of the constraint.
        entries : sequence of (nt,) or (1,) arrays
            Values of ``entries``.

        Raises
        ------
        UsageError
            No force at these points, or more than one, does the work of the constraint.
        """
        count, shape = len(work), (len(self.columns), len(self.rows))
        jacobian = np.empty((count, *shape))  # transposed
        for place, values in enumerate(entries):
            row, column = divmod(place, len(self.columns))
            jacobian[:, column, row] = values
        finite = np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(work).all(axis=1)
        force = np.full((count, len(self.rows)), np.nan)
        force[finite] = self._solved(jacobian[finite], work[finite])
        dimension = len(self.model.view.points[self.arrow.points[0]]) if self.model.view else 0
        for point in dict.fromkeys(name for name, _ in self.rows):
            components = [np.zeros(1)] * dimension
            for place, (name, axis) in enumerate(self.rows):
                if name == point:
                    components[axis] = force[:, place]
            yield point, tuple(components)

    def _solved(self, jacobian: Array, work: Array) -> Array:
        """Return F with Jᵀ F = λ b, of least norm if J is singular."""
        q = work[:, self.columns]
        if not len(q):
            return np.empty((0, len(self.rows)))
        u, s, vt = np.linalg.svd(jacobian, full_matrices=False)
        largest = s[:, :1]
        if len(self.rows) > len(self.columns) or not (s[:, -1:] > _NEVER * largest).any():
            raise self._error(
                "is not unique there: the points cannot move in every direction, and components of"
                " the force along the other directions do not appear in λ b"
            )
        inverse = np.divide(1.0, s, out=np.zeros_like(s), where=s > _SINGULAR * largest)
        force = np.einsum("nji,nj->ni", vt, inverse * np.einsum("nij,ni->nj", u, q))
        left = np.einsum("nij,nj->ni", jacobian, force) - q
        if np.abs(left).max(initial=0.0) > _LEFT * np.abs(work).max(initial=0.0):
            raise self._error(
                "cannot produce λ b (no F satisfies Jᵀ F = λ b): the points are written using the"
                " constraint, or the constraint also acts at other points"
            )
        return np.asarray(force)

    def _error(self, why: str) -> UsageError:
        at = " and ".join(f"`{name}`" for name in self.arrow.points)
        places = ExpressionLocations(self.model)
        return UsageError(
            Diagnostic(
                "force-at-point",
                f"vector `{self.arrow.name}` of the view: the force of `{self.arrow.constraint}` at"
                f" {at} {why}",
                places.location(places.inside("view", "vectors", self.arrow.name)),
                f"give the vector by `components`, for instance [lambda.{self.arrow.constraint}, 0]"
                " (docs/view.md),\nand draw the result with the corrected model file: --model FILE",
            )
        )


def point_force(model: Model, arrow: Arrow) -> PointForce:
    """Return the force of an arrow, with the derivatives of its points."""
    assert model.view is not None
    points = [(name, model.view.points[name]) for name in dict.fromkeys(arrow.points)]
    names = model.coordinate_names
    free = {s.name for _, place in points for x in place for s in x.free_symbols}
    columns = [j for j, name in enumerate(names) if name in free]
    symbols = [coordinate(names[j]) for j in columns]
    rows: list[tuple[str, int]] = []
    entries: list[Basic] = []
    for name, place in points:
        for axis, x in enumerate(place):
            if not x.free_symbols.isdisjoint(symbols):
                rows.append((name, axis))
                entries += [derivative(x, s) for s in symbols]
    return PointForce(model, arrow, rows, columns, entries)
