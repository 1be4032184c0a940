"""Directional derivatives of FMUs, next to differences, to `lagcli.dynamics` and a closed form."""

from __future__ import annotations

import ctypes
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import exported, points
from fmi import FmuError, Unpacked, with_another_word
from shipped import PATHS, every_model
from stepped_inputs import as_parameter
from test_fmu import PENDULUM, unpacked

import lagcli
from lagcli.export.dynamics import DynamicsFunction

#: A block that sticks to the floor by two feet.
FEET = """
coordinates: {x: m, y: m, a: rad}
parameters: {m: 2 kg, J: 1 kg m^2, g: 10 m/s^2, b: 0.5 m}
T: m/2*(x'^2 + y'^2) + J/2*a'^2
V: m*g*y
constraints:
  left: {expr: y - b*a >= 0, friction: 0.5, slip: x', restitution: 0}
  right: {expr: y + b*a >= 0, friction: 0.5, slip: x', restitution: 0}
initial: {x: 0, y: 0, a: 0, x': 0, y': 0, a': 0}
simulation: {t_end: 1 s}
"""


def state_names(model: lagcli.Model) -> list[str]:
    return [f"{q}{x}" for x in ("", "_dot") for q in model.coordinate_names]


def outputs_of(fmu: Unpacked) -> list[str]:
    """Return the outputs: coordinates, rates, λ, forces, energies, powers and the model's own."""
    return [name for name, x in fmu.variables.items() if x.get("causality") == "output"]


def difference(instance: Any, names: list[str], t: float, x: Any, j: int) -> tuple[Any, Any]:
    """Return a central difference by state j, or the time, with the error that rounding has."""
    h = 1e-5 * max(1e-2, abs(x[j]) if j >= 0 else 1.0)
    values = []
    for sign in (-1, 1):
        moved = x.copy()
        if j >= 0:
            moved[j] += sign * h
        instance.move(t if j >= 0 else t + sign * h, moved)
        values.append(np.array(instance.get(*names)))
    instance.move(t, x)
    return (values[1] - values[0]) / (2 * h), np.abs(values).max() * 1e-15 / h


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_derivatives_of_all_outputs_are_those_of_differences(name: str, tmp_path: Path) -> None:
    """Along the time and each state, at a state of a run that is moved off the constraints."""
    model, version = exported(name).model, "3.0" if len(name) % 2 else "2.0"
    fmu = unpacked(model, tmp_path, version)
    kind = fmu.description.find("CoSimulation")
    assert kind is not None
    assert any(key.startswith("providesDirectional") for key in kind.attrib)
    if fmu.description.find("ModelExchange") is None or exported(name).redundant:
        return  # with tables, or only along motions: see below
    states, names, point = state_names(model), outputs_of(fmu), points(name)[0]
    x = np.concatenate([point.q, point.v])
    instance = fmu.instance(exchange=True)
    instance.begin(0.0)
    instance.move(point.t, x)
    for j in range(len(states)):
        found = instance.directional(names, [states[j]], [1.0])
        expected, rounding = difference(instance, names, point.t, x, j)
        size = max(np.abs(expected).max(), 1e-3)
        assert np.abs(found - expected).max() <= 1e-6 * size + 10 * rounding, states[j]
    instance.free()


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_derivatives_are_those_of_the_dynamics(name: str, tmp_path: Path) -> None:
    """Of a and λ by time, states and parameters, to 1e-9: two eliminations of one matrix.

    In a co-simulation, also with tables. Parameters that follow from others change with these.
    """
    model = exported(name).model
    fmu = unpacked(model, tmp_path, "2.0" if len(name) % 2 else "3.0")
    f, states = DynamicsFunction(exported(name)), state_names(model)
    instance = fmu.instance()
    instance.begin(f.t)
    instance.step(f.t, 0.3)
    x, nq = np.array(instance.get(*states)), len(f.coordinates)
    p = np.array(instance.get(*f.parameters)) if f.parameters else np.zeros(0)
    slopes = f.derivatives(f.t + 0.3, x[:nq], x[nq:], p)
    set_ = [n for n in f.parameters if fmu.variables[n].get("causality") == "parameter"]
    knowns = [*(["time"] if "time" in fmu.variables else []), *states, *set_]
    unknowns = [f"{q}_ddot" for q in f.coordinates] + [f"lambda.{c}" for c in f.constraints]
    seed = np.random.default_rng(3).normal(size=len(knowns))
    of_p = instance.directional(f.parameters, knowns, seed)
    of_x = instance.directional(states, knowns, seed)
    of_t = instance.directional(["time"], knowns, seed)[0] if instance.three else 0.0
    found = instance.directional(unknowns, knowns, seed)
    for own, kind in ((found[:nq], "a"), (found[nq:], "multipliers")):
        t, q, v, by_p = (getattr(slopes, f"{kind}_{x}") for x in "tqvp")
        parts = [t * of_t, q @ of_x[:nq], v @ of_x[nq:], by_p @ of_p]
        size = np.abs(parts).max(initial=1e-6)
        assert np.abs(own - sum(parts)).max(initial=0.0) <= 1e-9 * size
    if instance.three:  # weights w of the unknowns: w J seed by both
        weights = np.random.default_rng(4).normal(size=len(found))
        adjoint = instance.directional(unknowns, knowns, weights, adjoint=True)
        size = np.abs(adjoint * seed).max()
        assert adjoint @ seed == pytest.approx(weights @ found, abs=1e-9 * size)
    instance.free()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_with_redundant_constraints_they_are_those_along_motions(
    version: str, tmp_path: Path
) -> None:
    """λ of least norm turns with the rods: dλ/dt along the motion, next to differences of h²."""
    fmu = unpacked(lagcli.load("parallelogram"), tmp_path, version)
    names, states = outputs_of(fmu), state_names(lagcli.load("parallelogram"))
    for start in (0.1, 0.37):
        values, h = [], 1e-4
        for t in (start - h, start, start + h):
            one = fmu.instance()
            one.begin(0.0)
            one.step(0.0, t)
            values.append(np.array(one.get(*names)))
            if t != start:
                one.free()
                continue
            rates = one.get(*states[len(states) // 2 :], *(f"{q[:-4]}_ddot" for q in states[4:]))
            time, seed = (["time"], [1.0]) if version == "3.0" else ([], [])
            found = one.directional(names, [*time, *states], [*seed, *rates])
            if version == "3.0":
                weights = np.random.default_rng(2).normal(size=len(names))
                adjoint = one.directional(names, [*time, *states], weights, adjoint=True)
                assert adjoint @ [*seed, *rates] == pytest.approx(weights @ found, rel=1e-10)
            one.free()
        expected = (values[2] - values[0]) / (2 * h)
        assert np.abs(found - expected).max() <= 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_pendulum_has_the_derivatives_of_its_closed_form(version: str, tmp_path: Path) -> None:
    """2 λ l² = F x - m g y - m v²: of a force F as an input, of m, and of l through r = l/4."""
    fmu = unpacked(lagcli.load_text(PENDULUM), tmp_path, version, inputs=["F"])
    instance = fmu.instance()
    instance.begin(0.0, {"F": 1.5})
    instance.step(0.0, 0.4)
    x, y, u, v = instance.get("x", "y", "x_dot", "y_dot")
    m, g, length = 2.0, 9.81, 0.5

    def slope(unknown: str, known: str) -> float:
        return float(instance.directional([unknown], [known], [1.0])[0])

    square = 2 * length**2
    assert slope("lambda.rod", "F") == pytest.approx(-x / square, rel=1e-12)
    expected = (g * y - u**2 - v**2) / square
    assert slope("lambda.rod", "m") == pytest.approx(expected, rel=1e-12)
    assert slope("x_ddot", "F") == pytest.approx(y**2 / (m * length**2), rel=1e-12)
    assert slope("lever", "l") == pytest.approx(0.25, rel=1e-15)
    assert slope("r", "l") == pytest.approx(0.25, rel=1e-15)
    assert slope("lever", "x") == 1.0
    assert slope("x_dot", "x_dot") == 1.0
    assert slope("energy_total", "y") == pytest.approx(m * g, rel=1e-12)
    with pytest.raises(FmuError, match="no derivatives with respect to"):
        slope("x_ddot", "lambda.rod")
    with pytest.raises(FmuError, match="no derivatives with respect to"):
        slope("x_ddot", "r")
    instance.free()


SWITCHING = [
    pytest.param(name, marks=[] if name in ("woodpecker", "rope_pendulum") else [pytest.mark.slow])
    for name, path in PATHS.items()
    if path.parent.name == "contact" and name != "appell_hamel"
]


@pytest.mark.parametrize("name", SWITCHING)
def test_those_of_a_model_that_switches_are_those_of_its_modes(name: str, tmp_path: Path) -> None:
    """Along the motion, next to one-sided differences of h², away from events."""
    model = lagcli.load(name)
    fmu, names, states = unpacked(model, tmp_path, "3.0"), [], state_names(model)
    names, nq, random = outputs_of(fmu), len(model.coordinate_names), np.random.default_rng(3)
    end, one, t, compared = float(model.settings.t_end or 0.0), fmu.instance(), 0.0, 0
    h = 2e-6 * end
    one.begin(0.0)
    for size in 0.05 * end * (0.3 + 0.7 * random.random(15)):
        if one.step(t, size):
            break
        t += size
        rates = one.get(*states[nq:], *(f"{q}_ddot" for q in model.coordinate_names))
        state = one.save()
        try:
            found = one.directional(names, ["time", *states], [1.0, *rates])
            weights = random.normal(size=len(names))
            adjoint = one.directional(names, ["time", *states], weights, adjoint=True)
        except FmuError as error:
            if "contacts share a force" not in str(error):
                raise
            one.forget(state)
            continue
        scale = np.abs(adjoint * [1.0, *rates]).max()
        assert adjoint @ [1.0, *rates] == pytest.approx(weights @ found, abs=1e-9 * scale + 1e-12)
        two, values, events = fmu.instance(events=True, early=True), [], False
        two.restore_from(one.serialize(state))
        one.forget(state)
        for k in range(3):
            values.append(np.array(two.get(*names)))
            events |= two.step3(t + k * h, h).event
        two.free()
        if not events:
            expected = (-3 * values[0] + 4 * values[1] - values[2]) / (2 * h)
            size = max(np.abs(expected).max(), 1e-3)
            assert np.abs(found - expected).max() <= 1e-6 * size
            compared += 1
    one.free()
    assert compared > 4


@pytest.mark.parametrize("kind", ["sliding, sticking and leaving the floor", "forces that jump"])
def test_a_model_that_switches_has_derivatives_by_its_inputs(kind: str, tmp_path: Path) -> None:
    fmu = unpacked(lagcli.load_text(as_parameter(kind)), tmp_path, "2.0", inputs=["F"])
    names, one, h = outputs_of(fmu), fmu.instance(), 1e-4
    one.begin(0.0, {"F": 13.0})
    one.step(0.0, 0.6)
    found, values = one.directional(names, ["F"], [1.0]), []
    for force in (13.0 - h, 13.0 + h):
        one.set({"F": force})
        values.append(np.array(one.get(*names)))
    expected = (values[1] - values[0]) / (2 * h)
    assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max()
    one.free()


def test_a_model_that_switches_with_redundant_constraints_says_that_it_has_none(
    tmp_path: Path,
) -> None:
    model = lagcli.load_text(
        "coordinates: [x, y]\nT: x'^2/2 + y'^2/2\nV: y\n"
        "constraints: {line: x - y = 0, again: 2*x - 2*y = 0}\n"
        "events: {far: {when: x <= -3, stop: true}}\n"
        "initial: {x: 0, y: 0, x': 0, y': 0}\nsimulation: {t_end: 1}\n"
    )
    for version in ("2.0", "3.0"):
        fmu = unpacked(model, tmp_path / version, version)
        kind = fmu.description.find("CoSimulation")
        assert kind is not None
        assert not any("Derivative" in key for key in kind.attrib)
        instance = fmu.instance()
        instance.begin(0.0)
        with pytest.raises(FmuError, match="no directional derivatives if its constraints are"):
            instance.directional(["x_ddot"], ["x"], [1.0])
        instance.free()


def test_where_contacts_share_a_force_there_are_none(tmp_path: Path) -> None:
    """A block on two feet, whose friction is not unique: the call is discarded, not an error."""
    fmu = unpacked(lagcli.load_text(FEET), tmp_path, "3.0")
    one = fmu.instance()
    one.begin(0.0)
    one.step(0.0, 0.01)
    with pytest.raises(FmuError, match="contacts share a force"):
        one.directional(["x_ddot"], ["x"], [1.0])
    references, out = (ctypes.c_uint * 1)(fmu.references["x_dot"]), (ctypes.c_double * 1)()
    given = (references, ctypes.c_size_t(1)) * 2
    last = ((ctypes.c_double * 1)(1.0), ctypes.c_size_t(1), out, ctypes.c_size_t(1))
    assert one.call("GetDirectionalDerivative", *given, *last, allowed=(2,)) == 2
    one.step(0.01, 0.01)
    one.free()


@pytest.mark.parametrize("name", ["slider_crank", "parallelogram", "woodpecker"])
def test_damaged_derivatives_are_refused(name: str, tmp_path: Path) -> None:
    """Or have some values: none crashes."""
    model = lagcli.load(name)
    fmu = unpacked(model, tmp_path)
    path = fmu.folder / "resources" / "derivatives.bin"
    whole, rng = path.read_bytes(), np.random.default_rng(7)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FmuError, match=r"derivatives\.bin is damaged"):
        fmu.instance()
    names, states = outputs_of(fmu), state_names(model)
    for _ in range(30):
        path.write_bytes(with_another_word(whole, rng))
        try:
            instance = fmu.instance()
        except FmuError:
            continue
        instance.begin(0.0)
        with suppress(FmuError):
            instance.directional(names, states, np.ones(len(states)))
        instance.free()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_model_whose_only_switch_is_a_smooth_force_by_a_multiplier(
    version: str, tmp_path: Path
) -> None:
    """A rail bears m g, and x'' = -mu g x': its rate along x' is -mu g."""
    model = lagcli.load_text(
        """
coordinates: [x, y]
parameters: {m: 2, mu: 0.1, g: 9.81}
T: m/2*(x'^2 + y'^2)
V: m*g*y
Q: {x: "-mu*lambda.rail*x'"}
constraints: {rail: y = 0}
initial: {x: 0, y: 0, x': 1, y': 0}
simulation: {t_end: 1}
"""
    )
    instance = unpacked(model, tmp_path, version).instance()
    instance.begin(0.0)
    instance.step(0.0, 1.0)
    assert instance.get("x_dot", "lambda.rail") == pytest.approx([np.exp(-0.981), 19.62], rel=1e-7)
    found = instance.directional(["x_ddot", "lambda.rail"], ["x_dot"], [1.0])
    assert found == pytest.approx([-0.981, 0.0], abs=1e-12)
    instance.free()
