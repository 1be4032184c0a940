"""The inputs: known functions of time, from tables in CSV files or in the model."""

from __future__ import annotations

import hashlib
import math
import os
from array import array
from collections.abc import Iterable, Mapping
from pathlib import Path

from symengine import Basic, Derivative, FunctionSymbol

from lagcli.errors import FileError, SourceLocation
from lagcli.model.csv_table import CsvTable, read_bytes
from lagcli.model.expression.units import UNIT_HELP, UnknownUnit, commensurable, to_si
from lagcli.model.keys import INPUT, keys_of
from lagcli.model.model import EXTENSIONS, INTERPOLATIONS, Constraint, Input, InputData, read_input
from lagcli.model.names.draft import Draft, read_quantity
from lagcli.model.names.families import Declaration
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Sequence, YamlNode
from lagcli.prose import counted

_EXAMPLE = "u: {file: road.csv, time: t, column: height}"


def read_inputs(
    draft: Draft, declared: Iterable[Declaration], known: Mapping[str, InputData]
) -> dict[str, Input]:
    """Read the tables of the inputs, and add them to the draft's names.

    Parameters
    ----------
    draft : Draft
    declared : iterable of Declaration
    known : mapping of str to InputData
        Tables that have already been read: their files are not read again.
    """
    inputs = {}
    for d in declared:
        made = _InputEntry(draft, d).read(known.get(d.name))
        if made is None:
            draft.names.broken.add(d.name)
        else:
            inputs[d.name] = made
    draft.names.inputs = {name: x.smoothness for name, x in inputs.items()}
    return inputs


class _InputEntry:
    """Reader of one entry."""

    def __init__(self, draft: Draft, declaration: Declaration):
        self.draft, self.declaration = draft, declaration
        self.name, self.key = declaration.name, declaration.key
        self.what = f"the input `{self.name}`"
        self.fields: dict[str, YamlNode] = {}

    def read(self, known: InputData | None) -> Input | None:
        """Return the input; None if its entry has an error, which is reported."""
        if self.declaration.spans:
            self.error("bad-name", self.key, "is a single name", "write one entry for each input")
            return None
        help_ = f"write `{_EXAMPLE}`, or `{self.name}: {{times: [0, 1], values: [0 N, 10 N]}}`"
        node = self.draft.mapping(self.declaration.node, self.what, help_)
        if node is None:
            return None
        before = len(self.draft.report.diagnostics)
        self.fields = self.draft.fields(node, self.what, keys_of(INPUT))
        interpolation = self.choice("interpolation", tuple(INTERPOLATIONS)) or "linear"
        extend = self.choice("extend", EXTENSIONS)
        description = self.draft.text(
            self.fields.get("description"), f"`description` of {self.what}"
        )
        unit = self.unit()
        if len(self.draft.report.diagnostics) > before:
            return None
        data = known or self.data(unit)
        if data is None or not self.fits(data, interpolation, extend):
            return None
        return Input(self.name, data, interpolation, extend, description, self.key.location)

    def error(self, kind: str, node: YamlNode, message: str, help_: str | None = None) -> None:
        self.draft.report.add(kind, f"{self.what} {message}", node.location, help_)

    def choice(self, field: str, allowed: tuple[str, ...]) -> str | None:
        node = self.fields.get(field)
        given = self.draft.text(node, f"`{field}` of {self.what}")
        if node is None or given is None or given in allowed:
            return given
        self.draft.report.add(
            "unknown-choice",
            f"`{field}` of {self.what} is `{shorten(given)}`",
            node.location,
            did_you_mean(nearest(given, allowed, 1))
            or "it is one of " + ", ".join(f"`{x}`" for x in allowed),
        )
        return None

    def unit(self) -> str | None:
        node = self.fields.get("unit")
        unit = self.draft.text(node, f"`unit` of {self.what}")
        if node is None or unit is None:
            return None
        try:
            to_si(unit)
        except UnknownUnit as error:
            self.error("unknown-unit", node, f"has an unknown unit: {error}", UNIT_HELP)
        return unit

    # tables

    def data(self, unit: str | None) -> InputData | None:
        """Read the table."""
        fields = self.fields
        inline: list[str] = [x for x in ("times", "values") if x in fields]
        if "file" in fields:
            for field in inline:
                self.error(
                    "contradiction",
                    fields[field],
                    f"has a `file` and `{field}`",
                    "keep one of the two",
                )
            return None if inline else self.of_file(unit)
        for field in ("time", "column"):
            if field in fields:
                self.error(
                    "contradiction", fields[field], f"has a `{field}`, but no `file`", "name a file"
                )
                return None
        missing = [x for x in ("times", "values") if x not in fields]
        if missing:
            self.error(
                "missing-value",
                self.key,
                "has no table" if not inline else f"has no `{missing[0]}`",
                "give `file`, or `times` and `values`",
            )
            return None
        return self.of_lists(unit)

    def of_lists(self, unit: str | None) -> InputData | None:
        times, values = self.fields["times"], self.fields["values"]
        for field, node in (("times", times), ("values", values)):
            if not isinstance(node, Sequence):
                self.error(
                    "wrong-type",
                    node,
                    f"must have a list of `{field}`, not {node.what}",
                    f"write `{field}: [0, 1, 2]`",
                )
                return None
        assert isinstance(times, Sequence)
        assert isinstance(values, Sequence)
        if len(times.items) != len(values.items):
            self.error(
                "wrong-length",
                values,
                f"has {counted(len(times.items), 'time')}, but"
                f" {counted(len(values.items), 'value')}",
                "give one value for each time",
            )
            return None
        if not times.items:
            self.error("missing-value", times, "has no times", "give at least two")
            return None
        seconds = array("d")
        for node in times.items:
            value = self.quantity(node, "time", "s")
            if value is None:
                return None
            if seconds and not value > seconds[-1]:
                self.error(
                    "bad-data",
                    node,
                    f"has the time {value:g} s after {seconds[-1]:g} s",
                    "let the times increase",
                )
                return None
            seconds.append(value)
        units: dict[str | None, YamlNode] = {}
        numbers = array("d")
        for node in values.items:
            value = self.quantity(node, "value", unit, units)
            if value is None:
                return None
            numbers.append(value)
        return InputData(seconds, numbers, unit or next((u for u in units if u), None))

    def quantity(
        self,
        node: YamlNode,
        what: str,
        unit: str | None,
        units: dict[str | None, YamlNode] | None = None,
    ) -> float | None:
        """Return a number, optionally with a unit, in SI; report errors."""
        own = None if units is None else unit
        read = read_quantity(self.draft, node, f"a {what} of {self.what}", own)
        if read is None:
            return None
        if read.number is None:
            self.error(
                "wrong-type",
                node,
                f"has a {what} that is not a number",
                "tables contain numbers; multiply the input by a parameter where it is used",
            )
            return None
        if units is None:
            if read.unit and not commensurable(read.unit, "s"):
                self.error("units", node, f"has a time in {read.unit}", "give times in s")
                return None
        elif read.number != 0 or read.unit:  # zero has every unit
            for other in units:
                if (other is None) != (read.unit is None) or (
                    other and read.unit and not commensurable(other, read.unit)
                ):
                    self.error(
                        "units",
                        node,
                        f"has values in {other or 'no unit'} and in {read.unit or 'no unit'}",
                        "give all values in units of one dimension",
                    )
                    return None
            units[read.unit] = node
        try:
            value = float(read.number * read.factor)
        except OverflowError:
            value = math.inf
        if math.isinf(value):
            self.error(
                "not-a-number",
                node,
                f"has a {what} that is too large",
                "the largest number is 1.8e308 in SI",
            )
            return None
        return value

    def of_file(self, unit: str | None) -> InputData | None:
        """Read a CSV file; errors state the location in the file, and the input."""
        draft, fields = self.draft, self.fields
        texts = {
            x: draft.text(fields.get(x), f"`{x}` of {self.what}")
            for x in ("file", "time", "column")
        }
        name = texts["file"]
        if not name:
            self.error("missing-value", fields["file"], "has no file name", f"{_EXAMPLE}")
            return None
        folder = Path(draft.source.path).parent
        path = os.fspath(folder / name)
        try:
            content = read_bytes(path)
            table = CsvTable(path, content)
            return self.of_table(table, texts, unit)._replace(
                file=name, sha256=hashlib.sha256(content).hexdigest()
            )
        except FileError as error:
            location = fields["file"].location
            if not error.diagnostics:
                self.error("unreadable", fields["file"], f"has no table: {error}")
            for d in error.diagnostics:
                assert d.location is not None
                note = (f"the table of {self.what} is named here", location)
                draft.report.add(d.kind, d.message, d.location, d.help, (*d.notes, note))
            return None

    def of_table(
        self, table: CsvTable, texts: Mapping[str, str | None], unit: str | None
    ) -> InputData:
        at, time_factor = table.times(texts["time"] or "t")
        column, factor, unit = table.column(texts["column"] or self.name, unit)
        times, values = array("d"), array("d")
        before, to_seconds, to_unit = -math.inf, float(time_factor), float(factor)
        number = table.number
        for line, row in table.rows():
            t, value = number(row, at, line, to_seconds), number(row, column, line, to_unit)
            if not t > before or value != value:
                raise self.bad_row(table, row, line, (at, t), column)
            before = t
            times.append(t)
            values.append(value)
        if not times:
            raise table.error("bad-data", "there is no row of numbers", "give at least two rows", 1)
        return InputData(times, values, unit)

    def bad_row(
        self, table: CsvTable, row: list[str], line: int, time: tuple[int, float], column: int
    ) -> FileError:
        """Return the error for a row whose time does not increase, or that lacks a number."""
        at, t = time
        if math.isnan(t):
            return table.error("bad-data", "the time is missing", "give every time", line, at)
        if math.isnan(table.number(row, column, line)):
            return table.error(
                "bad-data",
                f"column `{table.titles[column].strip()}`: the value is missing",
                "give every value, or remove the row",
                line,
                column,
            )
        return table.error(
            "bad-data",
            f"the time {row[at].strip()} is not after the one before",
            "sort the lines by time, and give each time once",
            line,
            at,
        )

    def fits(self, data: InputData, interpolation: str, extend: str | None) -> bool:
        """Return whether a table is valid for its interpolation; report why not."""
        node = self.fields.get("file") or self.fields.get("times") or self.key
        if len(data.times) < 2:
            self.error("bad-data", node, "has a single row", "give at least two rows")
            return False
        first, last = data.values[0], data.values[-1]
        if extend == "periodic" and interpolation != "step" and first != last:
            self.error(
                "not-periodic",
                self.fields["extend"],
                f"is periodic, but its first value is {first:g} and its last {last:g}",
                "the last row ends the period: give it the value of the first",
            )
            return False
        return True


_ENERGY = ", or write its force under `Q`"


class InputUses:
    """Reports inputs whose required derivatives do not exist.

    Parameters
    ----------
    draft : Draft
    inputs : mapping of str to Input
    """

    def __init__(self, draft: Draft, inputs: Mapping[str, Input]):
        self.draft, self.inputs = draft, inputs

    def check(
        self,
        constraints: Iterable[Constraint],
        expressions: Iterable[tuple[str, Iterable[Basic | None], int]],
    ) -> None:
        """Check the constraints, and other expressions of a model.

        Parameters
        ----------
        constraints : iterable of Constraint
        expressions : iterable of (key, expressions, order)
            Expressions under a key of the model, and how many times the equations differentiate
            them.
        """
        if not self.inputs:
            return
        for key, several, more in expressions:
            rough = next(
                (x for e in several if e is not None and (x := self._rough(e, more))), None
            )
            if rough is not None:
                location = self.draft.root.entries[key][1].location
                self._report(rough, f"`{key}`", location, _ENERGY if more else "")
        for c in constraints:
            rough = self._rough(c.expression, 2 if c.kind == "holonomic" else 1)
            if rough is not None and c.location is not None:
                self._report(rough, f"the {c.kind} constraint `{c.name}`", c.location, "")

    def _rough(self, expression: Basic, more: int) -> Input | None:
        """Return an input in an expression that cannot be differentiated ``more`` times."""
        for part in expression.atoms(FunctionSymbol, Derivative):
            input_ = read_input(part)
            if input_ is not None and input_[1] + more > self.inputs[input_[0]].smoothness:
                return self.inputs[input_[0]]
        return None

    def _report(self, used: Input, where: str, location: SourceLocation, remedy: str) -> None:
        kind = {"step": "jumps", "linear": "has kinks"}.get(used.interpolation, "is not smooth")
        smoother = "linear" if remedy and used.interpolation == "step" else "cubic"
        self.draft.report.add(
            "not-smooth",
            f"{where} depends on `{used.name}`, which {kind} at the rows of its table"
            f" (`interpolation: {used.interpolation}`): the motion would have to jump",
            location,
            f"give `{used.name}` the interpolation `{smoother}`{remedy}",
            ((f"`{used.name}` is declared here", used.location),),
        )
