"""Eigenvalues of matrices with zeros, and kinds of modes."""

from __future__ import annotations

import math

import numpy as np
import pytest

import lagcli
from lagcli.analysis.linear.modes import general_eigenpairs


def test_neutral_states_have_eigenvalues_of_zero() -> None:
    # x' = v y, y' = θ, and an oscillator: a Jordan block that rounding would spread to 1e-5
    matrix = np.zeros((5, 5))
    matrix[0, 1], matrix[1, 2], matrix[3, 4], matrix[4, 3] = 5.0, 7.0, 1.0, -4.0
    matrix[2, 3] = 0.3
    noise = 1e-16 * np.random.default_rng(2).standard_normal((5, 5))
    values, vectors = general_eigenpairs(matrix + noise, np.ones(5), 2.0)
    found = sorted(values, key=abs)
    assert found[:3] == [0, 0, 0]
    assert found[3] == pytest.approx(2j)
    k = int(np.argmax(np.abs(values)))
    np.testing.assert_allclose(matrix @ vectors[:, k], values[k] * vectors[:, k], atol=1e-14)


def test_kinds_of_modes() -> None:
    text = (
        "coordinates: [x, y, z, u, w]\nparameters: {c: 0.2, n: -0.2}\n"
        "T: (x'^2 + y'^2 + z'^2 + u'^2 + w'^2)/2\nV: (x^2 + 4*y^2 - 9*z^2 + 30*w^2)/2\n"
        "D: c/2*x'^2 + n/2*y'^2\n"
        "initial: {x: 0, y: 0, z: 0, u: 0, w: 0, x': 0, y': 0, z': 0, u': 0, w': 0}\n"
    )
    found = lagcli.modes(lagcli.load_text(text))
    kinds = [mode.kind for mode in found.modes]
    assert kinds == [
        *("neutral", "neutral", "oscillation", "growing oscillation"),
        *("divergence", "decay", "oscillation"),
    ]
    assert not found.undamped
    assert found.modes[2].damping_ratio == pytest.approx(0.1)
    assert found.modes[3].damping_ratio == pytest.approx(-0.05)
    assert found.modes[-1].damping_ratio == 0.0
    assert found.modes[-1].position.tolist() == [0, 0, 0, 0, 1]


@pytest.mark.parametrize(("mass", "damping"), [(1.0, 1e4), (1.0, 1e6), (1e-3, 1e5)])
@pytest.mark.parametrize("stiffness", [10.0, -10.0])
def test_slow_motions_beside_strong_damping_are_not_neutral(
    mass: float, damping: float, stiffness: float
) -> None:
    text = (
        f"coordinates: [x]\nparameters: {{k: {stiffness}}}\nT: {mass}*x'^2/2\nV: k*x^2/2\n"
        f"D: {damping}/2*x'^2\ninitial: {{x: 0, x': 0}}\n"
    )
    slowest = -2 * stiffness / (damping + math.sqrt(damping**2 - 4 * mass * stiffness))
    slow, fast = lagcli.modes(lagcli.load_text(text)).modes
    assert slow.kind == ("decay" if stiffness > 0 else "divergence")
    assert slow.eigenvalue == pytest.approx(slowest, rel=1e-9)
    assert fast.eigenvalue == pytest.approx(-damping / mass, rel=1e-3)
    (one,) = lagcli.equilibrium(lagcli.load_text(text)).equilibria
    assert one.stability.verdict == ("asymptotically stable" if stiffness > 0 else "unstable")


def test_zero_degrees_of_freedom_have_no_modes() -> None:
    text = (
        "coordinates: [x]\nT: x'^2/2\nV: x\nconstraints: {fixed: x = 1}\ninitial: {x: 1, x': 0}\n"
    )
    found = lagcli.modes(lagcli.load_text(text))
    assert found.modes == ()
    assert found.linear_model.states == ()
    (one,) = lagcli.equilibrium(lagcli.load_text(text)).equilibria
    assert one.operating_point.point.multipliers == pytest.approx([1.0])
    assert one.stability.verdict == "stable"
