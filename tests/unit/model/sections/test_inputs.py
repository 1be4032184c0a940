"""The key `inputs`: tables, their files, and what they may be used for."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

import lagcli
from lagcli.errors import ModelError

CSV = "t,height [mm]\n0,0\n0.5,10\n1,-5\n"
MODEL = """\
coordinates: {y: m}
parameters: {m: 1 kg, k: 100 N/m}
inputs:
  u: {ENTRY}
T: m/2*y'^2
V: k/2*(y - u)^2
initial: {y: 0 m, y': 0 m/s}
"""
FILE = "file: road.csv, column: height"
LISTS = "times: [0, 500 ms, 1], values: [0, 1 cm, -5 mm]"


def loaded(
    folder: Path, entry: str = FILE, text: str = MODEL, csv: str | bytes = CSV
) -> lagcli.Model:
    (folder / "road.csv").write_bytes(csv if isinstance(csv, bytes) else csv.encode())
    (folder / "m.yaml").write_text(text.replace("ENTRY", entry), encoding="utf-8")
    return lagcli.load(folder / "m.yaml")


def message(folder: Path, *arguments: str, **more: str | bytes) -> str:
    with pytest.raises(ModelError) as caught:
        loaded(folder, *arguments, **more)  # type: ignore[arg-type]
    return str(caught.value)


@pytest.mark.parametrize("entry", [FILE, LISTS, FILE + ", time: t, interpolation: cubic"])
def test_tables_are_in_si(tmp_path: Path, entry: str) -> None:
    """From files with units in their titles, and from lists with their own units."""
    u = loaded(tmp_path, entry).inputs["u"]
    assert u.data.times.tolist() == [0.0, 0.5, 1.0]
    assert u.data.values.tolist() == [0.0, 0.01, -0.005]
    assert u.interpolation == ("cubic" if "cubic" in entry else "linear")


def test_a_file_is_known_by_its_digest(tmp_path: Path) -> None:
    data = loaded(tmp_path).data["u"]
    assert (data.file, data.unit) == ("road.csv", "mm")
    assert data.sha256 == hashlib.sha256(CSV.encode()).hexdigest()


@pytest.mark.parametrize(
    "csv",
    [
        "\ufeff" + CSV,
        CSV.replace(",", ";"),
        CSV.replace(",", "\t"),
        CSV.replace("\n", "\r\n"),
        CSV.replace("\n", "\n\n"),
        'x,t,"height [mm]"\n7,0,0\n7,0.5,10\n7,1,-5',
        CSV.replace("t,", "t [ms],").replace("0.5", "500").replace("\n1,", "\n1000,"),
    ],
    ids=["BOM", "semicolons", "tabs", "CRLF", "blank lines", "columns", "ms"],
)
def test_files_as_programs_write_them(tmp_path: Path, csv: str) -> None:
    data = loaded(tmp_path, csv=csv).data["u"]
    assert data.times.tolist() == [0.0, 0.5, 1.0]
    assert data.values.tolist() == [0.0, 0.01, -0.005]


def test_data_at_hand_are_not_read_again(tmp_path: Path) -> None:
    """As result files and sweeps hand them to the loader."""
    model = loaded(tmp_path)
    (tmp_path / "road.csv").unlink()
    again = lagcli.load_text(model.text, model.path, data=model.data)
    assert again.data == model.data


@pytest.mark.parametrize(
    ("csv", "line", "fragment"),
    [
        ("", 4, "is empty"),
        ("t,height\n", 1, "no row of numbers"),
        ("t,height\n0,1\n", 4, "a single row"),
        ("t,high\n0,1\n1,1\n", 1, "no column `height`"),
        ("x,height\n0,1\n1,1\n", 1, "no column `t`"),
        ("t,height [quux]\n0,1\n1,1\n", 1, "quux"),
        ("t [m],height\n0,1\n1,1\n", 1, "the times are in m"),
        ("t,height\n0,1\n1,abc\n", 3, "'abc' is not a finite number"),
        ("t,height\n0,1\n1,inf\n", 3, "'inf' is not a finite number"),
        ("t,height\n0,1\n1,nan\n", 3, "the value is missing"),
        ("t,height\n0,1\n1,\n", 3, "the value is missing"),
        ("t,height\n0,1\n,1\n", 3, "the time is missing"),
        ("t,height\n0,1\n1,1\n1,2\n", 4, "not after the one before"),
        ("t,height\n0,1\n2,1\n1,2\n", 4, "not after the one before"),
        ("t,height\n0,1\n1,1,1\n", 3, "3 values under 2 names"),
        ("t,height\n0,1\n1, \n", 3, "the value is missing"),
        ("t,height [km]\n0,1\n1,1e307\n", 3, "'1e307' is not a finite number"),
        # two numbers that are one in s
        ("t [us],height\n0,1\n1000000,1\n1000000.0000000001,2\n", 4, "not after the one before"),
        (b"t,height\n0,\xff\n", 4, "not text"),
        (b"\x89HDF\r\n\x1a\n\x00\x00", 4, "not text"),
    ],
)
def test_damaged_files(tmp_path: Path, csv: str | bytes, line: int, fragment: str) -> None:
    """The message names the place in the file and in the model."""
    text = message(tmp_path, csv=csv)
    assert fragment in text
    assert f"road.csv:{line}:" in text or f"m.yaml:{line}:" in text
    assert "m.yaml:4" in text
    assert "height" in text or "u" in text


def test_lines_are_shown_as_csv_has_them(tmp_path: Path) -> None:
    """Separators of lines that Unicode has besides do not end a row."""
    text = message(tmp_path, csv="t,height\r0,1\u2028\r\n1,2\x0b\nx,4\n")
    assert "road.csv:4:1:" in text
    assert "    4 | x,4\n" in text


def test_files_that_are_none(tmp_path: Path) -> None:
    assert "there is no such file" in message(tmp_path, "file: other.csv")
    (tmp_path / "folder").mkdir()
    assert "it is a folder" in message(tmp_path, "file: folder")
    os.mkfifo(tmp_path / "pipe")
    assert "not a regular file" in message(tmp_path, "file: pipe")


@pytest.mark.parametrize(
    ("entry", "fragment"),
    [
        ("times: [0, 1], values: [1, 2], interpolation: cubik", "did you mean `cubic`"),
        ("times: [0, 1], values: [1, 2], extend: hold on", "`extend`"),
        ("times: [0, 1], values: [1, 2, 3]", "2 times, but 3 values"),
        ("times: [0, 0], values: [1, 2]", "the time 0 s after 0 s"),
        ("times: [0, 1 m], values: [1, 2]", "a time in m"),
        ("times: [0, 1], values: [1 m, 2 N]", "values in m and in N"),
        ("times: [0, 1], values: [1 m, 2]", "values in m and in no unit"),
        ("times: [0, 1], values: [k, 2]", "not a number"),
        ("times: [0], values: [1]", "a single row"),
        ("times: [], values: []", "no times"),
        ("times: [0, 1]", "no `values`"),
        ("times: [0, 1], values: [1e307 km, 1 m]", "a value that is too large"),
        ("unit: m", "has no table"),
        ("file: road.csv, times: [0, 1]", "a `file` and `times`"),
        ("column: height, times: [0, 1], values: [1, 2]", "but no `file`"),
        ("times: 3, values: [1, 2]", "must have a list of `times`"),
        ("file: road.csv, column: height, unit: quux", "unknown unit"),
        ("file: road.csv, columns: height", "did you mean `column`"),
        ("times: [0, 1], values: [1, 2], extend: periodic", "its first value is 1 and its last 2"),
    ],
)
def test_wrong_entries(tmp_path: Path, entry: str, fragment: str) -> None:
    text = message(tmp_path, entry)
    assert fragment in text
    assert "m.yaml:4:" in text


STEP = "times: [0, 1], values: [0 m, 1 m], interpolation: step"
LINEAR = STEP.replace("step", "linear")


@pytest.mark.parametrize(
    ("entry", "old", "new", "fragment"),
    [
        (STEP, "", "", "`V` depends on `u`, which jumps"),
        (LINEAR, "T: m/2*y'^2", "T: m/2*(y' + u')^2", "`T` depends on `u`, which has kinks"),
        (LINEAR, "initial:", "constraints: {c: y = u}\ninitial:", "the holonomic constraint `c`"),
        (LINEAR, "initial:", "constraints: {c: y' = u'}\ninitial:", "the nonholonomic constraint"),
        (LINEAR, "initial:", "outputs: {x: u''}\ninitial:", "no derivative `u''`"),
        (STEP, "V: k/2*(y - u)^2", "Q: {y: k*u'}", "no derivative `u'`"),
        (STEP, "V: k/2*(y - u)^2", "definitions: {w: 2*u}\nQ: {y: m*w'}", "`Q` depends on `u`"),
        (LINEAR, "initial:", "outputs: {x: u'''}\ninitial:", "the highest derivative"),
        (LINEAR, "parameters: {m: 1 kg", "parameters: {q: 2*u, m: 1 kg", "`u`"),
        (LINEAR, "y: 0 m,", "y: u,", "`u`"),
        (LINEAR, "parameters: {m: 1 kg", "parameters: {u: 1, m: 1 kg", "declared twice"),
        (LINEAR, "(y - u)", "(y - uu)", "did you mean `u`"),
    ],
)
def test_uses_that_need_more_than_there_is(
    tmp_path: Path, entry: str, old: str, new: str, fragment: str
) -> None:
    text = message(tmp_path, entry, MODEL.replace(old, new) if old else MODEL)
    assert fragment in text
    if "constraint" in fragment or "`T`" in fragment:
        assert "`cubic`" in text


def test_uses_that_are_smooth_enough(tmp_path: Path) -> None:
    """Steps in forces, lines in V and velocity constraints, splines everywhere."""
    loaded(tmp_path, STEP, MODEL.replace("V: k/2*(y - u)^2", "Q: {y: k*u}"))
    loaded(tmp_path, LINEAR)
    velocity = LINEAR.replace("0 m, 1 m", "0 m/s, 1 m/s")
    text = MODEL.replace("V: k/2*(y - u)^2\n", "constraints: {c: y' = u}\n")
    loaded(tmp_path, velocity, text)
    cubic = LINEAR.replace("linear", "cubic")
    loaded(tmp_path, cubic, MODEL.replace("initial:", "constraints: {c: y = u}\ninitial:"))
    loaded(tmp_path, cubic, MODEL.replace("T: m/2*y'^2", "T: m/2*(y' + u')^2"))


def test_units(tmp_path: Path) -> None:
    """An input's unit is checked like a parameter's, and so are those of its derivatives."""
    text = MODEL.replace("initial:", "outputs: {rate: u', force: k*u}\ninitial:")
    units = loaded(tmp_path, text=text).units
    assert units.of_output("rate") == "m/s"
    assert units.of_output("force") == "N"
    wrong = MODEL.replace("V: k/2*(y - u)^2", "Q: {y: u}")
    assert "must be in N, but `u` is in m" in message(tmp_path, text=wrong)


def test_a_table_that_does_not_reach_far_enough(tmp_path: Path) -> None:
    model = loaded(tmp_path)
    with pytest.raises(ModelError, match=r"m\.yaml:4:3.*`u` ends at t = 1 s"):
        lagcli.simulate(model, t_end=1.5)
    with pytest.raises(ModelError, match="after the start of the run"):
        lagcli.simulate(model, t_start=-1, t_end=1)
    assert lagcli.simulate(model, t_end=1).status == "completed"
    for extend in ("hold", "periodic"):
        held = loaded(tmp_path, f"{FILE}, extend: {extend}", csv=CSV.replace("-5", "0"))
        run = lagcli.simulate(held, t_start=-1, t_end=3, samples=9)
        assert run.status == "completed"
