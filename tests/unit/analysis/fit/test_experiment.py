"""Measured data: units, missing values, and errors that name file, line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import symengine as se

from lagcli.analysis.fit.experiment import Measured, read_measured
from lagcli.errors import FileError, SourceLocation
from lagcli.model.model import DataFile, ObservedQuantity

HERE = SourceLocation("model.yaml", 1, 1)


def observed(
    column: str, sigma: float | None = None, *, si: bool = False, unit: str | None = None
) -> ObservedQuantity:
    return ObservedQuantity("phi", se.Symbol("phi"), column, sigma, si, unit, HERE)


def read(folder: Path, text: str, *quantities: ObservedQuantity) -> Measured:
    (folder / "run.csv").write_text(text)
    return read_measured(DataFile("run.csv", "t", {}, {}, HERE), folder, quantities)


def test_columns_are_converted_to_si_by_their_titles(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        't [ms],enc [deg],load\n0,180,1\n\n500,90,"2"\n',
        observed("enc", 0.5),
        observed("load", 2.0, unit="kN"),
        observed("enc", 0.1, si=True),
    )
    np.testing.assert_allclose(found.times, [0, 0.5])
    expected = [[np.pi, 1000, np.pi], [np.pi / 2, 2000, np.pi / 2]]
    np.testing.assert_allclose(found.values, expected)
    np.testing.assert_allclose(found.sigmas, [np.radians(0.5), 2000, 0.1])


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_other_delimiters_and_missing_values(tmp_path: Path, delimiter: str) -> None:
    text = "t,a\n0,1\n1,\n2,nan\n".replace(",", delimiter)
    found = read(tmp_path, text, observed("a"))
    np.testing.assert_array_equal(found.values, [[1], [np.nan], [np.nan]])
    assert np.isnan(found.sigmas).all()


@pytest.mark.parametrize(
    ("text", "line", "column", "said"),
    [
        ("t,a\n0,1\n1,x2\n", 3, 3, "'x2' is not a finite number"),
        ("t,a\n0,inf\n", 2, 3, "'inf' is not a finite number"),
        ("t,a\n0,1,2\n", 2, 1, "3 values under 2 names"),
        ("t,a\n1,1\n0.5,2\n", 3, 1, "the time 0.5 is not after the one before"),
        ("t,a\n,1\n", 2, 1, "the time of the line is missing"),
        ("t,b,a2\n0,1,2\n", 1, 1, "there is no column `a`"),
        ("t,a [furlong/]\n0,1\n", 1, 3, "furlong/"),
        ('"x, y",t,a\n"1, 2",0,?\n', 2, 10, "'?' is not a finite number"),
    ],
)
def test_errors_name_file_line_and_column(
    tmp_path: Path, text: str, line: int, column: int, said: str
) -> None:
    with pytest.raises(FileError) as caught:
        read(tmp_path, text, observed("a"))
    message = str(caught.value)
    assert f"run.csv:{line}:{column}: error" in message
    assert said in message
    assert "help:" in message
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.location is not None
    assert (diagnostic.location.line, diagnostic.location.column) == (line, column)


@pytest.mark.parametrize("text", ["", "t,a\n", "t,a\n0,\n"])
def test_a_file_without_data_is_rejected(tmp_path: Path, text: str) -> None:
    with pytest.raises(FileError, match=r"run\.csv"):
        read(tmp_path, text, observed("a"))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"none\.csv"):
        read_measured(DataFile("none.csv", "t", {}, {}, HERE), tmp_path, [observed("a")])
