"""The units that follow from those that a model states."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest
import symengine as se

from lagcli import simulate
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.render import render
from lagcli.errors import ModelError
from lagcli.model.dimensions.deriving import expression_unit, symbolic_unit
from lagcli.model.expression.dimension import unit_of
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.units import read_unit
from lagcli.model.loader import load, load_text
from lagcli.model.model import Model, multiplier
from lagcli.model.result_units import result_units
from lagcli.pictures.scene.masses import moving_names

FOUND = Path(__file__).parents[3] / "found"
MODELS = Path(__file__).parents[4] / "models"

#: λ by constraint, and outputs, as the files' comments and textbooks have them.
EXPECTED = {
    "slider_crank": ({"guide": "N"}, {"slider": "m", "rod_tension": "N"}),
    "pendulum_cartesian": ({"rod": "N/m"}, {"angle": "rad", "tension": "N"}),
    "bead_on_rotating_hoop": (
        {"hoop": "N", "drive": "N*m"},
        {"radial_force": "N", "motor_torque": "N*m", "motor_power": "W"},
    ),
    "chaplygin_sleigh": ({"knife": "N"}, {"speed": "m/s", "side_force": "N"}),
    "heavy_top": (
        {"pin_x": "N", "pin_y": "N", "pin_z": "N", "unit": "J"},
        {"support_force": "N", "spin_rate": "rad/s"},
    ),
    "charged_pendulum": ({"rod": "N/m"}, {"tension": "N", "angular_momentum": "kg*m^2/s"}),
    "rolling_disk": (
        {"contact": "N", "roll_x": "N", "roll_y": "N"},
        {"normal_force": "N", "friction": "N", "friction_ratio": "1"},
    ),
    "parallelogram": (
        dict.fromkeys(["right_x", "right_y", "middle_x", "middle_y"], "N"),
        {"force_left_crank": "N*m", "force_platform": "N*m"},
    ),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_units_of_multipliers_and_outputs(name: str) -> None:
    model = load(MODELS / f"{name}.yaml")
    multipliers, outputs = EXPECTED[name]
    assert {c: model.units.of_multiplier(c) for c in model.constraint_names} == multipliers
    assert {o: model.units.of_output(o) for o in model.outputs} == outputs


@pytest.mark.parametrize("path", sorted(MODELS.rglob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_models_have_units_throughout_and_they_fit(path: Path) -> None:
    model = load(path)
    assert model.units.throughout
    assert model.units.findings == ()
    # V may be 0, and that of a torsion spring is in N m/rad rad²
    assert symbolic_unit(model, model.potential) in ("J", "N*m", None)
    every = [model.units.of_multiplier(c) for c in model.constraint_names]
    every += [model.units.of_output(o) for o in model.outputs]
    every += [model.units.of(name) for name in (*model.parameters, *model.definitions)]
    assert None not in every


TWO_WAYS = [
    *("pendulum_cartesian", "slider_crank", "rolling_disk", "charged_pendulum", "four_bar"),
    *("driven_slider_crank", "car_axis", "atwood", "knife_edge_incline"),
]


@pytest.mark.parametrize("name", TWO_WAYS)
def test_units_of_expressions_agree_with_those_of_their_text(name: str) -> None:
    model = load(MODELS / f"{name}.yaml")
    for output, expression in model.outputs.items():
        assert symbolic_unit(model, expression) == model.units.of_output(output)


def test_where_numbers_have_units_only_small_fractions_are_pure() -> None:
    """A symbolic expression no longer says which of its numbers has one."""
    model = load_text(text("x: m", "m: 1 kg, k: 2 N/m", "Q: {x: -0.3*x' - k*x}\n"))
    assert [unit_of(x.dimension) for x in model.units.numbers] == ["N*s/m"]
    x = se.Symbol("x")
    for pure in (se.Integer(12), se.Integer(-2), se.Rational(1, 12), se.Rational(-11, 12)):
        assert symbolic_unit(model, pure * x) == "m"
    for other in (se.Integer(13), se.Rational(1, 13), se.RealDouble(0.3), se.pi, se.sqrt(2)):
        assert symbolic_unit(model, other * x) is None
    plain = load_text(text("x: m", "m: 1 kg, k: 2 N/m", "Q: {x: -k*x}\n"))
    assert symbolic_unit(plain, se.RealDouble(0.3) * x) == "m"


def test_a_parameter_with_an_expression_and_a_unit() -> None:
    """A value in SI, or a number in that unit; numbers in it take what is due."""

    def units(value: str, unit: str) -> list[str]:
        parameters = f"m: 1 kg, l: 2 m, a: {{value: {value}, unit: {unit}}}"
        found = load_text(text("x: m", parameters, "outputs: {a: a}\n")).units
        assert found.of_output("a") == unit_of(read_unit(unit).dimension)
        return [unit_of(x.dimension) for x in found.numbers]

    assert units("2*l", "m") == []
    assert units("l/l", "cm") == []
    assert units("0.3*l", "N") == ["N/m"]
    assert units("0.3*l", "kN") == ["1/m"]
    for value, unit in (("2*l", "mm"), ("2*l", "N")):
        with pytest.raises(ModelError) as caught:
            units(value, unit)
        assert {d.kind for d in caught.value.diagnostics} == {"units"}


def test_each_entry_of_a_cross_product_has_its_unit() -> None:
    more = "definitions: {r: 'cross([l, tau, m], 2*[l, tau, m])'}\n"
    more += "outputs: {a: 'r[1]', b: 'r[2]', c: 'r[3]'}\n"
    units = load_text(text("x: m", "m: 1 kg, l: 1 m, tau: 1 s", more)).units
    assert [units.of_output(name) for name in "abc"] == ["kg*s", "kg*m", "m*s"]


def test_coefficients_of_contacts_are_numbers() -> None:
    contact = "constraints: {floor: {expr: x >= 0, restitution: RATIO}}\n"
    parameters = "m: 1 kg, d: 0.5 m, l: 2 m"
    for ratio in ("0.3", "1/2", "1 - d/l", "d/l"):
        load_text(text("x: m", parameters, contact.replace("RATIO", ratio)))
    for ratio in ("d", "d/2", "d*d"):
        with pytest.raises(ModelError, match="`restitution` of `floor` must be a number, but"):
            load_text(text("x: m", parameters, contact.replace("RATIO", ratio)))


@pytest.mark.parametrize(
    ("event", "said"),
    [
        ("when: x = tau, stop: true", "`x`, in m, and `tau`, in s, cannot be equal"),
        ("when: x > tau, stop: true", "`x`, in m, and `tau`, in s, cannot be compared"),
        (
            "when: 'x > d and m < tau', stop: true",
            "`m`, in kg, and `tau`, in s, cannot be compared",
        ),
        ("when: x = d, set: {x': d}", "the new value of `x'` must be in m/s, but `d` is in m"),
        ("when: x = d, set: {x: x'}", "the new value of `x` must be in m, but `x'` is in m/s"),
        ("when: x = d, impulse: {x: m*d}", "the impulse on `x` must be in kg*m/s, but `m*d`"),
        ("when: 'x > d and tau < t', set: {x': d/tau, x: x + d}", ""),
        ("when: x = d, impulse: {x: m*d/tau}", ""),
    ],
)
def test_conditions_and_actions_of_events(event: str, said: str) -> None:
    events = f"events: {{one: {{{event}}}}}\n"
    model = text("x: m", "m: 1 kg, tau: 1 s, d: 2 m", events)
    if not said:
        load_text(model)
        return
    with pytest.raises(ModelError, match=re.escape(said)):
        load_text(model)


@pytest.mark.parametrize("field", ["every", "offset"])
def test_clocks_are_in_seconds(field: str) -> None:
    clock = {"every": "every: {}, offset: 0", "offset": "every: 1, offset: {}"}[field]
    events = f"events: {{tick: {{{clock.format('tau/2')}, set: {{m: 2*m}}}}}}\n"
    load_text(text("x: m", "m: 1 kg, tau: 1 s", events))
    with pytest.raises(ModelError, match=f"`{field}` of `tick` must be in s, but `tau/2` is in m"):
        load_text(text("x: m", "m: 1 kg, tau: 1 m", events))


def test_result_units_name_columns() -> None:
    units = result_units(load(MODELS / "rolling_disk.yaml"))
    assert units["lambda.roll_x"] == "N"
    assert units["residual_velocity.roll_x"] == "m/s"
    assert "residual_position.roll_x" not in units
    assert units["residual_position.contact"] == "m"
    assert units["S"] == "rad/s"
    assert units["psi"] == "rad"


def text(coordinates: str, parameters: str, more: str = "") -> str:
    return f"""\
coordinates: {{{coordinates}}}
parameters: {{{parameters}}}
T: m/2*x'^2
V: 0
initial: {{x: 0, x': 0}}
{more}"""


def test_a_model_without_units_has_none() -> None:
    model = load_text(text("x: {}", "m: 1", "constraints: {c: x = 1}\n"))
    assert not model.units.stated
    assert model.units.of_multiplier("c") is None
    assert result_units(model) == {}
    assert symbolic_unit(model, multiplier("c")) is None


@pytest.mark.parametrize(("x", "m"), [("x: m", "m: 1"), ("x: {}", "m: 1 kg")])
def test_units_of_coordinates_or_of_parameters_are_units(x: str, m: str) -> None:
    model = load_text(text(x, m))
    assert model.units.stated
    assert not model.units.throughout
    assert {model.units.of("x"), model.units.of("m")} == {"m" if "m" in x else "kg", None}


def test_units_that_are_known_are_derived_where_others_are_missing() -> None:
    model = load_text(text("x: m", "m: 1 kg, k: 1", "outputs: {a: m*x'', b: k*x, c: x^2}\n"))
    assert model.units.missing == ("k",)
    assert not model.units.throughout
    assert [model.units.of_output(name) for name in "abc"] == ["N", None, "m^2"]


def test_coordinates_with_units_alone_are_labels() -> None:
    model = load_text(text("x: m", "n: 2").replace("m/2", "1/2"))
    assert not model.units.throughout


def test_small_integers_and_their_fractions_are_pure_as_factors() -> None:
    good = text("x: m", "m: 1 kg, g: 9.81 m/s^2").replace("V: 0", "V: m*g*x/2 + 0")
    assert load_text(good).units.numbers == ()
    for factor in ("2", "10", "12", "0.5", "1/12", "2.5", "3/4", "(1 + 2)", "sqrt(2)", "2*6"):
        with pytest.raises(ModelError, match=r"`V` must be an energy, in J, but `m\*"):
            load_text(good.replace("m*g*x/2", f"m*{factor}*x"))
        assert load_text(good.replace("m*g*x/2", f"m*g*{factor}*x")).units.numbers == ()
    for factor in ("9.81", "13", "0.3", "100", "sqrt(0.3)", "(1 + 0.3)", "1.5e3"):
        (taken,) = load_text(good.replace("m*g*x/2", f"m*{factor}*x")).units.numbers
        assert unit_of(taken.dimension) == "m/s^2"
        assert load_text(good.replace("m*g*x/2", f"m*g*{factor}*x")).units.numbers == ()
    assert load_text(good.replace("m*g*x/2", "m*g*(x - 1)")).units.numbers[0].dimension.m == 1


def test_numbers_may_denote_quantities_where_units_are_missing() -> None:
    model = load_text(
        text("x: m, y: {}", "m: 1 kg")
        .replace("V: 0", "V: m*9.81*(x - 0.5) + y")
        .replace("x': 0", "x': 0, y: 0, y': 0")
    )
    assert model.units.findings == ()


def test_a_number_alone_may_be_a_force_where_units_are_missing() -> None:
    assert load_text(text("x: m", "m: 1", "Q: {x: 5}\n")).units.findings == ()


@pytest.mark.parametrize(("row", "column", "unit"), [(1, 1, "J"), (1, 2, None), (2, 1, "m*s")])
def test_entries_of_a_matrix_have_units_of_their_own(
    row: int, column: int, unit: str | None
) -> None:
    model = text(
        "x: m",
        "m: 1 kg, a: 2 N, b: 3 N/m, c: 4 s",
        f"definitions: {{A: '[[a, b], [c, m]]'}}\nQ: {{x: 'A[{row}, {column}]*x'}}\n",
    )
    if unit is None:
        assert load_text(model).units.findings == ()
        return
    with pytest.raises(ModelError, match=re.escape(f"`A[{row}, {column}]*x` is in {unit}")):
        load_text(model)


@pytest.mark.parametrize("factor", ["2", "7", "100", "1/2", "0.5", "0.25", "0.125"])
@pytest.mark.parametrize("measured", ["0.3", "0.2", "1.7", "0.0625", "0.1"])
def test_which_numbers_are_pure_where_units_are_missing(factor: str, measured: str) -> None:
    model = text("x: m, y: {}", "m: 1 kg").replace("x': 0", "x': 0, y: 0, y': 0")
    for number, count in ((factor, 1), (measured, 0)):
        assert len(load_text(model.replace("V: 0", f"V: {number}*x")).units.findings) == count


@pytest.mark.parametrize(
    ("expression", "unit"),
    [
        ("x", "m"),
        ("x'", "m/s"),
        ("x''", "m/s^2"),
        ("phi'", "rad/s"),
        ("k*x", "N"),
        ("k*abs(x)^1.5/sqrt(l)", "N"),
        ("sqrt(k/m)", "1/s"),
        ("atan2(x, l)", "rad"),
        ("sin(phi)", "1"),
        ("if(x > 0, x, -l)", "m"),
        ("max(x, 0)", "m"),
        ("sign(x')", "1"),
        ("hypot(x, l)", "m"),
        ("cbrt(l^3)", "m"),
        ("pow(l, 2)", "m^2"),
        ("exp(-t*x'/l)", "1"),
        ("r", "m"),
        ("r'", "m/s"),
        ("dot(r, r)", "m^2"),
        ("norm(r)", "m"),
        ("cross(r, F)", "N*m"),
        ("rot_z(phi)*r", "m"),
        ("omega(rot_z(phi))", "rad/s"),
        ("transpose(rot_z(phi))*r", "m"),
        ("dot(w, J*w)/2", "J"),
        ("M*v", None),  # a torque and a force
        ("dot(v, M*v)", "J"),
        ("lambda.rod", "N/m"),
        ("Qc.x", "N"),
        ("Qc.phi", "N*m"),
        ("Qc.rod.x", "N"),
        ("N*x", "m"),
        ("sum(q[i]^2, i = 1..N)", "m^2"),
        ("a[1]", "m"),
        ("a[2]", "m^2"),
        ("a[3]", "m^3"),
        ("sum(a[i]/l^i, i = 1..N)", "1"),
        ("p_0", "m"),
        ("tau", "N*m"),
        ("tau*phi'", "W"),
        ("tau*phi", "J"),
    ],
)
def test_units_of_expressions(everything: Model, expression: str, unit: str | None) -> None:
    assert expression_unit(everything, parse(expression)) == unit


@pytest.fixture(scope="module")
def everything() -> Model:
    return load_text("""\
coordinates: {x: m, phi: rad, 'q[1..N]': m}
parameters:
  N: 3
  m: 2 kg
  l: 30 cm
  k: 3 N/mm
  p_0: l*2
  J_0: 1 kg*m^2
  tau: 2 N*m
  k_n: 2 1/s
definitions:
  r: [x, 0, l]
  F: [k*x, 0, 0]
  w: omega(rot_x(phi))
  J: [[J_0, 0, 0], [0, J_0, 0], [0, 0, J_0]]
  v: "[phi', x']"
  M: "[[J_0, m*l], [m*l, m]]"
  a[1]: l
  a[i = 2..N]: a[i-1]*l
T: m/2*x'^2 + J_0/2*phi'^2 + sum(m/2*q[i]'^2, i = 1..N)
constraints: {rod: x^2 + q[1]^2 = l^2}
initial: {x: l, phi: 0, 'q[1..N]': 0, x': 0, phi': 0, "q[1..N]'": 0}
outputs: {spare: sqrt(k/m)*phi}
""")


def test_units_survive_pickling(everything: Model) -> None:
    back = pickle.loads(pickle.dumps(everything.units))
    assert back.of_multiplier("rod") == "N/m"
    assert back.of("N") == "1"


VARIED = """\
coordinates: {'q[1..2]': m, 'q[3]': rad}
parameters: {m: 1 kg, J: 1 kg*m^2, 'c[1..3]': [1 N/m, 2 N/m, 3 N*m]}
T: sum(m/2*q[i]'^2, i = 1..2) + J/2*q[3]'^2
V: sum(c[i]/2*q[i]^2, i = 1..3)
constraints:
  d[i = 1..2]: q[i]*c[i] = q[i]^2*c[i]^2/c[i]*0
initial: {'q[1..3]': 0, "q[1..3]'": 0}
"""


def test_a_family_with_members_in_different_units() -> None:
    model = load_text(VARIED.replace("d[i = 1..2]: q[i]*c[i]", "d[i = 1..3]: q[i]*c[i]"))
    assert model.units.throughout
    assert [model.units.of_force(f"q[{i}]") for i in (1, 2, 3)] == ["N", "N", "N*m"]
    assert [model.units.of_multiplier(f"d[{i}]") for i in (1, 2, 3)] == ["m", "m", "1"]
    with pytest.raises(ModelError, match="units"):
        load_text(VARIED.replace("3 N*m]", "3 N/m]"))
    with pytest.raises(ModelError, match="cannot be added"):
        load_text(VARIED.replace("c[i]/2*q[i]^2", "c[i]/2*(q[i]^2 + q[1]^2)"))


def test_a_member_that_is_a_number_takes_the_unit_of_the_others() -> None:
    definitions = "definitions: {'a[1]': 0.3, 'a[2]': x, 'b[1]': phi, 'b[2]': sin(phi)}\n"
    units = load_text(text("x: m", "m: 1 kg, phi: 1 rad", definitions)).units
    assert [units.of(f"a[{i}]") for i in (1, 2)] == ["m", "m"]
    assert [units.of(f"b[{i}]") for i in (1, 2)] == ["rad", "rad"]  # an angle is a number, too


@pytest.mark.parametrize("first", ["x", "3", "0", "[x, x]", "rot_z(x/l)", "x + 2"])
@pytest.mark.parametrize("swapped", [False, True])
def test_members_may_have_different_shapes(first: str, swapped: bool) -> None:
    a, b = (2, 1) if swapped else (1, 2)
    definitions = f"definitions: {{'p[{a}]': '{first}', 'p[{b}]': '[x, x, x]'}}\n"
    more = f"outputs: {{o: 'p[{b}].x'}}\n"
    model = load_text(text("x: m", "m: 1 kg, l: 1 m", definitions + more))
    assert model.units.findings == ()
    assert model.units.of_output("o") in ("m", None)


def test_definitions_may_use_later_ones() -> None:
    more = "definitions: {a: b*c, b: c/tau, c: x}\n"
    units = load_text(text("x: m", "m: 1 kg, tau: 1 s", more)).units
    assert [units.of(name) for name in "abc"] == ["m^2/s", "m/s", "m"]
    with pytest.raises(ModelError, match=r"`b`, in m/s, and `c`, in m, cannot be added"):
        load_text(text("x: m", "m: 1 kg, tau: 1 s", more.replace("b*c", "b + c")))


def test_members_that_need_later_ones_are_not_guessed() -> None:
    model = load_text(
        text("x: m", "m: 1 kg, N: 9", "definitions: {'a[N]': x, 'a[i = 1..N-1]': 'a[i+1]*x'}\n")
    )
    assert model.units.findings == ()
    assert model.units.of("a[9]") in ("m", None)
    assert model.units.of("a[1]") in ("m^9", None)


def test_symbolic_units_of_conserved_quantities() -> None:
    model = load(MODELS / "charged_pendulum.yaml")
    x, y, m, b, q = map(se.Symbol, ("x", "y", "m", "B", "q"))
    momentum = m * (x * se.Symbol("y'") - y * se.Symbol("x'")) + q * b / 2 * (x**2 + y**2)
    assert symbolic_unit(model, momentum) == "kg*m^2/s"
    assert symbolic_unit(model, se.sqrt(x**2 + y**2)) == "m"
    assert symbolic_unit(model, se.atan2(y, x)) == "rad"
    cases = (se.Integer(0), x < 1), (x, x < 2), (2 * x, x < 3), (x * y, se.true)
    for k in (2, 3):
        assert symbolic_unit(model, se.Piecewise(*cases[:k])) == "m"


def test_where_numbers_have_units_small_ones_are_pure_in_symbolic_expressions() -> None:
    model = load_text(text("x: m", "m: 1 kg").replace("V: 0", "V: 9.81*m*x"))
    assert model.units.numbers
    x = se.Symbol("x")
    for top, bottom, unit in [
        (1, 1, "m"), (12, 1, "m"), (13, 1, None), (-12, 1, "m"), (-13, 1, None), (24, 1, None),
        (1, 12, "m"), (12, 11, "m"), (1, 13, None), (13, 12, None), (12, 13, None),
    ]:  # fmt: skip
        assert symbolic_unit(model, se.Rational(top, bottom) * x) == unit
    assert symbolic_unit(model, 0.3 * x) is None


@pytest.mark.parametrize(("moment", "right"), [("N*m", True), ("N", False), ("kN*mm/rad", True)])
def test_a_torque_on_a_body(moment: str, right: bool) -> None:
    more = "definitions: {R: rot_z(x)}\nQ: {R: '[0, 0, M]'}\n"
    model = text("x: rad", f"m: 1 kg*m^2, M: 1 {moment}", more)
    if right:
        load_text(model)
        return
    with pytest.raises(ModelError, match=r"the force on `R` must be in N\*m, but `M` is in N"):
        load_text(model)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ("t_end: 2*m", "`t_end` must be in s, but `2*m` is in kg"),
        ("t_end: 2*pi*sqrt(m/g)", "`t_end` must be in s"),
        ("dt: l/10", "`dt` must be in s, but `l/10` is in m"),
        ("t_end: 9, times: [0, l, 2*tau]", "`times` must be in s, but `l` is in m"),
        ("max_step: m", "`max_step` must be in s, but `m` is in kg"),
        ("samples: 10*m", "`samples` must be a number, but `10*m` is in kg"),
        ("formulation: baumgarte, alpha: 5*tau", "`alpha` must be in 1/s, but `5*tau` is in s"),
        ("atol: {x: tau}", "the tolerance of `x` must be in m, but `tau` is in s"),
        ("atol: {x': l}", "the tolerance of `x'` must be in m/s, but `l` is in m"),
        ("atol: {x_dot: l}", "the tolerance of `x'` must be in m/s, but `l` is in m"),
        ("atol: {ẋ: l}", "the tolerance of `x'` must be in m/s, but `l` is in m"),
        ("atol: {s_dot: tau}", "the tolerance of `s_dot` must be in m, but `tau` is in s"),
        ("atol: {'z[1..N]': tau}", "the tolerance of `z[1]` must be in m, but `tau` is in s"),
        ("atol: {'z[2]': tau}", "the tolerance of `z[2]` must be in m, but `tau` is in s"),
        ("atol: {'z[1..N]_dot': l}", "the tolerance of `z[1]'` must be in m/s, but `l` is in m"),
        ("atol: {'z_dot[2]': l}", "the tolerance of `z[2]'` must be in m/s, but `l` is in m"),
        ("atol: {x: 1 kg}", "the tolerance of `x` is in kg, but must be in m"),
        ("atol: {x_dot: 1 mm}", "the tolerance of `x_dot` is in mm, but must be in m/s"),
        ("atol: {'z[1..N]': 1 s}", "the tolerance of `z[1..N]` is in s, but must be in m"),
        ("atol: l", "`atol` must be a number, but `l` is in m"),
        ("atol: 1 mm", "`atol` is in mm, but must be a number"),
        ("rtol: 1 mm", "`rtol` is in mm, but must be a number"),
        ("atol: {s_dot: l, 'z[1..N]': l/9, 'z[1..N]_dot': l/tau, 's_dot_dot': l/tau}", ""),
        ("atol: l/1e9/l", ""),
        ("t_end: 2*pi*sqrt(l/g), dt: tau/10, max_step: tau, atol: {x: l/1e9, x': l/tau/1e9}", ""),
        ("t_end: 9*tau, times: [0, tau, 2*tau], formulation: baumgarte, alpha: 5/tau", ""),
    ],
)
def test_settings_of_parameters_have_their_dimension(settings: str, said: str) -> None:
    text = (
        "coordinates: {x: m, s_dot: m, 'z[1..N]': m}\n"
        "parameters: {m: 1 kg, l: 1 m, g: 9.81 m/s^2, tau: 1 s, N: 2}\n"
        "T: m/2*(x'^2 + s_dot'^2 + sum(z[i]'^2, i = 1..N))\nV: m*g*x\n"
        "initial: {x: 0, x': 0, s_dot: 0, s_dot': 0, 'z[1..N]': 0, \"z[1..N]'\": 0}\n"
        f"simulation: {{{settings}}}\n"
    )
    if not said:
        load_text(text)
        return
    with pytest.raises(ModelError, match=re.escape(said)) as caught:
        load_text(text)
    assert str(caught.value).count("error[") == 1  # also for a family


SOME = """\
coordinates: {coordinates}
parameters: {{m: 1 kg, k: 3}}
T: m/2*x'^2
V: k/2*x^2
initial: {initial}
"""


@pytest.mark.parametrize(
    ("coordinates", "initial", "said"),
    [
        ("{x: m}", "{x: 1 kg, x': 0}", "the initial value of `x` must be in m, not in kg"),
        ("{x: m}", "{x: 0, x': {guess: 2 m}}", "of `x'` must be in m/s, not in m"),
        ("[x]", "{x: 1 m, x': 2 kg}", "of `x'` must be in m/s, not in kg"),
    ],
)
def test_initial_values_fit_in_models_with_some_units(
    coordinates: str, initial: str, said: str
) -> None:
    with pytest.raises(ModelError, match=re.escape(said)):
        load_text(SOME.format(coordinates=coordinates, initial=initial))


@pytest.mark.parametrize(
    ("coordinates", "initial"),
    [
        ("{x: m}", "{x: 1 ft, x': 3 mph}"),
        ("[x]", "{x: 30 deg, x': 2 rpm}"),
        ("[x]", "{x: 1, x': 2 m}"),
    ],
)
def test_initial_values_that_may_fit_are_taken(coordinates: str, initial: str) -> None:
    load_text(SOME.format(coordinates=coordinates, initial=initial))


def test_options_and_presets_fit_in_models_with_some_units() -> None:
    text = SOME.format(coordinates="{x: m}", initial="{x: 0, x': 0}")
    with pytest.raises(ModelError, match="must be in m, not in kg"):
        load_text(text, set_initial={"x": "1 kg"})
    with pytest.raises(ModelError, match="must be in m, not in kg"):
        load_text(text + "presets: {heavy: {initial: {x: 1 kg}}}\n")


def test_an_inductance_called_l_is_no_lagrangian() -> None:
    model = load(FOUND / "def_L.yaml")
    assert model.units.of("L") == "H"
    run = simulate(model, t_end=5.0, samples=11, rtol=1e-10)
    np.testing.assert_allclose(run.q[:, 0], np.cos(run.time / np.sqrt(2.0)), atol=1e-8)


NAMED_AS_KEYS = """
coordinates: {x: m}
parameters: {m: 1 kg, k: 4 N/m, c: 1 N*s/m}
definitions: {T: 2*pi*sqrt(m/k), V: x', L: x, D: x^2}
T: m/2*V^2
V: k/2*L^2
D: c/2*V^2
initial: {x: 1, x': 0}
outputs: {phase: 2*pi*t/T, area: D}
"""


def test_definitions_may_have_the_names_of_energies() -> None:
    """What is checked and printed as T is the key T, and the definition T is a period."""
    model = load_text(NAMED_AS_KEYS)
    assert {x: model.units.of(x) for x in "TVLD"} == {"T": "s", "V": "m/s", "L": "m", "D": "m^2"}
    text = render(derive(model), steps=True)
    assert "½ m V²" in text
    assert "m ẍ + k x = −c ẋ" in text
    assert model.units.of_output("area") == "m^2"
    assert moving_names(model) == {"x"}
    with pytest.raises(ModelError, match=r":6:4: error\[units\]: `V` must be an energy, in J"):
        load_text(NAMED_AS_KEYS.replace("V: k/2*L^2", "V: k/2*L"))
