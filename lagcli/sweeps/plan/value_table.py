"""Values from a CSV file, one run per row: ``--vary @file.csv``."""

from __future__ import annotations

import csv
import math

import numpy as np

from lagcli.errors import FileError, UsageError
from lagcli.files import check_readable, read_failure
from lagcli.model.csv_table import split_title
from lagcli.model.expression.tokens import decimal
from lagcli.model.expression.units import UnknownUnit
from lagcli.model.model import Model
from lagcli.sweeps.plan.factors import TableFactor
from lagcli.sweeps.plan.varied import si_factor, varied_name


def read_table(path: str, model: Model) -> TableFactor:
    """Read a table of values.

    Parameters
    ----------
    path : str
        A CSV file. Its first line names parameters, coordinates and velocities (``phi'`` or
        ``phi_dot``), each with its unit in brackets if that is not SI: ``l [cm]``.
    model : Model

    Raises
    ------
    FileError
        The file cannot be read, or an entry is not a number.
    UsageError
        A column is not a parameter or initial value of the model.
    """
    check_readable(path)
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file)
            titles = next(lines, [])
            rows = [(lines.line_num, row) for row in lines if any(x.strip() for x in row)]
    except OSError as error:
        raise read_failure(path, error) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot read {path}: it is not a CSV file ({error})") from None
    columns, si = _columns(path, titles, model)
    if not rows:
        raise FileError(f"{path} contains no values; write one line for each run below the names")
    values = np.empty((len(rows), len(columns)))
    for i, (line, row) in enumerate(rows):
        if len(row) != len(columns):
            raise FileError(
                f"{path}:{line}: {len(row)} values under {len(columns)} names; give one for each"
            )
        for j, text in enumerate(row):
            values[i, j] = _number(f"{path}:{line}: `{columns[j]}`", text) * si[j]
    return TableFactor(columns, values)


def _columns(path: str, titles: list[str], model: Model) -> tuple[tuple[str, ...], list[float]]:
    columns: list[str] = []
    si: list[float] = []
    for title in titles:
        whole = title.strip()
        name, unit = split_title(title)
        try:
            known = varied_name(model, name)
            factor = float(si_factor(model, known, unit))
        except UnknownUnit as error:
            raise UsageError(
                f"{path}:1: `{whole}`: {error}; write the column as `l [cm]`"
            ) from None
        except UsageError as error:
            raise UsageError(f"{path}:1: {str(error).removeprefix('--vary: ')}") from None
        if known in columns:
            raise UsageError(f"{path}:1: `{known}` has two columns; keep one of them")
        columns.append(known)
        si.append(factor)
    return tuple(columns), si


def _number(where: str, text: str) -> float:
    value = decimal(text)
    if value is None or math.isinf(value):
        raise FileError(f"{where}: {text.strip()!r} is not a finite number; write it as 0.25")
    return value
