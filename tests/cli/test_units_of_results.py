"""Units from the model to summaries, result files and sweeps."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import pytest

from lagcli.cli.app import run
from lagcli.model.loader import load
from lagcli.sweeps.columns import measure_columns

MODELS = Path(__file__).parents[2] / "models"
HOOP = str(MODELS / "bead_on_rotating_hoop.yaml")


def test_the_summary_states_the_units_of_multipliers(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", HOOP, "--t-end", "0.1"]) == 0
    text = capsys.readouterr().out
    assert "lambda.hoop [N]" in text
    assert "lambda.drive [N*m]" in text
    assert run(["simulate", HOOP, "--t-end", "0.1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["multipliers"]
    assert {name: m["unit"] for name, m in found.items()} == {"hoop": "N", "drive": "N*m"}


def test_result_files_state_the_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "run.h5")
    assert run(["simulate", HOOP, "--t-end", "0.1", "-o", path, "--quiet"]) == 0
    with h5py.File(path) as root:
        units = {name: x.attrs["units"].decode() for name, x in root.items() if "units" in x.attrs}
        entries = {name: [x.decode() for x in root[name]] for name in root if "_unit" in name}
        outputs = {name: x.attrs["units"].decode() for name, x in root["outputs"].items()}
    assert units["multipliers"] == "see multiplier_unit"
    assert not any("mixed" in unit for unit in units.values())
    assert entries == {
        "coordinate_unit": ["m", "rad", "rad"],
        "force_unit": ["N", "N*m", "N*m"],
        "multiplier_unit": ["N", "N*m"],
        "position_unit": ["m", "rad"],
        "velocity_unit": ["m/s", "rad/s"],
        "conserved_unit": ["J"],
    }
    assert outputs == {"radial_force": "N", "motor_torque": "N*m", "motor_power": "W"}
    capsys.readouterr()
    assert run(["info", path]) == 0
    text = capsys.readouterr().out
    assert "drive [N*m]" in text
    assert "motor_power [W]" in text


ENGINEERS = """
coordinates: {phi: rad}
parameters: {m: 500 g, l: 250 mm, g: 9.81 m/s^2, omega: 1500 rpm, M: 0.1 kNm, P: 2 hp, a: 30°}
T: m*l^2*phi'^2/2
V: -m*g*l*cos(phi - a)
Q: {phi: M*sin(omega*t)}
initial: {phi: 10 deg, phi': 0}
"""
#: What commands print of each parameter.
GIVEN = (
    "m = 500 g = 0.5 kg",
    "l = 250 mm = 0.25 m",
    "omega = 1500 rpm = 157.08 rad/s",
    "M = 0.1 kNm = 100 N*m",
    "P = 2 hp = 1491.4 W",
    "a = 30 ° = 0.523599 rad",
)


def test_values_in_si_are_shown_beside_those_in_other_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(ENGINEERS)

    def printed(*arguments: str) -> str:
        assert run(list(arguments)) == 0
        return " ".join(capsys.readouterr().out.split())

    assert "Converted to SI: " + "; ".join(GIVEN) + "; phi = 10 deg = " in printed(
        "check", "m.yaml"
    )
    text = printed("derive", "m.yaml").replace("ω", "omega").replace("·", "*")
    assert [x for x in GIVEN if x not in text] == []

    faster = GIVEN[2].replace("1500", "3000").replace("157.08", "314.159")
    listed = ", ".join(GIVEN).replace(GIVEN[2], faster)
    simulate = ("simulate", "m.yaml", "--t-end", "0.1", "--set", "omega=3000 rpm")
    assert f" in SI {listed} energy" in printed(*simulate, "-o", "run.h5")
    printed(*simulate, "-o", "run.csv", "--meta")
    for name in ("run.h5", "run.csv"):
        text = printed("info", name).replace("g = 9.81 m/s^2, ", "")
        assert f" parameters {listed} options" in text
        found = json.loads(printed("info", name, "--json"))
        assert found["given"]["omega"] == "3000 rpm"
        assert found["parameters"]["omega"] == pytest.approx(314.159265)

    few = ("--t-end", "0.1", "--jobs", "1", "-o", "sweep.h5", "--quiet")
    printed("sweep", "m.yaml", "--vary", "phi=0.1,0.2 rad", "--set", "omega=3000 rpm", *few)
    text = printed("info", "sweep.h5").replace("g = 9.81 m/s^2, ", "")
    assert f" parameters {listed} options" in text


def test_parameters_that_follow_from_others_have_their_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(ENGINEERS.replace("m: 500 g,", "m: 500 g, J: m*l^2, n: M/(m*g*l),"))
    assert run(["derive", "m.yaml"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "J = 0.03125 kg·m² n = 81.5494 l =" in text


def test_one_unit_is_stated_with_the_array(tmp_path: Path) -> None:
    path = str(tmp_path / "run.h5")
    model = str(MODELS / "pendulum_cartesian.yaml")
    assert run(["simulate", model, "--t-end", "0.1", "-o", path, "--quiet"]) == 0
    with h5py.File(path) as root:
        units = {name: x.attrs["units"].decode() for name, x in root.items() if "units" in x.attrs}
    assert units["multipliers"] == "N/m"
    assert units["constraint_force"] == units["constraint_force_by"] == "N"
    assert units["residual_position"] == units["scale_position"] == "m^2"
    assert units["residual_velocity"] == "m^2/s"
    assert units["residual_equation"] == "N"


@pytest.mark.parametrize(
    ("measure", "unit"),
    [
        ("max(abs(lambda.drive))", "N*m"),
        ("max(lambda.drive*phi')", "W"),
        ("final(theta')", "rad/s"),
        ("mean(motor_power)", "W"),
        ("max(Qc.r) - min(Qc.r)", "N"),
        ("rms(r*theta)", "m"),
        ("max(energy_total)", "J"),
        ("argmax(r)", "s"),
        ("max(residual_velocity.hoop)", "m/s"),
        ("max(abs(residual_position))", "not stated"),
    ],
)
def test_measures_have_the_units_of_their_signals(measure: str, unit: str) -> None:
    (column,) = measure_columns(load(HOOP), (("m", measure),))
    assert column.unit == unit


def test_a_wrong_unit_ends_a_command_with_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "hoop.yaml"
    path.write_text(Path(HOOP).read_text().replace("R: 1 m", "R: 1 s"))
    for command in (["simulate"], ["derive"]):
        assert run([*command, str(path)]) == 2
        text = capsys.readouterr().err
        assert "error[units]: `r`, in m, and `R`, in s, cannot be equal" in text
        assert "all units fit with `R` in m" in text


NUMBERS = """\
coordinates: {x: m}
parameters: {m: 1 kg}
T: m/2*x'^2
Q: {x: -0.05*x' - 20*x}
events: {a: {when: t >= 0.5, set: {x: -0.3}}}
initial: {x: -0.3, x': 1}
simulation: {t_end: 1, samples: 3}
"""


def test_numbers_that_took_a_unit_are_a_warning_which_strict_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "numbers.yaml"
    path.write_text(NUMBERS)
    assert run(["simulate", str(path), "--quiet"]) == 0
    assert "warning: 2 numbers took a unit (lagcli check)" in capsys.readouterr().err
    assert run(["simulate", str(path), "--quiet", "--strict"]) == 3
    assert "error: 2 numbers took a unit (lagcli check)" in capsys.readouterr().err
    assert run(["check", str(path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Numbers that took a unit: `0.05` in N*s/m (line 4, column 9); `20` in N/m" in text
    sweep = ["sweep", str(path), "--vary", "m=1,2 kg", "--measure", "max(x)", "--quiet"]
    assert run([*sweep, "-o", str(tmp_path / "a.h5")]) == 0
    assert run([*sweep, "-o", str(tmp_path / "b.h5"), "--strict"]) == 3
    capsys.readouterr()
    named = NUMBERS.replace("1 kg", "1 kg, c: 0.05 Ns/m, k: 20 N/m, T: 0.5 s")
    path.write_text(named.replace("0.05*", "c*").replace("20*", "k*").replace(">= 0.5", ">= T"))
    assert run(["simulate", str(path), "--quiet", "--strict"]) == 0
    assert capsys.readouterr().err == ""


def test_a_torque_in_nm_and_a_table_in_nm(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "torque.csv").write_text("t [ms],M [kNm]\n0,0.005\n1000,0.005\n")
    model = """\
coordinates: {phi: rad}
parameters: {J: 0.1, M: 5 Nm}
inputs: {u: {file: torque.csv, time: t, column: M, extend: hold}}
T: J/2*phi'^2
Q: {phi: M + u}
initial: {phi: 0, phi': 0}
simulation: {t_end: 1, samples: 2}
"""
    path = tmp_path / "torque.yaml"
    path.write_text(model)
    assert run(["simulate", str(path), "-o", str(tmp_path / "a.csv"), "--quiet"]) == 0
    end = (tmp_path / "a.csv").read_text().splitlines()[-1].split(",")
    assert float(end[1]) == pytest.approx(50.0, rel=1e-9)  # phi'' = 100 rad/s^2
