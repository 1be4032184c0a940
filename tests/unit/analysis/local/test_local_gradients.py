"""Gradients of expressions, and parameters that follow others."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

import lagcli
from lagcli.analysis.local.gradients import (
    ForwardJacobians,
    Gradients,
    MotionJacobianTape,
    ParameterPath,
    Point,
    motion_jacobians,
)
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.engine.lowering.lower import lower
from lagcli.errors import NumericalError, UsageError

MODELS = Path(__file__).parents[4] / "models"
FOUND = Path(__file__).parents[3] / "found"

TEXT = """
coordinates: [x, y]
parameters: {m: 2, k: 3*m^2, c: sin(k), d: 5}
T: m/2*(x'^2 + y'^2)
V: k/2*x^2 + c*abs(y)
constraints: {line: x = y^2}
initial: {x: 0.25, y: 0.5, x': 0, y': 0}
"""


def test_gradients_are_filled_into_a_matrix() -> None:
    local = LocalEquations(lagcli.load_text(TEXT))
    eq = local.equations
    found = Gradients.of(eq, [eq.q[0] ** 2 * eq.v[1], eq.multipliers[0] * eq.a[0]], [*eq.q, *eq.v])
    point = Point(0.0, *np.array([[2.0, 3], [5, 7], [11, 13]]), np.array([17.0]), local.p)
    expected = [[2 * 2 * 7, 0, 0, 2**2], [0, 0, 0, 0]]
    assert found.at(point).tolist() == expected
    jac = local.jacobians(point)
    # the geometric stiffness: x − y² contributes −2 λ
    assert jac.force_position[1, 1] == pytest.approx(-2 * 17)


def test_parameters_that_are_defined_by_another_follow_it() -> None:
    path = ParameterPath(lagcli.load_text(TEXT), "m")
    assert path.followers == ("m", "k", "c")
    assert path.values((2.0, 12.0, 0.0, 5.0), 3.0) == pytest.approx((3, 27, math.sin(27), 5))
    assert path.slopes(3.0) == pytest.approx([1, 18, 18 * math.cos(27)])
    with pytest.raises(UsageError, match="not a parameter"):
        ParameterPath(lagcli.load_text(TEXT), "q")


def test_derivatives_that_do_not_exist_are_an_error() -> None:
    text = "coordinates: [x]\nT: x'^2/2\nV: sqrt(x)^3\ninitial: {x: 0, x': 0}\n"
    with pytest.raises(NumericalError):
        lagcli.linearize(lagcli.load_text(text))


@pytest.mark.parametrize(
    "name",
    ["slider_crank", "heavy_top", "rolling_disk", "charged_pendulum", "bead_on_rotating_hoop"],
)
def test_forward_differentiation_gives_the_compiled_derivatives(name: str) -> None:
    equations = lagcli.derive(lagcli.load(MODELS / f"{name}.yaml"))
    compiled = MotionJacobianTape(lower(equations))
    forward = ForwardJacobians(equations)
    random = np.random.default_rng(5)
    nq, nc = len(equations.q), len(equations.constraints)
    p = tuple(equations.model.parameter_values.values())
    for _ in range(5):
        q, v, a, multipliers = (random.normal(size=n) for n in (nq, nq, nq, nc))
        point = Point(0.3, q, v, a, multipliers, p)
        for found, expected in zip(forward.at(point), compiled.at(point), strict=True):
            size = np.abs(expected).max(initial=0.0)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * size)


def test_many_coordinates_are_differentiated_forward() -> None:
    chain = lagcli.derive(lagcli.load(MODELS / "pendulum_chain.yaml", set={"N": "24"}))
    assert isinstance(motion_jacobians(chain, lower(chain)), ForwardJacobians)
    crank = lagcli.derive(lagcli.load(MODELS / "slider_crank.yaml"))
    assert isinstance(motion_jacobians(crank, lower(crank)), MotionJacobianTape)


def test_frequencies_of_a_beam_of_many_links() -> None:
    """Straight, of n links: y' = L θ' for the n masses, the last one half, and springs of n⁴."""
    n = 30
    found = lagcli.modes(lagcli.load(FOUND / "beam40.yaml", set={"n": str(n)})).modes
    lower_triangle = np.tril(np.ones((n, n)))
    mass = lower_triangle.T @ np.diag([*[1.0] * (n - 1), 0.5]) @ lower_triangle
    stiffness = n**4 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    stiffness[0, 0], stiffness[-1, -1] = 3 * n**4, n**4
    squares = scipy.linalg.eigh(stiffness, mass, eigvals_only=True)
    frequencies = sorted(abs(mode.eigenvalue) for mode in found)
    np.testing.assert_allclose(frequencies, np.sqrt(squares), rtol=1e-10)
    # the first ones are near those of a clamped beam, 1.8751² and 4.6941²
    np.testing.assert_allclose(frequencies[:2], [3.516, 22.03], rtol=5e-3)
