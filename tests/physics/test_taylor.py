"""Taylor's method against DOP853, and where power series mislead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shipped import every_model

import lagcli
from lagcli.model.model import Model
from lagcli.trajectory.trajectory import Trajectory

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))


def run(model: Model, **options: Any) -> Trajectory:
    return lagcli.simulate(model, method="Taylor", **options)


@pytest.mark.parametrize("name", every_model(smooth=True))
def test_shipped_models_move_alike(name: str) -> None:
    model = lagcli.load(name)
    t_end = min(1.0, model.settings.t_end or 1.0)
    options: dict[str, Any] = {"t_end": t_end, "samples": 21, "rtol": 1e-11, "atol": 1e-12}
    found = run(model, **options)
    expected = lagcli.simulate(model, method="DOP853", **options)
    assert found.status == expected.status
    assert len(found.time) == len(expected.time)
    used = found.options["method"]
    assert used == "Taylor" or "used DOP853" in found.message
    for name in ("q", "v", "multipliers"):
        one, other = getattr(found, name), getattr(expected, name)
        size = np.abs(other).max(initial=1.0)
        # a second of the motions that part exponentially: some hundred times the tolerance
        assert np.abs(one - other).max(initial=0.0) < 1e-8 * size, name
    if used == "Taylor" and found.status == "completed":
        assert found.counts["steps"] < expected.counts["steps"]
        # NaN where a constraint is one of velocities
        assert not (np.abs(found.residual_position) > 1e-12).any()
        energy = np.abs(found.energy_kinetic).max()
        assert np.abs(found.energy_balance).max() < 1e-9 * max(energy, 1.0)


def test_stops_at_a_singular_configuration_or_passes_it() -> None:
    # both angles turn at 2 rad/s, and the constraint loses its gradient at π/2
    model = lagcli.load_text("""
coordinates: [phi, psi]
T: (phi'^2 + psi'^2)/2
constraints: {guide: sin(phi) = sin(psi)}
initial: {phi: 0.5, phi': 2, psi: {guess: 0.5}, psi': {guess: 0}}
""")
    for rtol in (1e-5, 1e-9, 1e-12):
        stopped = run(model, t_end=3, samples=301, rtol=rtol, atol=rtol)
        assert stopped.status == "failed"
        assert "singular configuration at t = 0.5353" in stopped.message
        assert stopped.time[-1] <= (np.pi / 2 - 0.5) / 2 + 1e-6
    passed = run(model, t_end=4, samples=401, rtol=1e-10, through_singular=True)
    assert passed.status == "completed"
    np.testing.assert_allclose(passed.q, np.outer(0.5 + 2 * passed.time, [1, 1]), atol=1e-8)


def test_another_branch_of_a_root_is_no_motion() -> None:
    # along the series √(1 − x) = y goes on to y < 0; the constraint as it is written ends
    model = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {c: y = sqrt(1 - x)}
initial: {x: 0, x': 1, y: {guess: 1}, y': {guess: 0}}
""")
    trajectory = run(model, t_end=4, samples=401)
    assert trajectory.status == "failed"
    assert trajectory.time[-1] < 2
    assert (trajectory.q[:, 1] > 0).all()


def test_kinks_are_frozen_within_a_step() -> None:
    model = lagcli.load_text("""
coordinates: [x]
T: x'^2/2
Q: {x: -abs(x)*x}
initial: {x: 1, x': 0}
""")
    trajectory = run(model, t_end=10)
    assert trajectory.status == "completed"
    assert trajectory.options["method"] == "Taylor"
    (x,), (v,) = trajectory.q.T, trajectory.v.T
    assert (x < -0.9).any()
    assert np.allclose(v**2 / 2 + np.abs(x) ** 3 / 3, 1 / 3, atol=1e-8)


def test_kinks_beside_a_root_are_left_to_another_method() -> None:
    model = lagcli.load_text("""
coordinates: [x]
T: x'^2/2
Q: {x: "-max(x, 0)^1.5"}
initial: {x: 1, x': 0}
""")
    trajectory = run(model, t_end=1)
    assert trajectory.status == "completed"
    assert trajectory.options["method"] == "DOP853"
    assert "functions with kinks or jumps have no power series" in trajectory.message


def test_redundant_constraints_are_left_to_another_method() -> None:
    model = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: 9.81*y
constraints: {rod: x^2 + y^2 = 1, again: 2*x^2 + 2*y^2 = 2}
initial: {x: 1, y: 0, x': 0, y': 0}
""")
    trajectory = run(model, t_end=1)
    assert trajectory.status == "completed"
    assert "solved densely" in trajectory.message


def test_long_chain_moves_alike() -> None:
    # long enough for operations on vectors
    n = 70
    rods = [f"  rod{i}: (x{i} - x{i - 1})^2 + (y{i} - y{i - 1})^2 = 1" for i in range(2, n + 1)]
    names = [f"{x}{i}" for i in range(1, n + 1) for x in "xy"]
    model = lagcli.load_text(f"""
coordinates: [{", ".join(names)}]
T: {" + ".join(f"{x}'^2/2" for x in names)}
V: {" + ".join(f"9.81*y{i}" for i in range(1, n + 1))}
constraints:
  rod1: x1^2 + y1^2 = 1
{chr(10).join(rods)}
initial: {{{", ".join(f"x{i}: {i}, y{i}: 0, x{i}': 0, y{i}': 0" for i in range(1, n + 1))}}}
""")
    options: dict[str, Any] = {"t_end": 0.6, "samples": 4, "rtol": 1e-11, "atol": 1e-11}
    found = run(model, **options)
    expected = lagcli.simulate(model, method="DOP853", **options)
    assert found.options["method"] == "Taylor"
    assert found.counts["steps"] < expected.counts["steps"] / 2
    np.testing.assert_allclose(found.q, expected.q, atol=1e-9)
    np.testing.assert_allclose(found.v, expected.v, atol=1e-8)
    size = np.abs(expected.multipliers).max()
    np.testing.assert_allclose(found.multipliers, expected.multipliers, atol=1e-8 * size)
    assert np.abs(found.energy_balance).max() < 1e-8
