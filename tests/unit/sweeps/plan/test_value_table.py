"""Tables of values from CSV files: names, units, and the place of what is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

import lagcli
from lagcli.errors import FileError, UsageError
from lagcli.sweeps.plan.vary import read_table

MODEL = lagcli.load_text("""
coordinates: [x, "p[1..2]"]
parameters: {m: 2, l: {value: 3, unit: cm}}
T: m*x'^2/2 + sum(p[i]'^2, i = 1..2)
V: l*x
initial: {x: 0, "x'": 0, "p[i = 1..2]": i, "p[i = 1..2]'": 0}
""")


def table(folder: Path, text: str):
    path = folder / "runs.csv"
    path.write_text(text)
    return read_table(str(path), MODEL)


def test_columns_are_quantities_in_their_units(tmp_path: Path) -> None:
    found = table(tmp_path, "m , l [cm],x_dot,p[2] (mm)\n1,2,3,4\n\n 5,6e1,-7,8\n")
    assert found.columns == ("m", "l", "x'", "p[2]")
    assert found.length == 2
    assert found.values.tolist() == [
        [1, pytest.approx(0.02), 3, pytest.approx(0.004)],
        [5, pytest.approx(0.6), -7, pytest.approx(0.008)],
    ]


@pytest.mark.parametrize(
    ("text", "message", "kind"),
    [
        ("m\n", "contains no values", FileError),
        ("m,x\n1,2\n3\n", "runs.csv:3: 1 value under 2 names", FileError),
        ("m\n1\n\nabc\n", "runs.csv:4: `m`: 'abc' is not a finite number", FileError),
        ("m\ninf\n", "'inf' is not a finite number", FileError),
        ("m,m\n1,2\n", "`m` has two columns", UsageError),
        ("q\n1\n", "runs.csv:1: the model has no parameter or initial value `q`", UsageError),
        ("m [foo]\n1\n", "write the column as `l [cm]`", UsageError),
        ("l\n1\n", "`l` is given in cm in the file", UsageError),
        ("", "it is empty", FileError),
    ],
)
def test_what_is_wrong_is_reported_with_its_line(
    tmp_path: Path, text: str, message: str, kind: type[Exception]
) -> None:
    with pytest.raises(kind) as error:
        table(tmp_path, text)
    assert message in str(error.value)
