"""Time scales of small motions, against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.analysis.check.description import page

FOUND = Path(__file__).parents[3] / "found"

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
initial: {x: 0, y: 0, x': 0, y': 0}
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


def test_a_start_that_is_no_equilibrium_has_no_small_motions() -> None:
    model = lagcli.load(FOUND / "pend.yaml")
    checked = lagcli.check(model)
    assert checked.steady is False
    assert checked.time_scales is None
    text = " ".join(page(checked).split())
    assert "the start is not an equilibrium or a motion at constant velocities" in text
    assert "`lagcli modes --equilibrium`" in text
    assert "rad/s" not in text
    (mode,) = lagcli.modes(model, equilibrium=True).modes
    assert abs(mode.eigenvalue) == pytest.approx(np.sqrt(9.81))
    hanging = lagcli.check(lagcli.load(FOUND / "pend.yaml", set_initial={"theta": 0}))
    assert hanging.steady is True
    assert hanging.time_scales is not None
    assert hanging.time_scales.largest_frequency == pytest.approx(np.sqrt(9.81))


@pytest.mark.parametrize(
    ("initial", "steady"),
    [
        ("a: 90 deg, b: 90 deg, a': 0, b': 0", False),  # released horizontally
        ("a: 0, b: 0, a': 0, b': 0", True),
        ("a: 180 deg, b: 0, a': 0, b': 0", True),
        ("a: 0, b: 0, a': 1, b': 0", False),  # passes the equilibrium
    ],
)
def test_a_double_pendulum(initial: str, steady: bool) -> None:
    text = f"""
coordinates: [a, b]
T: a'^2 + b'^2/2 + cos(a - b)*a'*b'
V: -9.81*(2*cos(a) + cos(b))
initial: {{{initial}}}
"""
    checked = lagcli.check(lagcli.load_text(text))
    assert checked.steady is steady
    assert (checked.time_scales is not None) is steady
    assert ("No oscillation" in page(checked)) is False


def test_a_steady_motion_has_time_scales() -> None:
    """A conical pendulum: V_eff'' = ω² (1 + 3 cos² θ), with g = ω² cos θ."""
    rate, angle = 2.0, 0.8
    text = f"""
coordinates: [th, phi]
T: (th'^2 + sin(th)^2*phi'^2)/2
V: -{float(rate**2 * np.cos(angle))!r}*cos(th)
initial: {{th: {angle}, phi: 0, th': 0, phi': {rate}}}
"""
    checked = lagcli.check(lagcli.load_text(text))
    assert checked.steady is True
    assert checked.time_scales is not None
    expected = rate * np.sqrt(1 + 3 * np.cos(angle) ** 2)
    assert checked.time_scales.largest_frequency == pytest.approx(expected, rel=1e-7)
