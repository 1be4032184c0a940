"""Dry friction of any form in Q and D: stopping times and positions in closed form."""

from __future__ import annotations

from math import exp, log

import numpy as np
import pytest

import lagcli
from lagcli.settings.settings import SettingsOverrides
from lagcli.trajectory.trajectory import Trajectory

F, S, C, V = 3.0, 5.0, 2.0, 1.5  # N, N, N s/m, m/s


def run(friction: str, times: list[float], rest: str = "") -> Trajectory:
    """Run a particle of mass 1 that begins at speed V, and is pulled by 2 t from t = 3 s on."""
    model = lagcli.load_text(
        f"coordinates: [x]\nparameters: {{F: {F}, S: {S}, c: {C}, v_s: 0.4}}\nT: x'^2/2\n"
        f"{friction}\n{rest}\ninitial: {{x: 0, x': {V}}}\n"
    )
    return lagcli.simulate(model, SettingsOverrides(times=tuple(times), rtol=1e-11))


def sticks_at(found: Trajectory) -> float:
    """Return when it comes to rest, which it does once."""
    log_ = found.events
    assert log_ is not None
    assert log_.counts()["x.sign"]["sticks"] == 1
    return float(log_.time[list(log_.kinds).index("sticks")])


def test_coulomb_friction_as_dissipation() -> None:
    found = run("D: F*abs(x')", [0, 0.1, 1, 2])
    assert sticks_at(found) == pytest.approx(V / F, abs=1e-11)
    stops = V * V / (2 * F)
    np.testing.assert_allclose(found.q[:, 0], [0, 0.1 * V - F * 0.005, stops, stops], atol=1e-11)
    np.testing.assert_allclose(found.v[2:], 0, atol=1e-14)
    assert abs(found.energy_balance).max() < 1e-10


def test_coulomb_and_viscous_friction() -> None:
    """v = (V + F/c) exp(-c t) - F/c."""
    found = run("Q: {x: \"-(F + c*abs(x'))*sign(x')\"}", [0, 1, 2])
    stops = log(1 + C * V / F) / C
    assert sticks_at(found) == pytest.approx(stops, abs=1e-10)
    x = (V + F / C) * (1 - exp(-C * stops)) / C - F / C * stops
    np.testing.assert_allclose(found.q[1:, 0], x, rtol=1e-10)


def test_friction_that_grows_as_it_slows_down() -> None:
    """v = S/c + (V - S/c) exp(c t) where the friction is S - c v, which is above F."""
    level = "max(S - c*abs(x'), F/10)"
    found = run(f'Q: {{x: "-{level}*sign(x\')"}}', [0, 1, 2])
    stops = log(S / C / (S / C - V)) / C
    assert sticks_at(found) == pytest.approx(stops, abs=1e-10)
    x = S / C * stops + (V - S / C) * (exp(C * stops) - 1) / C
    np.testing.assert_allclose(found.q[1:, 0], x, rtol=1e-10)


def test_stribeck_friction_stops_and_breaks_away() -> None:
    """t = ∫ dv/F(v) with F(v) = F + (S - F) exp(-v/v_s); then a force 2 (t - 1) exceeds S."""
    v_s, b = 0.4, S - F
    friction = "-(F + (S - F)*exp(-abs(x')/v_s))*sign(x') + 2*max(t - 1, 0)"
    found = run(f'Q: {{x: "{friction}"}}', [0, 1, 3, 3.45, 3.55])
    stops = v_s / F * log((F * exp(V / v_s) + b) / (F + b))
    assert sticks_at(found) == pytest.approx(stops, abs=1e-10)
    log_ = found.events
    assert log_ is not None
    assert log_.time[list(log_.kinds).index("slips")] == pytest.approx(1 + S / 2, abs=1e-10)
    # x = ∫ v dv/F(v) over 4000 Gauss nodes
    nodes, weights = np.polynomial.legendre.leggauss(400)
    v = V / 2 * (nodes + 1)
    x = float(V / 2 * (weights * v / (F + b * np.exp(-v / v_s))).sum())
    np.testing.assert_allclose(found.q[1:4, 0], x, rtol=1e-10)
    assert found.q[4, 0] > x
    np.testing.assert_allclose(found.multipliers[2:4, 0], [-4, -4.9], rtol=1e-12)


def test_friction_written_with_a_multiplier() -> None:
    text = """
coordinates: [x, y]
parameters: {m: 2, g: 9.81, mu: 0.3}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {floor: y = 0}
Q: {x: -mu*abs(lambda.floor)*sign(x')}
initial: {x: 0, x': 2, y: 0, y': 0}
"""
    settings = SettingsOverrides(times=(0, 1), rtol=1e-11)
    found = lagcli.simulate(lagcli.load_text(text), settings)
    assert sticks_at(found) == pytest.approx(2 / (0.3 * 9.81), abs=1e-11)
    assert found.q[-1, 0] == pytest.approx(4 / (2 * 0.3 * 9.81), abs=1e-11)


def test_two_blocks_with_stribeck_friction_stick_together() -> None:
    """Pulled by a spring, through dozens of changes."""
    text = """
coordinates: [x, y]
parameters: {F: 0.5, S: 1, v_s: 0.1, v: 0.2}
definitions:
  F_x: F + (S - F)*exp(-abs(x')/v_s)
  F_y: F + (S - F)*exp(-abs(y')/v_s)
T: (x'^2 + y'^2)/2
V: 5*(x - y)^2 + 5*(x - v*t)^2
Q: {x: -F_x*sign(x'), y: -F_y*sign(y')}
initial: {x: 0, x': 0, y: 0.01, y': 0}
"""
    settings = SettingsOverrides(times=(0, 3, 20))
    found = lagcli.simulate(lagcli.load_text(text), settings)
    assert found.status == "completed", found.message
    # of this engine and of an independent one, on SciPy (80096f2), with rtol 1e-9
    np.testing.assert_allclose(found.q[-1], [3.94872921, 3.84025990], atol=5e-8)
    counts = {"x.sign": {"slips": 14, "sticks": 12}, "y.sign": {"slips": 8, "sticks": 7}}
    assert found.events is not None
    assert found.events.counts() == counts
