"""Columns of sweep files: names, units and layout."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

from lagcli.column_units import NOT_STATED
from lagcli.columns import (
    QUANTITIES,
    SAMPLED,
    ColumnName,
    ResultQuantity,
    read_column_name,
    unit_of_column,
)
from lagcli.errors import UsageError
from lagcli.model.dimensions.deriving import expression_unit
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.trees import CallExpr, Name, SumExpr, Tree, walk
from lagcli.model.measures import REDUCTIONS, EventMeasure, event_measures
from lagcli.model.model import Model
from lagcli.model.names.expansion import expand
from lagcli.model.result_units import result_units

KIND = "sweep"

#: Datasets of a sweep file besides the varied quantities and the measures.
RESERVED = {
    *("run", "status", "message", "steps", "rejected", "evaluations", "outputs"),
    *("coordinate", "constraint", *(q.name for q in QUANTITIES)),
}
#: Quantities of stored trajectories.
KEPT = tuple(quantity for quantity in SAMPLED if quantity.kept)
COUNTS = ("steps", "rejected", "evaluations")

_NAMED = re.compile(r"\s*([^\W\d_]\w*)\s*=(?!=)\s*(.*)", re.DOTALL)


class Column(NamedTuple):
    """A column with one number per row.

    Parameters
    ----------
    name : str
        Name in the model, or text of the measure.
    dataset : str
        Name in the file.
    unit, long_name : str
    """

    name: str
    dataset: str
    unit: str
    long_name: str


def varied_columns(model: Model, names: tuple[str, ...]) -> list[Column]:
    """Return the columns of the varied quantities."""
    columns = []
    for name in names:
        dataset = name.removesuffix("'") + ("_dot" if name.endswith("'") else "")
        if dataset in RESERVED:
            dataset = f"set_{dataset}"
        if name in model.parameters:
            said = model.parameters[name].description or f"parameter {name}"
        else:
            said = f"initial value of {name}"
        columns.append(Column(name, dataset, _unit_of_name(model, name), said))
    return columns


def measure_columns(model: Model, measures: tuple[tuple[str, str], ...]) -> list[Column]:
    """Return the columns of measures."""
    columns = []
    for name, text in measures:
        plain, of_log = event_measures(model, text)
        units = {x: _unit_of_log(model, asked) for x, asked in of_log.items()}
        unit = _unit(model, expand(parse(plain), model.names), units)
        columns.append(Column(name, name, unit, text))
    return columns


def named_measure(text: str) -> tuple[str, str]:
    """Return name and expression of ``NAME=EXPRESSION``, or of an expression, whose text is the
    name.

    Raises
    ------
    UsageError
        The name is that of another column, or is not allowed in a file.
    """
    match = _NAMED.fullmatch(text)
    name, expression = (match[1], match[2].strip()) if match else (text.strip(),) * 2
    if not expression:
        raise UsageError(f"--measure {text!r} has no expression; write NAME=max(x), or max(x)")
    if name in RESERVED:
        raise UsageError(
            f"--measure: `{name}` is the name of another column of the file; choose another name"
        )
    if "/" in name or len(name) > 120:
        raise UsageError(
            f"--measure: {name!r} cannot be the name of a column; give it one, as in"
            f" --measure 'peak={expression}'"
        )
    return name, expression


def check_names(columns: list[Column]) -> None:
    """Raise an error if two columns have the same name.

    Raises
    ------
    UsageError
    """
    seen: dict[str, Column] = {}
    for column in columns:
        other = seen.setdefault(column.dataset, column)
        if other is not column:
            raise UsageError(
                f"two columns of the file would be named `{column.dataset}`; give the measure"
                f" another name, as in --measure 'of_{column.dataset}=…'"
            )


def _unit_of_log(model: Model, asked: EventMeasure) -> str:
    """Return the unit of a number from the event log."""
    if asked.kind == "count":
        return "1"
    if asked.kind == "time_of":
        return "s"
    force = _unit_of_name(model, str(ColumnName("multipliers", asked.name)))
    return force if force == NOT_STATED else f"{force}*s"


def _unit(model: Model, tree: Tree, of_log: Mapping[str, str]) -> str:
    """Return the unit of a measure if its form determines it: that of its signal, or s."""
    if isinstance(tree, SumExpr):
        units = {_unit(model, term, of_log) for _, term in tree.terms}
        return units.pop() if len(units) == 1 else NOT_STATED
    if isinstance(tree, Name) and tree.text in of_log:
        return of_log[tree.text]
    if not isinstance(tree, CallExpr) or REDUCTIONS.get(tree.function) != len(tree.arguments):
        return NOT_STATED
    if tree.function in ("argmax", "argmin", "time_of"):
        return "s"
    inner = tree.arguments[0]
    columns = [x for x in walk(inner) if isinstance(x, Name) and x.text.startswith("residual_")]
    if columns:
        return _unit_of_name(model, columns[0].text) if columns == [inner] else NOT_STATED
    return expression_unit(model, inner) or NOT_STATED


def _unit_of_name(model: Model, name: str) -> str:
    """Return the SI unit of a name, if the model gives it."""
    if name in model.outputs:
        return model.units.of_output(name) or NOT_STATED
    if name in model.parameters or name in model.definitions:
        return model.units.of(name) or NOT_STATED
    base = name.rstrip("'")
    plain = base + ("", "_dot", "_ddot")[min(len(name) - len(base), 2)]
    column = read_column_name(plain, model.coordinate_names, model.constraint_names)
    unit = None if column is None else unit_of_column(column, result_units(model))
    return unit or NOT_STATED


def default_measures(model: Model) -> tuple[tuple[str, str], ...]:
    """Return the default measures: extremes of λ, the last state, and errors."""
    multipliers = [ColumnName("multipliers", c) for c in model.constraint_names]
    texts = [f"{kind}({name})" for name in multipliers for kind in ("min", "max")]
    texts += [f"final({q}{dot})" for dot in ("", "'") for q in model.coordinate_names]
    worst = ["energy_balance"]
    worst += ["residual_position", "residual_velocity"] if model.constraints else []
    return tuple((x, x) for x in [*texts, *(f"max(abs({name}))" for name in worst)])


def kept_layout(model: Model) -> list[tuple[ResultQuantity, int]]:
    """Return the quantities of stored trajectories, and the number of values per sample of each.

    The outputs follow, in the model's order.
    """
    widths = {"coordinate": len(model.coordinates), "constraint": len(model.constraints), "": 1}
    return [(quantity, widths[quantity.along]) for quantity in KEPT]
