"""The automatic choice of the method: what it takes, and that a change in mid-run loses nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pendulum_by_hand import G, pendulum
from shipped import PATHS, every_model

import lagcli
from lagcli.engine.integrate import run as run_module
from lagcli.engine.integrate.methods import Methods
from lagcli.model.model import Model
from lagcli.trajectory.trajectory import Trajectory

PENDULUM = """
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 1, y: 0, x': 0, y': 0}
"""
#: Springs and dampers that are not loaded at the start: rounding errors of their forces limit the
#: steps of DOP853 far below stability.
SPRING = """
coordinates: [x, y]
parameters: {k: 1e7, c: 2e3}
definitions: {r: sqrt(x^2 + y^2)}
T: (x'^2 + y'^2)/2
V: k/2*(r - 1)^2 + 9.81*y
D: c/2*r'^2
initial: {x: 1, y: 0, x': 0, y': 0}
"""


def completed(model: Model, **options: Any) -> Trajectory:
    """Simulate; fail unless it completes."""
    trajectory = lagcli.simulate(model, **options)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def test_a_smooth_run_keeps_dop853() -> None:
    found = completed(lagcli.load_text(PENDULUM), t_end=900, samples=2401)
    assert found.options["method"] == "DOP853"
    assert "choice" not in found.options
    # the exact motion, by elliptic functions; an error of the energy shifts the phase
    np.testing.assert_allclose(found.q, pendulum(found.time), rtol=0, atol=1e-5)
    # the tension of the rod, −2 λ, is 3 g cos θ, by the energy
    np.testing.assert_allclose(-2 * found.multipliers[:, 0], -3 * G * found.q[:, 1], atol=1e-5)
    requested = completed(lagcli.load_text(PENDULUM), t_end=900, samples=2401, method="DOP853")
    np.testing.assert_array_equal(found.q, requested.q)


@pytest.mark.parametrize("t_end", [1.0, 40.0])
def test_stiff_forces_at_rest(t_end: float) -> None:
    found = completed(lagcli.load_text(SPRING), t_end=t_end, samples=41)
    assert found.options["method"] == "DOP853, Radau"
    assert found.options["choice"].startswith("Radau from t = ")
    assert found.counts["steps"] < 700 * t_end + 3000  # DOP853 would take 40 000 steps at first
    # it swings as a pendulum whose rod the spring is, lengthened by 3 g/k cos θ
    if t_end == 1.0:
        np.testing.assert_allclose(found.q, pendulum(found.time), rtol=0, atol=2e-5)


@pytest.mark.bits
@pytest.mark.parametrize("seconds", [1e-9, 1e3])
def test_the_choice_does_not_depend_on_clocks(
    seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    options: dict[str, Any] = {"t_end": 30, "samples": 31}
    usual = [completed(lagcli.load_text(x), **options) for x in (PENDULUM, SPRING)]
    monkeypatch.setattr(run_module, "_SLICE", seconds)
    other = [completed(lagcli.load_text(x), **options) for x in (PENDULUM, SPRING)]
    for one, two in zip(usual, other, strict=True):
        assert one.options == two.options
        assert one.counts == two.counts
        np.testing.assert_array_equal(one.q, two.q)
        np.testing.assert_array_equal(one.multipliers, two.multipliers)


def change(methods: Methods, report: Any) -> None:
    """Go on with Radau after 32 steps."""
    if methods.may_help() and report.steps >= 32:
        methods._go_on_implicitly(report)


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_a_change_in_mid_run_on_every_shipped_model(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Radau for nothing: every run that can changes to it after 32 steps."""
    monkeypatch.setattr(Methods, "most_steps", lambda self, steps: max(1, 32 - steps))
    monkeypatch.setattr(Methods, "review", change)
    model = lagcli.load(PATHS[name])
    end = (model.settings.t_start or 0.0) + 0.5 * model.settings.t_end
    options: dict[str, Any] = {"t_end": end, "samples": 201}
    found = completed(model, rtol=1e-9, **options)
    plain = completed(model, rtol=1e-9, method="DOP853", **options)
    exact = completed(model, rtol=1e-12, method="DOP853", **options)
    for column in ("q", "v", "a", "multipliers"):
        is_, was, should = (getattr(x, column) for x in (found, plain, exact))
        scale = np.abs(should).max(axis=0, initial=0.0).max(initial=0.0)
        error = np.abs(was - should).max(initial=0.0)
        # Radau at a tolerance is as accurate as DOP853 within two orders
        assert np.abs(is_ - should).max(initial=0.0) <= 30 * error + 1e-7 * scale, column
    for residual, scale in (
        ("residual_position", "scale_position"),
        ("residual_velocity", "scale_velocity"),
    ):
        part = np.abs(getattr(found, residual) / getattr(found, scale))
        assert np.nanmax(part, initial=0.0) <= 1e-11
