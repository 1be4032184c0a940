"""Reader of measured data in CSV files; its errors name the file, the line and the column."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import Diagnostic, FileError
from lagcli.model.csv_table import CsvTable, read_bytes
from lagcli.model.sections.fit import DataFile, ObservedQuantity


@dataclass(frozen=True, eq=False)
class Measured:
    """The data of one experiment, in SI.

    Parameters
    ----------
    path : str
    times : (n,) array
        s, increasing.
    values : (n, m) array
        Values of the observed quantities; NaN where there is no measured value.
    sigmas : (m,) array
        Standard deviations; NaN if they are to be estimated.
    """

    path: str
    times: Array
    values: Array
    sigmas: Array


def read_measured(
    file: DataFile, folder: str | os.PathLike[str], observed: Sequence[ObservedQuantity]
) -> Measured:
    """Read the data of one experiment.

    Parameters
    ----------
    file : DataFile
    folder : path
        Folder of relative file names.
    observed : sequence of m ObservedQuantity

    Returns
    -------
    Measured

    Raises
    ------
    FileError
        The file cannot be read, lacks a column, or contains an entry that is not a number; the
        times do not increase; there is no measured value.
    """
    path = os.fspath(Path(folder) / file.path)
    try:
        data = read_bytes(path)
    except FileError as error:
        help_ = "the path is relative to the folder of the model"
        raise FileError(
            Diagnostic("unreadable", f"`data` of `fit`: {error}", file.location, help_)
        ) from None
    return _measured(CsvTable(path, data), file.time, observed)


def _measured(table: CsvTable, time: str, observed: Sequence[ObservedQuantity]) -> Measured:
    found = [table.column(time, None), *(table.column(x.column, x.unit) for x in observed)]
    columns = [number for number, _, _ in found]
    rows: list[list[float]] = []
    before = -math.inf
    for line, fields in table.rows():
        row = [table.number(fields, number, line) for number in columns]
        if not row[0] > before:
            reason = "is missing" if math.isnan(row[0]) else "is not after the one before"
            raise table.error(
                "bad-data",
                f"the time {fields[columns[0]].strip() or 'of the line'} {reason}",
                "sort the lines by time, and give each time once",
                line,
                columns[0],
            )
        before = row[0]
        rows.append(row)
    factors = np.array([float(factor) for _, factor, _ in found])
    values = np.array(rows).reshape(-1, len(columns)) * factors
    if not np.isfinite(values[:, 1:]).any():
        raise FileError(f"{table.path} contains no measured values below its header")
    sigmas = [
        math.nan if x.sigma is None else x.sigma * (1.0 if x.sigma_si else factor)
        for x, factor in zip(observed, factors[1:], strict=True)
    ]
    return Measured(table.path, values[:, 0].copy(), values[:, 1:].copy(), np.array(sigmas))
