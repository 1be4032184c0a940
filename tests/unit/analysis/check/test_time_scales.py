"""Time scales of small motions, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli

#: A pendulum in x and y that hangs at rest, with friction.
HANGING = """
coordinates: [x, y]
parameters: {m: 2, g: 9.81, l: 0.5, c: 0.6}
T: m/2*(x'^2 + y'^2)
V: m*g*y
Q: {x: -c*x', y: -c*y'}
constraints: {rod: x^2 + y^2 = l^2}
initial: {x: 0, y: -l, x': 0, y': 0}
"""


def test_a_hanging_pendulum() -> None:
    scales = lagcli.check(lagcli.load_text(HANGING)).time_scales
    assert scales is not None
    free, decay = np.sqrt(9.81 / 0.5), 0.6 / (2 * 2)
    assert scales.largest_frequency == pytest.approx(np.sqrt(free**2 - decay**2), rel=1e-9)
    assert scales.damping_ratio == pytest.approx(decay / free, rel=1e-9)
    assert scales.fastest_decay == pytest.approx(decay, rel=1e-9)
    assert scales.fastest_growth == 0.0


def test_a_standing_pendulum_grows() -> None:
    text = HANGING.replace("y: -l", "y: l").replace("c: 0.6", "c: 0")
    scales = lagcli.check(lagcli.load_text(text)).time_scales
    assert scales is not None
    assert scales.largest_frequency == 0.0
    assert scales.fastest_growth == pytest.approx(np.sqrt(9.81 / 0.5), rel=1e-9)


def test_stiffness_is_the_ratio_of_rates() -> None:
    text = """
coordinates: [x, y]
T: x'^2/2 + y'^2/2
V: 0.5*y^2
Q: {x: -1000*x'}
initial: {x: 0, y: 0, x': 1, y': 0}
"""
    scales = lagcli.check(lagcli.load_text(text)).time_scales
    assert scales is not None
    assert scales.fastest_decay == pytest.approx(1000)
    assert scales.largest_frequency == pytest.approx(1)
    assert scales.stiffness == pytest.approx(1000)


def test_a_velocity_constraint_takes_one_eigenvalue() -> None:
    """A skate that slides along its edge is free: all eigenvalues are zero."""
    text = """
coordinates: [x, y]
T: x'^2/2 + y'^2/2
V: 2*x^2
constraints: {along: y' = 0}
initial: {x: 0, y: 0, x': 0, y': 0}
"""
    scales = lagcli.check(lagcli.load_text(text)).time_scales
    assert scales is not None
    assert scales.largest_frequency == pytest.approx(2)
    assert scales.slowest == pytest.approx(2)
