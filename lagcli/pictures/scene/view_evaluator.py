"""Evaluation of the view of a model: samples → Scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import symengine as se
from symengine import Basic

from lagcli.arrays import Array, Indices
from lagcli.columns import read_column_name, read_dotted_name
from lagcli.engine.inputs.functions import NO_FUNCTIONS
from lagcli.engine.inputs.tables import input_functions
from lagcli.engine.tape.compiler import compile_tape
from lagcli.engine.tape.interpreter import run_arrays
from lagcli.equations.render.names import Notation
from lagcli.model.dimensions.deriving import symbolic_unit
from lagcli.model.model import (
    TIME,
    Arrow,
    Model,
    acceleration,
    coordinate,
    multiplier,
    velocity,
)
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.scene.flashes import with_contacts
from lagcli.pictures.scene.point_force import PointForce, point_force
from lagcli.pictures.scene.scene import DrawnDisc, DrawnVector, Scene, extent_of, scaled
from lagcli.trajectory.samples import Terms

#: Largest number of values of a tape at once: 32 MB.
_HELD = 1 << 22


def scene_of(run: RunFile, samples: Indices | None = None) -> Scene | None:
    """Return the scene of a run; None if its model has no view.

    Parameters
    ----------
    run : Run
    samples : (m,) array of int, optional
        Indices of the samples, increasing; all by default.

    Raises
    ------
    UsageError
        There is no model, or the force of a constraint cannot act at the points of the view.
    ModelError, FileError
        As `RunFile.model`.
    """
    if run.model.view is None:
        return None
    evaluator = ViewEvaluator(run.model)
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
        self._parameters = [se.Symbol(name) for name in model.parameters]
        self._moving = self._inputs()
        places = {symbol: i for i, symbol in enumerate(self._moving)}
        self._steady = [places.keys().isdisjoint(e.free_symbols) for e in self._slots]
        functions = input_functions(model) if TIME in self._moving else NO_FUNCTIONS
        self._tape = compile_tape(self._slots, self._moving, self._parameters, functions)
        self.needs: tuple[str, ...] = ("time", "q", *self._also())

    def _put(self, expressions: Sequence[Basic]) -> list[int]:
        """Add expressions to evaluate; return their indices."""
        self._slots.extend(expressions)
        return list(range(len(self._slots) - len(expressions), len(self._slots)))

    def _inputs(self) -> list[Basic]:
        """Return the symbols that vary along the run and occur."""
        q = self._model.coordinate_names
        every = [TIME, *map(coordinate, q), *map(velocity, q), *map(acceleration, q)]
        every += map(multiplier, self._model.constraint_names)
        free = set().union(*(e.free_symbols for e in self._slots))
        forces = sorted(
            (s for s in free if _quantity(s.name).startswith("constraint_force")), key=str
        )
        return [s for s in every if s in free] + forces

    def _also(self) -> list[str]:
        """Return the required fields besides time and q."""
        names = [s.name for s in self._moving]
        quantities = set(map(_quantity, names))
        found = {
            "v": any(n.endswith("'") and not n.endswith("''") for n in names),
            "a": any(n.endswith("''") for n in names),
            "multipliers": "multipliers" in quantities,
            "constraint_force_by": any(self._forces) or not quantities <= {"", "multipliers"},
        }
        return [name for name, needed in found.items() if needed]

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
        values = self._values(columns, terms, parameters or model.parameter_values)
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
                vectors.append(DrawnVector(arrow.name, arrow.quantity, at, components, unit))
                continue
            drawn, slots = force
            by = columns["constraint_force_by"]
            rows = map(model.constraint_names.index, arrow.parts)
            work = sum((terms.dense(by, row) for row in rows), start=np.zeros(1))
            vectors += [
                DrawnVector(
                    arrow.name, arrow.quantity, at, components, unit, constraint=arrow.constraint
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

    def _values(
        self, columns: Mapping[str, Array], terms: Terms, parameters: Mapping[str, float]
    ) -> list[Any]:
        """Return the value of each expression, (nt,) or (1,) if constant."""
        count = len(columns["time"])
        given = [float(parameters[name]) for name in self._model.parameters]
        found = np.empty((len(self._slots), count))
        rows = max(1, _HELD // max(1, self._tape.registers))
        for start in range(0, count, rows):
            part = slice(start, min(count, start + rows))
            inputs = [self._column(columns, terms, s.name)[part] for s in self._moving]
            found[:, part] = run_arrays(self._tape, [*inputs, *given], part.stop - start)
        return [row[:1] if steady else row for row, steady in zip(found, self._steady, strict=True)]

    def _column(self, columns: Mapping[str, Array], terms: Terms, name: str) -> Array:
        """Return the values of a symbol."""
        coordinates = self._model.coordinate_names
        if name == TIME.name:
            return columns["time"]
        if read_dotted_name(name) is not None:
            constraints = self._model.constraint_names
            named = read_column_name(name, coordinates, constraints)
            assert named is not None
            if named.quantity == "multipliers":
                return columns["multipliers"][:, constraints.index(named.constraint)]
            by, place = columns["constraint_force_by"], coordinates.index(named.coordinate)
            if not named.constraint:
                return terms.total(by)[:, place]
            return terms.column(by, constraints.index(named.constraint), place)
        field = ("q", "v", "a")[len(name) - len(name.rstrip("'"))]
        return columns[field][:, coordinates.index(name.rstrip("'"))]


def _quantity(name: str) -> str:
    """Return the quantity of a symbol of λ or of a constraint force; None for other symbols."""
    named = read_dotted_name(name)
    return "" if named is None else named.quantity
