"""Rank, redundancy and the uniqueness of multipliers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli

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


def test_combinations_are_the_same_for_every_choice_of_the_multipliers() -> None:
    """Multipliers of a run are those of least norm; others differ by the null space of B^T."""
    found = lagcli.check(lagcli.load_text(HELD))
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
