"""What can be moved on the page of `lagcli play`: units, ranges, what follows, what is free."""

from __future__ import annotations

from pathlib import Path

import pytest

from lagcli.errors import ModelError
from lagcli.model.loader import load, load_text
from lagcli.play.controls import Control, controls
from lagcli.settings.settings import SettingsOverrides, resolve

MODELS = Path(__file__).parents[3] / "models"


def made(name: str, **settings: float) -> dict[str, Control]:
    model = load(name)
    return controls(model, resolve(SettingsOverrides(**settings), model.settings))


def of(parameters: str, initial: str = "{x: 0, x': 0}") -> dict[str, Control]:
    text = "coordinates: {x: m}\nT: 0*x'^2\nV: 0\n"
    model = load_text(f"{text}parameters: {parameters}\ninitial: {initial}\n")
    return controls(model, resolve(SettingsOverrides(), model.settings))


def test_all_values_are_there_in_the_models_order_and_in_the_files_units() -> None:
    found = made("slider_crank")
    assert list(found) == ["m", "r", "l", "g", "tau", "c", "phi", "phi'", "psi", "psi'", "t_end"]
    m = found["m"]
    assert (m.kind, m.label, m.value, m.unit, m.description) == (
        *("parameter", "m", 1.0, "kg"),
        "mass of A and of B",
    )
    assert (found["phi'"].label, found["phi'"].unit, found["phi'"].value) == ("φ̇", "rad/s", 12)
    assert [name for name, c in found.items() if c.free] == ["psi", "psi'"]
    degrees = made("particle_on_sphere")["theta_0"]
    assert (degrees.value, degrees.unit, degrees.suffix) == (5.0, "deg", " deg")
    cranks = made("parallelogram")["alpha_1"]
    assert (cranks.value, cranks.unit, cranks.low, cranks.high) == (-30.0, "deg", -180.0, 180.0)


@pytest.mark.parametrize(
    ("text", "low", "high", "step"),
    [
        ("2 kg", 0, 4, 0.01),
        ("-3", -6, 0, 0.01),
        ("9.81 m/s^2", 0, 19.65, 0.05 - 0.03),
        ("2.194e-6 kg", 0, 4.4e-6, 1e-8),
        ("0", -1, 1, 0.005),
    ],
)
def test_a_slider_reaches_from_0_to_twice_the_value_in_round_steps(
    text: str, low: float, high: float, step: float
) -> None:
    c = of(f"{{p: {text}}}")["p"]
    assert c.low == pytest.approx(low)
    assert c.high == pytest.approx(high, rel=2e-2)
    assert 200 <= (c.high - c.low) / c.step <= 1000
    assert c.step == pytest.approx(step, rel=0.6)
    for end in (c.low, c.high):
        assert end / c.step == pytest.approx(round(end / c.step), abs=1e-9)


def test_what_is_0_reaches_as_far_as_the_largest_value_of_its_unit() -> None:
    found = of("{l: 3 m, u: 0 N}", "{x: 0 m, x': 0 m/s}")
    assert (found["x"].low, found["x"].high) == (-3, 3)
    assert (found["u"].low, found["u"].high) == (-1, 1)


def test_what_follows_from_others_says_how() -> None:
    found = made("rolling_disk")
    assert found["A"].text == "m*r^2/4"
    assert found["theta"].text == "theta_0"
    assert found["m"].text == found["x"].text == ""
    assert of("{w: {value: 2*pi, unit: rad/s}}")["w"].text == ""


def test_families_and_numbers_of_members() -> None:
    found = made("chain")
    n = found["N"]
    assert (n.whole, n.low, n.high, n.step) == (True, 1, 40, 1)
    assert (found["m[3]"].family, found["x[3]"].family, found["x[3]'"].family) == ("m", "x", "x'")
    assert found["l"].family == ""


def test_an_option_in_another_unit_is_shown_in_it() -> None:
    model = load(MODELS / "slider_crank.yaml", set={"l": "40 cm"})
    c = controls(model, resolve(SettingsOverrides(), model.settings))["l"]
    assert (c.value, c.unit, c.suffix, c.shown(0.5)) == (40.0, "cm", " cm", 50.0)


def test_the_end_of_the_run_can_be_moved_unless_the_sample_times_are_given() -> None:
    end = made("slider_crank")["t_end"]
    assert (end.kind, end.value, end.high) == ("end", 3.0, 6.0)
    assert end.low > 0
    model = load(MODELS / "slider_crank.yaml")
    assert "t_end" not in controls(
        model, resolve(SettingsOverrides(times=(0.1, 0.2)), model.settings)
    )


BOUNDED = """
coordinates: {x: m}
parameters:
  m: {value: 1 kg, min: 100 g, max: 5}
  c: 0 N*s/m
  k: {value: 10 N/m, max: 100}
  Omega: {value: 3000 rpm, min: 0, max: 6000 rpm}
  F: 0 N
  mu: 0
  N: 9.81 N
T: m*x'^2/2
V: k*x^2/2 - F*x
Q: {x: -mu*N*sign(x') - c*x'}
initial: {x: 0.1 m, x': 0 m/s}
"""


def test_sliders_end_at_min_and_max_and_have_the_sign_of_their_quantity() -> None:
    model = load_text(BOUNDED)
    made = controls(model, resolve(SettingsOverrides(), model.settings))
    found = {name: (made[name].low, made[name].high) for name in model.parameters}
    assert found["m"] == (0.1, 5.0)
    assert found["k"] == (0.0, 100.0)
    assert found["Omega"] == (0.0, 6000.0)
    # viscous and dry friction are not negative; a force may be
    assert found["c"] == (0.0, 1.0)
    assert found["mu"][0] == 0.0
    assert found["F"][0] < 0


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{value: 1 kg, min: 5 m}", "`min` of the parameter `m` is in m, and its value in kg"),
        ("{value: 1 kg, min: 5, max: 2}", "`min` 5 is not below `max` 2"),
        ("{value: 1 kg, max: m}", "is in no unit, and its value in kg"),
    ],
)
def test_ends_of_sliders_are_checked(entry: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        load_text(BOUNDED.replace("{value: 1 kg, min: 100 g, max: 5}", entry))
