"""Tree → SymEngine: values, derivatives, vectors, rotations, and what is rejected."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import symengine as se
from numpy.typing import NDArray

from lagcli.functions import FUNCTIONS
from lagcli.model.expression.constants import fault, number, relation
from lagcli.model.expression.functions import apply, derivative
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Sized, Tensor
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.loader import load_text
from lagcli.model.names.building import MAX_DEPTH, TENSOR_FUNCTIONS, ExpressionTemplate, build
from lagcli.model.names.namespace import Allowed, Namespace
from lagcli.model.names.scope import Scope

Array = NDArray[np.float64]

X, Y, DX, DY, T = (se.Symbol(n) for n in ("x", "y", "x'", "y'", "t"))


def scope(definitions: dict[str, str] | None = None, allowed: Allowed = Allowed.MOTION) -> Scope:
    """Return a scope with coordinates x, y, a parameter m, and definitions."""
    names = Namespace(
        coordinates=("x", "y"), constraints=("rod",), parameters={"m": lambda: se.Symbol("m")}
    )
    built: dict[str, Sized] = {}
    names.definitions = {}
    for name, text in (definitions or {}).items():
        built[name] = build(parse(text), Scope(names, "d", allowed))
        names.definitions = {n: (lambda n=n: built[n]) for n in built}
    return Scope(names, "it", allowed)


def value(text: str, **definitions: str):
    return build(parse(text), scope(definitions)).value


def at(expression, **values: float) -> float:
    names = {"dx": DX, "dy": DY}
    return number(
        expression.subs({names.get(k, se.Symbol(k)): se.RealDouble(v) for k, v in values.items()})
    )


MATH: dict[str, Callable[..., float]] = {
    "abs": abs,
    "sign": lambda x: math.copysign(1, x),
    "step": lambda x: float(x >= 0),
    "min": min,
    "max": max,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_have_the_values_of_math(name: str) -> None:
    function = MATH.get(name) or getattr(math, name)
    fewest = FUNCTIONS[name].fewest
    points = [1.3, 2.0, 1.1] if name == "acosh" else [0.3, -0.7, 0.9]
    if name in ("log", "log10", "log2", "sqrt", "pow"):
        points = [0.3, 0.7, 0.9]
    for x in points:
        arguments = [x, 0.6][:fewest]
        expected = function(*arguments) if name not in ("min", "max") else x
        text = f"{name}({', '.join(['x', 'y'][:fewest])})"
        assert math.isclose(at(value(text), x=x, y=0.6), expected, rel_tol=1e-14)
        # and folded, as a constant
        folded = value(f"{name}({', '.join(str(a) for a in arguments)})")
        assert math.isclose(number(folded), expected, rel_tol=1e-14)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8, 30])
def test_min_and_max_of_many(count: int) -> None:
    numbers = [math.sin(7 * i) for i in range(count)]
    symbols = [se.Symbol(f"a{i}") for i in range(count)]
    values = {s: se.RealDouble(x) for s, x in zip(symbols, numbers, strict=True)}
    assert number(apply("min", *symbols).subs(values)) == min(numbers)
    assert number(apply("max", *symbols).subs(values)) == max(numbers)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.1 + 0.2", 0.3),
        ("2^10", 1024),
        ("2^0.5", 2**0.5),
        ("0^0", 1),
        ("-2^2", -4),
        ("if(0.1 + 0.2 == 0.3, 1, 2)", 1),
        ("if(sqrt(2) < 3/2, 1, 2)", 1),
        ("if(not pi > 3, 1, 2)", 2),
        ("if(1 < 2 < 3 and 2 != 3, 1, 2)", 1),
        ("cbrt(-8)", -2),
        ("cbrt(-sqrt(2))", -(2 ** (1 / 6))),
        ("abs(-sqrt(2))", 2**0.5),
        ("max(sqrt(2), pi, 3)", math.pi),
        ("floor(-1/2)", -1),
        ("log(8, 2)", 3),
        ("dot([1, 2], [3, 4])", 11),
        ("norm([3, 4])", 5),
    ],
)
def test_constants(text: str, expected: float) -> None:
    assert math.isclose(number(value(text)), expected, rel_tol=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        *("sqrt(-1)", "1/0", "0/0", "log(0)", "log(-1)", "asin(2)", "(-8)^(1/3)", "10^400"),
        "1e308*10",
        *("0^-1", "0^(-1/2)", "tan(pi/2)", "exp(1000)", "1/(1 - 1)", "x/(x - x)", "atan2(0, 0)"),
        *("acosh(1/2)", "atanh(1)", "(-2)^pi", "(-2)^x", "0^x", "sqrt(-1) + x", "x + log(x - x)"),
        *("if(1 < sqrt(-1), 1, 2)", "max(1, log(0))", "floor(1e300*1e300)", "floor(exp(1000))"),
        *("expm1(1000)", "1/expm1(1000)", "log1p(-1)", "x + log1p(-2)", "expm1(1e300*pi)"),
        *("dot([1/0], [1])", "exp(exp(exp(exp(9))))", "pow(0, -1)", "pow(-8, 1/3)"),
    ],
)
def test_what_is_no_number_is_rejected(text: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        value(text)
    assert caught.value.kind == "not-a-number"


@pytest.mark.parametrize(
    "text",
    ["9^9^9^9", "x^1001", "x^1000.5", "(10^300)^1000", "x^-9999", "(((x/3)^1000)^1000)^1000"],
)
def test_powers_are_bounded(text: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        value(text)
    assert caught.value.kind == "too-large"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x^1.3333", 3.7**1.3333),
        ("x^-7.1109", 3.7**-7.1109),
        ("x^0.333333333333", 3.7**0.333333333333),
        ("12.3456789^9.87", 12.3456789**9.87),
        ("2^(1/1001)", 2 ** (1 / 1001)),
        ("6^6.148", 6**6.148),
    ],
)
def test_exponents_may_have_many_decimals(text: str, expected: float) -> None:
    found = float(value(text).subs({X: 3.7}).n(53, real=True))
    assert found == pytest.approx(expected, rel=1e-14)


def test_a_parameter_may_be_the_exponent_of_a_negative_number() -> None:
    assert value("(-2)^m").subs({se.Symbol("m"): 3}) == -8


def test_fault() -> None:
    assert fault(se.Integer(10) ** 300) is None
    assert fault(se.Rational(1, 10**400)) is None
    assert "real" in str(fault(se.sqrt(se.Integer(-1))))
    for infinite in (se.zoo, se.oo, -se.oo, se.RealDouble(math.inf), se.Integer(2) ** 1100):
        assert "infinite" in str(fault(infinite))


def test_relations_of_constants_are_decided() -> None:
    assert relation("==", se.RealDouble(0.5), se.Rational(1, 2)) == se.true
    assert relation("<", se.sqrt(se.Integer(2)), se.pi) == se.true
    assert relation(">=", X, se.Integer(0)) == se.Ge(X, 0)


def test_doubling_definitions_are_bounded() -> None:
    definitions = {"d0": "x"} | {f"d{i}": f"sin(d{i - 1})*cos(d{i - 1})" for i in range(1, 60)}
    with pytest.raises(ExpressionError) as caught:
        scope(definitions)
    assert caught.value.kind == "too-large"


@pytest.mark.parametrize("function", ["abs", "sign", "cbrt"])
def test_nested_cases_count_their_copies(function: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        value(f"{function}(" * 40 + "x" + ")" * 40)
    assert caught.value.kind == "too-large"


def test_depth_is_bounded() -> None:
    definitions = {"d0": "x"}
    definitions |= {f"d{i}": f"sin(cos(d{i - 1}))" for i in range(1, MAX_DEPTH)}
    with pytest.raises(ExpressionError) as caught:
        scope(definitions)
    assert f"{MAX_DEPTH} functions deep" in caught.value.message


def test_chains_of_sums_are_not_deep() -> None:
    definitions = {"s0": "x"} | {f"s{i}": f"s{i - 1} + m*sin(y)" for i in range(1, 1000)}
    scope(definitions)


# derivatives


def numeric(function: Callable[[float], Array | float], step: float = 1e-5) -> Array:
    """Differentiate at 0, with an error of step⁴."""
    f = {k: np.asarray(function(k * step)) for k in (-2, -1, 1, 2)}
    return (8 * (f[1] - f[-1]) - (f[2] - f[-2])) / (12 * step)


MOTION = {"x": 0.7, "y": -0.4, "dx": 1.3, "dy": 0.8, "t": 0.2}


def moved(s: float) -> dict[str, float]:
    """Return the state after a time s at constant velocity."""
    now = dict(MOTION)
    now["x"] += s * MOTION["dx"]
    now["y"] += s * MOTION["dy"]
    now["t"] += s
    return now


@pytest.mark.parametrize(
    "text",
    [
        *("x*sin(y)*t", "abs(y)*x", "max(x, y, x*y)", "floor(9*x)*x", "if(x > y, x^2, y)"),
        *("cbrt(y)", "atan2(y, x)", "sign(y)*x", "hypot(x, y)", "step(x)*y", "x^y"),
        *("log(x, 3)", "ceil(x)*t"),
    ],
)
def test_primes_are_total_time_derivatives(text: str) -> None:
    found = at(value("d'", d=text), **MOTION)
    expected = numeric(lambda s: at(value(text), **moved(s)))
    # central differences of order 4: rounding 1e-16/1e-5
    assert math.isclose(found, float(expected), rel_tol=1e-9, abs_tol=1e-9)


def test_two_primes_bring_accelerations() -> None:
    inner = scope({"d": "x^2"}, Allowed.ACCELERATIONS)
    found = build(parse("d''"), inner).value
    assert se.expand(found - 2 * DX**2 - 2 * X * se.Symbol("x''")) == 0
    with pytest.raises(ExpressionError, match="accelerations"):
        value("d''", d="x^2")
    with pytest.raises(ExpressionError, match="highest derivative"):
        build(parse("d'''"), inner)


def test_dots_are_primes() -> None:
    assert value("d_dot*x_dot", d="x*y") == value("d'*x'", d="x*y")


def test_derivatives_of_jumps_are_zero() -> None:
    assert derivative(se.floor(X**2) * X, X) == se.floor(X**2)
    assert derivative(derivative(se.floor(X * Y) * X**2, X), X) == 2 * se.floor(X * Y)


# vectors and rotations


def array(tensor: Tensor, **values: float) -> Array:
    return np.array([[at(e, **values) for e in row] for row in tensor.rows])


ROTATIONS = {
    "elementary": "rot_x(x)*rot_z(y)",
    "three": "rot_z(x)*rot_x(y)*rot_z(x*y + t)",
    "axis": "rot([1, 2, 2], x)*rot_y(y^2)",
    "transposed": "transpose(rot_x(x)*rot_y(y))*rot_z(t)",
    "no factors": "[[cos(x), -sin(x), 0], [sin(x), cos(x), 0], [0, 0, 1]]*rot_x(y)",
    # a unit quaternion, by construction
    "quaternion": "quat(cos(x)*cos(t), sin(x)*cos(y), sin(x)*sin(y), cos(x)*sin(t))",
}


@pytest.mark.parametrize("text", ROTATIONS.values(), ids=ROTATIONS)
def test_rotations_are_rotations(text: str) -> None:
    r = array(value(text), **MOTION)
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-15)
    assert math.isclose(np.linalg.det(r), 1, rel_tol=1e-15 * 4)


@pytest.mark.parametrize("text", ROTATIONS.values(), ids=ROTATIONS)
def test_omega_is_the_body_frame_angular_velocity(text: str) -> None:
    rotation = value(text)
    spin = array(rotation, **MOTION).T @ numeric(lambda s: array(rotation, **moved(s)))
    expected = [spin[2, 1], spin[0, 2], spin[1, 0]]
    found = array(value("omega(R)", R=text), **MOTION)[:, 0]
    np.testing.assert_allclose(found, expected, atol=1e-9)  # as the differences are


def test_senses_of_rotation() -> None:
    quarter = math.pi / 2
    for text, expected in [
        ("rot_z(x)*[1, 0, 0]", [0, 1, 0]),
        ("rot_x(x)*[0, 1, 0]", [0, 0, 1]),
        ("rot_y(x)*[0, 0, 1]", [1, 0, 0]),
    ]:
        turned = array(value(text), x=quarter)[:, 0]
        np.testing.assert_allclose(turned, expected, atol=1e-15)
    half = value("quat(cos(x/2), 0, 0, sin(x/2)) - rot_z(x)")
    np.testing.assert_allclose(array(half, x=0.7), 0, atol=1e-15)


def test_products() -> None:
    r = value("[[1, 2], [3, 4]]*[x, y]*2 - [x, 0]/m")
    np.testing.assert_allclose(
        array(r, x=1.0, y=2.0, m=4.0)[:, 0], [2 * 5 - 1 / 4, 2 * 11], rtol=1e-15
    )
    assert value("cross([1, 0, 0], [0, 1, 0])") == value("[0, 0, 1]")
    assert value("transpose([[1, 2], [3, 4]])") == value("[[1, 3], [2, 4]]")
    assert value("-[x, y]") == value("[-x, -y]")


def test_a_serial_arm_of_many_rotations_is_not_too_large() -> None:
    text = "*".join(f"rot_z(x)*rot_x(y + {i})" for i in range(4))
    with pytest.raises(ExpressionError, match="operations"):
        value(f"dot({'*'.join([text] * 4)}*[1, 2, 3], [1, 0, 0])")
    assert value(f"dot({text}*[1, 2, 3], [1, 0, 0])") is not None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[x, y] + 1", "cannot be added; a component is written `A.x`"),
        ("[x, y]*[x, y]", "use dot"),
        ("[x, y]^2", "dot(a, a)"),
        ("1/[x, y]", "cannot divide"),
        ("rot_x(x)*[x, y]", "cannot be multiplied"),
        ("sin([x])", "must be a scalar"),
        ("dot(x, [y])", "needs a vector"),
        ("rot_x([x])", "needs a scalar"),
        ("cross([1, 2], [3, 4])", "two vectors of 3"),
        ("[[1, 2], [3]]", "equal length"),
        ("[1, [2]]", "row of a matrix"),
        ("[]", "needs entries"),
        ("rot([x, 0, 0], y)", "axis"),
        ("omega([x, y])", "3×3"),
        ("x > 1", "not a value"),
        ("1 + (x > 1)", "not a value"),
        ("if(x, 1, 2)", "expected a condition"),
        ("if(x > 1 and y, 1, 2)", "expected a condition"),
        ("(x > 1) > 2", "not a value"),
        ("atan2(x)", "takes 2 arguments, not 1"),
        ("log(x, y, 1)", "takes 1 or 2"),
        ("min()", "takes 1 or more"),
        ("if(x > 1, 2)", "takes 3"),
        ("arctan(x)", "`atan`"),
        ("sinn(x)", "did you mean `sin`"),
        ("m(x)", "is not a function"),
        ("sum(x)", "needs an index and its range"),
    ],
)
def test_shapes_conditions_and_calls(text: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        value(text)
    error = caught.value
    assert words in f"{error.message}; {error.help}"
    assert 0 <= error.start < error.end <= len(text)


def test_no_name_is_two_functions() -> None:
    assert not FUNCTIONS.keys() & TENSOR_FUNCTIONS.keys()


MODEL = load_text(
    "coordinates: [x[1..6]]\nparameters: {k: 1}\nT: sum(x[i]'^2, i = 1..6)/2\n"
    "initial: {x[1..6]: 0, x[1..6]': 0}\n"
)


@pytest.mark.parametrize(
    ("text", "built"),
    [
        ("k*(x[i] - x[i + 1])^2", 1),  # all others are renamed
        ("x[i]*x[4]", 3),  # for i = 4 two symbols become one, which no renaming gives or undoes
        ("i*x[i]", 5),  # the index is a number, too
        ("x[i] + x[6 - i]", 3),  # equal members at i = 3
    ],
)
def test_renamed_expressions_are_those_built_again(text: str, built: int) -> None:
    scope = Scope(MODEL.names, "it", indices=("i",))
    count = 0

    def counted(tree):
        nonlocal count
        count += 1
        return build(tree, scope)

    scope.values["i"] = 1
    template = ExpressionTemplate(parse(text), scope, counted)
    for i in range(1, 6):
        scope.values["i"] = i
        assert template.value().value == build(parse(text), scope).value
    assert count == built


SUMMED = """\
coordinates: [x[1..3], y[1..3], a[1..3]]
parameters: {m: 2, c: 0.3, g[1..3]: [1, 2, 3]}
functions:
  rate(z): z'
  turn(z): omega(rot_z(z)).z
definitions:
  mean: (x[1] + x[2] + x[3])/3
  last: x[3]^2
  centre: [mean, y[2], 0]
  total: sum(x[i] + i, i = 1..3)
T: sum(x[i]'^2 + y[i]'^2 + a[i]'^2, i = 1..3)/2
initial: {x[1..3]: 0, x[1..3]': 0, y[1..3]: 0, y[1..3]': 0, a[1..3]: 0, a[1..3]': 0}
"""


@pytest.mark.parametrize(
    "term",
    [
        "m*(x[i] - mean)^2",
        "(x[i]' - mean')^2",
        "x[i]'*mean",
        "x[i]*last",
        "x[i]*last'",
        "y[i]*last",
        "dot([x[i], y[i], 0], centre)",
        "x[i]*total",
        "rate(x[i]^2)",
        "rate(g[i]*y[i])*x[i]'",
        "rate(rate(sin(a[i])))",
        "turn(a[i])^2",
        "omega(rot_z(a[i])*rot_x(y[i])).x",
        "body(m, diag(1, 1, c), [x[i], y[i], 0], rot_z(a[i]))",
        "body(m, diag(1, 1, c), [x[i], y[i], 0] - centre, rot_z(a[i] - mean))",
    ],
)
def test_a_sum_is_the_sum_of_its_terms(term: str) -> None:
    terms = [term.replace("[i]", f"[{i}]") for i in (1, 2, 3)]
    written = SUMMED + "outputs:\n"
    written += f'  summed: "sum({term}, i = 1..3)"\n  added: "{" + ".join(terms)}"\n'
    written += f'  each[i = 1..3]: "{term}"\n' + "".join(
        f'  alone_{i}: "{x}"\n' for i, x in enumerate(terms, 1)
    )
    expressions = load_text(written).outputs
    assert se.expand(expressions["summed"] - expressions["added"]) == 0
    for i in (1, 2, 3):
        assert expressions[f"each[{i}]"] == expressions[f"alone_{i}"]
