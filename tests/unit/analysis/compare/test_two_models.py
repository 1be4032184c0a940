"""Two models of one system."""

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.errors import UsageError

MODELS = Path(__file__).parents[4] / "models"
CRANK, TEXTBOOK = (str(MODELS / f"slider_crank{x}.yaml") for x in ("", "_textbook"))


def test_a_lagrangian_shortened_by_the_constraint_explains_its_multiplier() -> None:
    first, second = lagcli.load(CRANK), lagcli.load(TEXTBOOK)
    found = lagcli.compare_models(first, second)
    assert all(x.difference < 1e-7 * x.size for x in found.coordinates)
    assert set(found.explained) == {"guide"}
    # F by hand: m r sin(phi) (phi' + psi') psi' + m g, as the textbook's file says
    run, p = found.first, first.parameter_values
    (phi, _), (dphi, dpsi) = run.q.T, run.v.T
    expected = p["m"] * p["r"] * np.sin(phi) * (dphi + dpsi) * dpsi + p["m"] * p["g"]
    change = found.second.multipliers[:, 0] - run.multipliers[:, 0]
    np.testing.assert_allclose(change, -expected, atol=1e-5)


_DRIVEN = """
coordinates: [x, y]
inputs:
  u: {times: [0, 1, 2], values: [-1, 0, 1], interpolation: linear}
T: x'^2/2 + y'^2/2
V: x^2/2 - u*x%s
constraints: {tie: y = x}
initial: {x: 0, x': 0, y: 0, y': 0}
simulation: {t_end: 2, samples: 11}
"""


def test_an_input_in_the_difference_of_the_lagrangians_explains_it() -> None:
    first, second = (lagcli.load_text(_DRIVEN % x) for x in ("", " + u^2*(x - y)"))
    found = lagcli.compare_models(first, second)
    # V gains -u^2 (y - x), so that F = u^2 with u = t - 1
    change = found.second.multipliers[:, 0] - found.first.multipliers[:, 0]
    np.testing.assert_allclose(change, -((found.first.time - 1) ** 2), atol=1e-9)
    assert set(found.explained) == {"tie"}


def test_another_mass_explains_nothing() -> None:
    first, second = lagcli.load(CRANK), lagcli.load(CRANK, {"m": "1.2"})
    found = lagcli.compare_models(first, second)
    assert found.multipliers[0].difference > 0.01
    assert not found.explained


def test_models_without_a_common_coordinate_are_rejected() -> None:
    other = lagcli.load(str(MODELS / "pendulum_cartesian.yaml"))
    with pytest.raises(UsageError, match="no coordinate in common"):
        lagcli.compare_models(lagcli.load(CRANK), other)


def test_what_one_model_has_alone_is_named() -> None:
    one = lagcli.load_text(
        "coordinates: [x, y]\nT: x'^2 + y'^2\nV: 0\nconstraints: {c: x = y}\n"
        "initial: {x: 0, y: 0, x': 1, y': 1}\n"
    )
    other = lagcli.load_text("coordinates: [x]\nT: 2*x'^2\nV: 0\ninitial: {x: 0, x': 1}\n")
    found = lagcli.compare_models(one, other)
    assert found.only_first == ("lambda.c", "y")
    assert found.only_second == ()
    assert found.coordinates[0].difference < 1e-12
