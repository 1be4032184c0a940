"""Numbers without a unit in place of initial values that the file gives in other units than SI."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import ModelError, UsageError
from lagcli.sweeps.plan.vary import read_vary

MODEL = """\
coordinates: {phi: rad, r: point, "u[1..2]": m, e: quaternion}
parameters: {m: 1 kg, A: 1 kg*m^2}
definitions: {w: omega(e)}
T: A/2*phi'^2 + m/2*dot(r', r') + sum(m*u[i]'^2, i = 1..2) + A/2*dot(w, w)
initial:
  phi: 20 deg
  phi': {guess: 30 rpm}
  r: [10 cm, 0.5 m, 1]
  r': 0
  u[1..2]: [3 mm, 4 m]
  u[1..2]': 1 km/h
  e: 1
  e': [0, 10 deg/s, 1 rad/s]
"""


@pytest.mark.parametrize(
    ("name", "text", "unit"),
    [
        ("phi", "30", "deg"),
        ("phi", "-1e-3", "deg"),
        ("phi", "{guess: 30}", "deg"),
        ("phi'", "3", "rpm"),
        ("phi_dot", "3", "rpm"),
        ("r.x", "2", "cm"),
        ("u[1]", "2", "mm"),
        ("u[2]'", "2", "km/h"),
    ],
)
def test_a_number_needs_a_unit_where_the_file_has_one_other_than_si(
    name: str, text: str, unit: str
) -> None:
    with pytest.raises(ModelError) as found:
        lagcli.load_text(MODEL, set_initial={name: text})
    [one] = found.value.diagnostics
    written = f"{{guess: 30 {unit}}}" if text.startswith("{") else f"{text} {unit}"
    assert one.kind == "ambiguous-unit"
    assert one.message.endswith(f"is given in {unit} in the file, and without a unit here")
    assert f'--set-initial "{name}={written}"' in (one.help or "")
    # the remedy is accepted
    lagcli.load_text(MODEL, set_initial={name: written})


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("phi", "30 deg", {"phi": math.pi / 6}),
        ("phi", "0.3 rad", {"phi": 0.3}),
        ("phi", "0", {"phi": 0.0}),
        ("phi", "pi/6", {"phi": math.pi / 6}),
        ("phi", 0.3, {"phi": 0.3}),
        ("r.y", "2", {"r.y": 2.0}),
        ("r", "[1, 2, 3]", {"r.x": 1.0, "r.y": 2.0, "r.z": 3.0}),
        ("u[2]", "2", {"u[2]": 2.0}),
        ("e'", "[0, 1, 0]", {"e.2'": 0.5}),
    ],
)
def test_other_values_are_taken(name: str, text: object, expected: dict[str, float]) -> None:
    values = lagcli.load_text(MODEL, set_initial={name: text}).initial
    assert {k: values[k].value for k in expected} == pytest.approx(expected, rel=1e-15)


def test_numbers_from_python_are_in_si_and_are_kept_with_their_units() -> None:
    given = {"phi": 0.3, "phi'": np.float64(3.5), "r.x": 2, "u[2]": 1, "u[1]'": "2 m/s"}
    model = lagcli.load_text(MODEL, set_initial=given)
    kept = {"phi": "0.3 rad", "phi'": "3.5 rad/s", "r.x": "2 m", "u[2]": 1, "u[1]'": "2 m/s"}
    assert model.set_initial == kept
    # as a result file has them
    texts = {name: str(value) for name, value in model.set_initial.items()}
    again = lagcli.load_text(MODEL, set_initial=texts)
    assert {k: x.value for k, x in again.initial.items()} == {
        k: x.value for k, x in model.initial.items()
    }
    assert [model.initial[k].value for k in given] == [0.3, 3.5, 2, 1, 2]


@pytest.mark.parametrize("values", ["phi=0:1:0.5", "phi=0.1,0.2", "phi'=1:2:0.5", "u[1]=1,2"])
def test_a_varied_initial_value_needs_the_unit_too(values: str) -> None:
    model, name = lagcli.load_text(MODEL), values.partition("=")[0]
    with pytest.raises(UsageError, match=r"without a unit here; write the unit after the values"):
        read_vary(values, model)
    unit = {"phi": "deg", "phi'": "rpm", "u[1]": "mm"}[name]
    read_vary(f"{values} {unit}", model)


def test_a_column_needs_the_unit_in_its_title(tmp_path: Path) -> None:
    model, table = lagcli.load_text(MODEL), tmp_path / "table.csv"
    table.write_text("phi\n30\n")
    with pytest.raises(UsageError) as found:
        read_vary(f"@{table}", model)
    assert str(found.value) == (
        f"{table}:1: `phi` is given in deg in the file, and without a unit here;"
        " write the unit in the title, `phi [deg]`"
    )
    table.write_text("phi [deg]\n30\n")
    assert read_vary(f"@{table}", model).rows(np.array([0])) == pytest.approx(
        np.array([[np.pi / 6]])
    )


def test_a_preset_needs_the_unit_too() -> None:
    with pytest.raises(ModelError) as found:
        lagcli.load_text(MODEL + "presets: {a: {initial: {phi: 30, r: [20, 1, 2], u[1..2]: 5}}}\n")
    assert [(x.kind, x.help) for x in found.value.diagnostics] == [
        ("ambiguous-unit", "write the unit: `30 deg`"),
        ("ambiguous-unit", "write the unit: `20 cm`"),
        ("ambiguous-unit", "write the unit: `5 mm`"),
    ]
    text = MODEL + (
        "presets: {a: {initial: {phi: 30 deg, r: [20 cm, 1, 2], u[i = 1..2]: i*0.1 ,"
        " e': [1 deg/s, 2 rad/s, 3]}}}\n"
    )
    values = lagcli.load_text(text, preset="a").initial
    assert values["phi"].value == pytest.approx(math.pi / 6, rel=1e-15)
    assert [values[k].value for k in ("r.x", "r.y", "u[1]", "u[2]")] == [0.2, 1, 0.1, 0.2]
    assert values["e.1'"].value == pytest.approx(math.pi / 360, rel=1e-15)


@pytest.mark.parametrize(
    ("written", "name", "text"),
    [
        ("30 rpm", "phi'", "3 Hz"),
        ("30 rpm", "phi_dot", "{guess: 3 kHz}"),
        ("10 deg/s", "", "3 hertz"),
    ],
)
def test_angular_velocities_are_not_in_hertz(written: str, name: str, text: str) -> None:
    in_file = MODEL.replace(written, re.findall(r"3 \w+", text)[0])
    for model, given in ((in_file, {}), (MODEL if name else in_file, {name: text} if name else {})):
        with pytest.raises(ModelError) as found:
            lagcli.load_text(model, set_initial=given)
        [one] = found.value.diagnostics
        assert one.kind == "units"
        assert "rad/s, rev/s or rpm" in (one.help or "")
    for unit in ("1/s", "rad/s", "rev/s"):
        lagcli.load_text(MODEL, set_initial={"phi'": f"3 {unit}"})


def test_sweeps_of_angular_velocities_are_not_in_hertz() -> None:
    model = lagcli.load_text(MODEL)
    with pytest.raises(UsageError, match="rad/s, rev/s or rpm"):
        read_vary("phi'=1:3:1 Hz", model)


def test_parameters_in_hertz_are_frequencies() -> None:
    text = MODEL.replace("A: 1 kg*m^2", "A: 1 kg*m^2, f: 50 Hz, u_0: 2 rad/s")
    assert lagcli.load_text(text, set={"f": "2 kHz"}).parameter_values["f"] == 2000.0
    for name, value in (("f", "3000 rpm"), ("u_0", "50 Hz")):
        with pytest.raises(ModelError, match=f"`{name}` is in"):
            lagcli.load_text(text, set={name: value})
