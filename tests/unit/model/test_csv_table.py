"""CSV files with titles: columns, units, and errors with their place."""

from __future__ import annotations

import math

import pytest

from lagcli.errors import FileError
from lagcli.model.csv_table import CsvTable, split_title


def table(text: str) -> CsvTable:
    return CsvTable("run.csv", text.encode())


def test_the_delimiter_is_the_commonest_in_the_titles() -> None:
    for delimiter in ",;\t":
        found = table(delimiter.join(["t", "x [cm]", "y (deg)"]) + "\n")
        assert found.titles == ["t", "x [cm]", "y (deg)"]
    assert table("\ufefft,x\n").titles == ["t", "x"]


def test_columns_have_factors_to_si() -> None:
    found = table("t, x [cm],y (deg), v[1]\n")
    assert found.column("x", None) == (1, pytest.approx(0.01), "cm")
    assert found.column("v[1]", "mm") == (3, pytest.approx(0.001), "mm")
    assert found.column("y", None)[1] == pytest.approx(math.pi / 180)
    assert found.column("v[1]", None) == (3, 1, None)  # an index is no unit
    with pytest.raises(FileError, match="there is no column `z`"):
        found.column("z", None)
    with pytest.raises(FileError, match="`x \\[foo\\]`"):
        table("x [foo]\n").column("x", None)


def test_a_column_has_one_unit() -> None:
    found = table("t,u [kN],w [N],z [left]\n")
    assert found.column("w", "kg*m/s^2")[1] == 1
    assert found.column("z", "mm")[1] == pytest.approx(0.001)  # the brackets hold no unit
    for unit in ("N", "MN", "m"):
        with pytest.raises(FileError, match=rf"`u \[kN\]` states kN, but .* is {unit}"):
            found.column("u", unit)


def test_rows_come_with_their_lines_and_without_blank_ones() -> None:
    assert list(table("t,x\n\n0,1\n , \n2,3\n").rows()) == [(3, ["0", "1"]), (4, [" ", " "]), (5, ["2", "3"])]  # fmt: skip # noqa: E501
    assert list(table("t\n1\n\n2\n").rows()) == [(2, ["1"]), (4, ["2"])]
    with pytest.raises(FileError, match="3 values under 2 names") as error:
        list(table("t,x\n0,1\n0,1,2\n").rows())
    assert error.value.diagnostics[0].location.line == 3


def test_numbers_are_finite_or_missing() -> None:
    found = table('t,x\n1,"2,5"\n3,nan\n4,\n5,inf\n')
    rows = list(found.rows())
    assert found.number(rows[0][1], 0, 2) == 1.0
    assert math.isnan(found.number(rows[1][1], 1, 3))
    assert math.isnan(found.number(rows[2][1], 1, 4))
    for line, fields in (rows[0], rows[3]):
        with pytest.raises(FileError, match="is not a finite number") as error:
            found.number(fields, 1, line)
        place = error.value.diagnostics[0].location
        assert (place.line, place.column) == (line, 3)


@pytest.mark.parametrize("content", [b"", b" \n", b"\xff\xfe\x00"])
def test_a_file_without_text_is_rejected(content: bytes) -> None:
    with pytest.raises(FileError, match=r"is empty|not text"):
        CsvTable("run.csv", content)


@pytest.mark.parametrize("titles", ["t,u,u", "t,u,u [N]", "t,u [kN],u (N)", 'u,t,"u"'])
def test_a_name_of_two_columns_is_an_error(titles: str) -> None:
    with pytest.raises(FileError, match="two columns have the name `u`") as error:
        table(titles + "\n0,1,2\n")
    place = error.value.diagnostics[0].location
    assert (place.line, place.column) == (1, titles.rindex(",") + 2)
    assert table("t,,,u\n").titles == ["t", "", "", "u"]  # columns without a name


@pytest.mark.parametrize(
    "text", ["1_0", "1__0", "infinity", "\u0661", "\uff11", "0x10", "1d5", "1e", "1,0"]
)
def test_spellings_of_programming_languages_are_no_numbers(text: str) -> None:
    found = table(f't;u\n0;0\n1;"{text}"\n')
    row = list(found.rows())[1][1]
    with pytest.raises(FileError, match="is not a finite number") as error:
        found.number(row, 1, 3)
    place = error.value.diagnostics[0].location
    assert (place.line, place.column) == (3, 3)


@pytest.mark.parametrize("text", ["1", "-1.5", "+.5", "5.", "1e-3", " 2E+4 "])
def test_numbers_are_those_of_model_files(text: str) -> None:
    assert table(f"u\n{text}\n").number([text], 0, 2) == float(text)


@pytest.mark.parametrize(
    ("title", "name", "unit"),
    [
        ("u", "u", None),
        (" u [kNm] ", "u", "kNm"),
        ("u (1/s)", "u", "1/s"),
        ("c [N/(m/s)]", "c", "N/(m/s)"),
        ("x[1]", "x[1]", None),
        ("x[1] [mm]", "x[1]", "mm"),
        ("mu [-]", "mu", "-"),
    ],
)
def test_titles_are_names_and_units(title: str, name: str, unit: str | None) -> None:
    assert split_title(title) == (name, unit)


def test_a_whole_title_is_read_with_its_unit() -> None:
    assert table("t,x [cm]\n").column("x [cm]", None) == (1, pytest.approx(0.01), "cm")
    assert table("t,x [left]\n").column("x [left]", None) == (1, 1, None)


def test_lines_may_end_in_any_way() -> None:
    for end in ("\n", "\r\n", "\r"):
        found = table(end.join(["t,x", "0,1", "2,3", ""]))
        assert found.titles == ["t", "x"]
        assert [fields for _, fields in found.rows()] == [["0", "1"], ["2", "3"]]


def test_a_title_that_is_no_field_is_an_error() -> None:
    with pytest.raises(FileError, match="this is not CSV: field larger than field limit"):
        table("t," + 200_000 * "x" + "\n0,1\n")


@pytest.mark.parametrize(
    ("text", "place"),
    [("t,x\0\n0,1\n", (1, 4)), ("t,x\r\n0,1\n2,\x003\n", (3, 3)), ('t,"a\nb",\0\n', (2, 4))],
)
def test_nul_is_not_text(text: str, place: tuple[int, int]) -> None:
    with pytest.raises(FileError, match=r"the character U\+0000, which is not text") as error:
        table(text)
    (diagnostic,) = error.value.diagnostics
    assert diagnostic.location is not None
    assert (diagnostic.location.line, diagnostic.location.column) == place
