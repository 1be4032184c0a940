"""The tables of inputs in an HDF5 file: one group each, with times and values."""

from __future__ import annotations

from collections.abc import Mapping

import h5py
import numpy as np

from lagcli.results.hdf5.container import add_array, set_text
from lagcli.results.hdf5.structure import group, numbers, text_attribute
from lagcli.trajectory.samples import InputTable

_GROUP = "inputs"


def write_inputs(root: h5py.Group, inputs: Mapping[str, InputTable]) -> None:
    """Write the tables; without any, no group is created."""
    if not inputs:
        return
    groups = root.create_group(_GROUP)
    for name, table in inputs.items():
        place = groups.create_group(name)
        for part, values, unit in (("time", table.times, "s"), ("value", table.values, table.unit)):
            dataset = add_array(place, part, values)
            set_text(dataset, "units", unit or "not stated")
        for field in ("unit", "file", "sha256"):
            set_text(place.id, field, getattr(table, field))


def read_inputs(root: h5py.Group) -> dict[str, InputTable]:
    """Return the tables; files written before inputs existed have none.

    Raises
    ------
    ValueError
        A table is damaged.
    """
    if _GROUP not in root:
        return {}
    groups, tables = group(root, _GROUP), {}
    for name in groups:
        place = group(groups, name)
        times, values = (
            np.asarray(numbers(place, part)[()], dtype=np.float64) for part in ("time", "value")
        )
        texts = {x: text_attribute(place, x) or "" for x in ("unit", "file", "sha256")}
        tables[name] = InputTable(times, values, **texts)
        tables[name].check(name)
    return tables
