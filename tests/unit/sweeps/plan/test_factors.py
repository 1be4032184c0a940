"""Rows of factors: functions of their numbers, whoever asks and in whichever order."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from lagcli.sweeps.plan.factors import Distribution, Ratios, Sample, Steps, TableFactor

SAMPLE = Sample(
    "sobol", 64, 3, ("a", "b"), (Distribution("uniform", 2, 4), Distribution("loguniform", 1, 100))
)


def test_steps_are_rounded_once() -> None:
    steps = Steps(("x",), Fraction(1), Fraction(1, 10), 11, Fraction(1, 100))
    assert steps.rows(np.arange(3)).tolist() == [[0.01], [0.011], [0.012]]
    assert steps.rows(np.array([10, 0, 10])).tolist() == [[0.02], [0.01], [0.02]]


def test_ratios_have_their_ends_exactly() -> None:
    found = Ratios(("x",), 0.1, 0.7, 4).rows(np.array([3, 0, 1, 2]))[:, 0]
    assert (found[0], found[1]) == (0.7, 0.1)
    assert found[2] / found[1] == pytest.approx(found[3] / found[2])
    assert Ratios(("x",), 0.1, 0.7, 1).rows(np.array([0])).tolist() == [[0.1]]


def test_tables_give_their_rows() -> None:
    table = TableFactor(("a", "b"), np.array([[1.0, 2], [3, 4]]))
    assert table.length == 2
    assert table.rows(np.array([1, 0, 1])).tolist() == [[3, 4], [1, 2], [3, 4]]


@pytest.mark.parametrize("kind", ["sobol", "lhs", "random"])
def test_samples_do_not_depend_on_the_order(kind: str) -> None:
    sample = Sample(kind, 64, 3, SAMPLE.columns, SAMPLE.distributions)
    whole = sample.rows(np.arange(64))
    some = np.array([40, 3, 40])
    np.testing.assert_array_equal(sample.rows(some), whole[some])
    assert ((whole[:, 0] >= 2) & (whole[:, 0] <= 4)).all()
    assert ((whole[:, 1] >= 1) & (whole[:, 1] <= 100)).all()


def test_sobol_points_fill_each_half_evenly() -> None:
    """64 points are a net: each half of a range has 32 of them, by logarithm for the second."""
    whole = SAMPLE.rows(np.arange(64))
    assert (whole[:, 0] < 3).sum() == (whole[:, 1] < 10).sum() == 32
