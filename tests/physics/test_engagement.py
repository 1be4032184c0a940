"""Constraints that events engage, and conditions that actions end."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.cli.app import run
from lagcli.trajectory.trajectory import Trajectory

#: A mass that falls from 1 m, and what can be engaged.
FALL = """
coordinates: [y, x]
parameters: {g: 9.81}
T: (y'^2 + x'^2)/2
V: g*y
constraints:
  NAME: {expr: y SIGN HEIGHT, active: false}
events:
  EVENT
initial: {y: 1, y': 0, x: 0, x': 1}
simulation: {t_end: 0.6, samples: 7}
"""


def fall(event: str, height: float = 0.0, **options: Any) -> Trajectory:
    name, sign = ("floor", ">=") if "engage: floor" in event else ("pin", "=")
    if "engage" not in event:
        event += "\n  never: {when: t >= 10, engage: pin}"
    text = FALL.replace("NAME", name).replace("SIGN", sign).replace("HEIGHT", repr(height))
    text = text.replace("EVENT", event)
    return lagcli.simulate(lagcli.load_text(text), **options)


def kinds(found: Trajectory) -> tuple[str, ...]:
    assert found.events is not None
    return tuple(found.events.kinds)


def test_a_constraint_is_engaged_where_phi_vanishes_though_its_terms_do() -> None:
    """φ = y is there a rounding error of a height that is one of a fall from 1 m."""
    found = fall("catch: {when: y <= 0, engage: pin}")
    assert found.status == "completed", found.message
    assert kinds(found) == ("event", "engages")
    np.testing.assert_allclose(found.events.time, math.sqrt(2 / 9.81), atol=1e-9)
    np.testing.assert_allclose(found.q[-1, 0], 0, atol=1e-12)


@pytest.mark.parametrize(("closed", "met"), [(1e-9, False), (1e-6, True)])
def test_the_gap_that_counts_as_none_is_the_setting_closed(closed: float, met: bool) -> None:
    event = "catch: {when: y <= 0.5, set: {y: 0.50000001}, engage: pin}"
    found = fall(event, 0.5, closed=closed)
    assert found.status == ("completed" if met else "failed"), found.message
    if met:
        np.testing.assert_allclose(found.q[-1, 0], 0.5, atol=1e-12)
    else:
        assert found.message.startswith("`pin` cannot be engaged at t = 0.319275")
        assert "phi = 1e-08" in found.message


def test_a_contact_is_engaged_while_it_is_open_but_not_beyond_its_surface() -> None:
    found = fall("floor: {when: y <= 0.5, engage: floor}", 0.2)
    assert found.status == "completed", found.message
    assert kinds(found) == ("event", "engages", "impact", "closes")
    np.testing.assert_allclose(found.events.time[-1], math.sqrt(1.6 / 9.81), atol=1e-9)
    found = fall("floor: {when: y <= 0.5, engage: floor}", 0.7)
    assert found.status == "failed"
    assert "`floor` cannot be engaged" in found.message
    assert "phi = -0.2" in found.message


def test_a_condition_that_an_action_ends_by_a_rounding_error_stays_true() -> None:
    found = fall("lift: {when: y <= 0.5, set: {y: 0.5000000000000002}}")
    assert found.status == "completed", found.message
    assert kinds(found) == ("event",)
    np.testing.assert_allclose(found.q[-1, 0], 1 - 9.81 / 2 * 0.36, atol=1e-9)


def test_a_condition_that_an_action_ends_is_true_again_later() -> None:
    found = fall("lift: {when: y <= 0.5, set: {y: 0.51}, times: 5}")
    assert found.status == "completed", found.message
    assert kinds(found) == ("event",) * 5
    # each time it falls 1 cm, from the velocity of all falls before
    speeds = np.sqrt(2 * 9.81 * (0.5 + 0.01 * np.arange(5)))
    np.testing.assert_allclose(found.events.time, speeds / 9.81, atol=1e-9)


FOUND = Path(__file__).parents[1] / "found"


@pytest.mark.parametrize("name", ["release_needed", "swap_massless"])
def test_massless_point_whose_constraint_events_change(name: str) -> None:
    """x = cos(√k t), and λ = −k x holds the point, also by the constraint that takes over."""
    run = lagcli.simulate(lagcli.load(FOUND / f"{name}.yaml"))
    assert run.status == "completed"
    x = np.cos(np.sqrt(10) * run.time)
    assert np.abs(run.q - np.stack([0 * x, x], 1)).max() < 1e-8
    assert np.abs(np.nansum(run.multipliers, axis=1) + 10 * x).max() < 1e-7
    assert np.abs(run.energy_balance).max() < 1e-7


def test_results_have_the_parameters_of_the_file_alone(tmp_path: Path) -> None:
    """The weights of its constraints cannot be set, and are not written."""
    model = lagcli.load(FOUND / "swap_massless.yaml")
    results = [tmp_path / "run.h5", tmp_path / "sweep.h5"]
    run(["simulate", model.path, "-o", str(results[0]), "-q"])
    run(["sweep", model.path, "--vary", "k=9,10", "-o", str(results[1]), "-q"])
    assert list(lagcli.open(results[0]).parameters) == ["m", "k"]
    for path in results:
        assert run(["report", str(path), "-o", str(path.with_suffix(".html")), "-q"]) == 0
        assert "held.weight" not in path.with_suffix(".html").read_text(encoding="utf-8")


def test_massless_pulley_with_a_stop() -> None:
    """The heavy mass on the pulley lifts the counterweight off its stop, or does not."""
    text = (FOUND / "contact_massless.yaml").read_text()
    run = lagcli.simulate(lagcli.load_text(text))
    # y1 = p + d and y2 = −L − 2 p: T = (m1 + 4 m2) p'²/2, V = (m1 − 2 m2) g p
    a = -(5 - 2 * 2) * 9.81 / (5 + 4 * 2)
    assert np.abs(run.q[:, 0] - (-1.5 + a / 2 * run.time**2)).max() < 1e-9
    held = lagcli.simulate(lagcli.load_text(text.replace("m1: 5 kg", "m1: 3 kg")))
    assert np.abs(held.q - held.q[0]).max() < 1e-12
    assert np.abs(held.multipliers[1:, 2] - (2 - 1.5) * 9.81).max() < 1e-9


def test_controls_of_massless_coordinates() -> None:
    run = lagcli.simulate(lagcli.load(FOUND / "release_other.yaml"))
    later = np.maximum(run.time - 0.2, 0)
    a = (2 * 2 - 3) * 9.81 / (3 + 4 * 2)
    assert np.abs(run.q[:, 0] - (-1.5 + a / 2 * later**2)).max() < 1e-8
    run = lagcli.simulate(lagcli.load(FOUND / "pid.yaml"))
    roots = np.roots([1, 5, 20, 10])  # of the third derivative, x'', x' and x − 1
    start = np.array([-1.0, 0.0, 20 - 9.81])
    weights = np.linalg.solve(np.vander(roots, increasing=True).T, start)
    exact = 1 + (weights * np.exp(roots * run.time[:, None])).sum(axis=1).real
    assert np.abs(run.q[:, 0] - exact).max() < 1e-8


def test_event_that_leaves_a_massless_point_undetermined_is_named() -> None:
    text = (FOUND / "release_needed.yaml").read_text().replace("x >= 5", "x <= 0.5")
    run = lagcli.simulate(lagcli.load_text(text))
    at = math.acos(0.5) / math.sqrt(10)
    assert run.status == "failed"
    assert run.time[-1] == pytest.approx(at, abs=0.1)
    assert f"event `never` releases `held` at t = {at:.9g} s" in run.message
    assert "`p` has no inertia" in run.message


def test_velocity_of_a_massless_point_does_not_jump() -> None:
    text = (FOUND / "swap_massless.yaml").read_text()
    text = text.replace("held: p = 0", "held: p = sin(t)").replace("p': 0", "p': {guess: 1}")
    run = lagcli.simulate(lagcli.load_text(text))
    assert run.status == "failed"
    assert "the velocity of a coordinate without inertia" in run.message
    assert "event `swap` engages `follow` at t = 1 s" in run.message


@pytest.mark.parametrize("mass", [1e-6, 1.0, 1e6])
def test_equal_constraints_take_turns(mass: float) -> None:
    """A swap of a constraint for the same one, of which λ is half: as without the event."""
    text = f"""
coordinates: [p, x, z]
parameters: {{m: {mass}}}
T: m/2*x'^2 + m/3*z'^2
V: m*(2*(x - p)^2 + (z - p)^2 + z^2/2)
constraints:
  held: p - 0.3*x = 0.15*sin(t/2)
  other: {{expr: 2*p - 0.6*x = 0.3*sin(t/2), active: false}}
initial: {{p: {{guess: 0}}, x: 1, z: 0.2, p': {{guess: 0}}, x': 0, z': 0}}
events: {{swap: {{when: t >= 0.7, release: held, engage: other}}}}
simulation: {{t_end: 2, samples: 21}}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    lines = [x for x in text.splitlines() if not x.startswith(("  other", "events"))]
    plain = lagcli.simulate(lagcli.load_text("\n".join(lines)))
    assert np.abs(run.q - plain.q).max() < 1e-8
    forces = np.where(run.time > 0.7, 2 * run.multipliers[:, 1], run.multipliers[:, 0])
    assert np.abs(forces - plain.multipliers[:, 0]).max() < 1e-7 * mass
