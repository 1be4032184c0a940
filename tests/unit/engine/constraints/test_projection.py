"""Projection: onto the constraints, by the smallest change, or not at all."""

from __future__ import annotations

import numpy as np
import pytest
from lowered import lowered
from pendulum_by_hand import G, pendulum_system

import lagcli
from lagcli.engine.constraints.projection import Projection, jumped
from lagcli.engine.contract import Stop, Undefined
from lagcli.engine.evaluator import Evaluator

REST = np.zeros(2)


def of(constraints: str, rank: int, T: str = "(x'^2 + y'^2)/2") -> Projection:
    system, p = lowered(
        lagcli.load_text(f"""
coordinates: [x, y]
T: {T}
constraints: {constraints}
initial: {{x: {{guess: 1}}, y: {{guess: 1}}, x': {{guess: 0}}, y': {{guess: 0}}}}
""")
    )
    return Projection(Evaluator(system, p), rank)


@pytest.mark.parametrize("drift", [1e-12, 1e-6, 1e-3, 0.1])
def test_a_drifted_pendulum_comes_back_along_its_rod(drift: float) -> None:
    angle = np.array([0.6, -0.8])
    across = np.array([0.8, 0.6])
    project = Projection(Evaluator(pendulum_system(), (G,)), 1)
    q, v = project(0.0, (1 + drift) * angle, 2 * across + drift * angle)
    np.testing.assert_allclose(q, angle, atol=1e-15)
    np.testing.assert_allclose(v, 2 * across, atol=1e-15)


def test_light_masses_move_more() -> None:
    project = of('{sum: "x + y = 4"}', 1, T="3*x'^2/2 + y'^2/2")
    # M δ along Bᵀ: δ = (1, 3)
    q, v = project(0.0, REST, np.array([4.0, 0.0]))
    np.testing.assert_allclose(q, [1.0, 3.0], rtol=1e-14)
    np.testing.assert_allclose(v, [3.0, -3.0], rtol=1e-14)


def test_what_is_on_the_constraints_stays() -> None:
    q, v = np.array([0.0, 1.0]), np.array([3.0, 0.0])
    found = of('{rod: "x^2 + y^2 = 1"}', 1)(0.0, q, v)
    np.testing.assert_array_equal(found, (q, v))


def test_nonholonomic_constraints_move_velocities_alone() -> None:
    q = np.array([2.0, 3.0])
    found, v = of("{roll: \"x' = x*y'\"}", 1)(0.0, q, np.array([1.0, 1.0]))
    np.testing.assert_array_equal(found, q)
    # the part along (1, −2) is taken away
    np.testing.assert_allclose(v, np.array([1.0, 1.0]) + np.array([1.0, -2.0]) / 5, rtol=1e-14)


def test_redundant_constraints_are_met_together() -> None:
    project = of('{one: "x^2 + y^2 = 1", other: "2*x^2 + 2*y^2 = 2"}', 1)
    q, v = project(0.0, np.array([0.66, -0.88]), np.array([0.6, 0.0]))
    np.testing.assert_allclose(q, [0.6, -0.8], atol=1e-14)
    np.testing.assert_allclose(q @ v, 0.0, atol=1e-15)


def test_contradicting_constraints_are_named() -> None:
    project = of('{one: "x = 1", two: "x = 2"}', 1)
    with pytest.raises(Stop, match=r"contradict each other at t = 0\.5 s: `one`, `two`"):
        project(0.5, np.array([1.5, 0.0]), REST)


def test_constraints_that_cannot_be_met_are_named() -> None:
    project = of('{never: "x^2 + 1 = 0"}', 1)
    with pytest.raises(Stop, match=r"brought back onto the constraints `never` at t = 0\.5 s"):
        project(0.5, np.array([0.3, 0.0]), REST)


def test_values_that_are_not_finite_end_it() -> None:
    project = of('{root: "y = sqrt(x)"}', 1)
    with pytest.raises(Undefined) as caught:
        project(0.5, np.array([-1.0, 0.0]), REST)
    assert caught.value.undefined is not None
    np.testing.assert_array_equal(caught.value.undefined.q, [-1.0, 0.0])


def test_a_jump_names_the_coordinate() -> None:
    stop = jumped(pendulum_system(), 0.25, np.array([1.0, 0.0]), np.array([1.1, -2.0]))
    assert "t = 0.25 s" in str(stop)
    assert "differs by 2 in `y`" in str(stop)
