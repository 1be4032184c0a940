"""CSV files with a header: columns by name, and errors with line and column."""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Iterator

from lagcli.errors import Diagnostic, FileError, SourceLocation
from lagcli.files import check_regular, read_failure
from lagcli.model.expression.dimension import Factor
from lagcli.model.expression.tokens import decimal
from lagcli.model.expression.units import (
    UnknownUnit,
    are_equal,
    commensurable,
    is_unit,
    to_si,
)
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.prose import counted

_DELIMITERS = ",;\t"
#: A title with its unit: ``enc [deg]``, ``c [N/(m/s)]``; digits are an index, ``x[1]``.
_NO_INDEX = r"(?!\s*[0-9])|(?=\s*1\s*/)"
_TITLE = re.compile(rf"(.*?)\s*(?:\[((?:{_NO_INDEX})[^\[\]]+)\]|\(((?:{_NO_INDEX})[^()]+)\))")


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return the content of a regular file.

    Raises
    ------
    FileError
        The file cannot be read.
    """
    name = os.fspath(path)
    check_regular(name)
    try:
        with open(name, "rb") as opened:
            return opened.read()
    except OSError as error:
        raise read_failure(name, error) from error


def split_title(title: str) -> tuple[str, str | None]:
    """Return the name and the unit of a column from its title; None without a unit."""
    plain = title.strip()
    match = _TITLE.fullmatch(plain)
    if match is None:
        return plain, None
    return match[1], (match[2] or match[3]).strip()


class CsvTable:
    """A CSV file whose first line names the columns.

    Parameters
    ----------
    path : str
        The file's name for messages.
    content : bytes

    Raises
    ------
    FileError
        The content is not text, or empty, or two columns have one name.
    """

    def __init__(self, path: str, content: bytes):
        self.path = path
        try:
            self.text = content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise FileError(
                f"cannot read {path}: it is not text in UTF-8 ({error}); name a CSV file, saved as"
                " UTF-8"
            ) from None
        if "\0" in self.text:
            *before, line = self._lines(self.text[: self.text.index("\0")])
            raise self._error_at(
                "not-text",
                "the table contains the character U+0000, which is not text",
                "remove it, or save the table as CSV in UTF-8",
                len(before) + 1,
                (len(line), len(line) + 1),
            )
        first = next(iter(io.StringIO(self.text, newline="")), "")
        if not self.text.strip():
            raise FileError(f"{path} is empty; its first line names the columns")
        self.delimiter = max(_DELIMITERS, key=first.count)
        try:
            self.titles = next(csv.reader([first], delimiter=self.delimiter), [])
        except csv.Error as error:
            raise self.no_csv(error, 1) from None
        seen: set[str] = set()
        for number, title in enumerate(self.titles):
            name = split_title(title)[0]
            if name and name in seen:
                raise self.error(
                    "duplicate-name",
                    f"two columns have the name `{shorten(name)}`",
                    "rename or remove one of them",
                    1,
                    number,
                )
            seen.add(name)

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the nonblank rows below the header, with their line numbers.

        Raises
        ------
        FileError
            A row has more or fewer values than the header, or is not valid CSV.
        """
        reader = csv.reader(io.StringIO(self.text, newline=""), delimiter=self.delimiter)
        count = len(self.titles)
        try:
            next(reader)
            for fields in reader:
                if len(fields) == count and (count > 1 or fields[0].strip()):
                    yield reader.line_num, fields
                elif any(field.strip() for field in fields):
                    raise self.error(
                        "bad-data",
                        f"{counted(len(fields), 'value')} under {counted(count, 'name')}",
                        "give one value for each name; leave the field of a missing value empty",
                        reader.line_num,
                    )
        except csv.Error as error:
            raise self.no_csv(error, reader.line_num) from None

    def column(self, name: str, unit: str | None) -> tuple[int, Factor, str | None]:
        """Return the number of a column, its conversion factor to SI, and its unit.

        Parameters
        ----------
        name : str
        unit : str or None
            A valid unit of the model; the title may state the same one, or none.

        Raises
        ------
        FileError
            The column does not exist, or the unit in its title is unknown, or is another one.
        """
        split = [split_title(title) for title in self.titles]
        for number, title in enumerate(map(str.strip, self.titles)):
            own, stated = split[number]
            if name not in (title, own):
                continue
            used = unit or stated
            if stated and name == title and not is_unit(stated):
                used = unit  # brackets that are part of the name
            elif unit and stated and is_unit(stated) and not are_equal(unit, stated):
                raise self.error(
                    "units",
                    f"`{title}` states {stated}, but `unit` in the model file is {unit}",
                    "correct one of them, or remove `unit`",
                    1,
                    number,
                )
            try:
                return number, to_si(used) if used else 1, used
            except UnknownUnit as error:
                raise self.error(
                    "unknown-unit",
                    f"`{title}`: {error}",
                    "write the unit as in `enc [deg]`, or give `unit` in the model file",
                    1,
                    number,
                ) from None
        known = [own for own, _ in split]
        raise self.error(
            "no-column",
            f"there is no column `{shorten(name)}`",
            did_you_mean(nearest(name, known)) or "the columns are " + ", ".join(known[:20]),
            1,
        )

    def times(self, name: str) -> tuple[int, Factor]:
        """Return the number of the column of times, and its conversion factor to s.

        Raises
        ------
        FileError
            As `column`; or the unit in its title is not one of time.
        """
        number, factor, unit = self.column(name, None)
        if unit and not commensurable(unit, "s"):
            raise self.error(
                "units", f"the times are in {unit}", "give them in s, ms, min, …", 1, number
            )
        return number, factor

    def number(self, fields: list[str], number: int, line: int, factor: float = 1.0) -> float:
        """Return the number in a field times a factor; NaN if it is empty or ``nan``.

        Raises
        ------
        FileError
            The field is not a finite number, or it is too large in SI.
        """
        text = fields[number].strip()
        value = math.nan if text.lower() in ("", "nan") else decimal(text)
        if value is None or math.isinf(value * factor):
            raise self.error(
                "bad-data",
                f"column `{self.titles[number].strip()}`: {shorten(text)!r} is not a finite number",
                "write it as 0.25; leave the field of a missing value empty",
                line,
                number,
            )
        return value * factor

    def no_csv(self, error: csv.Error, line: int) -> FileError:
        """Return an error at a line that cannot be divided into fields."""
        remedy = "write one row of numbers in each line"
        return self.error("bad-data", f"this is not CSV: {error}", remedy, line)

    def error(
        self, kind: str, message: str, help_: str, line: int, number: int | None = None
    ) -> FileError:
        """Return an error at a line, or at one of its fields."""
        lines = self._lines(self.text)
        text = lines[line - 1] if line <= len(lines) else ""
        span = (0, len(text))
        if number is not None:
            # split as written: quoted fields may contain delimiters
            spans = [m.span() for m in re.finditer(rf'(?:"[^"]*"|[^{self.delimiter}])+|(?<=[{self.delimiter}])(?=[{self.delimiter}]|$)|^(?=[{self.delimiter}])', text)]  # fmt: skip # noqa: E501
            if number < len(spans):
                span = spans[number]
        return self._error_at(kind, message, help_, line, span)

    def _error_at(
        self, kind: str, message: str, help_: str, line: int, span: tuple[int, int]
    ) -> FileError:
        start, end = span
        lines = self._lines(self.text)
        text = lines[line - 1] if line <= len(lines) else ""
        location = SourceLocation(self.path, line, start + 1, max(1, end - start), text)
        diagnostic = Diagnostic(kind, message, location, help_)
        error = FileError(diagnostic.render())
        error.diagnostics = [diagnostic]
        return error

    @staticmethod
    def _lines(text: str) -> list[str]:
        """Return the lines as CSV has them."""
        return io.StringIO(text, newline=None).read().split("\n")
