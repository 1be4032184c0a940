"""The report on units: what follows, what is missing, what disagrees."""

from __future__ import annotations

import json
from pathlib import Path

from lagcli.analysis.check.units import report_units
from lagcli.model.loader import load, load_text

MODELS = Path(__file__).parents[4] / "models"


def test_a_model_with_units_throughout() -> None:
    report = report_units(load(MODELS / "bead_on_rotating_hoop.yaml"))
    assert report.checked
    assert list(report.sentences()) == [
        "Given throughout and consistent.",
        "Multipliers: hoop in N; drive in N*m.",
        "Generalized forces: r in N; theta, phi in N*m.",
        "Outputs: radial_force in N; motor_torque in N*m; motor_power in W.",
    ]
    assert report.constraints == {"hoop": "m", "drive": "rad"}
    found = json.loads(json.dumps(report.to_mapping()))
    assert found["multipliers"] == {"hoop": "N", "drive": "N*m"}
    assert found["parameters"]["Omega"] == "rad/s"
    assert found["findings"] == []


def test_families_are_listed_together() -> None:
    lines = list(report_units(load(MODELS / "chain.yaml")).sentences())
    assert "Multipliers: rod[1..20] in N/m." in lines
    assert "Generalized forces: x[1..20], y[1..20] in N." in lines


def test_families_given_in_other_units_are_listed_together() -> None:
    text = """\
coordinates: {x[1..3]: m}
parameters: {m: 1 kg, "a[1..2]": 5 cm, "k[1]": 1 kN/m, "k[2]": 3 kN/m, "k[3]": 2 kN/m}
T: sum(m/2*x[i]'^2, i = 1..3)
V: sum(k[i]/2*(x[i] - a[1] - a[2])^2, i = 1..3)
initial: {"x[i = 1..3]": 0, "x[i = 1..3]'": 0}
"""
    *_, last = report_units(load_text(text)).sentences()
    assert last == (
        "Converted to SI: a[1..2] = 5 cm = 0.05 m; k[1..3] from 1 to 3 kN/m = 1000 to 3000 N/m."
    )


PARTLY = """\
coordinates: {x: m, y: {}}
parameters: {m: 1 kg, k: 3, g: 9.81 m/s}
T: m/2*(x'^2 + y'^2)
V: k*x^2 + m*g*x
initial: {x: 0, y: 0, x': 0, y': 0}
"""


def test_what_is_missing_and_what_disagrees_even_so() -> None:
    report = report_units(load_text(PARTLY, "f.yaml"))
    assert report.stated
    assert not report.checked
    assert report.missing == ("y", "k")
    assert report.summary == "not checked: no unit for `y`, `k`"
    (finding,) = report.findings
    assert finding.severity == "warning"
    assert "`m*g*x` is in kg*m^2/s" in finding.message
    (about,) = report.to_mapping()["findings"]
    assert about["places"][0] == {"file": "f.yaml", "line": 4, "column": 12, "length": 5}
    assert report.forces == {"x": "N", "y": None}


def test_a_model_without_units() -> None:
    text = PARTLY.replace("x: m", "x: {}").replace("1 kg", "1").replace("9.81 m/s", "9.81")
    report = report_units(load_text(text))
    assert list(report.sentences()) == ["None given."]
    assert set(report.forces.values()) == {None}


def test_values_in_other_units_are_shown_in_si() -> None:
    text = """\
coordinates: {phi: rad}
parameters: {J: 100 gcm², M: 5 kNm, n: 3000 rpm, s: 1 N*m}
T: J/2*phi'^2
Q: {phi: M}
initial: {phi: 90°, phi': 0}
"""
    report = report_units(load_text(text))
    assert {name: str(x) for name, x in report.converted.items()} == {
        "J": "100 gcm² = 1e-05 kg*m^2",
        "M": "5 kNm = 5000 N*m",
        "n": "3000 rpm = 314.159 rad/s",
        "phi": "90 ° = 1.5708 rad",
    }
    (line,) = [x for x in report.sentences() if x.startswith("Converted")]
    assert line.startswith("Converted to SI: J = 100 gcm² = 1e-05 kg*m^2; M = 5 kNm = 5000 N*m; ")
    assert report.to_mapping()["converted"]["M"] == "5 kNm = 5000 N*m"


def test_numbers_that_took_a_unit_are_listed_with_their_places() -> None:
    text = """\
coordinates: {x: m}
parameters: {m: 1 kg, k: 2 N/m}
functions: {damp(v): -0.3*v}
T: m/2*x'^2
V: >
  k/2*(x - 1)^2
Q: {x: damp(x') + 40*sin(30*x)}
initial: {x: -0.3, x': 0}
events: {a: {when: x <= -0.5, set: {x': -0.3}}}
"""
    report = report_units(load_text(text, "f.yaml"))
    found = [(x.text, x.unit, x.location.line, x.location.column) for x in report.numbers]
    assert found == [
        ("1", "m", 6, 12),
        ("damp(x')", "N*s/m", 7, 8),
        ("40", "N", 7, 19),
        ("30", "1/m", 7, 26),
        ("-0.5", "m", 9, 25),
    ]
    (line,) = [x for x in report.sentences() if x.startswith("Numbers")]
    assert line.startswith("Numbers that took a unit: `1` in m (line 6, column 12); `damp(x')` in")
    numbers = json.loads(json.dumps(report.to_mapping()))["numbers"]
    assert numbers[2]["place"] == {"file": "f.yaml", "line": 7, "column": 19, "length": 2}
