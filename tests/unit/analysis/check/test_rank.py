"""Rank, redundancy and the uniqueness of multipliers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sympy import Matrix, Rational

import lagcli
from lagcli.analysis.check import rank
from lagcli.analysis.check.description import page

MODELS = Path(__file__).parents[4] / "models"

#: The same point held twice in x, by constraints of different scale, and once in y.
HELD = """
coordinates: [x, y]
T: x'^2/2 + y'^2/2
constraints: {one: x = 0, two: 4*x = 0, other: y = 0}
initial: {x: 0, y: 0, x': 0, y': 0}
"""


def test_the_parallelogram_has_one_degree_of_freedom() -> None:
    found = lagcli.check(lagcli.load(MODELS / "parallelogram.yaml"))
    assert found.degrees_of_freedom == 1
    assert found.rank.freedom.rank == 3
    assert set(found.rank.random_ranks) == {3}
    (redundant,) = found.rank.freedom.redundant
    assert set(redundant.constraints) == set(found.rank.not_unique)
    assert redundant.surplus == 1
    assert found.rank.not_unique == ("right_x", "right_y", "middle_x", "middle_y")
    assert found.rank.unique == ()
    assert len(found.rank.combinations) == 3


@pytest.mark.parametrize("unit", ["1", "1e8"])
def test_combinations_are_the_same_for_every_choice_of_the_multipliers(unit: str) -> None:
    """Multipliers of a run are those of least norm; others differ by the null space of B^T."""
    text = HELD.replace("one: x", f"one: {unit}*x").replace("4*x", f"4*{unit}*x")
    found = lagcli.check(lagcli.load_text(text))
    assert found.rank.unique == ("other",)
    assert found.rank.not_unique == ("one", "two")
    (combination,) = found.rank.combinations
    # B^T lambda = lambda_one + 4 lambda_two on x
    assert combination.factors == pytest.approx({"one": 1.0, "two": 4.0})


def test_combinations_of_the_parallelogram_vanish_on_the_null_space() -> None:
    model = lagcli.load(MODELS / "parallelogram.yaml")
    found = lagcli.check(model)
    a = model.initial["alpha_1"].value
    p = model.parameter_values
    # rows of B by hand, from the constraints as the file states them, at beta = 0
    s, c = p["l"] * np.sin(a), p["l"] * np.cos(a)
    rows = np.array(
        [[-s, s, 0, 0], [c, -c, 0, p["d"]], [-s, 0, s, 0], [c, 0, -c, p["d"] / 2]],
    )
    _, values, vectors = np.linalg.svd(rows.T)
    null = vectors[-1]
    assert values[-1] < 1e-15
    for combination in found.rank.combinations:
        total = sum(
            x * null[model.constraint_names.index(n)] for n, x in combination.factors.items()
        )
        assert abs(total) < 1e-9


def test_a_singular_start_is_noticed() -> None:
    """Two rods in line that can only turn about each other: a bifurcation of the rhombus."""
    text = """
coordinates: [a, b, c]
T: a'^2/2 + b'^2/2 + c'^2/2
constraints:
  x: cos(a) + cos(b) - cos(c) = 1
  y: sin(a) + sin(b) - sin(c) = 0
initial: {a: 0, b: 0, c: 0, a': 0, b': 0, c': 0}
"""
    found = lagcli.check(lagcli.load_text(text))
    assert found.rank.freedom.rank == 1
    assert max(found.rank.random_ranks) == 2
    assert found.rank.special
    regular = text.replace("a: 0", "a: 1").replace("c: 0", "c: 1")
    assert not lagcli.check(lagcli.load_text(regular)).rank.special


NEXT_TO = """
coordinates: [q0, q1, q2]
parameters: {l: 0.728, g: 9.81}
definitions:
  x: l*(sin(q0) + sin(q1) + sin(q2))
  y: -l*(cos(q0) + cos(q1) + cos(q2))
T: (q0'^2 + q1'^2 + q2'^2)/2
V: g*y
constraints:
  c2: y + q0^2*0.3 = -3*l*0.9
  c6: x^2 + y^2 = 7.29*l^2
initial:
  q0: {guess: -0.573}
  q0': {guess: -0.559}
  q1: {guess: 0.123}
  q1': {guess: -0.959}
  q2: {guess: -0.415}
  q2': {guess: 0.212}
simulation: {t_end: 0.5, samples: 21}
"""


def test_no_frequencies_are_given_next_to_a_singular_configuration() -> None:
    """The constraints touch at q0 = 0: y = −2.7 l and x = 0, where they are dependent.

    The consistent start is as far away as residuals allow, 1e-7. The coefficients of small motions
    change over this distance, so that frequencies of 8e5 rad/s describe nothing.
    """
    found = lagcli.check(lagcli.load_text(NEXT_TO))
    assert abs(found.start.state.q[0]) < 1e-5
    assert found.rank.near_singular == ("c2", "c6")
    assert not found.rank.special
    text = " ".join(page(found).split())
    assert "The start is next to a singular configuration" in text
    assert "Not computed next to a singular configuration" in text
    assert "rad/s" not in text
    # away from there, with a constraint that crosses the other one
    away = NEXT_TO.replace("= -3*l*0.9", "= -3*l*0.8")
    found = lagcli.check(lagcli.load_text(away))
    assert not found.rank.near_singular
    assert "singular configuration" not in " ".join(page(found).split())


def test_constraints_that_are_almost_dependent_everywhere_are_no_singular_configuration() -> None:
    text = """
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
V: x^2 + 2*z^2
constraints: {one: y = 0, two: y + 1e-6*(x - z) = 0}
initial: {x: 0, y: 0, z: {guess: 0}, x': 0, y': 0, z': {guess: 0}}
"""
    found = lagcli.check(lagcli.load_text(text))
    assert not found.rank.near_singular
    assert found.time_scales is not None
    # x = z: (1 + 1) x'' = −(2 + 4) x
    assert found.time_scales.largest_frequency == pytest.approx(3**0.5, rel=1e-6)


def test_a_large_system_is_looked_at_where_it_starts_alone() -> None:
    found = lagcli.check(lagcli.load(MODELS / "chain.yaml", set={"N": "31"}))
    assert found.rank.freedom.rank == 31
    assert found.rank.random_ranks == ()
    assert found.time_scales is None
    assert [q.name for q in found.conserved.quantities] == ["energy"]


@pytest.mark.parametrize("name", ["slider_crank", "heavy_top", "chaplygin_sleigh", "atwood"])
def test_multipliers_of_independent_constraints_are_unique(name: str) -> None:
    found = lagcli.check(lagcli.load(MODELS / f"{name}.yaml"))
    assert found.rank.not_unique == ()
    assert set(found.rank.random_ranks) == {len(found.equations.constraints)}
    assert len(found.rank.random_ranks) == 20


def test_the_reduced_form_is_that_of_exact_arithmetic() -> None:
    rng = np.random.default_rng(4)
    for _ in range(60):
        exact = Matrix(3, 5, rng.integers(-3, 4, 15).tolist())
        if rng.random() < 0.5:
            exact[2, :] = exact[0, :] - 2 * exact[1, :]
        # beginning with another basis of the same rows
        mixed = rng.normal(size=(3, 3)) @ np.array(exact, dtype=float)
        found = rank._reduced(mixed)
        expected = np.array(exact.rref()[0], dtype=float)
        np.testing.assert_allclose(found, expected, atol=1e-8)
        if abs(np.linalg.det(mixed[:, :3])) > 1e-2:
            assert found.tolist() == expected.tolist()  # simple fractions are exact
    assert rank._reduced(np.zeros((0, 4))).shape == (0, 4)


def test_only_fractions_with_small_denominators_are_rounded_to() -> None:
    for x in (Rational(1, 997), Rational(-355, 113), Rational(0), Rational(7)):
        assert rank._simple(float(x) + 9e-10) == float(x)
        assert rank._simple(float(x) + 1.1e-9) == float(x) + 1.1e-9
    for value in (2**0.5, 1 / 1501 + 1e-12, np.pi / 1e4):
        assert rank._simple(value) == value
