"""Conversion of the tables of a model's inputs to records and back."""

from __future__ import annotations

from array import array
from collections.abc import Mapping

import numpy as np

from lagcli.model.inputs import InputData
from lagcli.model.model import Model
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
