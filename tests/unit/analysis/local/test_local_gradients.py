"""Gradients of expressions, and parameters that follow others."""

from __future__ import annotations

import math

import numpy as np
import pytest

import lagcli
from lagcli.analysis.local.gradients import Gradients, Point
from lagcli.analysis.local.local_equations import LocalEquations
from lagcli.analysis.local.parameter_path import ParameterPath
from lagcli.errors import NumericalError, UsageError

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
