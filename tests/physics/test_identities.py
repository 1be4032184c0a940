"""Identities that every right solution obeys, on several mechanisms."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lagcli
from lagcli.engine.integrate.many_states import Batch
from lagcli.engine.lowering.lower import lower
from lagcli.model.model import Model
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[2] / "models"
RTOL = 1e-11
#: Two runs of one motion with other steps, over a second or so.
SAME = 1e-8

NAMES = ("slider_crank", "four_bar", "double_pendulum_cartesian", "rolling_disk", "heavy_top")


@cache
def shipped(name: str) -> str:
    return (MODELS / f"{name}.yaml").read_text(encoding="utf-8")


def run(text: str | Model, **options: Any) -> Trajectory:
    model = lagcli.load_text(text) if isinstance(text, str) else text
    settings = {"t_end": 0.8, "samples": 41, "rtol": RTOL, "atol": RTOL} | options
    trajectory = lagcli.simulate(model, **settings)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def model(*blocks: str) -> str:
    return "name: written in a test\n" + "\n".join(blocks) + "\n"


def assert_balanced(trajectory: Trajectory, exchanged: float) -> None:
    """Energy minus the work done is constant, next to the energy that is exchanged."""
    assert np.abs(trajectory.energy_balance).max() < 1e-8 * exchanged
    # ... and something is exchanged, or the test would say nothing
    assert exchanged > 1e-3
    # dE/dt is the power, by differences of samples
    t, energy = trajectory.time, trajectory.energy_total
    power = trajectory.power_applied + trajectory.power_constraint + trajectory.power_time
    slope = np.gradient(energy, t, edge_order=2)[2:-2]
    # central differences are good to the square of the spacing
    room = 0.02 * (np.ptp(power) + np.abs(power).max())
    np.testing.assert_allclose(slope, power[2:-2], rtol=0, atol=room + 1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_kinetic_energy_is_half_v_m_v(name: str) -> None:
    loaded = lagcli.load_text(shipped(name))
    trajectory = run(loaded, t_end=0.2, samples=11)
    system = lower(lagcli.derive(loaded))
    values = tuple(loaded.parameter_values.values())
    batch = Batch(system, values, trajectory.time, trajectory.q, trajectory.v)
    mass = batch.dynamics().mass_matrix
    half = np.einsum("ti,ijt,tj->t", trajectory.v, mass, trajectory.v) / 2
    np.testing.assert_allclose(half, trajectory.energy_kinetic, rtol=1e-12)
    np.testing.assert_allclose(mass, mass.transpose(1, 0, 2), rtol=0, atol=0)
    total = trajectory.energy_kinetic + trajectory.energy_potential
    np.testing.assert_allclose(trajectory.energy_total, total, rtol=1e-11)


@pytest.mark.parametrize("name", ["slider_crank", "four_bar", "double_pendulum_cartesian"])
def test_motion_runs_back_in_reversed_time(name: str) -> None:
    forth = run(shipped(name), t_end=0.5)
    loaded = lagcli.load_text(shipped(name))
    names = [c.name for c in loaded.coordinates]
    back_to = {n: repr(float(x)) for n, x in zip(names, forth.q[-1], strict=True)}
    back_to |= {f"{n}'": repr(float(-x)) for n, x in zip(names, forth.v[-1], strict=True)}
    back = run(lagcli.load_text(shipped(name), set_initial=back_to), t_end=0.5)
    np.testing.assert_allclose(back.q[::-1], forth.q, rtol=0, atol=SAME)
    size = np.abs(forth.multipliers).max()
    np.testing.assert_allclose(back.multipliers[::-1], forth.multipliers, atol=10 * SAME * size)


# constraints written in other ways

ROD = (
    "coordinates: [x, y]",
    "T: (x'^2 + y'^2)/2",
    "V: 9.81*y",
    "initial: {x: 0.8, y: -0.6, x': {guess: 0.3}, y': 0.5}",
)


@pytest.mark.parametrize("factor", ["1000", "-0.001", "(2 + cos(x))"])
def test_scaling_a_constraint_divides_its_multiplier(factor: str) -> None:
    plain = run(model(*ROD, "constraints: {rod: x^2 + y^2 = 1}"))
    scaled = run(model(*ROD, f"constraints: {{rod: {factor}*(x^2 + y^2 - 1) = 0}}"))
    np.testing.assert_allclose(scaled.q, plain.q, rtol=0, atol=SAME)
    np.testing.assert_allclose(scaled.constraint_force, plain.constraint_force, atol=100 * SAME)
    number = 2 + np.cos(plain.q[:, :1]) if "cos" in factor else float(factor)
    np.testing.assert_allclose(
        scaled.multipliers * number, plain.multipliers, rtol=0, atol=100 * SAME
    )


def test_a_duplicated_constraint_changes_nothing_but_how_lambda_is_shared() -> None:
    plain = run(model(*ROD, "constraints: {rod: x^2 + y^2 = 1}"))
    both = run(model(*ROD, "constraints: {rod: x^2 + y^2 = 1, twin: 2*x^2 = 2 - 2*y^2}"))
    np.testing.assert_allclose(both.q, plain.q, rtol=0, atol=SAME)
    np.testing.assert_allclose(both.constraint_force, plain.constraint_force, atol=100 * SAME)
    # least norm: λ of rows b and 2 b stand as 1 to 2
    np.testing.assert_allclose(both.multipliers[:, 1], 2 * both.multipliers[:, 0], rtol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_a_duplicated_constraint_on_mechanisms(name: str) -> None:
    text = shipped(name)
    first = re.search(r"\nconstraints:\n  (\w+): (.+)\n", text)
    assert first
    twice = text.replace(first[0], first[0] + f"  twin: {first[2]}\n")
    plain, both = (run(t, t_end=0.2, samples=5) for t in (text, twice))
    np.testing.assert_allclose(both.q, plain.q, rtol=0, atol=SAME)
    size = np.abs(plain.constraint_force).max()
    np.testing.assert_allclose(
        both.constraint_force, plain.constraint_force, rtol=0, atol=1e-6 * size
    )


# energy

SLIDING = ("coordinates: [x, y]", "T: (x'^2 + y'^2)/2")


def test_balance_with_a_constraint_that_depends_on_time() -> None:
    trajectory = run(
        model(
            *SLIDING,
            "V: 9.81*y",
            "constraints: {rod: (x - sin(3*t)/5)^2 + y^2 = 1}",
            "initial: {x: {guess: 0.8}, y: -0.6, x': {guess: 0}, y': 0.1}",
        )
    )
    assert np.ptp(trajectory.power_constraint) > 0.1
    assert_balanced(trajectory, np.ptp(trajectory.energy_total))


def test_balance_with_time_in_the_potential_and_in_the_kinetic_energy() -> None:
    trajectory = run(
        model(
            "coordinates: [x, y]",
            "T: (1 + t^2)*(x'^2 + y'^2)/2",
            "V: 9.81*y + 3*x*cos(4*t)",
            "constraints: {rod: x^2 + y^2 = 1}",
            "initial: {x: 0.8, y: -0.6, x': {guess: 0}, y': 0.1}",
        )
    )
    assert np.ptp(trajectory.power_time) > 0.1
    assert_balanced(trajectory, np.ptp(trajectory.energy_total))


def test_balance_with_dissipation() -> None:
    trajectory = run(
        model(
            *SLIDING,
            "V: 9.81*y",
            "D: 0.7/2*(x'^2 + y'^2)",
            "constraints: {rod: x^2 + y^2 = 1}",
            "initial: {x: 0.8, y: -0.6, x': {guess: 0}, y': 0.5}",
        )
    )
    # the power of D is −2 D
    speed2 = (trajectory.v**2).sum(axis=1)
    np.testing.assert_allclose(trajectory.power_applied, -0.7 * speed2, rtol=1e-12)
    assert_balanced(trajectory, np.ptp(trajectory.energy_total))


def test_magnetic_force_does_no_work() -> None:
    trajectory = run(
        model(
            *SLIDING,
            "V: 9.81*y - 5/2*(x*y' - y*x')",
            "initial: {x: 0.8, y: -0.6, x': 1, y': 0.5}",
        )
    )
    energy = (trajectory.v**2).sum(axis=1) / 2 + 9.81 * trajectory.q[:, 1]
    np.testing.assert_allclose(trajectory.energy_total, energy, rtol=1e-12)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    # m a = q v × B − m g: a' = 5 (y', −x') − (0, g)
    expected = 5 * np.column_stack([trajectory.v[:, 1], -trajectory.v[:, 0]])
    np.testing.assert_allclose(trajectory.a, expected - [0, 9.81], atol=1e-11)


def test_kinetic_energy_with_terms_linear_in_the_velocities() -> None:
    # a particle in coordinates of a frame that turns at the rate w: T2 + T1 + T0
    w = 1.3
    turning = run(
        model(
            "coordinates: [x, y]",
            f"T: ((x' - {w}*y)^2 + (y' + {w}*x)^2)/2",
            "initial: {x: 0.8, y: -0.6, x': 1, y': 0.5}",
        )
    )
    x, y = turning.q.T
    c, s = np.cos(w * turning.time), np.sin(w * turning.time)
    # in the frame at rest it moves straight on
    start, speed = np.array([0.8, -0.6]), np.array([1 + w * 0.6, 0.5 + w * 0.8])
    rest = np.column_stack([c * x - s * y, s * x + c * y])
    np.testing.assert_allclose(rest, start + np.outer(turning.time, speed), rtol=0, atol=SAME)
    # Jacobi's integral T2 − T0 is conserved, not T
    jacobi = (turning.v**2).sum(axis=1) / 2 - w**2 * (turning.q**2).sum(axis=1) / 2
    np.testing.assert_allclose(turning.energy_total, jacobi, atol=1e-12)
    np.testing.assert_allclose(jacobi, jacobi[0], atol=SAME)


# the same model in other words


def test_lagrangian_in_place_of_t_and_v() -> None:
    rod = "constraints: {rod: x^2 + y^2 = 1}"
    start = ROD[-1]
    apart = run(model(*ROD, rod))
    whole = run(model(ROD[0], "L: (x'^2 + y'^2)/2 - 9.81*y", rod, start))
    np.testing.assert_allclose(whole.q, apart.q, rtol=0, atol=SAME)
    np.testing.assert_allclose(whole.multipliers, apart.multipliers, rtol=0, atol=100 * SAME)
    for key in ("energy_kinetic", "energy_potential", "energy_total"):
        np.testing.assert_allclose(getattr(whole, key), getattr(apart, key), atol=100 * SAME)


def test_force_along_a_definition_is_the_force_on_its_coordinates() -> None:
    common = (
        "coordinates: [phi]",
        "definitions: {x: 2*cos(phi), y: 2*sin(phi)}",
        "T: (x'^2 + y'^2)/2",
        "initial: {phi: 0.4, phi': 1}",
    )
    defined = run(model(*common, "Q: {x: -3*x' + t, y: 2}"))
    by_hand = run(model(*common, "Q: {phi: (-3*x' + t)*(-2*sin(phi)) + 2*2*cos(phi)}"))
    np.testing.assert_allclose(defined.q, by_hand.q, rtol=0, atol=SAME)
    np.testing.assert_allclose(defined.power_applied, by_hand.power_applied, atol=100 * SAME)
    assert_balanced(defined, np.ptp(defined.energy_total))


def test_holonomic_constraint_in_its_two_forms() -> None:
    held = run(model(*ROD, "constraints: {rod: x^2 + y^2 = 1}"))
    rolled = run(model(*ROD, "constraints: {rod: 2*x*x' + 2*y*y' = 0}"))
    np.testing.assert_allclose(rolled.q, held.q, rtol=0, atol=SAME)
    np.testing.assert_allclose(rolled.multipliers, held.multipliers, rtol=0, atol=100 * SAME)


def test_holonomic_and_nonholonomic_constraints_together() -> None:
    # a blade on an inclined plane in space; the plane is one constraint, the blade another
    trajectory = run(
        model(
            "coordinates: [x, y, z, phi]",
            "T: (x'^2 + y'^2 + z'^2)/2 + phi'^2/2",
            "V: 9.81*z",
            "constraints: {plane: z = -x/2, blade: x'*sin(phi) = y'*cos(phi)}",
            "initial: {x: 0, y: 0, z: {guess: 0}, phi: 0.3, x': {guess: 1}, y': {guess: 0},"
            " z': {guess: 0}, phi': 2}",
        )
    )
    x, y, z, phi = trajectory.q.T
    u, v, w, _ = trajectory.v.T
    np.testing.assert_allclose(z, -x / 2, rtol=0, atol=1e-14)
    np.testing.assert_allclose(u * np.sin(phi), v * np.cos(phi), rtol=0, atol=1e-14)
    # neither does work, and nothing turns the blade
    energy = (u**2 + v**2 + w**2) / 2 + 9.81 * z
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=SAME)
    np.testing.assert_allclose(phi, 0.3 + 2 * trajectory.time, rtol=0, atol=SAME)
    np.testing.assert_allclose(trajectory.power_constraint, 0, atol=1e-12)
    assert np.ptp(y) > 0.01
