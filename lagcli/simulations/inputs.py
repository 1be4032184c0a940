"""Tables of a model's inputs: their record in results, and their range."""

from __future__ import annotations

from array import array
from collections.abc import Mapping

import numpy as np

from lagcli.errors import Diagnostic, ModelError
from lagcli.model.model import InputData, Model
from lagcli.trajectory.samples import InputTable


def input_tables(model: Model) -> dict[str, InputTable]:
    """Return the tables of a model's inputs for the record of a run."""
    return {
        name: InputTable(np.array(x.times), np.array(x.values), x.unit or "", x.file, x.sha256)
        for name, x in model.data.items()
    }


def input_data(tables: Mapping[str, InputTable]) -> dict[str, InputData]:
    """Return tables of a record in the form that `lagcli.load_text` takes."""
    return {
        name: InputData(
            array("d", x.times.tobytes()),
            array("d", x.values.tobytes()),
            x.unit or None,
            x.file,
            x.sha256,
        )
        for name, x in tables.items()
    }


#: Rounding error of times, relative.
_ROUNDING = 1e-12


def check_input_range(model: Model, start: float, end: float) -> None:
    """Raise ModelError unless all inputs are defined from one time to another, s."""
    errors = []
    for x in model.inputs.values():
        first, last = x.data.times[0], x.data.times[-1]
        slack = _ROUNDING * max(abs(first), abs(last))
        if x.extend is not None or (first - slack <= start and end <= last + slack):
            continue
        where = "the file" if x.data.file else "the list"
        if start < first - slack:
            fault = f"begins at t = {first:.9g} s, after the start of the run, t = {start:.9g} s"
            remedy = f"start the run later: --t-start {first:.9g}"
        else:
            fault = f"ends at t = {last:.9g} s, before the end of the run, t = {end:.9g} s"
            remedy = f"end the run earlier: --t-end {last:.9g}"
        errors.append(
            Diagnostic(
                "outside-table",
                f"the table of `{x.name}` {fault}",
                x.location,
                f"give {where} more rows, write `extend: hold` or `extend: periodic`, or {remedy}",
            )
        )
    if errors:
        raise ModelError(errors)
