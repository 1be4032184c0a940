"""Evaluation of expressions of a model from the columns of a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import symengine as se
from symengine import Basic

from lagcli.arrays import Array
from lagcli.columns import read_column_name, read_dotted_name
from lagcli.engine.lowering.compiler import compile_tape, input_functions
from lagcli.engine.tape.inputs import NO_FUNCTIONS
from lagcli.engine.tape.interpreter import ArrayTape
from lagcli.model.model import TIME, Model, acceleration, coordinate, multiplier, velocity
from lagcli.trajectory.samples import Terms

#: Largest number of values of a tape at once: 32 MB.
_HELD = 1 << 22


class ColumnEvaluator:
    """Evaluates expressions in t, q, v, a, λ and constraint forces at samples.

    Parameters
    ----------
    model : Model
    expressions : sequence of expressions

    Attributes
    ----------
    needs : tuple of str
        The fields of `Samples` that `values` needs.
    """

    def __init__(self, model: Model, expressions: Sequence[Basic]):
        self._model = model
        self._moving = _moving(model, expressions)
        self._constant = [set(self._moving).isdisjoint(e.free_symbols) for e in expressions]
        functions = input_functions(model) if TIME in self._moving else NO_FUNCTIONS
        parameters = [se.Symbol(name) for name in model.parameters]
        tape = compile_tape(expressions, self._moving, parameters, functions)
        self._evaluate, self._registers = ArrayTape(tape), tape.registers
        names = [s.name for s in self._moving]
        quantities = {_quantity(name) for name in names}
        needed = {
            "time": True,
            "q": True,
            "v": any(n.endswith("'") and not n.endswith("''") for n in names),
            "a": any(n.endswith("''") for n in names),
            "multipliers": "multipliers" in quantities,
            "constraint_force_by": not quantities <= {"", "multipliers"},
        }
        self.needs = tuple(name for name, is_needed in needed.items() if is_needed)

    def values(
        self, columns: Mapping[str, Array], terms: Terms, parameters: Mapping[str, float]
    ) -> list[Array]:
        """Return the value of each expression, (nt,), or (1,) if it is constant.

        Parameters
        ----------
        columns : mapping of str to arrays
            The fields of `Samples` in ``needs``.
        terms : Terms
            Terms of ``constraint_force_by``.
        parameters : mapping of str to float
            Values of the parameters that the model file declares, in SI.
        """
        count = len(columns["time"])
        own = self._model.parameter_values
        given = [float(parameters.get(name, value)) for name, value in own.items()]
        values = np.empty((len(self._constant), count))
        rows = max(1, _HELD // max(1, self._registers))
        for start in range(0, count, rows):
            part = slice(start, min(count, start + rows))
            inputs = [self._column(columns, terms, s.name)[part] for s in self._moving]
            values[:, part] = self._evaluate([*inputs, *given], part.stop - start)
        return [
            row[:1] if constant else row
            for row, constant in zip(values, self._constant, strict=True)
        ]

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


def _moving(model: Model, expressions: Sequence[Basic]) -> list[Basic]:
    """Return the symbols of expressions that vary along a run."""
    q = model.coordinate_names
    every = [TIME, *map(coordinate, q), *map(velocity, q), *map(acceleration, q)]
    every += map(multiplier, model.constraint_names)
    free: set[Basic] = set().union(*(e.free_symbols for e in expressions))
    forces = sorted((s for s in free if _quantity(s.name).startswith("constraint_force")), key=str)
    return [s for s in every if s in free] + forces


def _quantity(name: str) -> str:
    """Return the quantity of a symbol of λ or of a constraint force; empty for other symbols."""
    named = read_dotted_name(name)
    return "" if named is None else named.quantity
