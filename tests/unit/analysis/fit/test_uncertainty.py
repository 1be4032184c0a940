"""Covariance and identifiability against linear least squares."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm, t

from lagcli.analysis.fit.uncertainty import Uncertainty, quantile, uncertainty

RNG = np.random.default_rng(5)
RESIDUALS = RNG.normal(size=40)
JACOBIAN = RNG.normal(size=(40, 3)) * [1.0, 1e-6, 1e4]
VALUES = np.array([2.0, 0.0, -3e-4])
SCALES = np.array([1.0, 1.0, 3e-4])
FREE = np.ones(3, dtype=bool)
NAMES = ("a", "b", "c")


def found(jacobian: np.ndarray, *, estimated: bool = False, free: np.ndarray = FREE) -> Uncertainty:
    return uncertainty(RESIDUALS, jacobian, VALUES, SCALES, NAMES, free, estimated)


def test_the_covariance_is_that_of_linear_least_squares() -> None:
    expected = np.linalg.inv(JACOBIAN.T @ JACOBIAN)
    known = found(JACOBIAN)
    np.testing.assert_allclose(known.covariance, expected, rtol=1e-8)
    np.testing.assert_allclose(np.diag(known.correlation), 1.0)
    estimated = found(JACOBIAN, estimated=True)
    square = RESIDUALS @ RESIDUALS / 37
    np.testing.assert_allclose(estimated.covariance, square * expected, rtol=1e-8)
    assert (known.sigma, known.freedom, estimated.freedom) == (1.0, 37, 37)
    assert not known.combinations


def test_a_combination_that_the_data_do_not_identify_is_named() -> None:
    # the data depend on a/b alone: a ∂r/∂a + b ∂r/∂b = 0
    values = np.array([2.0, 5.0, 1.0])
    jacobian = JACOBIAN.copy()
    jacobian[:, 1] = -2.0 / 5.0 * jacobian[:, 0]
    sure = uncertainty(RESIDUALS, jacobian, values, np.abs(values), NAMES, FREE, False)
    (combination,) = sure.combinations
    assert combination.names == ("a", "b")
    np.testing.assert_allclose(combination.changes, [1, 1], rtol=1e-8)
    assert "no change of the data for a +100 %, b +100 %" in combination.text
    assert np.isnan(sure.standard_errors[:2]).all()
    expected = 1 / np.linalg.norm(
        jacobian[:, 2]
        - jacobian[:, 0] * (jacobian[:, 2] @ jacobian[:, 0]) / (jacobian[:, 0] @ jacobian[:, 0])
    )
    np.testing.assert_allclose(sure.standard_errors[2], expected, rtol=1e-8)


def test_a_quantity_that_the_data_do_not_depend_on_is_named() -> None:
    jacobian = JACOBIAN * [1, 0, 1]
    sure = found(jacobian)
    assert [x.names for x in sure.combinations] == [("b",)]
    assert sure.combinations[0].text == "b: the data do not depend on it"
    assert np.isfinite(sure.standard_errors[[0, 2]]).all()


@pytest.mark.parametrize("value", [1e-9, 1e-14, -1e-30])
def test_a_quantity_that_is_found_to_be_nearly_zero_has_an_error(value: float) -> None:
    values = np.array([2.0, value, -3e-4])
    sure = uncertainty(RESIDUALS, JACOBIAN, values, SCALES, NAMES, FREE, False)
    assert not sure.combinations
    expected = np.linalg.inv(JACOBIAN.T @ JACOBIAN)
    np.testing.assert_allclose(sure.covariance, expected, rtol=1e-8)


def test_quantities_on_a_bound_have_no_error() -> None:
    sure = found(JACOBIAN, free=np.array([True, False, True]))
    assert np.isnan(sure.standard_errors[1])
    two = JACOBIAN[:, [0, 2]]
    expected = np.sqrt(np.diag(np.linalg.inv(two.T @ two)))
    np.testing.assert_allclose(sure.standard_errors[[0, 2]], expected, rtol=1e-8)


def test_fewer_data_than_quantities_leave_combinations() -> None:
    sure = uncertainty(RESIDUALS[:2], JACOBIAN[:2], VALUES, SCALES, NAMES, FREE, False)
    assert len(sure.combinations) == 1


@pytest.mark.parametrize("level", [0.5, 0.95])
def test_quantiles(level: float) -> None:
    assert quantile(level, 7, False) == pytest.approx(norm.ppf(0.5 + level / 2))
    assert quantile(level, 7, True) == pytest.approx(t.ppf(0.5 + level / 2, 7))


@pytest.mark.parametrize("weight", [1.0, 0.1, 1e-2, 1e-3])
@pytest.mark.parametrize("value", [1.0, 1e-6])
def test_quantities_of_a_combination_have_no_error_however_small_their_part(
    weight: float, value: float
) -> None:
    # the data depend on a + weight b
    values = np.array([value, 2.0, 1.0])
    jacobian = JACOBIAN * [1.0, 1.0, 1e-4]
    jacobian[:, 1] = weight * jacobian[:, 0]
    sure = uncertainty(RESIDUALS, jacobian, values, np.ones(3), NAMES, FREE, False)
    assert [x.names for x in sure.combinations] == [("a", "b")]
    assert np.isnan(sure.standard_errors[:2]).all()
    assert np.isfinite(sure.standard_errors[2])


def test_changes_of_negative_quantities_are_relative_to_their_values() -> None:
    # the data depend on a + b at a = 1, b = −2: a +100 % and b +50 % leave the sum
    values = np.array([1.0, -2.0, 1.0])
    jacobian = JACOBIAN.copy()
    jacobian[:, 1] = jacobian[:, 0]
    (combination,) = uncertainty(
        RESIDUALS, jacobian, values, np.abs(values), NAMES, FREE, False
    ).combinations
    np.testing.assert_allclose(combination.changes, [1.0, 0.5], rtol=1e-8)


def test_a_weak_quantity_is_identified_by_precise_data() -> None:
    # as the drag of a satellite, which moves it by 1e-8 of the radius
    sure = found(JACOBIAN * [1e16, 1e14, 1e16])
    assert not sure.combinations
    assert np.isfinite(sure.standard_errors).all()


def test_degrees_of_freedom_count_what_the_data_identify() -> None:
    jacobian = JACOBIAN.copy()
    jacobian[:, 1] = jacobian[:, 0]
    estimated = found(jacobian, estimated=True)
    assert estimated.freedom == 38
    assert estimated.sigma == pytest.approx(np.sqrt(RESIDUALS @ RESIDUALS / 38))
