"""Mechanisms in space that failed once: against closed forms and other coordinates."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk
from singular_motions import stated_time

import lagcli
from lagcli.arrays import Array
from lagcli.trajectory.trajectory import Trajectory

FOUND = Path(__file__).parents[1] / "found"

#: The Bricard mechanism of `bricard_a04` in its joint angles: by its threefold symmetry every other
#: joint turns alike, and the loop closes where sin a + sin b + sin a sin b = 0.
BRICARD = """
coordinates: [a, b]
parameters: {m: 1 kg, L: 1 m, w: 0.1 m, g: 9.81 m/s^2}
definitions:
  G[1]: rot_y(a)
  G[2]: G[1]*rot_z(b)
  G[3]: G[2]*rot_x(a)
  G[4]: G[3]*rot_y(b)
  G[5]: G[4]*rot_z(a)
  d[1]: [L, 0, 0]
  d[2]: [0, -L, 0]
  d[3]: [0, 0, L]
  d[4]: [-L, 0, 0]
  d[5]: [0, L, 0]
  P[0]: [0, 0, 0]
  P[i = 1..5]: P[i-1] + G[i]*d[i]
  C[i = 1..5]: P[i-1] + G[i]*d[i]/2
  k: m*w^2/6
  n: m*(L^2 + w^2)/12
  J[1]: "[[k, 0, 0], [0, n, 0], [0, 0, n]]"
  J[2]: "[[n, 0, 0], [0, k, 0], [0, 0, n]]"
  J[3]: "[[n, 0, 0], [0, n, 0], [0, 0, k]]"
  J[4]: "[[k, 0, 0], [0, n, 0], [0, 0, n]]"
  J[5]: "[[n, 0, 0], [0, k, 0], [0, 0, n]]"
  o[i = 1..5]: omega(G[i])
T: sum(m/2*dot(C[i]', C[i]') + 1/2*dot(o[i], J[i]*o[i]), i = 1..5)
V: sum(m*g*dot([0, 1, 0], C[i]), i = 1..5)
constraints:
  closed: sin(a) + sin(b) + sin(a)*sin(b) = 0
initial: {a: 0, b: 0, a': 0, b': 0}
outputs:
  P3x: dot([1, 0, 0], P[3])
  P3y: dot([0, 1, 0], P[3])
  P3z: dot([0, 0, 1], P[3])
simulation: {t_end: 10, samples: 1001}
"""

#: The Bennett linkage of `bennett` in one angle: tan(q/2) tan(p/2) = sin((β+α)/2)/sin((β−α)/2)
#: (Bennett, A new mechanism, Engineering 76, 1903), the other two angles are −q and −p.
BENNETT = """
coordinates: [q]
parameters: {a: 1 m, b: 1.5 m, alpha: 30 deg, beta: asin(1.5*sin(pi/6)), m: 1 kg, g: 9.81 m/s^2}
definitions:
  k: sin((beta + alpha)/2)/sin((beta - alpha)/2)
  p: 2*atan2(k*cos(q/2), sin(q/2))
  R[1]: rot_z(q)*rot_x(alpha)
  R[2]: R[1]*rot_z(p)*rot_x(beta)
  P[1]: rot_z(q)*[a, 0, 0]
  P[2]: P[1] + R[1]*rot_z(p)*[b, 0, 0]
  P[3]: P[2] + R[2]*rot_z(0 - q)*[a, 0, 0]
T: sum(m/2*dot(P[i]', P[i]'), i = 1..3)
V: sum(m*g*dot([0, 1, 0], P[i]), i = 1..3)
initial: {q: 1.2, q': 0}
simulation: {t_end: 5}
"""


@cache
def run(name: str, **options: Any) -> Trajectory:
    trajectory = lagcli.simulate(lagcli.load(FOUND / f"{name}.yaml"), **options)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def worst_residual(t: Trajectory) -> float:
    position = np.nanmax(np.abs(t.residual_position / t.scale_position), initial=0.0)
    velocity = np.abs(t.residual_velocity / t.scale_velocity).max(initial=0.0)
    return float(max(position, velocity))


@pytest.mark.parametrize("name", ["door_one_hinge", "door_two_hinges", "door_off"])
def test_door_is_a_pendulum(name: str) -> None:
    """About the vertical axis: (m w²/3) θ'' = −m g_x (w/2) sin θ, from rest at θ = π/2."""
    t = run(name, t_end=10.0, samples=41)
    assert worst_residual(t) <= 1e-12
    w, gx, mass = 0.8, 1.7, 20.0
    rate, k = np.sqrt(1.5 * gx / w), np.sin(np.pi / 4)
    sn, cn, _, _ = ellipj(rate * t.time + ellipk(k**2), k**2)
    angle, spin = 2 * np.arcsin(k * sn), 2 * k * rate * cn
    # default tolerances (rtol = 1e-9) over three swings
    np.testing.assert_allclose(t.outputs["angle"], angle, atol=1e-7)
    # what the hinges bear is that of the centre's acceleration less gravity
    turning = -(rate**2) * np.sin(angle)
    ax = w / 2 * (-np.sin(angle) * turning - np.cos(angle) * spin**2)
    ay = w / 2 * (np.cos(angle) * turning - np.sin(angle) * spin**2)
    np.testing.assert_allclose(t.outputs["Fx"], mass * (ax - gx), atol=1e-5)
    np.testing.assert_allclose(t.outputs["Fy"], mass * ay, atol=1e-5)
    np.testing.assert_allclose(t.outputs["Fz"], mass * 9.66, atol=1e-7)


def points(t: Trajectory) -> np.ndarray:
    return np.array([t.outputs[f"P3{c}"] for c in "xyz"])


@pytest.mark.parametrize("end", [2.0, pytest.param(10.0, marks=pytest.mark.slow)])
def test_bricard(end: float) -> None:
    options: dict[str, Any] = {"t_end": end, "samples": 101}
    straight, tilted = (run(name, **options) for name in ("bricard_a04", "bricard_tilted"))
    angles = lagcli.simulate(lagcli.load_text(BRICARD), rtol=1e-12, atol=1e-13, **options)
    assert angles.status == "completed", angles.message
    for t in (straight, tilted):
        assert worst_residual(t) <= 1e-12
        np.testing.assert_allclose(points(t), points(angles), atol=1e-7)
        np.testing.assert_allclose(t.energy_kinetic, angles.energy_kinetic, atol=1e-6)
    np.testing.assert_allclose(points(straight), points(tilted), atol=1e-7)


def test_bennett() -> None:
    # the linkage lies flat at 1.01 s
    options: dict[str, Any] = {"t_end": 5.0, "samples": 101}
    t = run("bennett", **options)
    assert worst_residual(t) <= 1e-12
    angle = lagcli.simulate(lagcli.load_text(BENNETT), rtol=1e-12, atol=1e-13, **options)
    np.testing.assert_allclose(t.q[:, 0], angle.q[:, 0], atol=1e-7)
    np.testing.assert_allclose(t.q[:, 2:], -t.q[:, :2], atol=1e-9)
    k = np.sin(np.arcsin(0.75) / 2 + np.pi / 12) / np.sin(np.arcsin(0.75) / 2 - np.pi / 12)
    half = t.q[:, :2] / 2
    np.testing.assert_allclose(np.sin(half).prod(axis=1), k * np.cos(half).prod(axis=1), atol=1e-9)
    np.testing.assert_allclose(t.energy_total, t.energy_total[0], atol=1e-7)


def test_terms_that_vanish_up_to_a_singular_configuration() -> None:
    """x y = 0 with y = 0: x falls to zero in 1 s, where the constraint has no gradient."""
    model = lagcli.load(FOUND / "hostile" / "vanishing-terms.yaml")
    t = lagcli.simulate(model, t_end=2)
    assert t.status == "failed"
    assert "singular configuration at t = " in t.message
    assert worst_residual(t) <= 1e-12
    np.testing.assert_allclose(t.q[:, 0], 1 - t.time, atol=1e-9)
    np.testing.assert_allclose(t.multipliers[:, 0], 9.81 / t.q[:, 0], rtol=1e-9)
    # although the force is infinite there, the motion goes on
    assert t.message.endswith("--through-singular continues through it")
    passed = lagcli.simulate(model, t_end=2, through_singular=True)
    np.testing.assert_allclose(passed.q[:, 0], 1 - passed.time, atol=1e-9)


def test_a_platform_on_many_cranks_is_a_pendulum() -> None:
    """Eleven pairs of constraints are redundant, and all lose rank where the cranks lie flat; the
    motion goes on there. Beside SciPy on the equation of one angle."""
    t = lagcli.simulate(lagcli.load(FOUND / "cranks.yaml"), t_end=3, samples=61)
    through = lagcli.simulate(
        lagcli.load(FOUND / "cranks.yaml"), t_end=3, samples=61, through_singular=True
    )
    count, length, mass, crank, g = 12, 0.3, 4.0, 0.2, 9.81
    rate = (mass + count * crank / 2) * g / ((mass + count * crank / 3) * length)

    def flat(_: float, y: Array) -> float:
        return float(y[0])

    exact = solve_ivp(
        lambda _, y: [y[1], -rate * np.cos(y[0])], (0, 3), [t.q[0, 3], 0],
        rtol=1e-11, atol=1e-11, events=flat, dense_output=True,
    )  # fmt: skip
    assert stated_time(t.message) == pytest.approx(exact.t_events[0][0], abs=1e-7)
    assert through.status == "completed"
    for found in (t, through):
        a, rates = exact.sol(found.time)
        np.testing.assert_allclose(found.q[:, 3:] - a[:, None], 0, atol=1e-7)
        x, y = length * np.cos(a), length * np.sin(a)
        np.testing.assert_allclose(found.q[:, :3], np.stack([x, y, 0 * a], axis=1), atol=1e-7)
        # the cranks carry the platform together
        turn = -rate * np.cos(a)
        forces = mass * np.stack([-x * rates**2 - y * turn, g - y * rates**2 + x * turn])
        multipliers = found.multipliers.reshape(len(a), 2, count).sum(axis=2).T
        np.testing.assert_allclose(multipliers, forces, atol=1e-5)


#: Those of the others that have constraints; the rest of them has none, or is of the reader alone.
OTHERS = ("stewart", "whipple_bicycle")
LONG = ("net_rods", "ring100")


@pytest.mark.parametrize(
    "name", [*OTHERS, *(pytest.param(name, marks=pytest.mark.slow) for name in LONG)]
)
def test_residuals_of_the_other_models(name: str) -> None:
    assert worst_residual(run(name)) <= 1e-12
