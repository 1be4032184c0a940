"""Closed forms satisfy their equations, on the branch of the given values."""

from __future__ import annotations

import math

import pytest
import symengine as se

from lagcli.equations.reduction.closed_forms import Angle, angle_of, solve

a, b, c, q, u, w = map(se.Symbol, ("a", "b", "c", "q", "u", "w"))
sin, cos = se.sin, se.cos
AT = {a: 0.3, b: 0.7, c: 0.5, q: 0.4}


def number(expression: se.Basic, values: dict[se.Basic, float]) -> float:
    known = {s: se.RealDouble(values[s]) for s in expression.free_symbols}
    return float(expression.xreplace(known).n(53, real=True))


#: One equation and a value of its unknown; a constant is added so that it holds there.
ONE = {
    "linear": (a * u + b * q, -0.93),
    "square": ((u - q) ** 2 + b * q, 0.9),
    "square below": ((u - q) ** 2 + b * q, -0.9),
    "quadratic": (a * u**2 + b * u + q, 1.3),
    "quadratic, other root": (a * u**2 + b * u + q, -4.1),
    "sine": (a * sin(u) + b * q, 0.6),
    "sine behind": (a * sin(u) + b * q, 2.7),
    "sine, turned": (a * sin(u) + b * q, 0.6 + 4 * math.pi),
    "cosine": (a * cos(u) + b * q, 0.6),
    "cosine below": (a * cos(u) + b * q, -0.6),
    "sine and cosine": (a * sin(u) + b * cos(u) + q, 2.1),
    "other angle": (a * sin(u + q) + b * cos(u + q), 0.8),
    "minus": (a * sin(q - u) + b * cos(q - u), 0.8),
    "two angles": (a * sin(u + q) + b * cos(u), -1.1),
    "squares of both": (a * sin(u) ** 2 + a * cos(u) ** 2 + b * sin(u), 0.4),
}


@pytest.mark.parametrize("name", ONE)
def test_one_equation(name: str) -> None:
    form, value = ONE[name]
    at = AT | {u: value}
    equation = form - c
    at[c] = number(form, at)
    (found,) = solve([equation], [u], lambda e: number(e, at))
    assert u not in found.value.free_symbols
    assert number(found.value, at) == pytest.approx(value, rel=1e-12)
    if found.angle is not None:
        assert number(found.sine - sin(found.angle), at) == pytest.approx(0, abs=1e-12)
        assert number(found.cosine - cos(found.angle), at) == pytest.approx(0, abs=1e-12)
        # and without u where functions of it are replaced
        used = a * u + sin(2 * u + q) + cos(u - q)
        put = found.put_into(used)
        assert u not in put.free_symbols
        assert number(put, at) == pytest.approx(number(used, at), rel=1e-12)


def loop(first: float, second: float):
    """Return the closure of a four-bar linkage at two angles."""
    at = AT | {u: first, w: second}
    d, e = se.Symbol("d"), se.Symbol("e")
    forms = (a * cos(q) + b * cos(u) - c * cos(w), a * sin(q) + b * sin(u) - c * sin(w))
    at |= {d: number(forms[0], at), e: number(forms[1], at)}
    return [forms[0] - d, forms[1] - e], at


PAIRS = {
    "loop": lambda: loop(0.9, 1.9),
    "loop, other assembly": lambda: loop(-0.5, -2.1),
    "loop of relative angles": lambda: (
        [a * cos(u) + b * cos(u + w) - c, a * sin(u) + b * sin(u + w) - q],
        AT
        | {u: 0.4, w: 1.2}
        | {c: 0.3 * math.cos(0.4) + 0.7 * math.cos(1.6)}
        | {q: 0.3 * math.sin(0.4) + 0.7 * math.sin(1.6)},
    ),
    "slider": lambda: (
        [a * cos(q) + b * cos(u) - w, a * sin(q) - b * sin(u)],
        AT
        | {u: (s := math.asin(0.3 * math.sin(0.4) / 0.7))}
        | {w: 0.3 * math.cos(0.4) + 0.7 * math.cos(s)},
    ),
    "circles": lambda: (
        [u**2 + w**2 - a, (u - q) ** 2 + (w - b) ** 2 - c],
        AT | {u: 0.2, w: -0.5, a: 0.29, c: (0.2 - 0.4) ** 2 + 1.2**2},
    ),
    "linear": lambda: ([a * u + b * w - c, b * u - a * w - q], AT | _linear()),
}


def _linear() -> dict[se.Basic, float]:
    below = -(0.3 * 0.3 + 0.7 * 0.7)
    return {u: (-0.3 * 0.5 - 0.7 * 0.4) / below, w: (0.3 * 0.4 - 0.7 * 0.5) / below}


@pytest.mark.parametrize("name", PAIRS)
def test_two_equations(name: str) -> None:
    equations, at = PAIRS[name]()
    assert all(abs(number(e, at)) < 1e-12 for e in equations)
    found = solve(equations, [u, w], lambda e: number(e, at))
    assert {s.unknown for s in found} == {u, w}
    assert found[0].value.free_symbols.isdisjoint({u, w})
    for solution in found:
        assert number(solution.value, at) == pytest.approx(at[solution.unknown], rel=1e-9)


@pytest.mark.parametrize(
    "equation",
    [u + sin(u) - a, se.exp(u) + u - a, sin(3 * u) + sin(u) - a, u**3 - a * u - b],
    ids=str,
)
def test_others_have_no_closed_form(equation: se.Basic) -> None:
    assert solve([equation], [u], lambda e: number(e, AT | {u: 0.2})) == []


U, A, B = map(se.Symbol, "uab")
SINE, COSINE = se.Symbol("s"), se.Symbol("c")


def test_the_angle_is_the_only_argument_or_the_unknown() -> None:
    both = angle_of([se.sin(U + A), B * se.cos(U + A)], U)
    assert both is not None
    assert both.expression == U + A
    assert se.expand(both.solved(B) - (B - A)) == 0
    several = angle_of([se.sin(U + A) + se.cos(2 * U)], U)
    assert several is not None
    assert several.expression == U
    assert angle_of([se.sin(3 * U)], U) is None
    assert angle_of([se.sin(A) + U], U) is None


def test_an_angle_that_falls_with_the_unknown_is_solved() -> None:
    falling = Angle(U, A - U)
    assert se.expand(falling.solved(B) - (A - B)) == 0


@pytest.mark.parametrize(
    "expression",
    [se.sin(U + A), se.cos(A - U), se.sin(2 * U + B), se.cos(-2 * U), se.sin(U) * se.cos(U + A)],
)
def test_addition_theorems_keep_the_value(expression: se.Basic) -> None:
    angle = Angle(U, U)
    opened = angle.replaced(expression, SINE, COSINE)
    assert U not in opened.free_symbols
    values = {U: 0.7, A: 0.3, B: -1.1}
    there = {**values, SINE: se.sin(se.RealDouble(0.7)), COSINE: se.cos(se.RealDouble(0.7))}
    # a few roundings
    assert float(opened.subs(there)) == pytest.approx(float(expression.subs(values)), abs=1e-14)


def test_linear_parts_are_found_where_there_are_some() -> None:
    angle = Angle(U, U)
    found = angle.linear_parts(3 * se.cos(U) - A * se.sin(U) + B)
    assert found is not None
    assert [se.expand(x) for x in found] == [3, -A, B]
    # sin² + cos² is one
    squares = angle.linear_parts((se.cos(U) + A) ** 2 + se.sin(U) ** 2)
    assert squares is not None
    assert [se.expand(x) for x in squares] == [2 * A, 0, 1 + A**2]
    assert angle.linear_parts(se.sin(U) * se.cos(U)) is None
