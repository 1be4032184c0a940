"""Measured data: units, missing values, and errors that name file, line and column."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import symengine as se

import lagcli
from lagcli.analysis.fit.experiment import Measured, read_measured
from lagcli.errors import FileError, ModelError, SourceLocation
from lagcli.model.model import DataFile, ObservedQuantity

HERE = SourceLocation("model.yaml", 1, 1)


#: Without units: a column may have any.
PLAIN = "coordinates: [phi]\nT: phi'^2/2\nV: 0\ninitial: {phi: 0, phi': 0}\n"
#: A pendulum on a rod, with units throughout.
PENDULUM = """\
coordinates: {r: m, phi: rad}
parameters: {m: 1 kg, l: 1 m, g: 9.81 m/s^2, error: 2 deg}
T: m/2*(r'^2 + r^2*phi'^2)
V: -m*g*r*cos(phi)
constraints: {rod: r = l}
initial: {r: {guess: l}, r': {guess: 0}, phi: 30 deg, phi': 0}
outputs: {x: r*sin(phi)}
"""


def observed(column: str, sigma: float | None = None) -> ObservedQuantity:
    return ObservedQuantity("phi", se.Symbol("phi"), column, sigma, None, None, HERE)


def read(folder: Path, text: str, *quantities: ObservedQuantity, model: str = PLAIN) -> Measured:
    (folder / "run.csv").write_text(text)
    data = DataFile("run.csv", "t", {}, {}, HERE)
    return read_measured(data, folder, lagcli.load_text(model), quantities)


def described(*entries: str) -> Sequence[ObservedQuantity]:
    """Return the observed quantities of the pendulum, as its file describes them."""
    fit = (
        f"fit: {{data: {{file: run.csv}}, observe: {{{', '.join(entries)}}}, parameters: {{m: }}}}"
    )
    found = lagcli.load_text(PENDULUM + fit).fit
    assert found is not None
    return found.observed


def test_columns_are_converted_to_si_by_their_titles(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        't [ms],enc [deg],load\n0,180,1\n\n500,90,"2"\n',
        *described(
            "phi: {column: enc, sigma: 0.5}",
            "lambda.rod: {column: load, sigma: 2, unit: kN}",
            "2*phi: {column: enc, sigma: 0.1 rad}",
            "3*phi: {column: enc, sigma: error}",
        ),
        model=PENDULUM,
    )
    np.testing.assert_allclose(found.times, [0, 0.5])
    expected = [[np.pi, 1000, np.pi, np.pi], [np.pi / 2, 2000, np.pi / 2, np.pi / 2]]
    np.testing.assert_allclose(found.values, expected)
    np.testing.assert_allclose(found.sigmas, [np.radians(0.5), 2000, 0.1, np.radians(2)])


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
    model = lagcli.load_text(PLAIN)
    with pytest.raises(FileError, match=r"none\.csv"):
        read_measured(DataFile("none.csv", "t", {}, {}, HERE), tmp_path, model, [observed("a")])


@pytest.mark.parametrize(
    ("title", "entry", "said"),
    [
        ("a [m]", "phi: a", "run.csv:1:3: error[units]: `phi` is in rad, and its column in m"),
        ("a [N*m]", "lambda.rod: a", "`lambda.rod` is in N, and its column in N*m"),
        ("a [deg]", "x: a", "`x` is in m, and its column in deg"),
        ("a [m/s]", "r*phi''*sin(phi): a", "in m/s^2, and its column in m/s"),
        ("a [W]", "energy_total: a", "`energy_total` is in J, and its column in W"),
        ("a [kN*m]", "Qc.rod.r: a", "`Qc.rod.r` is in N, and its column in kN*m"),
        ("a", "phi: {column: a, unit: mm}", ":8:40: error[units]: `phi` is in rad, and its column"),
        ("a", "phi: {column: a, sigma: 1 mm}", "`phi` is in rad, and its `sigma` in mm"),
        ("a", "x: {column: a, sigma: error/10}", "`x` is in m, and its `sigma` in rad"),
    ],
)
def test_columns_have_the_dimension_of_what_they_measure(
    tmp_path: Path, title: str, entry: str, said: str
) -> None:
    with pytest.raises((FileError, ModelError)) as found:
        read(tmp_path, f"t,{title}\n0,1\n", *described(entry), model=PENDULUM)
    assert said in str(found.value)


def test_hertz_fit_expressions_but_no_angular_velocity(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="`phi'` is in rad/s, and its column in Hz"):
        read(tmp_path, "t,a [Hz]\n0,1\n", *described("phi': a"), model=PENDULUM)
    found = read(tmp_path, "t,a [kHz]\n0,1\n", *described("phi'/(2*pi): a"), model=PENDULUM)
    assert found.values == pytest.approx(1000.0)


def test_times_are_times(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="the times are in kg"):
        read(tmp_path, "t [kg],a\n0,1\n", observed("a"))
