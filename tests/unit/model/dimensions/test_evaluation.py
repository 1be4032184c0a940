"""Numbers without units take the unit with which their places are right."""

from __future__ import annotations

import operator
import random
from fractions import Fraction
from typing import Any

import pint
import pytest
import sympy
from random_cases import seeds

from lagcli.errors import ModelError
from lagcli.model.dimensions.evaluation import (
    DimensionEvaluator,
    FreeNumbers,
    is_constant,
    is_small,
)
from lagcli.model.expression.dimension import Dimension, unit_of
from lagcli.model.expression.grammar import parse
from lagcli.model.loader import load_text
from lagcli.model.model import Model

MODEL = """\
coordinates: {{x: m, y: m, phi: rad}}
parameters: {{m: 1 kg, J: 1 kg*m^2, l: 1 m, k: 10 N/m, g: 9.81 m/s^2, c: 1 N*s/m}}
definitions: {{A: "[x, y]", {definitions}}}
functions: {{f(a): 0.3*a}}
T: {T}
V: {V}
Q: {{{Q}}}
constraints: {{{constraints}}}
initial: {{x: {{guess: {initial}}}, y: {{guess: 0}}, phi: {{guess: 0}}, x': {{guess: 0}}, y': {{guess: 0}}, phi': {{guess: 0}}}}
outputs: {{o: "{output}"}}
{more}
"""  # noqa: E501
PLAIN = {
    **{"T": "m/2*(x'^2 + y'^2) + J/2*phi'^2", "V": "m*g*y", "Q": "", "constraints": ""},
    **{"initial": "0", "output": "x", "more": "", "definitions": ""},
}


def model(**changed: str) -> Model:
    return load_text(MODEL.format(**{**PLAIN, **changed}))


def taken(**changed: str) -> list[str]:
    return [unit_of(x.dimension) for x in model(**changed).units.numbers]


@pytest.mark.parametrize(
    ("changed", "units"),
    [
        # what users wrote
        ({"Q": "phi: -0.05*phi'"}, ["N*m*s"]),
        ({"constraints": "r: A[2] - 1 = 0"}, ["m"]),
        ({"initial": "-(l + m*g/k) + 0.08"}, ["m"]),
        ({"V": "k*l^2*sin(40*x + 1)"}, ["1/m"]),
        ({"more": "events: {a: {when: x <= -0.3, stop: true}}"}, ["m"]),
        ({"more": "events: {a: {when: x <= 0, set: {x: 0.3}}}"}, []),
        ({"more": "events: {a: {when: x <= 0, set: {x: -0.3}}}"}, []),
        ({"more": "events: {a: {when: x <= 0, set: {x: 0.3 - l}}}"}, ["m"]),
        ({"more": "events: {a: {when: x <= 0, impulse: {x: -5/2}}}"}, []),
        # factors, terms, sides, whole values
        ({"V": "m*9.81*y"}, ["m/s^2"]),
        ({"Q": "x: 5"}, ["N"]),
        ({"Q": "x: -2*3"}, ["N"]),
        ({"Q": "x: 100*(l - x) - 20"}, ["N/m", "N"]),
        ({"Q": "x: f(x)"}, ["N/m"]),
        ({"Q": "x: f(x'), phi: f(phi)"}, ["N*s/m", "N*m"]),  # each call has its number
        ({"constraints": "r: x^2 + y^2 = 1"}, ["m^2"]),
        ({"constraints": "r: 2*x = 3*y"}, []),
        ({"output": "if(x > 1, 0.3, y)"}, ["m", "m"]),
        ({"output": "max(x, 0.3)"}, ["m"]),
        ({"output": "atan2(y, 2)"}, ["m"]),
        ({"output": "hypot(x, 1)"}, ["m"]),
        ({"output": "x*exp(-0.3*t)"}, ["1/s"]),
        # beside t itself: a time in s, which is no assumption
        ({"output": "x*step(t - 1)"}, []),
        ({"output": "x*sin((t - 0.3)/(1.3 - t))"}, []),
        ({"output": "if(t < 5, x, y)"}, []),
        ({"output": "x*min(t, 30)/max(4 + 2*7, t)"}, []),
        ({"output": "t - 5"}, []),
        ({"more": "events: {a: {when: t >= 5, stop: true}}"}, []),
        ({"more": "events: {a: {when: 2*5 <= t and not t > 30, stop: true}}"}, []),
        ({"more": "events: {a: {when: t >= 5 or x >= 5, stop: true}}"}, ["m"]),
        ({"output": "x*step(2*t - 1)"}, ["s"]),
        ({"output": "x*step(t - (1 + x/x'))"}, ["s"]),
        ({"output": "sqrt(x/0.3)"}, []),  # a pure number fits: the unit of an output is free
        ({"Q": "x: k*sqrt(0.3*x)"}, ["m"]),
        ({"Q": "x: k*(0.3*x')^2"}, ["s/m^0.5"]),
        # several numbers in one product: the last takes the unit
        ({"Q": "x: 0.3*0.05*x'"}, ["N*s/m"]),
        # nothing to take
        ({"output": "1000*x"}, []),
        ({"output": "0.3*x/y + 1"}, []),
        ({"output": "0.05*x + 0.3*y'"}, ["s"]),  # the first stays pure
        ({"Q": "x: (1 + 0.3)*k*x"}, []),
        ({"Q": "x: k*x^1.5/sqrt(l)"}, []),
        ({"output": "0.3*sin(2)*x + y"}, []),  # functions of numbers are numbers
        ({"output": "hypot(sin(0), cos(2*pi))*x + exp(1)*y"}, []),
        # vectors
        ({"Q": "A: [0.3, -1]"}, ["N", "N"]),
        ({"Q": "A: m*[0, -9.81]"}, ["m/s^2"]),
        ({"constraints": "r: norm([x, 1]) = 2"}, ["m", "m"]),
        ({"constraints": "r: norm([2, 1]) = x"}, ["m", "m"]),
        ({"definitions": "r: [x - 0.3, 1]", "V": "k/2*dot(r, r)"}, ["m", "m"]),
        # definitions take the units of their uses
        ({"definitions": "F: 0.3*x'", "Q": "x: -F"}, ["N*s/m"]),
        ({"definitions": "h: 0.3", "V": "m*g*(y - h)"}, ["m"]),
        ({"definitions": "h: 2", "V": "m*g*(y - h)"}, ["m"]),
    ],
)
def test_numbers_take_the_unit_of_their_place(changed: dict[str, str], units: list[str]) -> None:
    assert sorted(taken(**changed)) == sorted(units)


@pytest.mark.parametrize(
    "changed",
    [
        {"T": "m*x^2/2"},
        {"T": "0.5*m*x^2"},
        {"T": "3/4*m*x^2"},
        {"V": "m*g*y + k*x"},
        {"output": "x'^2 + y^2"},
        {"output": "2*x'^2 + 3*y^2"},
        {"output": "sin(x)"},
        {"output": "sin(x/2)"},
        {"Q": "x: 10*x"},
        {"Q": "x: 12*x'"},
        {"Q": "A: m*[0, -1]"},
        {"output": "(0.3 - x)*(0.3 - t) + (0.3 - x)*l"},
        {"definitions": "h: 0.3", "V": "m*g*(y - h)", "output": "t - h"},  # one number, one unit
        {"definitions": "h: 0.3*x", "Q": "x: h, phi: h"},
        {"output": "x - pi"},
        {"output": "2^x"},
        {"Q": "x: dot([2, 3], A)"},  # factors, not terms
        {"output": "norm(A + if(x > l, A, [x, t]))"},  # reported once, and no vector then
    ],
)
def test_what_no_number_can_mend_is_an_error(changed: dict[str, str]) -> None:
    with pytest.raises(ModelError) as caught:
        model(**changed)
    assert {d.kind for d in caught.value.diagnostics} == {"units"}


NAMES = {"m": "kg", "l": "m", "k": "N/m", "g": "m/s^2", "c": "N*s/m", "x": "m", "x'": "m/s"}
PLACES = {
    "Q": ("N", 'x: "{}"'),
    "V": ("J", "m*g*y + {}"),
    "T": ("J", "m/2*(x'^2 + y'^2) + J/2*phi'^2 + {}"),
    "constraints": ("m", 'r: "y = {}"'),
    "output": ("N", "k*x - max({}, 0)"),
}


@pytest.mark.parametrize("seed", seeds(80, 200))
def test_random_products_have_the_unit_that_is_left(seed: int) -> None:
    """A number times a product of names takes the due dimension over theirs, as by Pint."""
    rng = random.Random(seed)
    registry = _registry()
    key, (due, form) = rng.choice(list(PLACES.items()))
    names = {n: e for n, e in NAMES.items() if not (n == "x'" and key in ("V", "constraints"))}
    factors = [(rng.choice(list(names)), rng.choice([1, 1, 2, -1, 3])) for _ in range(3)]
    nested = rng.choice(["{}", "sqrt(({})^2)", "{}*cos(30*x/l)", "({})/7", "if(x > 2, {}, 0)"])
    number = rng.choice(["0.3", "13", "2.7e-3", "1e3", "sqrt(0.1)"])
    parts = [f"{n}^{e}" if e > 0 else f"l^0/{n}" for n, e in factors]
    rng.shuffle(parts)
    expression = nested.format("*".join([number, *parts]))
    units = registry(due).units
    for n, e in factors:
        units = units / registry(names[n]).units ** e
    found = model(**{key: form.format(expression)}).units.numbers
    dimension = registry.Quantity(1, units).dimensionality
    taken = [registry(unit_of(x.dimension)).dimensionality for x in found]
    assert dimension == {} or dimension in taken


@pytest.mark.parametrize("seed", seeds(50, 100))
def test_random_products_of_pure_numbers_are_errors_unless_they_fit(seed: int) -> None:
    rng = random.Random(seed)
    registry = _registry()
    key, (due, form) = rng.choice(list(PLACES.items()))
    names = {n: e for n, e in NAMES.items() if not (n == "x'" and key in ("V", "constraints"))}
    factors = [(rng.choice(list(names)), rng.choice([1, 2, -1])) for _ in range(2)]
    units = registry(due).units
    for n, e in factors:
        units = units / registry(names[n]).units ** e
    right = registry.Quantity(1, units).dimensionality == {}
    number = rng.choice(["2", "1/2", "0.5", "12", "2.5", "3/8"])
    expression = "*".join([number, *(f"{n}^{e}" if e > 0 else f"1/{n}" for n, e in factors)])
    if right:
        assert not model(**{key: form.format(expression)}).units.numbers
    else:
        with pytest.raises(ModelError, match="error\\[units\\]"):
            model(**{key: form.format(expression)})


_REGISTRIES: list[pint.UnitRegistry] = []


def _registry() -> pint.UnitRegistry:
    if not _REGISTRIES:
        _REGISTRIES.append(pint.UnitRegistry(cache_folder=None))
    return _REGISTRIES[0]


@pytest.mark.parametrize("seed", seeds(60, 150))
def test_shared_numbers_are_solved_as_linear_equations(seed: int) -> None:
    """Two numbers in several terms: accepted if and only if the linear system has a solution."""
    rng = random.Random(seed)
    names = {"m": (1, 0, 0), "l": (0, 1, 0), "k": (1, 0, -2), "c": (1, 0, -1), "x": (0, 1, 0)}
    known = rng.choice([True, False])
    units = [tuple(rng.randint(-1, 1) for _ in range(3)) for _ in range(2)]
    rows, rest, terms = [], [], []
    for _ in range(rng.randint(1, 4)):
        exponents = {n: rng.randint(-1, 2) for n in rng.sample(list(names), 2)}
        a, b = rng.randint(-1, 2), rng.randint(-1, 2)
        powers = {"h": a, "n": b}
        if known:  # fill up to a force with the units that the numbers shall have
            missing = [
                due
                - a * units[0][i]
                - b * units[1][i]
                - sum(e * names[n][i] for n, e in exponents.items())
                for i, due in enumerate((1, 1, -2))
            ]
            for name, extra in (("m", missing[0]), ("l", missing[1]), ("s0", missing[2])):
                exponents[name] = exponents.get(name, 0) + extra
        dimension = [
            sum(e * {**names, "s0": (0, 0, 1)}[n][i] for n, e in exponents.items())
            for i in range(3)
        ]
        rows.append([a, b])
        rest.append([due - d for due, d in zip((1, 1, -2), dimension, strict=True)])
        factors = [f"{n}^({e})" for n, e in {**exponents, **powers}.items() if e]
        terms.append("*".join(factors) or "1")
    left, right = sympy.Matrix(rows), sympy.Matrix(rest)
    solvable = left.rank() == left.row_join(right).rank() or "1" in terms
    text = MODEL.format(
        **{
            **PLAIN,
            "definitions": "h: 0.3, n: 7",
            "Q": f'x: "{" + ".join(terms)}"',
        }
    ).replace("m: 1 kg", "m: 1 kg, s0: 1 s")
    if "1" in terms:
        return  # a bare 1 takes any unit
    if not solvable:
        assert not known
        with pytest.raises(ModelError, match="error\\[units\\]"):
            load_text(text)
        return
    found = load_text(text).units
    if left.rank() == 2:
        solution = (left.T * left).inv() * left.T * right
        for name, row in (("h", 0), ("n", 1)):
            dimension = found.names[name]
            assert isinstance(dimension, Dimension)
            assert [dimension.kg, dimension.m, dimension.s] == list(solution.row(row))


def test_equations_between_unknown_dimensions_are_solved() -> None:
    numbers = FreeNumbers()
    a, b, c = (numbers.unknown(parse("0.3")) for _ in range(3))
    ab = Dimension(m=1, numbers=((0, 1), (1, 1)))
    assert numbers.agree(ab, c)  # c = a b m
    assert numbers.agree(b, Dimension(s=1))
    assert numbers.agree(c, Dimension(kg=2))  # a = kg^2/(m s)
    assert numbers.resolved(a) == Dimension(kg=2, m=-1, s=-1)
    assert not numbers.agree(c, b)
    assert numbers.agree(Dimension(numbers=((0, 2),)), Dimension(kg=4, m=-2, s=-2))
    d = numbers.unknown(parse("0.4"))
    assert numbers.agree(Dimension(numbers=((3, 2),)), Dimension(m=1))
    assert numbers.resolved(d) == Dimension(m=Fraction(1, 2))
    assert len(list(numbers.taken())) == 4


OPERATIONS: dict[str, Any] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


@pytest.mark.parametrize("seed", range(40))
def test_exponents_are_computed_exactly(seed: int) -> None:
    """Beside Python's fractions; what divides by zero is no exponent."""
    rng = random.Random(seed)

    def expression(depth: int) -> tuple[str, Fraction | None]:
        if not depth:
            number = rng.choice(["0", "1", "2", "3", "0.5", "1.5"])
            return number, Fraction(number)
        (a, x), sign, (b, y) = expression(depth - 1), rng.choice("+-*/"), expression(depth - 1)
        undefined = x is None or y is None or (sign == "/" and not y)
        return f"({a} {sign} {b})", None if undefined else OPERATIONS[sign](x, y)

    text, expected = expression(rng.randint(1, 3))
    names: Any = None  # there are none
    assert DimensionEvaluator(names, strict=True).number(parse(text)) == expected


@pytest.mark.parametrize(
    ("text", "constant", "small"),
    [
        ("2", True, True),
        ("-1/2", True, True),
        ("0.125", True, True),
        ("sqrt(2)*pi", True, True),
        ("12", True, True),
        ("13", True, False),
        ("0.3", True, False),
        ("2.5", True, True),
        ("12.5", True, False),
        ("pi", False, True),
        ("x", False, True),
        ("2*x", False, True),
        ("[1, 2]", False, True),
    ],
)
def test_which_expressions_are_numbers(text: str, constant: bool, small: bool) -> None:
    assert is_constant(parse(text)) == constant
    assert is_small(parse(text)) == small
