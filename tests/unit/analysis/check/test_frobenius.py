"""Integrability of the velocity constraints of a model, alone and together."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
import symengine as se

import lagcli
from lagcli.analysis.check.description import page
from lagcli.analysis.check.integrability import Integrability, VelocityConstraint

MODELS = Path(__file__).parents[4] / "models"
FOUND = Path(__file__).parents[3] / "found"


def checked(constraints: str, coordinates: str = "x, y, z") -> dict[str, VelocityConstraint]:
    names = coordinates.split(", ")
    initial = ", ".join(f"{n}: {{guess: 0.5}}, {n}': {{guess: 0.1}}" for n in names)
    text = f"""
coordinates: [{coordinates}]
parameters: {{a: 0.7}}
T: {" + ".join(f"{n}'^2" for n in names)}
constraints: {{{constraints}}}
initial: {{{initial}}}
"""
    return dict(lagcli.check(lagcli.load_text(text)).integrability.constraints)


@pytest.mark.parametrize(
    "constraint",
    ["x' = y'", "x' = a*y'", "y*x' = x*y'", "y*x' + x*y' = 0", "x*x' + y*y' = cos(t)"],
)
def test_integrals_are_found_and_the_run_keeps_them(constraint: str) -> None:
    found = checked(f'c: "{constraint}"')["c"]
    assert found.integrable == "alone"
    assert found.integral is not None
    text = f"""
coordinates: [x, y, z]
parameters: {{a: 0.7}}
T: x'^2 + y'^2 + z'^2
V: x*y + z
constraints: {{c: "{constraint}"}}
initial:
  {{x: 0.5, y: 0.6, z: 0, x': {{guess: 0.3}}, y': {{guess: 0.2}}, z': 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=1.0, samples=11, rtol=1e-11)
    names = [*map(se.Symbol, ("x", "y", "z", "t", "a"))]
    function = se.Lambdify(names, [found.integral.expression])
    inputs = np.column_stack([run.q, run.time, np.full(11, 0.7)])
    values = np.array([function(row)[0] for row in inputs])
    assert np.ptp(run.q[:, 0]) > 1e-2
    assert np.ptp(values) < 1e-9


def test_a_knife_edge_is_not_integrable() -> None:
    found = lagcli.check(lagcli.load(MODELS / "knife_edge_incline.yaml")).integrability.constraints
    assert found["skate"].integrable == "no"
    assert found["skate"].integral is None


def test_a_knife_edge_in_a_straight_groove_is() -> None:
    found = checked("knife: y'*cos(z) = x'*sin(z), groove: z = 0.5")
    assert found["knife"].integrable == "together"
    assert found["knife"].integral is not None
    x, y, z = map(se.Symbol, "xyz")
    assert found["knife"].integral.expression == y * se.cos(z) - x * se.sin(z)
    assert "groove" not in found


def test_two_contact_forms_are_not() -> None:
    found = checked("c: \"x' = y*z'\", d: \"w' = u*z'\"", "x, y, z, u, w")
    assert {x.integrable for x in found.values()} == {"no"}


def test_a_disk_that_rolls_straight_on_is_integrable_with_its_heading() -> None:
    found = checked("roll: x' = a*cos(y)*z', heading: y' = 0")
    assert found["heading"].integrable == "alone"
    assert found["roll"].integrable == "together"


PARAMETERS = {"a": 0.7, "b": 0.4, "l": 0.8, "r": 0.1, "R": 0.35, "w": 0.6}


def integrability(coordinates: str, rows: list[str]) -> Integrability:
    names = coordinates.split()
    initial = ", ".join(
        f"{n}: {{guess: {0.3 + 0.13 * i}}}, {n}': {{guess: 0}}" for i, n in enumerate(names)
    )
    lines = "".join(f'  c{i}: "{row}"\n' for i, row in enumerate(rows))
    text = f"""
coordinates: [{", ".join(names)}]
parameters: {PARAMETERS}
T: {" + ".join(f"{n}'^2" for n in names)}
constraints:
{lines}
initial: {{{initial}}}
"""
    return lagcli.check(lagcli.load_text(text)).integrability


KNIFE = "x'*sin(th) = y'*cos(th)"
ROLL = "x'*cos(th) + y'*sin(th) {} w*th' = {}*{}'"
OMNI = "r*{}' = -sin(th + {})*x' + cos(th + {})*y' + l*th'"
MECANUM = "r*{}' = (cos(th) {} sin(th))*x' + (sin(th) {} cos(th))*y' {} l*th'"
BALL = [
    "x' = R*(u'*sin(w1)*sin(v) + v'*cos(w1))",
    "y' = -R*(u'*cos(w1)*sin(v) - v'*sin(w1))",
]


def trailers(count: int) -> tuple[str, list[str]]:
    coordinates, rows = ["x", "y", "h0"], ["x'*sin(h0) = y'*cos(h0)"]
    x, y = "x'", "y'"
    for i in range(1, count + 1):
        coordinates.append(f"h{i}")
        x, y = f"{x} + sin(h{i})*h{i}'", f"{y} - cos(h{i})*h{i}'"
        rows.append(f"({x})*sin(h{i}) = ({y})*cos(h{i})")
    return " ".join(coordinates), rows


@pytest.mark.parametrize(
    ("coordinates", "rows", "nonintegrable", "integrals"),
    [
        ("x y th p", ["x' = R*cos(th)*p'", "y' = R*sin(th)*p'"], 2, []),  # a rolling disk
        ("x y th", ["y'*cos(th) - x'*sin(th) = a*th'"], 1, []),  # Chaplygin's sleigh
        ("x y th", [KNIFE, "y'*cos(th) - x'*sin(th) = a*th'"], 0, ["th", "x*sin(th) - y*cos(th)"]),
        (
            "x y th s",
            [KNIFE, "(x' - l*sin(th)*th')*sin(th + s) = (y' + l*cos(th)*th')*cos(th + s)"],
            2,
            [],
        ),  # a car
        (
            "x y th s u",
            [
                "y'*cos(th + s) - x'*sin(th + s) = l*cos(s)*th'",
                "y'*cos(th - u) - x'*sin(th - u) = -l*cos(u)*th'",
            ],
            2,
            [],
        ),  # a snakeboard
        ("x y u v w1", BALL, 2, []),  # a ball on a plane
        ("x y u v w1", [*BALL, "u'*cos(v) + w1' = 0"], 3, []),  # that does not spin
        (
            "x y u v w1",
            [BALL[0].replace("x'", "x' + a*y"), BALL[1].replace("y'", "y' - a*x")],
            2,
            [],
        ),  # on a turntable
        (*trailers(1), 2, []),
        (*trailers(4), 5, []),
        (
            "x y th p q",
            [KNIFE, ROLL.format("-", "r", "p"), ROLL.format("+", "r", "q")],
            2,
            ["2*w*th + r*p - r*q"],
        ),  # a differential drive
        (
            "x y th p q s",
            [
                KNIFE,
                ROLL.format("-", "r", "p"),
                ROLL.format("+", "r", "q"),
                ROLL.format("-", "R", "s"),
            ],
            2,
            ["2*w*th + r*p - r*q", "r*p - R*s"],
        ),
        (
            "x y th p q s",
            [
                OMNI.format(*x)
                for x in (("p", 0, 0), ("q", "2*pi/3", "2*pi/3"), ("s", "4*pi/3", "4*pi/3"))
            ],
            2,
            ["r*(p + q + s) - 3*l*th"],
        ),
        (
            "x y th p q s u",
            [
                MECANUM.format(*x)
                for x in (
                    ("p", "+", "-", "-"),
                    ("q", "-", "+", "+"),
                    ("s", "-", "+", "-"),
                    ("u", "+", "-", "+"),
                )
            ],
            2,
            ["2*l*th + r*p - r*u", "2*l*th + r*s - r*q"],
        ),
        (
            "a1 a2 a3 a4",
            ["R*a1' + r*a2' = (R + r)*a4'", "w*a3' - r*a2' = (w - r)*a4'"],
            0,
            ["R*a1 + r*a2 - (R + r)*a4", "w*a3 - r*a2 - (w - r)*a4"],
        ),  # planetary gears
        ("x y z u", ["z' = x*y' - y*x'", "u' = x^2*y'"], 2, []),
        ("x y z u", ["y' = z*x'", "z' = u*x'"], 2, []),  # Engel
        ("x y z u", ["x' - y*z' + u*x' + x*u' = 0", "x' - y*z' - u*x' - x*u' = 0"], 1, ["u*x"]),
        ("x y z u", ["x' - y*z' + cos(t) = 0", "x' - y*z' + u'*x + u*x' = 0"], 1, ["u*x - sin(t)"]),
        ("x y z", [KNIFE.replace("th", "z"), "z' = b"], 1, ["z - b*t"]),  # turns as time does
        ("x y z u", ["x' = y*z'", "(1 + 4*t)*u' + 4*u + x' = y*z'"], 1, ["(1 + 4*t)*u"]),
    ],
)
def test_what_is_integrable_of_a_distribution(
    coordinates: str, rows: list[str], nonintegrable: int, integrals: list[str]
) -> None:
    """With closed forms: each integral is a function of those that are found, and conversely."""
    found = integrability(coordinates, rows)
    assert found.nonintegrable == nonintegrable
    constraints, combinations = found.constraints.values(), found.combinations
    functions = [x.integral.expression for x in (*constraints, *combinations) if x.integral]
    assert len(functions) == len(integrals)
    symbols = [*map(se.Symbol, coordinates.split()), se.Symbol("t")]
    point = {x: se.RealDouble(0.37 + 0.21 * i) for i, x in enumerate(symbols)}
    point |= {se.Symbol(n): se.RealDouble(x) for n, x in PARAMETERS.items()}

    def gradients(expressions: list[se.Basic]) -> np.ndarray:
        rows = [[float(e.diff(x).xreplace(point).n(53, real=True)) for x in symbols] for e in expressions]  # fmt: skip # noqa: E501
        return np.array(rows).reshape(-1, len(symbols))

    known = gradients([se.sympify(text.replace("^", "**")) for text in integrals])
    both = np.vstack([known, gradients(functions)])
    assert np.linalg.matrix_rank(known, 1e-9) == np.linalg.matrix_rank(both, 1e-9) == len(integrals)


def test_the_wheels_of_a_robot_determine_its_heading() -> None:
    model = lagcli.load(FOUND / "diffdrive.yaml")
    checked = lagcli.check(model)
    found = checked.integrability
    assert {x.integrable for x in found.constraints.values()} == {"no"}
    assert found.nonintegrable == 2
    (combination,) = found.combinations
    assert combination.factors == {"left": -1, "right": 1}
    w, psi, big, a, b = map(se.Symbol, ("w", "psi", "R", "a", "b"))
    assert combination.integral is not None
    assert (combination.integral.expression - (w * psi - big * (b - a))).expand() == 0
    assert combination.value == 0
    text = " ".join(page(checked).split())
    assert "right − left: R (a − b) + w ψ = 0 integrable: it also restricts the positions" in text
    assert "Otherwise not integrable: all positions with these values remain accessible." in text
    assert "left not integrable" not in text


def test_factors_that_depend_on_positions_and_parameters() -> None:
    """x − y z' in each row, times functions, with the differential of x u."""
    rows = ["a*(x' - y*z') + cos(y)*(u*x' + x*u') = 0", "b*(x' - y*z') + y*(u*x' + x*u') = 0"]
    found = integrability("x y z u", rows)
    assert found.nonintegrable == 1
    (combination,) = found.combinations
    assert combination.factors is not None
    first, second = combination.factors["c0"], combination.factors["c1"]
    point = {se.Symbol("a"): 0.7, se.Symbol("b"): 0.4, se.Symbol("y"): 0.9}
    ratio = float((first / second).xreplace(point).n(53, real=True))
    assert ratio == pytest.approx(-0.4 / 0.7)
    assert combination.integral is not None
    assert combination.integral.expression.free_symbols == {se.Symbol("x"), se.Symbol("u")}


def test_many_rows_take_little_time() -> None:
    coordinates, rows = trailers(9)
    began = time.process_time()
    assert integrability(coordinates, rows).nonintegrable == 10
    assert time.process_time() - began < 15  # 1.5 s alone


def test_the_distribution_is_not_judged_where_rows_have_branches() -> None:
    found = integrability("x y z u", ["x' = step(z)*y'", "u' = y*z'"])
    assert found.nonintegrable is None
    assert {x.integrable for x in found.constraints.values()} == {"not tested"}
