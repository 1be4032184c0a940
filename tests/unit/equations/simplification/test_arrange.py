"""Arranged formulas have the value of what they were arranged from, and read as people write."""

from __future__ import annotations

import math
import random
import re
import time

import pytest
import symengine as se
from formula_values import (
    MODELS,
    equations_of,
    expressions,
    model_of,
    number,
    point,
    size,
    value,
)
from shipped import PATHS, WRITTEN, every_model

from lagcli.equations.derivation.lagrange import Equations, derive
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.simplification.arrange import (
    Arranger,
    cases_node,
    condition_node,
    writing_order,
)
from lagcli.equations.typesetting.nodes import (
    Call,
    Cases,
    Logical,
    Node,
    Number,
    Relation,
    Symbol,
    children,
    weight,
)
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.model.expression.functions import apply, cases
from lagcli.model.loader import load_text

# Both sides are sums in doubles of some hundred terms at most: 1e-16 each, of the terms' size.
TOLERANCE = 1e-12


def text(equations: Equations, expression: se.Basic) -> str:
    model = equations.model
    return TextFormula(Notation(model)).text(Arranger(model).arrange(expression))


def equation(equations: Equations, i: int) -> str:
    return text(equations, equations.momentum_rates[i] - equations.gradient[i])


def assert_equal_values(equations: Equations, points: int = 2) -> None:
    arranger = Arranger(equations.model, named=True)
    source = random.Random(8)
    compared = 0
    for name, expression in expressions(equations).items():
        node = arranger.arrange(expression)
        for _ in range(points):
            at = point(equations, source)
            try:
                wanted = number(expression, at)
            except RuntimeError:  # not real at this point
                continue
            scale = size(expression, at)
            if not expression.atoms(se.Piecewise):
                scale = max(scale, size(se.expand(expression), at))
            assert abs(value(node, at) - wanted) <= TOLERANCE * scale, name
            compared += 1
    assert compared > points


@pytest.mark.parametrize("name", every_model(few=WRITTEN))
def test_arranged_expressions_keep_their_value(name):
    assert_equal_values(equations_of(PATHS[name]))


@pytest.mark.parametrize(
    ("function", "shown"),
    [
        ("abs(x)", "|x|"),
        ("abs(x - y)", "|x − y|"),
        ("sign(x)", "sign(x)"),
        ("step(x)", "step(x)"),
        ("min(x, y)", "min(x, y)"),
        ("max(x, y)", "max(x, y)"),
        ("max(x, 0)", "max(x, 0)"),
        ("max(0, x)", "max(0, x)"),
        ("min(x, y, x*y)", "min(x, y, x y)"),
        ("cbrt(x)", "cbrt(x)"),
        ("if(x > 1, y, 2*y)", "if(x > 1, y, 2 y)"),
        ("if(x > 1 and y < 2, x, y)", "if(x > 1 and y < 2, x, y)"),
        ("hypot(x, y)", "√(x² + y²)"),
        ("exp(-x)*sqrt(y^2 + 1)", "exp(−x) √(1 + y²)"),
        ("(x^2 + y^2)^(3/2)", "(x² + y²)^(3/2)"),
        ("1/(x + y)", "1/(x + y)"),
        ("x^y + tan(x/2)^2", "tan²(½ x) + x^y"),
        ("atan2(y, x) + asinh(x) + erf(x)", "asinh(x) + erf(x) + atan2(y, x)"),
        ("log(x^2 + 1)/2", "½ log(1 + x²)"),
        ("sin(x - t)*cos(pi*t)", "sin(x − t) cos(π t)"),
    ],
)
def test_functions_are_recognized(function, shown):
    equations = model_of("x y", "m/2*(x'^2 + y'^2)", f"m*({function})")
    assert text(equations, equations.potential / se.Symbol("m")) == shown
    assert_equal_values(equations, points=4)


def test_conditions():
    equations = model_of("x y", "m/2*(x'^2 + y'^2)")
    x, y = equations.q
    both = se.And(se.Gt(x, 1), se.Lt(y, 2))
    assert text(equations, cases(se.Gt(x, 1), y, 2 * y)) == "if(x > 1, y, 2 y)"
    assert text(equations, cases(both, x, y)) == "if(x > 1 and y < 2, x, y)"
    nested = cases(se.Gt(x, 1), y, cases(se.Lt(x, 0), 2 * y, se.Integer(3)))
    assert text(equations, nested) == "if(x > 1, y, if(x < 0, 2 y, 3))"
    assert text(equations, cases(se.Ne(x, 1), y, y)) == "y"
    for e in (both, se.Ne(x, 1), se.Or(both, se.Le(x, 0))):
        whole = 3 * cases(e, x, y) ** 2 + x
        for seed in range(5):
            at = point(equations, random.Random(seed))
            node = Arranger(equations.model).arrange(whole)
            assert value(node, at) == pytest.approx(number(whole, at))


@pytest.mark.parametrize("function", ["abs(x*y)", "sign(x')*x", "min(x, sin(y))", "floor(x)*y"])
def test_derivatives_of_cases_keep_their_value(function):
    equations = model_of("x y", f"m/2*(x'^2 + y'^2)*(2 + {function.replace(chr(39), '')})")
    assert_equal_values(equations, points=4)


def test_double_pendulum_in_angles():
    equations = model_of(
        "theta_1 theta_2",
        "m_1/2*((l_1*cos(theta_1)*theta_1')^2 + (l_1*sin(theta_1)*theta_1')^2)"
        " + m_2/2*((l_1*cos(theta_1)*theta_1' + l_2*cos(theta_2)*theta_2')^2"
        " + (l_1*sin(theta_1)*theta_1' + l_2*sin(theta_2)*theta_2')^2)",
        "-(m_1 + m_2)*g*l_1*cos(theta_1) - m_2*g*l_2*cos(theta_2)",
        parameters="m_1 m_2 l_1 l_2 g",
    )
    assert equation(equations, 0) == (
        "(m₁ + m₂) l₁² θ̈₁ + m₂ l₁ l₂ [θ̈₂ cos(θ₁ − θ₂) + θ̇₂² sin(θ₁ − θ₂)] + (m₁ + m₂) g l₁ sin θ₁"
    )
    assert equation(equations, 1) == (
        "m₂ l₂² θ̈₂ + m₂ l₁ l₂ [θ̈₁ cos(θ₁ − θ₂) − θ̇₁² sin(θ₁ − θ₂)] + m₂ g l₂ sin θ₂"
    )
    assert_equal_values(equations)


def test_spherical_coordinates():
    equations = model_of(
        "r theta phi", "m/2*(r'^2 + r^2*theta'^2 + r^2*sin(theta)^2*phi'^2)", "-m*g*r*cos(theta)"
    )
    assert equation(equations, 0) == "m (r̈ − r θ̇² − r φ̇² sin² θ) − m g cos θ"
    assert equation(equations, 1) == ("m r (r θ̈ + 2 ṙ θ̇ − r φ̇² sin θ cos θ) + m g r sin θ")


@pytest.mark.parametrize(
    ("expression", "shown"),
    [
        ("m*(x'^2 + 2*x'*y' + y'^2)", "m (ẋ + ẏ)²"),
        ("m*(2*x'^2 + 2*x'*y')", "2 m (ẋ + ẏ) ẋ"),
        ("m*(x'^2 - y'^2)*sin(x)", "m (ẋ² − ẏ²) sin x"),
        ("m*x'^2*cos(x)^2 + m*x'^2*sin(x)^2", "m ẋ²"),
        ("m*x'^2*(1 - cos(x)^2)", "m ẋ² sin² x"),
        ("2*m*x'*cos(x)^2 + m*x'*sin(x)^2", "m (1 + cos² x) ẋ"),
        ("m*x'*(cos(x)*cos(y) - sin(x)*sin(y))", "m ẋ cos(x + y)"),
        ("m*x'*(sin(x)*cos(y) - cos(x)*sin(y))", "m ẋ sin(x − y)"),
        ("m*x'*(sin(x)*cos(y) + cos(x)*sin(y))", "m ẋ sin(x + y)"),
        ("m*x'*(cos(y)*cos(x + y) + sin(y)*sin(x + y))", "m ẋ cos x"),
        ("-x' + y'", "ẏ − ẋ"),
        ("m*l*x' + g*l*x'", "(m + g) l ẋ"),
        ("(m + g)*x'", "(m + g) ẋ"),
        ("x'/3 + y'/7", "⅓ ẋ + ¹⁄₇ ẏ"),
        ("m*g/l*x", "m g x/l"),
    ],
)
def test_short_forms(expression, shown):
    equations = model_of("x y", f"({expression})*x'")
    whole = equations.kinetic / se.Symbol("x'")
    assert text(equations, se.expand(whole)) == shown


def test_parameters_are_written_as_in_the_models_products():
    equations = model_of("x", "m/2*l^2*x'^2", "m*g*l*cos(x)", parameters="l m g")
    assert writing_order(equations.model) == ("m", "g", "l")
    assert equation(equations, 0) == "m l² ẍ − m g l sin x"


def test_of_contradicting_products_the_first_counts():
    equations = model_of("x", "m/2*l*x'^2 + l*m*x'^2", parameters="l m")
    assert writing_order(equations.model) == ("m", "l")


def test_a_hopeless_expansion_keeps_its_structure():
    factors = "*".join(f"(x + {i}*y + sin({i}*x))" for i in range(1, 10))
    equations = model_of("x y", f"m/2*x'^2 + m/2*y'^2*(2 + {factors})")
    arrange = Arranger(equations.model).arrange
    at = point(equations, random.Random(8))
    start = time.process_time()
    for expression in (equations.kinetic, *equations.momenta, *equations.gradient):
        node = arrange(expression)
        # products of nine sums lose a digit or two
        assert value(node, at) == pytest.approx(number(expression, at), rel=1e-12)
        assert weight(node) < 10_000
    assert time.process_time() - start < 5


def chain(n: int) -> Equations:
    names = [f"{c}{i}" for i in range(1, n + 1) for c in "xy"]
    kinetic = " + ".join(f"m/2*{q}'^2" for q in names)
    rods = [f"  rod{i}: (x{i} - x{i - 1})^2 + (y{i} - y{i - 1})^2 = l^2" for i in range(2, n + 1)]
    lines = [
        f"coordinates: [{', '.join(names)}]",
        "parameters: {m: 1, g: 9.81, l: 0.1}",
        f"T: {kinetic}",
        f"V: {' + '.join(f'm*g*y{i}' for i in range(1, n + 1))}",
        "constraints:",
        "  rod1: x1^2 + y1^2 = l^2",
        *rods,
        "initial:",
        *(f"  {q}: {{guess: 0}}\n  {q}': 0" for q in names),
    ]
    return derive(load_text("\n".join(lines)))


def test_a_chain_of_fifty_costs_little():
    equations = chain(50)
    start = time.process_time()
    arrange = Arranger(equations.model).arrange
    nodes = [arrange(e) for e in expressions(equations).values()]
    assert time.process_time() - start < 5
    assert max(map(weight, nodes[3:])) < 200  # T, V and L know all coordinates, the rest does not


def test_a_chain_in_angles_stays_bounded():
    n = 14
    angles = [f"a{i}" for i in range(n)]
    parts = []
    for i in range(n):
        x = " + ".join(f"l*cos({a})*{a}'" for a in angles[: i + 1])
        y = " + ".join(f"l*sin({a})*{a}'" for a in angles[: i + 1])
        parts.append(f"m/2*(({x})^2 + ({y})^2)")
    equations = model_of(" ".join(angles), " + ".join(parts))
    start = time.process_time()
    arrange = Arranger(equations.model).arrange
    first = arrange(equations.momentum_rates[0] - equations.gradient[0])
    assert time.process_time() - start < 5
    # 14 accelerations and 13 squares of velocities, each with one function of a difference
    assert sum(1 for term in children(first) for _ in children(term)) < 400


def left_sides(name: str) -> list[str]:
    """Return the left sides of the equations of motion of a shipped model, with named roots."""
    path = next(x for x in MODELS if x.stem == name)
    f = Formulas(equations_of(path))
    write = TextFormula(Notation(f.model)).text
    return [write(f.equation_line(i).sides[0]) for i in range(len(f.coordinates))]


def shape(text: str) -> str:
    """Return a formula without its names and signs."""
    return re.sub(r"[−+]", "±", re.sub(r"[^\W\d]+[̈̇]?[₀₁₂₃]?", "x", text))


def test_twins_are_arranged_alike():
    """Like coordinates have like equations: each begins with its own acceleration."""
    quaternion = left_sides("heavy_top")[3:]
    for i, line in enumerate(quaternion):
        assert re.match(rf"4 J_t {{\(e.² \+ e.²\) ë{'₀₁₂₃'[i]} ", line)
        assert shape(line).startswith("4 x {(x ± x) x ± (x x ± x x) x ± (x x ± x x) x ± 2 [")
        spin = "(x x ± x x ± x x ± x x)"
        assert shape(line).endswith(f" 4 x [x {spin} ± 2 x {spin}]")
    x_l, y_l, x_r, y_r = left_sides("car_axis")
    assert x_l == "m ẍ_l + k x_l (L_l − L₀)/L_l"
    assert y_l == "m ÿ_l + m g + k y_l (L_l − L₀)/L_l"
    assert x_r == "m ẍ_r + k (L_r − L₀) (x_r − x_b)/L_r"
    assert y_r == "m ÿ_r + m g + k (L_r − L₀) (y_r − y_b)/L_r"


def test_the_own_acceleration_comes_first():
    _, second = left_sides("slider_crank")
    assert second.startswith("m l² ψ̈ − m r l [φ̈ cos(φ + ψ) − φ̇² sin(φ + ψ)]")


def test_accelerations_and_velocities_have_common_factors_of_their_own():
    equations = model_of("x y", "m/2*(x'^2 + y'^2)")
    (x, y), (u, v), (a, b) = equations.q, equations.v, equations.a
    m = se.Symbol("m")
    shown = text(equations, m * (x * x * a + x * y * b + 2 * v * x * u + 2 * v * y * v))
    assert shown == "m [x (x ẍ + y ÿ) + 2 ẏ (x ẋ + y ẏ)]"


def test_a_positive_term_begins_a_sum_of_brackets():
    equations = model_of("x y", "m/2*(x'^2 + y'^2)", parameters="m l")
    x, y = equations.q
    assert text(equations, se.sqrt(se.Symbol("l") ** 2 - x * x - y * y)) == "√(l² − x² − y²)"


X, Y, Z = se.symbols("x y z")


def arrange(e: se.Basic) -> Node:
    """Return a number or a name; sums are not of interest here."""
    return Number(int(e)) if isinstance(e, se.Integer) else Symbol(str(e))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("abs", (X,)),
        ("sign", (X,)),
        ("step", (X,)),
        ("cbrt", (X,)),
        ("min", (X, Y)),
        ("max", (X, Y)),
        ("min", (X, Y, Z)),
        ("max", (X, Y, Z)),
    ],
)
def test_functions_are_called_by_their_names(name: str, arguments: tuple[se.Basic, ...]) -> None:
    found = cases_node(apply(name, *arguments), arrange)
    assert isinstance(found, Call)
    assert found.function == name
    assert sorted(map(str, found.arguments)) == sorted(str(arrange(a)) for a in arguments)


def test_other_cases_stay_cases() -> None:
    condition = se.And(se.Lt(X, 2), se.Ne(Y, 1))
    found = cases_node(se.Piecewise((X, condition), (Z, se.true)), arrange)
    assert isinstance(found, Cases)
    almost = se.Piecewise((X, se.Le(0, X)), (-2 * X, se.true))  # |x|, but for the slope
    assert isinstance(cases_node(almost, arrange), Cases)


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        (se.Lt(X, Y), Relation(arrange(X), "<", arrange(Y))),
        (se.Le(X, 2), Relation(arrange(X), "<=", Number(2))),
        (se.Ge(X, 2), Relation(arrange(X), ">=", Number(2))),  # SymEngine has 2 <= x
        (se.Eq(X, 2), Relation(arrange(X), "==", Number(2))),
    ],
)
def test_conditions_have_their_variable_on_the_left(condition: se.Basic, expected: Node) -> None:
    assert condition_node(condition, arrange) == expected


def test_joined_conditions_come_in_one_order() -> None:
    one, other = se.Lt(X, 0), se.Lt(Y, 0)
    found = condition_node(se.Or(other, one), arrange)
    assert found == Logical("or", tuple(Relation(arrange(s), "<", Number(0)) for s in (X, Y)))


def test_differences_from_parameters_are_kept_as_those_of_coordinates() -> None:
    model = load_text(
        "coordinates: [x, y, X]\nparameters: {m: 1, l: 1, R: 0.3, g: 9.81, k: 3}\n"
        "T: m/2*(x'^2 + y'^2 + X'^2)\nV: m*g*y + k/2*(y - R)^2 + k/2*(x - X - R)^2\n"
        "constraints: {rod: (x - X)^2 + (y - R)^2 = l^2}\n"
        "initial: {x: 1, y: {guess: 0.3}, X: 0, x': 0, y': {guess: 0}, X': 0}\n"
    )
    equations = derive(model)
    x, y, base, v, w, u = map(se.Symbol, ("x", "y", "X", "x'", "y'", "X'"))
    assert text(equations, equations.gradient[1]) == "−m g − k (y − R)"
    assert text(equations, equations.gradient[0]) == "−k (x − X − R)"
    velocity = 2 * (x - base) * (v - u) + 2 * (y - se.Symbol("R")) * w
    assert text(equations, velocity) == "2 [(x − X) (ẋ − Ẋ) + (y − R) ẏ]"
    # but not where y is alone too
    assert text(equations, (y - se.Symbol("R")) * w - y * w) == "−R ẏ"
    assert_equal_values(equations)


@pytest.mark.parametrize(
    ("potential", "force"),
    [
        ("(1.2 + x)^b", lambda x: 2 * (1.2 + x)),
        ("(x*(1 + x))^b", lambda x: 2 * x * (1 + x) * (1 + 2 * x)),
        ("(1 + x)^c", lambda x: 0.5 / math.sqrt(1 + x)),
        ("(x*(1 + x))^(b*d) + x", lambda x: 1),
        ("a*(1 + x)^(b - 3)", lambda x: 2 / (1 + x) ** 2),
        ("(a*x)^b*(1 + x)^d", lambda x: 8 * x),
        ("(1 + x)^b*(2 + x)^(b + 1)", lambda x: (1 + x) * (2 + x) ** 2 * (7 + 5 * x)),
        ("d^b*x + x", lambda x: 1),
    ],
)
def test_exponents_that_are_parameters_have_values(potential: str, force) -> None:
    equations = derive(
        load_text(
            f"coordinates: [x]\nparameters: {{a: -2, b: 2, c: 0.5, d: 0}}\nT: x'^2/2\n"
            f"V: {potential}\ninitial: {{x: 1, x': 0}}\n"
        )
    )
    formulas = Formulas(equations, numeric=True)
    node = formulas.arrange(equations.gradient[0])
    for x in (0.3, 0.7, 1.9):
        assert value(node, {"x": x}) == pytest.approx(-force(x), rel=1e-12)
