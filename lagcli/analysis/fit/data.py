"""Measured data from CSV files, with errors that name the file, the line and the column."""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lagcli.arrays import Array
from lagcli.errors import Diagnostic, FileError, SourceLocation
from lagcli.model.expression.units import UnknownUnit, to_si
from lagcli.model.model import DataFile, ObservedQuantity
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.results.reasons import check_readable, read_failure

_DELIMITERS = ",;\t"
#: A title with its unit: ``enc [deg]``.
_TITLE = re.compile(r"(.*?)\s*[\[(]([^\[\]()0-9][^\[\]()]*)[\])]")


@dataclass(frozen=True, eq=False)
class Measured:
    """The data of one experiment, in SI.

    Parameters
    ----------
    path : str
    times : (n,) array
        s, increasing.
    values : (n, m) array
        Of the observed quantities; NaN where there is no measured value.
    sigmas : (m,) array
        Standard deviations; NaN where they are to be estimated.
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
        Where relative names begin.
    observed : sequence of m ObservedQuantity

    Returns
    -------
    Measured

    Raises
    ------
    FileError
        The file cannot be read, lacks a column, or an entry is no number; the times do not
        increase; there is no measured value.
    """
    path = os.fspath(Path(folder) / file.path)
    check_readable(path)
    try:
        with open(path, newline="", encoding="utf-8-sig") as opened:
            lines = opened.read().splitlines()
    except OSError as error:
        raise read_failure(path, error) from error
    except UnicodeDecodeError as error:
        raise FileError(f"cannot read {path}: it is not text ({error})") from None
    return _Table(path, lines).measured(file.time, observed)


class _Table:
    """The lines of a CSV file."""

    def __init__(self, path: str, lines: list[str]):
        self.path, self.lines = path, lines
        first = lines[0] if lines else ""
        self.delimiter = max(_DELIMITERS, key=first.count)
        self.titles = self.fields(1) if lines else []

    def fields(self, line: int) -> list[str]:
        return next(csv.reader([self.lines[line - 1]], delimiter=self.delimiter), [])

    def error(
        self, kind: str, message: str, help_: str, line: int, number: int | None = None
    ) -> FileError:
        """Return an error at a line, or at one of its fields."""
        text = self.lines[line - 1] if line <= len(self.lines) else ""
        start, length = 0, len(text)
        if number is not None:
            # as it is written: fields in quotes may hold delimiters
            spans = [m.span() for m in re.finditer(rf'(?:"[^"]*"|[^{self.delimiter}])+|(?<=[{self.delimiter}])(?=[{self.delimiter}]|$)|^(?=[{self.delimiter}])', text)]  # fmt: skip # noqa: E501
            if number < len(spans):
                start, length = spans[number][0], max(1, spans[number][1] - spans[number][0])
        location = SourceLocation(self.path, line, start + 1, max(1, length), text)
        diagnostic = Diagnostic(kind, message, location, help_)
        error = FileError(diagnostic.render())
        error.diagnostics = [diagnostic]
        return error

    def measured(self, time: str, observed: Sequence[ObservedQuantity]) -> Measured:
        if not self.lines:
            raise FileError(f"{self.path} is empty; its first line names the columns")
        columns = [self.column(time, None), *(self.column(x.column, x.unit) for x in observed)]
        table: list[list[float]] = []
        before = -math.inf
        for line in range(2, len(self.lines) + 1):
            if not self.lines[line - 1].strip():
                continue
            fields = self.fields(line)
            if len(fields) != len(self.titles):
                raise self.error(
                    "bad-data",
                    f"{len(fields)} values under {len(self.titles)} names",
                    "give one value for each name; leave the place of a missing one empty",
                    line,
                )
            row = [self.number(fields, number, line) for number, _ in columns]
            if not row[0] > before:
                reason = "is missing" if math.isnan(row[0]) else "is not after the one before"
                raise self.error(
                    "bad-data",
                    f"the time {fields[columns[0][0]].strip() or 'of the line'} {reason}",
                    "sort the lines by time, and give each time once",
                    line,
                    columns[0][0],
                )
            before = row[0]
            table.append(row)
        factors = np.array([factor for _, factor in columns])
        values = np.array(table).reshape(-1, len(columns)) * factors
        if not np.isfinite(values[:, 1:]).any():
            raise FileError(f"{self.path} holds no measured values below the names of its columns")
        sigmas = [
            math.nan if x.sigma is None else x.sigma * (1.0 if x.sigma_si else factor)
            for x, factor in zip(observed, factors[1:], strict=True)
        ]
        return Measured(self.path, values[:, 0].copy(), values[:, 1:].copy(), np.array(sigmas))

    def column(self, name: str, unit: str | None) -> tuple[int, float]:
        """Return the number of a column, and what brings its values to SI."""
        plain = [title.strip() for title in self.titles]
        matches = [_TITLE.fullmatch(title) for title in plain]
        for number, (title, match) in enumerate(zip(plain, matches, strict=True)):
            if title == name:
                return number, float(to_si(unit)) if unit else 1.0
            if match is not None and match[1] == name:
                try:
                    return number, float(to_si(unit or match[2]))
                except UnknownUnit as error:
                    raise self.error(
                        "unknown-unit",
                        f"`{title}`: {error}",
                        "write the unit as in `enc [deg]`, or give `unit` in the model file",
                        1,
                        number,
                    ) from None
        known = [match[1] if match else title for title, match in zip(plain, matches, strict=True)]
        raise self.error(
            "no-column",
            f"there is no column `{name}`",
            did_you_mean(nearest(name, known)) or "the columns are " + ", ".join(known[:20]),
            1,
        )

    def number(self, fields: list[str], number: int, line: int) -> float:
        """Return a number; NaN for a place that is empty."""
        text = fields[number].strip()
        if text.lower() in ("", "nan"):
            return math.nan
        try:
            value = float(text)
        except ValueError:
            value = math.inf
        if not math.isfinite(value):
            raise self.error(
                "bad-data",
                f"column `{self.titles[number].strip()}`: {text!r} is not a finite number",
                "write it as 0.25; leave the place of a missing value empty",
                line,
                number,
            )
        return value
