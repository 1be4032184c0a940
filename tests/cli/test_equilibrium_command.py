"""`lagcli equilibrium` from the shell, and the plots of what it writes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from documented_schemas import schema

from lagcli.cli.app import run

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
CRANK, HOOP = str(MODELS / "slider_crank.yaml"), str(MODELS / "bead_on_rotating_hoop.yaml")
PITCHFORK = ("--set", "theta_0=0 rad", "--along", "Omega=2 rad/s:4 rad/s", "--branches")


def valid(text: str) -> dict[str, object]:
    found = json.loads(text)
    schema("equilibrium")(found)
    assert list(found)[:2] == ["command", "model"]
    return dict(found)


def test_json_is_that_of_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["equilibrium", CRANK, "--json"]) == 0
    assert len(valid(capsys.readouterr().out)["equilibria"]) == 1  # type: ignore[arg-type]
    assert run(["equilibrium", CRANK, "--along", "tau=0 N*m:0.4 N*m", "--json"]) == 0
    assert valid(capsys.readouterr().out)["parameter"] == "tau"


def test_text_says_stability_forces_and_sets(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["equilibrium", CRANK, "--all", "--starts", "8"]) == 0
    text = capsys.readouterr().out
    assert "stable (a minimum of the potential energy)" in text
    assert "guide on psi" in text
    assert run(["equilibrium", str(MODELS / "chaplygin_sleigh.yaml")]) == 0
    assert "one of a set of dimension 3" in capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80


def test_branches_are_written_plotted_and_described(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import h5py

    file, picture = tmp_path / "branch.h5", tmp_path / "branch.svg"
    assert run(["equilibrium", HOOP, *PITCHFORK, "-o", str(file)]) == 0
    said = capsys.readouterr().out
    assert "branch point (pitchfork) on branch 0: Omega = 3.13209195267" in said
    assert run(["info", str(file)]) == 0
    assert capsys.readouterr().out.strip() in said
    assert run(["info", str(file), "--json"]) == 0
    content = valid(capsys.readouterr().out)
    with h5py.File(file) as root:
        count = sum(len(b["parameter"]) for b in content["branches"])  # type: ignore[attr-defined]
        assert root["q"].shape == (count, 3)
        assert set(root["branch"][()]) == {0.0, 1.0, 2.0}
    assert run(["plot", str(file), "theta", "lambda.hoop", "-o", str(picture)]) == 0
    drawn = picture.read_text()
    assert "unstable" in drawn
    assert "branch point" in drawn
    assert "Omega" in drawn
    assert run(["plot", str(file), "tetha", "-o", str(tmp_path / "x.svg")]) == 2
    assert "did you mean `theta`" in capsys.readouterr().err


def test_spectrum_of_modes_is_plotted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(tmp_path / "modes.h5")
    assert run(["modes", CRANK, "--equilibrium", "-o", file, "-q"]) == 0
    assert run(["plot", file, "-o", str(tmp_path / "spectrum.svg")]) == 0
    assert run(["animate", file, "-o", str(tmp_path / "x.html")]) == 2
    assert "--mode 1" in capsys.readouterr().err
    assert "divergence" in (tmp_path / "spectrum.svg").read_text()
    assert run(["info", file]) == 0
    assert "modes about the equilibrium" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        ([CRANK, "--along", "tau"], 2, "NAME=START:END"),
        (
            [CRANK, "--along", "taw=0:1"],
            2,
            "--along: the model has no parameter `taw`; did you mean `tau`",
        ),
        ([CRANK, "--steady", "phi'"], 2, 'as in --steady "phi\'=10"'),
        ([CRANK, "--along", "tau=0 N*m:0 N*m"], 2, "two different"),
        ([CRANK, "--along", "tau=0 N*m:1 N*m", "--all"], 2, "choose one"),
        ([CRANK, "--branches"], 2, "needs --along"),
        ([str(MODELS / "chain.yaml"), "--along", "N=2:5"], 2, "varied continuously"),
        ([CRANK, "-o", "found.csv"], 2, "found.json"),
        ([CRANK, "--starts", "0", "--all"], 2, "0"),
        ([CRANK, "--set", "tau=5"], 3, "no equilibrium"),
        ([HOOP, "--steady", "phi'=1"], 2, "the constraints determine phi'"),
    ],
)
def test_mistakes_are_explained(
    arguments: list[str], status: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["equilibrium", *arguments]) == status
    assert said in capsys.readouterr().err


#: A pendulum that a torque M presses against a stop.
STOPPED = """
coordinates: [a]
parameters: {M: 5}
T: a'^2/2
V: -4*cos(a)
Q: {a: M}
constraints: {stop: a <= 0.5}
initial: {a: 0.1, a': 0}
"""


def test_contacts_are_in_all_that_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, file = str(tmp_path / "stopped.yaml"), str(tmp_path / "found.h5")
    Path(model).write_text(STOPPED, encoding="utf-8")
    assert run(["equilibrium", model, "--json"]) == 0
    (found,) = valid(capsys.readouterr().out)["equilibria"]  # type: ignore[misc]
    (contact,) = found["contacts"]
    force = 4 * math.sin(0.5) - 5
    assert contact == pytest.approx(
        {"name": "stop", "state": "closed", "gap": 0.0, "multiplier": force, "limit": None}
    )
    assert run(["equilibrium", model]) == 0
    assert "contacts stop closed (λ = -3.0823)" in capsys.readouterr().out
    assert run(["equilibrium", model, "--along", "M=5:1", "-o", file, "--json"]) == 0
    (point,) = valid(capsys.readouterr().out)["special_points"]  # type: ignore[misc]
    assert (point["kind"], point["contact"]) == ("contact opens", "stop")
    assert run(["info", file]) == 0
    assert "contact opens (stop) on branch 0: M = 1.917" in capsys.readouterr().out
    for command, suffix in (("plot", "svg"), ("report", "html")):
        picture = tmp_path / f"branch.{suffix}"
        assert run([command, file, "-o", str(picture)]) == 0
        assert "contact opens" in picture.read_text(encoding="utf-8")


def test_linear_models_state_their_contacts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = str(MODELS / "contact" / "rope_pendulum.yaml")
    for command in ("modes", "linearize"):
        file, page = str(tmp_path / f"{command}.h5"), str(tmp_path / f"{command}.html")
        assert run([command, model, "--equilibrium", "--json", "-o", file]) == 0
        found = json.loads(capsys.readouterr().out)
        schema(command)(found)
        assert [x["state"] for x in found["operating_point"]["contacts"]] == ["closed"]
        assert run(["report", file, "-o", page]) == 0
        capsys.readouterr()
    page = str(tmp_path / "mode.html")
    assert run(["animate", str(tmp_path / "modes.h5"), "--mode", "1", "-o", page]) == 0
    capsys.readouterr()
    cradle = str(MODELS / "contact" / "newtons_cradle.yaml")
    assert run(["modes", cradle]) == 3
    assert "newtons_cradle.yaml:" in (said := capsys.readouterr().err)
    assert "`hit[3]` touches without a force, and closes or opens" in said


CONICAL = """
coordinates: {x: m, y: m, z: m}
parameters: {m: 2 kg, l: 0.5 m, g: 9.81 m/s^2}
T: m/2*(x'^2 + y'^2 + z'^2)
V: m*g*z
constraints: {rod: x^2 + y^2 + z^2 = l^2}
initial: {x: 0.3 m, y: 0 m, z: -0.4 m, x': 0 m/s, y': 2 m/s, z': 0 m/s}
"""


def test_motions_along_symmetries_are_printed_and_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, file = tmp_path / "conical.yaml", str(tmp_path / "found.h5")
    model.write_text(CONICAL, encoding="utf-8")
    assert run(["equilibrium", str(model), "--steady", "z=-30 cm"]) == 0
    said = capsys.readouterr().out
    assert "speeds   rate(J_1) = 5.71839138" in said  # √(g/0.3 m)
    assert "does not have initial velocities of the file:" in said
    given = ["--steady", "rate(J_1)", "--steady", "J_1=1 kg*m^2/s"]
    assert run(["equilibrium", str(model), *given, "--json"]) == 0
    found = valid(capsys.readouterr().out)
    assert found["steady"] == {"rate(J_1)": None, "J_1": 1.0}
    assert run(["equilibrium", str(model)]) == 0
    assert '--steady "y\'=2" finds a motion with it' in " ".join(capsys.readouterr().out.split())
    along = ["--along", "rate(J_1)=5 rad/s:9 rad/s"]
    assert run(["equilibrium", str(model), *along, "-o", file, "--json"]) == 0
    assert valid(capsys.readouterr().out)["parameter"] == "rate(J_1)"
    assert run(["info", file]) == 0
    assert "rate(J_1) from 5 to 9" in capsys.readouterr().out
    for command, suffix in (("plot", "svg"), ("report", "html")):
        assert run([command, file, "-o", str(tmp_path / f"branch.{suffix}")]) == 0
    capsys.readouterr()
    assert run(["modes", str(model), "--steady", "rate(J_1)=6 rad/s"]) == 0
    assert "axes that move along with the steady motion" in capsys.readouterr().out
    for command in ("equilibrium", "modes"):
        assert run([command, str(model), "--steady", "zz=1"]) == 2
        assert "--steady zz: error[unknown-name]" in capsys.readouterr().err
    assert run(["equilibrium", str(model), "--steady", "z=1 parsec7"]) == 2
    assert "parsec7" in capsys.readouterr().err


def test_lines_of_equilibria_take_few_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "wire.yaml"
    model.write_text(
        "coordinates: {x: m, y: m}\n"
        "parameters: {m: 1 kg, k: 0.8 1/m, g: 9.81 m/s^2, Omega: 3 rad/s}\n"
        "T: m/2*(x'^2 + y'^2 + Omega^2*x^2)\nV: m*g*y\nconstraints: {wire: y = k*x^2}\n"
        "initial: {x: {guess: 0.1}, y: {guess: 0}, x': 0, y': {guess: 0}}\n",
        encoding="utf-8",
    )
    along = ["--along", "Omega=3 rad/s:5 rad/s", "--branches"]
    assert run(["equilibrium", str(model), *along]) == 0
    said = capsys.readouterr().out
    assert len(said.splitlines()) < 25
    assert "branch point (line of equilibria) on branch 0: Omega = 3.96181776461" in said
    assert "all of it is a line of equilibria at Omega = 3.96181776461" in said
    assert "stable 3 to 3.96182; unstable 3.96182 to 5" in said


GOVERNOR = """\
coordinates: {th: rad, a: rad}
parameters: {m: 2 kg, l: 50 cm, g: 9.81 m/s^2, J: 0.3 kg*m^2, P: 1 kN, k: 30 N*m}
T: m*l^2*(a'^2 + sin(a)^2*th'^2) + J/2*th'^2
V: -2*m*g*l*cos(a) + k/2*a^2 - P*l/1000*sin(a)
initial: {th: 0, a: 20 deg, th': 60 rpm, a': 0}
simulation: {t_end: 1 s}
"""


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--steady", "th'=60"], 'as in --steady "th\'=60 rpm"'),
        (["--steady", "th'=60 kg"], "must be in rad/s, not in kg"),
        (["--steady", "th'+a'=60 kg"], "`th'+a'` is in rad/s, and its value in kg"),
        (["--steady", "th'+a'=m"], "`th'+a'` is in rad/s, and its value in kg"),
        (["--steady", "p_th=3 kg"], "`p_th` is in kg*m^2/s, and its value in kg"),
        (["--steady", "rate(p_th)=6 m/s"], "`rate(p_th)` is in 1/s, and its value in m/s"),
        (["--along", "P=0:3"], 'as in --along "P=0:3 kN"'),
        (["--along", "P=0:3 kg"], "`P` is in kN in the file, and in kg here"),
        (["--along", "th'=10:60"], 'as in --along "th\'=10:60 rpm"'),
        (["--along", "p_th=1:2 kg"], "`p_th` is in kg*m^2/s, and its value in kg"),
    ],
)
def test_values_of_steady_motions_have_their_dimension(
    options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "governor.yaml").write_text(GOVERNOR)
    assert run(["equilibrium", str(tmp_path / "governor.yaml"), *options]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("value", "expected"),
    [("th'=60 rpm", 2 * math.pi), ("p_th=3 N*mm*s", 0.003), ("rate(p_th)=60 rpm", 2 * math.pi)],
)
def test_values_of_steady_motions_are_converted_to_si(
    value: str, expected: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "governor.yaml").write_text(GOVERNOR)
    model = str(tmp_path / "governor.yaml")
    assert run(["equilibrium", model, "--steady", value, "--json"]) == 0
    steady = json.loads(capsys.readouterr().out)["steady"]
    assert list(steady.values()) == pytest.approx([expected])


def test_the_unit_after_the_last_value_is_that_of_both_ends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "governor.yaml").write_text(GOVERNOR)
    model = str(tmp_path / "governor.yaml")
    assert run(["equilibrium", model, "--along", "P=1:2 kN", "--json"]) == 0
    (branch,) = json.loads(capsys.readouterr().out)["branches"]
    assert (branch["parameter"][0], branch["parameter"][-1]) == pytest.approx((1000, 2000))


def test_a_branch_that_ends_within_the_range_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "root.yaml"
    model.write_text(
        "coordinates: [x]\nparameters: {s: 0}\nT: x'^2/2\n"
        "V: (x - 3)^2*sqrt(2 - s)/2 + x^4/4\ninitial: {x: 1, x': 0}\n"
    )
    for end, stops in (("4", True), ("1.5", False)):
        assert run(["equilibrium", str(model), "--along", f"s=0:{end}"]) == 0
        assert ("no further point was found" in capsys.readouterr().out) == stops


SAMPLED = str(MODELS / "contact" / "sampled_pendulum.yaml")
LEFT_OUT = "event `sample`, every T_s from delay, is left out"


@pytest.mark.parametrize(
    "command",
    [
        ["equilibrium"],
        ["equilibrium", "--along", "g=9 m/s^2:10 m/s^2"],
        ["modes", "--equilibrium"],
        ["linearize"],
    ],
)
def test_clocked_events_that_are_left_out_are_named(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sampled controller holds the pendulum, which the analyses call unstable."""
    name, *options = command
    assert run([name, SAMPLED, *options]) == 0
    assert LEFT_OUT in " ".join(capsys.readouterr().out.split())
    assert run([name, SAMPLED, *options, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert any(LEFT_OUT in note for note in content["notes"])
    file, page = str(tmp_path / "analysis.h5"), tmp_path / "page.html"
    assert run([name, SAMPLED, *options, "-o", file]) == 0
    assert run(["info", file]) == 0
    assert LEFT_OUT in " ".join(capsys.readouterr().out.split())
    assert run(["report", file, "-o", str(page)]) == 0
    assert "is left out" in page.read_text()
