"""Wrong units: each is found, with both parts underlined, their units and a remedy."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from lagcli.errors import Diagnostic, ModelError, SourceLocation
from lagcli.model.dimensions.reporting import taken_units
from lagcli.model.loader import load_text

MODELS = Path(__file__).parents[4] / "models"


class Wrong(NamedTuple):
    """A shipped model with one wrong unit.

    ``underlined`` are the parts that the first message underlines, the name to blame last;
    ``count`` is the number of places where units disagree; one message states all of them.
    """

    model: str
    right: str
    wrong: str
    message: str
    underlined: tuple[str, ...]
    help: str
    count: int = 1


WRONG = [
    Wrong(
        *("pendulum_cartesian", "g: 9.81 m/s^2", "g: 9.81 m/s"),
        "`V` must be an energy, in J, but `m*g*y` is in kg*m^2/s",
        ("m*g*y", "9.81 m/s"),
        "all units fit with `g` in m/s^2",
    ),
    Wrong(
        *("pendulum_cartesian", "  m: 1 kg", "  m: 1 m"),
        "`T` must be an energy, in J, but `m/2*(x'^2 + y'^2)` is in m^3/s^2",
        ("m/2*(x'^2 + y'^2)", "1 m"),
        "all units fit with `m` in kg",
        2,
    ),
    Wrong(
        *("pendulum_cartesian", "  l: 1 m", "  l: 1 s"),
        "`x^2 + y^2`, in m^2, and `l^2`, in s^2, cannot be equal",
        ("x^2 + y^2", "l^2", "1 s"),
        "all units fit with `l` in m",
        3,
    ),
    Wrong(
        *("pendulum_cartesian", "  x: {unit: m}", "  x: {unit: rad}"),
        "`x'^2`, in 1/s^2, and `y'^2`, in m^2/s^2, cannot be added",
        ("x'^2", "y'^2", "x"),
        "all units fit with `x` in m",
        5,
    ),
    Wrong(
        *("pendulum_cartesian", "x': {guess: 0 m/s}", "x': {guess: 0 m}"),
        "the initial value of `x'` must be in m/s, not in m",
        ("0 m",),
        "give it in m/s, or in another unit of that dimension",
    ),
    Wrong(
        *("pendulum_cartesian", "x: l*sin(theta_0)", "x: 3 kg"),
        "the initial value of `x` must be in m, not in kg",
        ("3 kg",),
        "give it in m, or in another unit of that dimension",
    ),
    Wrong(
        *("pendulum_cartesian", "theta_0: {value: 2 rad", "theta_0: {value: 2 m"),
        "the argument of `sin` must be a number or an angle, but `theta_0` is in m",
        ("theta_0", "2 m"),
        "all units fit with `theta_0` in rad",
        2,
    ),
    Wrong(
        *("slider_crank", "tau: {value: 0 N*m", "tau: {value: 0 N"),
        "the force on `phi` must be in N*m, but `tau` is in N",
        ("tau", "0 N"),
        "all units fit with `tau` in N*m",
    ),
    Wrong(
        *("slider_crank", "c: {value: 0 N*s/m", "c: {value: 0 N/m"),
        "the force on `x_B` must be in N, but `c*x_B'` is in N/s",
        ("c*x_B'", "0 N/m"),
        "all units fit with `c` in N*s/m",
    ),
    Wrong(
        *("slider_crank", "r: {value: 0.1 m", "r: {value: 0.1 m^2"),
        "`r*cos(phi)`, in m^2, and `l*cos(psi)`, in m, cannot be added",
        ("r*cos(phi)", "l*cos(psi)", "0.1 m^2"),
        "all units fit with `r` in m",
        5,
    ),
    Wrong(
        *("slider_crank", "phi: {unit: rad", "phi: {unit: m"),
        "the argument of `cos` must be a number or an angle, but `phi` is in m",
        ("phi", "phi"),
        "all units fit with `phi` in rad",
        8,
    ),
    Wrong(
        *("slider_crank", "phi': 12 rad/s", "phi': 12 rad/s^2"),
        "the initial value of `phi'` must be in rad/s, not in rad/s^2",
        ("12 rad/s^2",),
        "give it in rad/s, or in another unit of that dimension",
    ),
    Wrong(
        *("atwood", "J: {value: 0.04 kg*m^2", "J: {value: 0.04 kg*m"),
        "`m_1`, in kg, and `J/R^2`, in kg/m, cannot be added",
        ("m_1", "J/R^2", "0.04 kg*m"),
        "all units fit with `J` in kg*m^2",
        2,
    ),
    Wrong(
        *("atwood", "h: {value: 1 m", "h: {value: 1 s"),
        "`h`, in s, and `R*phi`, in m, cannot be added",
        ("h", "R*phi", "1 s"),
        "all units fit with `h` in m",
    ),
    Wrong(
        *("car_axis", "k: {value: 1 N/m", "k: {value: 1 N"),
        "`V` must be an energy, in J, but `k/2*(L_l - L_0)^2` is in N*m^2",
        ("k/2*(L_l - L_0)^2", "m*g*(y_l + y_r)", "1 N"),
        "all units fit with `k` in N/m",
        2,
    ),
    Wrong(
        *("car_axis", "w: {value: 10 rad/s", "w: {value: 10 rad"),
        "the argument of `sin` must be a number or an angle, but `w*t` is in rad*s",
        ("w*t", "10 rad"),
        "all units fit with `w` in rad/s",
        3,
    ),
    Wrong(
        *("car_axis", "eps: {value: 0.01, unit: 1}", "eps: {value: 0.01, unit: m}"),
        "`T` must be an energy, in J, but `m/2*(x_l'^2 + y_l'^2 + x_r'^2 + y_r'^2)` is in N*m^3",
        ("m/2*(x_l'^2 + y_l'^2 + x_r'^2 + y_r'^2)", "10 kg"),
        "all units fit with `M` in kg/m^2, or with `eps` in 1",
        2,
    ),
    Wrong(
        *("charged_pendulum", "B: {value: 1 T", "B: {value: 1 V"),
        "`V` must be an energy, in J, but `q*B/2*(x*y' - y*x')` is in N*m^3/s",
        ("q*B/2*(x*y' - y*x')", "m*g*z", "0.2 C"),
        "all units fit with `q` in s^2*A/m^2, or with `B` in T",
        2,
    ),
    Wrong(
        *("chain", "m[1..N]: {value: 1/N, unit: kg}", "m[1..N]: {value: 1/N, unit: N}"),
        "`T` must be an energy, in J, but `m[i]/2*(x[i]'^2 + y[i]'^2)` is in N*m^2/s^2",
        ("m[i]/2*(x[i]'^2 + y[i]'^2)", "1/N"),
        "all units fit with `m` in kg",
        2,
    ),
    Wrong(
        *("chain", "x[1..N]': 0 m/s", "x[1..N]': 0 m/s^2"),
        "the initial value of `x[1]'` must be in m/s, not in m/s^2",
        ("0 m/s^2",),
        "give it in m/s, or in another unit of that dimension",
    ),
    Wrong(
        *("heavy_top", "J_s: {value: 0.46875 kg*m^2", "J_s: {value: 0.46875 kg*m"),
        "the products that `dot(w, J*w)` adds differ: some are in J, some in N",
        ("dot(w, J*w)", "0.46875 kg*m"),
        "all units fit with `J_s` in kg*m^2",
    ),
    Wrong(
        *("heavy_top", "a: {value: 1 m", "a: {value: 1 kg"),
        "`r_C`, in m, and `R*[0, a, 0]`, in kg, cannot be added",
        ("r_C", "R*[0, a, 0]", "1 kg"),
        "all units fit with `a` in m",
        2,
    ),
    Wrong(
        *("chaplygin_sleigh", "v_0: {value: 1 m/s", "v_0: {value: 1 m"),
        "the initial value of `x'` must be in m/s, but `v_0` is in m",
        ("v_0", "1 m"),
        "all units fit with `v_0` in m/s",
    ),
    Wrong(
        *("four_bar", "mu: {value: 4 kg/m", "mu: {value: 4 kg/m^2"),
        "`T` must be an energy, in J, but `m_1*a^2/6*theta_1'^2` is in N",
        ("m_1*a^2/6*theta_1'^2", "4 kg/m^2"),
        "all units fit with `mu` in kg/m",
        6,  # with m_2*b^2/24, whose 24 takes a unit
    ),
    Wrong(
        *("rolling_disk", "Omega: {value: 1.5 rad/s", "Omega: {value: 1.5 rad"),
        "`m*g*r*sin(theta_0)`, in J, and `A*Omega^2*sin(theta_0)*cos(theta_0)`, in kg*m^2,"
        " cannot be added",
        ("m*g*r*sin(theta_0)", "A*Omega^2*sin(theta_0)*cos(theta_0)", "1.5 rad"),
        "all units fit with `Omega` in rad/s",
        3,
    ),
    Wrong(
        *("andrews_squeezer", "k: {value: 4530 N/m", "k: {value: 4530 N*m"),
        "`V` must be an energy, in J, but `k/2*(spring - l_0)^2` is in N*m^3",
        ("k/2*(spring - l_0)^2", "4530 N*m"),
        "all units fit with `k` in N/m",
    ),
    Wrong(
        *("knife_edge_incline", "alpha: {value: 30 deg", "alpha: {value: 30 kg"),
        "the argument of `sin` must be a number or an angle, but `alpha` is in kg",
        ("alpha", "30 kg"),
        "all units fit with `alpha` in rad",
    ),
    Wrong(
        *("driven_slider_crank", "J_1: {value: 0.002 kg*m^2", "J_1: {value: 0.002 kg"),
        "`T` must be an energy, in J, but `J_1/2*phi'^2` is in N/m",
        ("J_1/2*phi'^2", "m_2/2*(x_G'^2 + y_G'^2)", "0.002 kg"),
        "all units fit with `J_1` in kg*m^2",
    ),
]


def underlined(place: SourceLocation | None) -> str:
    assert place is not None
    return place.text[place.column - 1 :][: place.length]


def errors(text: str) -> list[Diagnostic]:
    with pytest.raises(ModelError) as caught:
        load_text(text, "f.yaml")
    found = caught.value.diagnostics
    assert {d.kind for d in found} == {"units"}
    return list(found)


@pytest.mark.parametrize("case", WRONG, ids=lambda w: f"{w.model}-{w.wrong.split(':')[0].strip()}")
def test_a_wrong_unit_is_found(case: Wrong) -> None:
    text = (MODELS / f"{case.model}.yaml").read_text(encoding="utf-8")
    assert text.count(case.right) == 1
    found = errors(text.replace(case.right, case.wrong))
    first = found[0]
    assert first.message == case.message
    places = [first.location, *(place for _, place in first.notes if place is not None)]
    assert tuple(map(underlined, places)) == case.underlined
    single, _, fitting = (first.help or "").rpartition(" is missing, or ")
    assert fitting == case.help
    assert not single or case.count == 1
    more = [note.split(" more for the same reason in line")[0] for note, _ in first.notes[-1:]]
    assert len(found) == 1
    assert case.count == 1 or more == [str(case.count - 1)]


def test_what_has_its_own_reason_is_reported_by_itself() -> None:
    """One more is named only if there is one, and only if one unit corrects all."""
    (found,) = errors(MODEL.replace("k: 1 N/m", "k: 1 N"))
    assert "more for the same reason" in found.render()
    (found,) = errors(MODEL.replace("J: 1 kg*m^2", "J: 1 kg*m"))
    assert "more for the same reason" not in found.render()
    assert "or all units fit with `J` in kg*m^2" in found.render()
    both = errors(MODEL.replace("V: k/2*x^2", "V: k/2*x").replace("D: c/2*x'^2", "D: m/2*x'"))
    assert ["`V` must be" in both[0].message, "`D` must be" in both[1].message] == [True, True]
    assert not any("more for the same reason" in x.render() for x in both)


def test_a_coordinate_in_place_of_its_velocity() -> None:
    pendulum = (MODELS / "pendulum_cartesian.yaml").read_text(encoding="utf-8")
    (found,) = errors(pendulum.replace("x'^2 + y'^2", "x^2 + y^2"))
    assert found.help == (
        "a factor in 1/s^2 is missing, as where `x` is written for its velocity `x'`, or a unit"
        " under `parameters` is wrong"
    )


MODEL = """\
coordinates: {x: m, phi: rad}
parameters: {m: 1 kg, J: 1 kg*m^2, l: 1 m, k: 1 N/m, c: 1 N*s/m, n: {value: 1.5, unit: 1}}
definitions: {r: [x, l], s: x + l}
T: m/2*x'^2 + J/2*phi'^2
V: k/2*x^2
Q: {x: -c*x', r: [0, k*l]}
D: c/2*x'^2
constraints: {rod: x = l*phi}
initial: {x: 0, phi: 0, x': 0, phi': 0}
outputs:
  pull: {expr: k*x, unit: N}
  side: k*x*x
"""


@pytest.mark.parametrize(
    ("old", "new", "message", "parts"),
    [
        ("D: c/2*x'^2", "D: c/2*x^2", "`D` must be a power, in W, but", ["c/2*x^2"]),
        ("[0, k*l]", "[0, k]", "the force on `r` must be in N, but `k` is in N/m", ["k"]),
        ("[0, k*l]", "k*r/l", "the force on `r` must be in N, but `k*r/l` is in N/m", ["k*r/l"]),
        ("expr: k*x,", "expr: k*x^2,", "the output `pull` must be in N, but", ["k*x^2"]),
        ("k*x*x", "x^phi", "`x` is in m, and its exponent must be a constant", ["x", "phi"]),
        ("k*x*x", "x^x", "an exponent must be a number or an angle, but `x`", ["x"]),
        ("k*x*x", "exp(x) + 1", "the argument of `exp` must be a number", ["x"]),
        ("k*x*x", "max(x, m)", "cannot be arguments of one function", ["x", "m"]),
        ("k*x*x", "if(x > m, x, l)", "cannot be compared", ["x", "m"]),
        ("k*x*x", "if(x > 0, x, m)", "cannot be cases of one `if`", ["x", "m"]),
        ("k*x*x", "if(x > 0 and x < m, 1, 2)", "cannot be compared", ["x", "m"]),
        ("k*x*x", "dot([l, 0, 0], rot_x(x)*[l, 0, 0])", "the argument of `rot_x` must be", ["x"]),
        ("k*x*x", "dot([x, phi], [l, l])", "adds differ: some are in m^2, some in m", None),
        ("k*x*x", "lambda.rod + x", "`lambda.rod`, in N, and `x`, in m", ["lambda.rod", "x"]),
        ("k*x*x", "sum(x*i + m, i = 1..2)", "`x*i`, in m, and `m`, in kg", ["x*i", "m"]),
        ("k*x*x", "s*t + m", "`s*t`, in m*s, and `m`, in kg, cannot be added", ["s*t", "m"]),
        ("k*x*x", "x + l + m", "`x`, in m, and `m`, in kg, cannot be added", ["x", "m"]),
        ("x = l*phi", "x - pi = l*phi", "`x`, in m, and `pi`, a number", ["x", "pi"]),
        ("l: 1 m", "l: {value: 2*m, unit: m}", "the unit of `l` must be in m", ["2*m"]),
        ("l: 1 m", "d: 1 m, l: {value: 2*d, unit: mm}", "is given another unit", ["2*d"]),
        ("l: 1 m", "l: 1 m, a: l + m", "`l`, in m, and `m`, in kg", ["l", "m"]),
        ("n: {value: 1.5, unit: 1}", "n: 3 s", "no error", None),
    ],
)
def test_other_statements(old: str, new: str, message: str, parts: list[str] | None) -> None:
    text = MODEL.replace(old, new)
    assert text != MODEL
    if message == "no error":
        assert load_text(text).units.throughout
        return
    first = errors(text)[0]
    assert message in first.message
    places = [first.location, *(place for _, place in first.notes if place is not None)]
    if parts is not None:
        assert [underlined(place) for place in places][: len(parts)] == parts


def test_the_message_as_a_whole() -> None:
    (found,) = errors(MODEL.replace("V: k/2*x^2", "V: k/2*x^2 + 10*x"))
    assert found.render() == (
        "f.yaml:5:14: error[units]: `V` must be an energy, in J, but `10*x` is in m\n"
        "    5 | V: k/2*x^2 + 10*x\n"
        "      |              ^^^^\n"
        "   note: `k/2*x^2` is in J, as it must be (f.yaml:5)\n"
        "    5 | V: k/2*x^2 + 10*x\n"
        "      |    ^^^^^^^\n"
        "   note: `x` is in m\n"
        "   help: `10` counts as a pure number; if it is a quantity, give it a name and a unit"
        " under `parameters`: `name: 10 N`"
    )


@pytest.mark.parametrize("zero", ["0", "0*x"])
def test_a_zero_is_not_the_term_that_differs(zero: str) -> None:
    (found,) = errors(MODEL.replace("V: k/2*x^2", f"V: k*x*({zero} + x + m)"))
    assert "`x`, in m, and `m`, in kg, cannot be added" in found.message


def test_what_is_made_of_an_error_is_no_second_one() -> None:
    more = "u: '[x, l, x] + [m, m, m]', v: 'cross(u, [x, l, x])', w: 'dot(u, v)', z: 'v[3] + l'"
    (found,) = errors(MODEL.replace("s: x + l", f"s: x + l, {more}"))
    assert "cannot be added" in found.message


def test_values_of_options() -> None:
    text = (MODELS / "slider_crank.yaml").read_text(encoding="utf-8")
    with pytest.raises(ModelError, match=r"--set r=2 kg: error\[units\]: `r` is in m in the file"):
        load_text(text, set={"r": "2 kg"})
    with pytest.raises(ModelError, match="initial value of `phi` must be in rad, not in m"):
        load_text(text, set_initial={"phi": "2 m"})
    with pytest.raises(ModelError, match=r"`l`, in m, and `m`, in kg, cannot be added"):
        load_text(text, set={"r": "l + m"})
    model = load_text(text, set={"r": "10 cm", "g": "2*pi", "l": "3*r"}, set_initial={"phi": 1})
    assert model.units.throughout
    assert [model.units.of(name) for name in "rgl"] == ["m", "m/s^2", "m"]


@pytest.mark.parametrize("factor", [1, 2, 3, 4, 6])
def test_usual_factors_are_not_taken_for_quantities(factor: int) -> None:
    """The message names a number that could be a quantity, if there is one."""
    text = """\
coordinates: {{x: m}}
parameters: {{m: 1 kg}}
T: m/2*x'^2
Q: {{x: "{factor}*x{more}"}}
initial: {{x: 0, x': 0}}
"""
    with pytest.raises(ModelError) as caught:
        load_text(text.format(factor=factor, more=""))
    assert "counts as a pure number" not in str(caught.value)
    with pytest.raises(ModelError) as caught:
        load_text(text.format(factor=factor, more="*8"))
    assert "`8` counts as a pure number" in str(caught.value)


def test_numbers_that_take_a_unit_are_located_themselves() -> None:
    text = """\
coordinates: {x: m}
parameters: {m: 1 kg, k: 3 N/m}
T: m*x'^2/2
V: k*(x - 2)^2/2
initial: {x: 0, x': 0}
"""
    model = load_text(text)
    (taken,) = taken_units(model)
    assert (taken.text, taken.unit) == ("2", "m")
    assert model.units.warnings == ("a number took a unit (lagcli check)",)
    model = load_text(text.replace("(x - 2)", "(x - 2 + 0.1)"))
    assert [(x.text, x.unit) for x in taken_units(model)] == [("2", "m"), ("0.1", "m")]
    assert model.units.warnings == ("2 numbers took a unit (lagcli check)",)
    assert taken.location is not None
    assert (taken.location.line, taken.location.column, taken.location.length) == (4, 11, 1)
