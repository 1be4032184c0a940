"""What must not depend on how a model is written."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field

import numpy as np
import symengine as se
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from lagcli.model.expression.constants import number
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import (
    CallExpr,
    Name,
    NumberExpr,
    PowerExpr,
    ProductExpr,
    SumExpr,
    Tree,
)
from lagcli.model.loader import load_text
from lagcli.model.names.building import build
from lagcli.model.names.namespace import Namespace
from lagcli.model.names.scope import Scope
from lagcli.simulations.simulation import simulate
from lagcli.trajectory.trajectory import Trajectory

# expressions: against Python's own reading of the same text

ATOMS = st.sampled_from(["a", "b", "c", "0.5", "2", "3", "1e-1", "pi"])


def _larger(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    functions = st.sampled_from(["sin", "cos", "exp", "tanh", "atan", "sqrt", "erf", "abs"])
    return st.one_of(
        st.builds("{} {} {}".format, inner, st.sampled_from("+-*/"), inner),
        st.builds("{}{}{}".format, inner, st.sampled_from("+-*/"), inner),
        st.builds("({})".format, inner),
        st.builds("-{}".format, inner),
        st.builds("({})^{}".format, inner, st.sampled_from(["2", "3", "-1", "2^2", "-2", "0"])),
        st.builds("a^{}".format, st.sampled_from(["b", "-b", "c^2", "-2", "(1/3)"])),
        st.builds("{}({})".format, functions, inner),
        st.builds("max({}, {})".format, inner, inner),
        st.builds("atan2({}, {})".format, inner, inner),
    )


EXPRESSIONS = st.recursive(ATOMS, _larger, max_leaves=12)
POINTS = st.tuples(*[st.floats(0.1, 2)] * 3)
NAMES = Namespace(parameters={n: (lambda n=n: se.Symbol(n)) for n in "abc"})


def evaluated(tree: Tree, point: tuple[float, ...]) -> float:
    value = build(tree, Scope(NAMES, "it")).value
    at = {se.Symbol(n): se.RealDouble(x) for n, x in zip("abc", point, strict=True)}
    return number(value.subs(at))


def printed(tree: Tree) -> str:
    """Return a tree as text, with all its parentheses."""
    match tree:
        case NumberExpr():
            return f"({tree.value})"
        case Name():
            return tree.text
        case CallExpr():
            return f"{tree.function}({', '.join(map(printed, tree.arguments))})"
        case SumExpr():
            return "(" + "".join(f" {'+-'[s < 0]} {printed(t)}" for s, t in tree.terms) + ")"
        case ProductExpr():
            text = "".join(f" {'*/'[e < 0]} {printed(f)}" for e, f in tree.factors)
            return f"({text[3:]})"
        case PowerExpr():
            return f"({printed(tree.base)})^({printed(tree.exponent)})"
    raise AssertionError(tree)


def sensitivity(text: str, point: tuple[float, ...]) -> float:
    """Return how much the value changes when the arguments change in their last digits."""
    values = [in_python(text, tuple(x * (1 + k * 1e-15) for x in point)) for k in (-1, 0, 1)]
    return max(values) - min(values)


def in_python(text: str, point: tuple[float, ...]) -> float:
    names = {n: getattr(math, n) for n in ("sin", "cos", "exp", "tanh", "atan", "sqrt", "erf")}
    names |= {"pi": math.pi, "atan2": math.atan2, "abs": abs, "max": max}
    return float(eval(text.replace("^", "**"), {**names, **dict(zip("abc", point, strict=True))}))


@settings(max_examples=70, deadline=None)
@given(EXPRESSIONS, POINTS)
def test_expressions_mean_what_they_mean_in_python(text: str, point: tuple[float, ...]) -> None:
    try:
        expected = in_python(text, point)
        slack = sensitivity(text, point)
    except (ZeroDivisionError, OverflowError, ValueError, TypeError):
        assume(False)
    assume(abs(expected) < 1e6)
    try:
        found = evaluated(parse(text), point)
    except (ExpressionError, ValueError):  # a constant part is infinite, or not real
        assume(False)
    # SymEngine reorders terms: each may round differently, and cancel
    assume(slack < 1e-9)
    assert math.isclose(found, expected, rel_tol=1e-9, abs_tol=1e-9 + 1e3 * slack)


@settings(max_examples=50, deadline=None)
@given(EXPRESSIONS, POINTS)
def test_printed_and_parsed_again(text: str, point: tuple[float, ...]) -> None:
    tree = parse(text)
    again = parse(printed(tree))
    assert printed(again) == printed(parse(printed(again)))
    try:
        expected = evaluated(tree, point)
    except (ExpressionError, ValueError, RuntimeError):  # undefined there
        assume(False)
    assert math.isclose(evaluated(again, point), expected, rel_tol=1e-9, abs_tol=1e-9)


# mechanisms: point masses in a plane, hung on each other by rods


@dataclass
class Mechanism:
    """A chain or tree of rods, as the lines of a model file."""

    coordinates: list[str] = field(default_factory=list)
    parameters: list[str] = field(default_factory=list)
    energies: list[str] = field(default_factory=list)
    potentials: list[str] = field(default_factory=list)
    constraints: list[str] = field(default_factory=list)
    initial: list[str] = field(default_factory=list)

    def text(self) -> str:
        return "\n".join(
            [
                f"coordinates: [{', '.join(self.coordinates)}]",
                *("parameters:", *self.parameters),
                f"T: {' + '.join(self.energies)}",
                f"V: {' + '.join(self.potentials)}",
                *("constraints:", *self.constraints),
                *("initial:", *self.initial),
                "simulation: {t_end: 0.1, samples: 5, rtol: 1e-9}",
            ]
        )

    def run(self) -> Trajectory:
        trajectory = simulate(load_text(self.text()))
        assert trajectory.status == "completed"
        return trajectory


@st.composite
def mechanisms(draw: st.DrawFn) -> Mechanism:
    found = Mechanism(parameters=["  g: 9.81"])
    places = [(0.0, 0.0)]
    for i in range(1, draw(st.integers(1, 3)) + 1):
        parent = draw(st.integers(0, i - 1))
        angle = draw(st.floats(-2.8, -0.4))
        length, mass = draw(st.floats(0.5, 2)), draw(st.floats(0.5, 2))
        x = places[parent][0] + length * math.cos(angle)
        y = places[parent][1] + length * math.sin(angle)
        places.append((x, y))
        px, py = (f"x{parent}", f"y{parent}") if parent else ("0", "0")
        found.coordinates += [f"x{i}", f"y{i}"]
        found.parameters += [f"  m{i}: {mass!r}", f"  l{i}: {length!r}"]
        found.energies.append(f"m{i}/2*(x{i}'^2 + y{i}'^2)")
        found.potentials.append(f"m{i}*g*y{i}")
        found.constraints.append(f"  rod{i}: (x{i} - {px})^2 + (y{i} - {py})^2 = l{i}^2")
        speed = draw(st.floats(-1, 1))
        found.initial += [
            f"  x{i}: {x!r}",
            f"  y{i}: {{guess: {y!r}}}",
            f"  x{i}': {{guess: {speed!r}}}",
            f"  y{i}': {{guess: 0}}",
        ]
    return found


SLOW = settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])

# forces of two runs agree to some hundred times the runs' tolerance of 1e-9
RTOL = 1e-6


def assert_close(one: np.ndarray, other: np.ndarray) -> None:
    assert one.shape == other.shape
    np.testing.assert_allclose(one, other, rtol=0, atol=RTOL * max(1.0, np.abs(one).max(initial=0)))


@SLOW
@given(mechanisms(), st.data())
def test_a_constraint_times_a_constant(mechanism: Mechanism, data: st.DataObject) -> None:
    before = mechanism.run()
    which = data.draw(st.integers(0, len(mechanism.constraints) - 1))
    c = data.draw(st.sampled_from([-1.0, 2.0, -0.25, 10.0]))
    name, _, equation = mechanism.constraints[which].partition(": ")
    left, right = equation.split(" = ")
    mechanism.constraints[which] = f"{name}: {c}*({left}) = {c}*{right}"
    after = mechanism.run()
    factor = np.ones(len(mechanism.constraints))
    factor[which] = 1 / c
    assert_close(after.multipliers, before.multipliers * factor)
    assert_close(after.constraint_force_by, before.constraint_force_by)
    assert_close(after.q, before.q)


@SLOW
@given(mechanisms(), st.randoms(use_true_random=False))
def test_the_order_of_a_model_is_only_an_order(mechanism: Mechanism, r: random.Random) -> None:
    before = mechanism.run()
    names = (list(before.coordinates), list(before.constraints))
    for block in (
        *(mechanism.coordinates, mechanism.parameters, mechanism.constraints),
        *(mechanism.initial, mechanism.energies, mechanism.potentials),
    ):
        r.shuffle(block)
    after = mechanism.run()
    q = [list(after.coordinates).index(n) for n in names[0]]
    c = [list(after.constraints).index(n) for n in names[1]]
    assert_close(after.q[:, q], before.q)
    assert_close(after.v[:, q], before.v)
    assert_close(after.a[:, q], before.a)
    assert_close(after.multipliers[:, c], before.multipliers)
    for name in names[1]:
        assert_close(after.constraint_force_of(name)[:, q], before.constraint_force_of(name))
    assert_close(after.energy_total, before.energy_total)
