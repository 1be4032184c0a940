"""FMUs simulate as lagcli does, with other parameters and initial values, too."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmi import FmuError, Unpacked, with_another_word
from random_cases import some

import lagcli
from lagcli.errors import UsageError

MODELS = Path(lagcli.__file__).parents[1] / "models"
#: Smooth, redundant, nonholonomic, with tables, stiff friction, contacts, events, clocks.
NAMES = (
    "slider_crank",
    "parallelogram",
    "rolling_disk",
    "car_on_road",
    "contact/bouncing_ball",
    "contact/stick_slip_belt",
    "contact/sampled_pendulum",
    "contact/woodpecker",
)
PENDULUM = """
coordinates: {x: m, y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, l: 0.5 m, r: l/4, F: 0 N}
T: m*(x'^2 + y'^2)/2
V: m*g*y
Q: {x: F}
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: l*sin(30 deg), y: {guess: -l}, x': 0, y': {guess: 0}}
simulation: {t_end: 2 s, rtol: 1e-10, atol: 1e-12}
outputs: {lever: r + x}
"""


def unpacked(model: Any, folder: Path, version: str = "2.0", **options: Any) -> Unpacked:
    try:
        content = lagcli.fmu(model, version, **{"icon": False} | options)
    except UsageError as error:
        if "has no name for this platform" in str(error):
            pytest.skip(str(error))
        raise
    return Unpacked(content, folder / version)


def columns(run: Any, names: list[str]) -> Any:
    """Return columns of a run by their names in files."""
    found = {}
    for i, q in enumerate(run.coordinates):
        found |= {q: run.q[:, i], f"{q}_dot": run.v[:, i], f"{q}_ddot": run.a[:, i]}
        found[f"Qc.{q}"] = run.constraint_force[:, i]
    found |= {f"lambda.{c}": run.multipliers[:, i] for i, c in enumerate(run.constraints)}
    found |= {"energy_total": run.energy_total, **run.outputs}
    return np.array([found[name] for name in names]).T


def names_of(run: Any) -> list[str]:
    names = [f"{q}{x}" for x in ("", "_dot", "_ddot") for q in run.coordinates]
    names += [f"Qc.{q}" for q in run.coordinates if len(run.constraints)]
    return [*names, *(f"lambda.{c}" for c in run.constraints), "energy_total", *run.outputs]


@pytest.mark.parametrize("version", some(["3.0", "2.0"], 1))
@pytest.mark.parametrize("name", NAMES)
def test_a_co_simulation_is_a_run(name: str, version: str, tmp_path: Path) -> None:
    model = lagcli.load(str(MODELS / f"{name}.yaml"))
    run = lagcli.simulate(model)
    count = len(run.time) // 4
    instance = unpacked(model, tmp_path, version).instance()
    names = names_of(run)
    values = instance.simulate(run.time[:count], names)
    instance.free()
    expected = columns(run, names)[:count]
    size = np.abs(expected).max(axis=0) + 1e-9
    # the steps end at other times, so that the errors differ
    assert np.abs(values - expected).max() == pytest.approx(0.0, abs=1e-6 * size.max())
    assert (np.abs(values - expected) <= 1e-6 * size + 1e-9).all()


def test_parameters_and_initial_values_that_are_set(tmp_path: Path) -> None:
    """Against runs with --set and --set-initial; guesses follow, and dependent parameters."""
    fmu = unpacked(lagcli.load_text(PENDULUM), tmp_path)
    rng = np.random.default_rng(5)
    for _ in range(6):
        length = float(rng.uniform(0.3, 2.0))
        given = {"m": float(rng.uniform(0.5, 3.0)), "l": length}
        initial = {"x": float(rng.uniform(-0.9, 0.9)) * length, "x'": float(rng.normal())}
        model = lagcli.load_text(PENDULUM, set=given, set_initial=initial)
        run = lagcli.simulate(model)
        instance = fmu.instance()
        names = [*names_of(run)]
        start = {**given, "x": initial["x"], "x_dot": initial["x'"]}
        values = instance.simulate(run.time[:40], names, start)
        assert instance.get("r") == [pytest.approx(length / 4, rel=1e-15)]
        instance.free()
        expected = columns(run, names)[:40]
        assert (np.abs(values - expected) <= 1e-7 * (1 + np.abs(expected))).all()


def test_the_initial_state_follows_what_is_set_before_it_begins(tmp_path: Path) -> None:
    instance = unpacked(lagcli.load_text(PENDULUM), tmp_path).instance()
    instance.begin(0.0, {"l": 1.0})
    x, y = instance.get("x", "y")
    assert (x, y) == (pytest.approx(0.5), pytest.approx(-np.sqrt(0.75)))
    with pytest.raises(FmuError, match="parameters are fixed once the simulation has begun"):
        instance.set({"l": 2.0})
    with pytest.raises(FmuError, match="cannot be set now"):
        instance.set({"x": 0.1})
    instance.call("Reset")
    instance.begin(0.0)
    assert instance.get("l") == [0.5]
    instance.free()


#: A shaker that moves a table, with springs on one side of x and of y: branches beside a table.
SHAKER = """
coordinates: [x, y]
parameters: {k: 3, l: 0.2}
inputs: {u: {times: [0, 0.5, 1, 1.5], values: [-0.5, 0.3, 0.2, 0.9], interpolation: cubic}}
T: (x'^2 + y'^2)/2
V: k/2*max(y, 0)^2 + k/2*max(0.1 - x, 0)^2
constraints: {cam: x = u + l*sin(y)}
initial: {x: {guess: 0}, y: 0.3, x': {guess: 0}, y': 1}
simulation: {t_end: 1.5, samples: 16}
"""


def test_the_initial_state_of_a_model_with_a_table_and_branches(tmp_path: Path) -> None:
    """What is fixed remains so, and x follows the table: x = u(0) + l sin y."""
    instance = unpacked(lagcli.load_text(SHAKER), tmp_path).instance()
    run = lagcli.simulate(lagcli.load_text(SHAKER, set={"k": 2, "l": 0.25}))
    values = instance.simulate(run.time, ["x", "y", "x_dot", "y_dot"], {"k": 2.0, "l": 0.25})
    x, y, _, rate = values[0]
    assert (x, y, rate) == (pytest.approx(0.25 * np.sin(0.3) - 0.5, rel=1e-14), 0.3, 1.0)
    np.testing.assert_allclose(values, np.hstack([run.q, run.v]), rtol=0, atol=1e-7)
    instance.free()


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"x": 0.7}, "do not satisfy the constraints"),
        ({"x": 0.5, "x_dot": 1.0}, "do not satisfy the constraints"),
        ({"r": 0.1}, "computes from others cannot be set"),
        ({"lambda.rod": 0.1}, "cannot be set now"),
        ({"m": float("nan")}, "not finite"),
    ],
)
def test_what_cannot_be_set(start: dict[str, float], message: str, tmp_path: Path) -> None:
    instance = unpacked(lagcli.load_text(PENDULUM), tmp_path).instance()
    with pytest.raises(FmuError, match=message):
        instance.begin(0.0, start)
    instance.free()


def test_an_input_acts_from_a_communication_point_on(tmp_path: Path) -> None:
    """A force that is switched on is one that a table switches on."""
    fmu = unpacked(lagcli.load_text(PENDULUM), tmp_path, inputs=["F"])
    assert fmu.variables["F"].get("causality") == "input"
    instance = fmu.instance()
    instance.begin(0.0)
    force = {0.0: 0.0, 0.5: 3.0, 1.0: -2.0}
    for i in range(150):
        t = i / 100
        if t in force:
            instance.set({"F": force[t]})
        instance.step(t, 0.01)
    values = instance.get("x", "y", "lambda.rod")
    instance.free()
    rows = "times: [0, 0.5, 1], values: [0, 3, -2], unit: N, interpolation: step, extend: hold"
    text = PENDULUM.replace(", F: 0 N", "")
    model = lagcli.load_text(f"{text}inputs: {{F: {{{rows}}}}}\n")
    run = lagcli.simulate(model, t_end=1.5)
    expected = [run.q[-1, 0], run.q[-1, 1], run.multipliers[-1, 0]]
    assert values == pytest.approx(expected, rel=1e-7)


def test_inputs_and_versions_that_cannot_be() -> None:
    model = lagcli.load_text(PENDULUM)
    with pytest.raises(UsageError, match=r"there is no FMI 1\.0; known are 2\.0, 3\.0"):
        lagcli.fmu(model, "1.0")
    with pytest.raises(UsageError, match=r"--input r: .* computed or structural"):
        lagcli.fmu(model, inputs=["r"])
    with pytest.raises(UsageError, match=r"--input k: .* unknown"):
        lagcli.fmu(model, inputs=["k"])
    with pytest.raises(UsageError, match="--input m: the kinetic energy depends on it"):
        lagcli.fmu(lagcli.load("bouncing_ball"), inputs=["m"])
    with pytest.raises(UsageError, match="--input l: the constraint `rod` depends on it"):
        lagcli.fmu(model, inputs=["l"])
    with pytest.raises(UsageError, match="--input a: the event `on` sets `b`"):
        lagcli.fmu(
            lagcli.load_text(
                "coordinates: [x]\nparameters: {a: 1, b: 2*a}\nT: x'^2/2\nQ: {x: b}\n"
                "events: {on: {when: t >= 1, set: {b: 3}}}\ninitial: {x: 0, x': 1}\n"
            ),
            inputs=["a"],
        )


@pytest.mark.parametrize("name", ["pendulum_cartesian", "chaplygin_sleigh"])
def test_model_exchange(name: str, tmp_path: Path) -> None:
    """Integrated by the classical Runge-Kutta method, with h^4 of error."""
    model = lagcli.load(str(MODELS / f"{name}.yaml"))
    fmu = unpacked(model, tmp_path)
    n = len(model.coordinates)
    run = lagcli.simulate(model, t_end=1.0, rtol=1e-11)
    expected = np.concatenate([run.q[-1], run.v[-1]])
    instance = fmu.instance(exchange=True)
    values = instance.exchanged(1.0, 1000, 2 * n)
    instance.free()
    assert values == pytest.approx(expected, abs=1e-8)
    listed = fmu.description.find("ModelStructure/Derivatives")
    assert listed is not None
    assert len(listed) == 2 * n


@pytest.mark.parametrize(
    "text",
    [
        "coordinates: [x]\nT: x'^2/2\ninitial: {x: 0, x': 1}\nsimulation: {t_end: 1}",
        "coordinates: [x]\nT: x'^2/2\nV: x^2/2\nQ: {x: -0.3*sign(x')}\n"
        "initial: {x: 2, x': 0}\nsimulation: {t_end: 9}",
    ],
    ids=["without parameters", "forces that jump"],
)
def test_models_of_other_shapes(text: str, tmp_path: Path) -> None:
    model = lagcli.load_text(text)
    run = lagcli.simulate(model)
    instance = unpacked(model, tmp_path).instance()
    values = instance.simulate(run.time[::50], ["x", "x_dot", "x_ddot", "energy_total"])
    instance.free()
    expected = columns(run, ["x", "x_dot", "x_ddot", "energy_total"])[::50]
    assert values == pytest.approx(expected, abs=1e-6)


def test_contacts_are_for_co_simulation_alone(tmp_path: Path) -> None:
    fmu = unpacked(lagcli.load("bouncing_ball"), tmp_path)
    assert fmu.description.find("ModelExchange") is None


def test_an_event_ends_the_simulation(tmp_path: Path) -> None:
    for version in ("2.0", "3.0"):
        model = lagcli.load(str(MODELS / "contact" / "particle_on_sphere.yaml"))
        run = lagcli.simulate(model)
        instance = unpacked(model, tmp_path, version).instance()
        instance.begin(0.0)
        t, ended = 0.0, False
        while not ended:
            ended = instance.step(t, 0.1)
            t += 0.1
        assert run.events is not None
        assert t - 0.1 < run.events.time[-1] <= t
        names = [*model.coordinate_names]
        assert instance.get(*names) == pytest.approx(run.events.q[-1].tolist(), rel=1e-9)
        instance.free()


def test_a_failure_is_reported_with_its_time(tmp_path: Path) -> None:
    text = """
coordinates: {x: m}
parameters: {m: 1 kg, k: 1 N/m, F: 1 N, d: 1 m}
T: m*x'^2/2
V: k*x^2/2
Q: {x: F/(1 - x/d)}
initial: {x: 0, x': 3}
simulation: {t_end: 0.1 s}
"""
    instance = unpacked(lagcli.load_text(text), tmp_path).instance()
    instance.begin(0.0)
    with pytest.raises(FmuError, match=r"at t = 0\.\d+ s: "):
        instance.step(0.0, 5.0)
    instance.free()


@pytest.mark.parametrize(("rod", "passes"), [(1.0, False), (1.0001, True)])
def test_a_singular_configuration_is_not_passed(rod: float, passes: bool, tmp_path: Path) -> None:
    """A slider-crank with arms of equal length is singular where the slider is at its axis."""
    text = f"""
coordinates: {{a: rad, b: rad, x: m}}
parameters: {{m: 1 kg, l: 1 m, r: {rod} m, J: 1 kg*m^2}}
T: J*a'^2/2 + J*b'^2/2 + m*x'^2/2
V: 0
constraints: {{along: l*cos(a) + r*cos(b) = x, across: l*sin(a) = r*sin(b)}}
initial:
  {{a: 0.3, b: {{guess: 0.3}}, x: {{guess: 1.9}}, a': 2, b': {{guess: 2}}, x': {{guess: -1}}}}
simulation: {{t_end: 2}}
"""
    model = lagcli.load_text(text)
    run = lagcli.simulate(model)
    assert (run.status == "completed") == passes
    instance = unpacked(model, tmp_path).instance()
    instance.begin(0.0)
    if passes:
        for i in range(40):
            instance.step(i / 20, 0.05)
        assert instance.get("a", "b", "x") == pytest.approx(run.q[-1].tolist(), rel=1e-6)
    else:
        with pytest.raises(FmuError, match="singular"):
            instance.step(0.0, 2.0)
    instance.free()


@pytest.mark.parametrize(("angle", "begins"), [(-1e-3, True), (0.0, False)])
def test_a_singular_start_is_refused(angle: float, begins: bool, tmp_path: Path) -> None:
    """Redundant constraints, which are singular where all links are in one line."""
    values = {"alpha_1": angle, "alpha_2": angle, "alpha_3": angle}
    model = lagcli.load("parallelogram")
    run = lagcli.simulate(lagcli.load("parallelogram", set_initial=values), t_end=0.1)
    assert (run.status == "completed") == begins
    instance = unpacked(model, tmp_path).instance()
    if begins:
        instance.begin(0.0, values)
        instance.step(0.0, 0.1)
        found = instance.get("alpha_1", "alpha_2", "alpha_3", "beta")
        assert found == pytest.approx(run.q[-1].tolist(), rel=1e-7)
    else:
        assert "the start is a singular configuration" in run.message
        with pytest.raises(FmuError, match="the constraints are singular at the initial state"):
            instance.begin(0.0, values)
    instance.free()


def test_damaged_resources_are_refused(tmp_path: Path) -> None:
    fmu = unpacked(lagcli.load("slider_crank"), tmp_path)
    rng = np.random.default_rng(7)
    for name in ("model.bin", "values.bin"):
        path = fmu.folder / "resources" / name
        whole = path.read_bytes()
        path.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(FmuError, match=f"{name} is damaged"):
            fmu.instance()
        for _ in range(60):  # none of them may crash
            path.write_bytes(with_another_word(whole, rng))
            try:
                instance = fmu.instance()
            except FmuError:
                continue
            try:
                instance.begin(0.0)
                instance.step(0.0, 0.001)
            except FmuError:
                pass
            instance.free()
        path.unlink()
        with pytest.raises(FmuError, match="cannot open"):
            fmu.instance()
        path.write_bytes(whole)
    shutil.rmtree(fmu.folder)


def test_a_step_begins_where_the_last_one_ended(tmp_path: Path) -> None:
    instance = unpacked(lagcli.load("pendulum_cartesian"), tmp_path).instance()
    instance.begin(0.0)
    instance.step(0.0, 0.1)
    with pytest.raises(FmuError, match=r"from t = 0\.3 s is not possible: .* at t = 0\.1 s"):
        instance.step(0.3, 0.1)
    instance.free()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_units_of_multipliers_and_forces(version: str, tmp_path: Path) -> None:
    """2 λ x is a force: λ has N/m, in the bases of SI."""
    fmu = unpacked(lagcli.load_text(PENDULUM), tmp_path, version)
    bases = {}
    for unit in fmu.description.findall("UnitDefinitions/Unit"):
        base = unit.find("BaseUnit")
        assert base is not None
        bases[unit.get("name")] = {key: int(x) for key, x in base.attrib.items()}

    def base_of(name: str) -> dict[str, int]:
        variable = fmu.variables[name]
        return bases[(variable if version == "3.0" else variable[0]).get("unit")]

    assert base_of("lambda.rod") == {"kg": 1, "s": -2}
    assert base_of("Qc.x") == base_of("F") == {"kg": 1, "m": 1, "s": -2}
    assert base_of("energy_total") == {"kg": 1, "m": 2, "s": -2}
    assert base_of("x_dot") == {"m": 1, "s": -1}


def test_without_changes_the_start_is_that_of_the_run(tmp_path: Path) -> None:
    """To the last bit, also where parameters depend on others."""
    model = lagcli.load_text(PENDULUM)
    run = lagcli.simulate(model)
    instance = unpacked(model, tmp_path).instance()
    instance.begin(0.0, {"m": 2.0, "x": float(run.q[0, 0])})
    expected = [*run.q[0], *run.v[0], run.multipliers[0, 0]]
    assert instance.get("x", "y", "x_dot", "y_dot", "lambda.rod") == expected
    instance.free()


def test_the_same_model_is_the_same_file() -> None:
    model = lagcli.load("pendulum_cartesian")
    assert lagcli.fmu(model) == lagcli.fmu(model)


def test_a_folder_with_blanks_and_letters(tmp_path: Path) -> None:
    instance = unpacked(lagcli.load("pendulum_cartesian"), tmp_path / "größe 1 %41").instance()
    instance.begin(0.0)
    instance.free()


def wheel(folder: Path, platform: str, suffix: str, content: bytes) -> None:
    name = f"lagcli-{lagcli.__version__}-py3-none-{platform}.whl"
    with zipfile.ZipFile(folder / name, "w") as file:
        file.writestr(f"lagcli/engine/core/liblagcore.{suffix}", content)


def test_libraries_of_other_platforms_come_from_wheels(tmp_path: Path) -> None:
    wheel(tmp_path, "win_amd64", "dll", b"windows")
    wheel(tmp_path, "macosx_11_0_arm64", "dylib", b"mac")
    model = lagcli.load("pendulum_cartesian")
    two = unpacked(model, tmp_path, wheels=str(tmp_path))
    three = unpacked(model, tmp_path, "3.0", wheels=str(tmp_path))
    assert "binaries/win64/pendulum_cartesian.dll" in two.names
    assert not any("darwin" in name for name in two.names)
    own = three.folder / "binaries"
    assert (own / "aarch64-darwin" / "pendulum_cartesian.dylib").read_bytes() == b"mac"
    assert (own / "x86_64-windows" / "pendulum_cartesian.dll").read_bytes() == b"windows"
    assert len(list(own.iterdir())) == 3
    (tmp_path / f"lagcli-{lagcli.__version__}-py3-none-win_amd64.whl").write_bytes(b"no zip")
    with pytest.raises(UsageError, match="cannot read the library"):
        lagcli.fmu(model, wheels=str(tmp_path))
