"""The search for symmetries: its extent, and what it does with large systems."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest
import symengine as se
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import lagcli
from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.symmetry.linear import (
    Monomials,
    echelon,
    independent,
    linear_symmetries,
    null_space,
    rational,
    remainder,
    symbolic,
)

x, y, a, b, t = se.symbols("x y a b t")


def terms(expression: se.Basic, **values: float) -> list[object]:
    write = Monomials(values)
    return list(write.terms(write.exponential(expression)))


@pytest.mark.parametrize(
    "zero",
    [
        se.sin(x) ** 2 + se.cos(x) ** 2 - 1,
        se.cos(x - y) - se.cos(x) * se.cos(y) - se.sin(x) * se.sin(y),
        se.sin(2 * x) - 2 * se.sin(x) * se.cos(x),
        se.cos(x / 2) ** 2 - (1 + se.cos(x)) / 2,
        se.sin(a * t + x) - se.sin(a * t) * se.cos(x) - se.cos(a * t) * se.sin(x),
        (x + y) ** 3 / se.sqrt(x**2 + y**2) - (x + y) * (x + y) ** 2 / se.sqrt(x**2 + y**2),
        (x**2 + 1) / (x**2 + y**2) - 1 / (x**2 + y**2) - x**2 / (x**2 + y**2),
    ],
)
def test_identities_have_no_terms(zero: se.Basic) -> None:
    assert terms(zero) == []


@pytest.mark.parametrize(
    "other", [se.sin(x) ** 2 - 1, se.cos(x - y) - se.cos(x + y), se.sin(x) - x, a * x - b * x]
)
def test_others_have_some(other: se.Basic) -> None:
    assert terms(other)


def test_values_of_parameters_are_put_in_exactly() -> None:
    assert terms(a * x - 3 * b * x, a=0.3, b=0.1) == []
    assert terms(x * se.Integer(0) + a, a=0.25) == [(se.Integer(1), Fraction(1, 4), 0)]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.1, Fraction(1, 10)),
        (0.4 * 0.0225 / 12, Fraction(3, 4000)),  # rounded on the way
        (1 / 3, Fraction(1, 3)),
        (4.41e-7, Fraction(441, 10**9)),
        (-2.0, Fraction(-2)),
        (0.0, Fraction(0)),
    ],
)
def test_doubles_denote_simple_numbers(value: float, expected: Fraction) -> None:
    assert rational(value) == expected
    assert symbolic(expected) == se.Rational(expected.numerator, expected.denominator)


ENTRIES = st.sampled_from([0, 0, 0, 1, -1, 2, Fraction(1, 3), Fraction(-5, 7)])


def sparse(rows: list[list[Fraction]]) -> list[dict[int, Fraction]]:
    return [{j: Fraction(x) for j, x in enumerate(row) if x} for row in rows]


@settings(deadline=None)
@given(st.lists(st.lists(ENTRIES, min_size=5, max_size=5), max_size=6))
def test_the_basis_spans_the_null_space(rows: list[list[Fraction]]) -> None:
    matrix = sympy.Matrix(len(rows), 5, [sympy.Rational(str(Fraction(x))) for r in rows for x in r])
    basis = null_space(sparse(rows), 5)
    assert len(basis) == 5 - matrix.rank()
    for vector in basis:
        for row in rows:
            assert sum(Fraction(x) * vector.get(j, 0) for j, x in enumerate(row)) == 0
    # reduced: each has an entry 1 where the others have 0, its last entry
    for vector in basis:
        own = max(vector)
        assert vector[own] == 1
        assert all(own not in other for other in basis if other is not vector)


@settings(deadline=None)
@given(st.lists(st.lists(ENTRIES, min_size=4, max_size=4), max_size=6))
def test_independent_vectors_are_as_many_as_the_rank(rows: list[list[Fraction]]) -> None:
    given_rows = sparse(rows)
    kept = independent(given_rows)
    matrix = sympy.Matrix(len(rows), 4, [sympy.Rational(str(Fraction(x))) for r in rows for x in r])
    assert len(kept) == matrix.rank() == len(echelon(given_rows))
    first = next((i for i, row in enumerate(given_rows) if row), None)
    assert first is None or kept[0] == first
    # what is in their space leaves nothing
    assert all(remainder(row, echelon(given_rows)) == {} for row in given_rows)


MODELS = Path(__file__).parents[4] / "models"

FREE = """
coordinates: [x, y, s]
parameters: {m: 1}
T: m/2*(x'^2 + y'^2 + s'^2)
V: m*sqrt(x^2 + y^2)
initial: {x: 1, y: 0, s: 0, x': 0, y': 1, s': 1}
"""


def found(equations: Equations, effort: float) -> tuple[list[set[str]], str]:
    symmetries, extent = linear_symmetries(equations, equations.model.parameter_values, effort)
    names = equations.model.coordinate_names
    moved = [{names[i] for i, _ in s.linear} | {names[i] for i in s.shift} for s in symmetries]
    return moved, extent


def test_less_is_searched_where_there_is_more_to_do() -> None:
    equations = lagcli.derive(lagcli.load_text(FREE))
    assert found(equations, 1e5) == ([{"s"}, {"x", "y"}, set()], "linear")
    assert found(equations, 10) == ([{"s"}, set()], "absent coordinates")
    top = lagcli.derive(lagcli.load(MODELS / "heavy_top.yaml"))
    quaternion = {"e0", "e1", "e2", "e3"}
    assert found(top, 1e3) == ([{"X", "Y"} | quaternion, quaternion, set()], "linear")
    assert found(top, 600) == ([set()], "translations")
    assert found(top, 400) == ([set()], "absent coordinates")


def test_a_large_model_is_not_searched_for_long() -> None:
    chain = lagcli.load(MODELS / "pendulum_chain.yaml", set={"N": "40"})
    moved, extent = found(lagcli.derive(chain), 1e3)
    assert extent == "absent coordinates"
    assert moved == [set()]


def test_forces_and_rheonomic_constraints_end_the_conservation_of_energy() -> None:
    for change in ("Q: {s: -0.1*s'}", "constraints: {drive: s = t}"):
        text = FREE.replace("s: 0,", "s: {guess: 0},").replace("s': 1", "s': {guess: 1}")
        equations = lagcli.derive(lagcli.load_text(f"{text}{change}\n"))
        for effort in (1e5, 10):
            assert set() not in found(equations, effort)[0]
