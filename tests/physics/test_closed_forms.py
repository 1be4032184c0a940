"""The shipped models against closed forms that are written here from scratch.

Runs are made at RTOL; their global error over a few seconds stays within a hundred or so of it,
so that closed forms are compared to 1e-8, or to CLOSE where the motion is not periodic in time.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import lagcli
from lagcli.trajectory.trajectory import Trajectory

MODELS = Path(__file__).parents[2] / "models"
RTOL = 1e-12
CLOSE = 1e-9


def run(
    name: str,
    t_end: float,
    set: dict[str, float] | None = None,
    set_initial: dict[str, float] | None = None,
) -> Trajectory:
    """Simulate a shipped model to 101 samples."""
    model = lagcli.load(MODELS / f"{name}.yaml", set=set, set_initial=set_initial)
    times = np.linspace(0, t_end, 101)
    trajectory = lagcli.simulate(model, times=times, rtol=RTOL, atol=RTOL)
    assert trajectory.status == "completed", trajectory.message
    return trajectory


def columns(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Return coordinates, velocities (x'), accelerations (x'') and multipliers by name."""
    found = {}
    for prime, values in (("", trajectory.q), ("'", trajectory.v), ("''", trajectory.a)):
        found |= {n + prime: values[:, i] for i, n in enumerate(trajectory.coordinates)}
    found |= {
        f"lambda.{n}": trajectory.multipliers[:, i] for i, n in enumerate(trajectory.constraints)
    }
    return found


def assert_close(found: np.ndarray, expected: np.ndarray | float, tolerance: float) -> None:
    """Compare to a tolerance relative to the largest expected value."""
    size = np.abs(expected).max() or 1.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * size)


def test_hanging_pendulum_pins_the_sign_of_lambda() -> None:
    trajectory = run("pendulum_cartesian", 1, set={"theta_0": 0})
    p = trajectory.parameters
    # Σ λ b = 2 λ (x, y) is the rod's force: it points up with m g at y = -l
    assert_close(columns(trajectory)["lambda.rod"], -p["m"] * p["g"] / (2 * p["l"]), 1e-12)
    np.testing.assert_allclose(trajectory.constraint_force[:, 1], p["m"] * p["g"], rtol=1e-12)
    np.testing.assert_allclose(trajectory.outputs["tension"], p["m"] * p["g"], rtol=1e-12)


def test_hanging_double_pendulum_carries_the_weights() -> None:
    trajectory = run("double_pendulum_cartesian", 1, set={"theta_1": "0 deg", "theta_2": "0 deg"})
    p = trajectory.parameters
    assert_close(trajectory.outputs["tension_1"], (p["m_1"] + p["m_2"]) * p["g"], 1e-12)
    assert_close(trajectory.outputs["tension_2"], p["m_2"] * p["g"], 1e-12)


@pytest.mark.parametrize("theta_0", [0.3, 2.0, 3.0])
def test_pendulum_by_jacobi_elliptic_functions(theta_0: float) -> None:
    trajectory = run("pendulum_cartesian", 5, set={"theta_0": theta_0})
    p, c, t = trajectory.parameters, columns(trajectory), trajectory.time
    # released at rest: sin(theta/2) = k sn(K - w t), k = sin(theta_0/2)
    k2 = math.sin(theta_0 / 2) ** 2
    sn, _, _, _ = ellipj(ellipk(k2) - math.sqrt(p["g"] / p["l"]) * t, k2)
    theta = 2 * np.arcsin(math.sqrt(k2) * sn)
    assert_close(c["x"], p["l"] * np.sin(theta), CLOSE)
    assert_close(c["y"], -p["l"] * np.cos(theta), CLOSE)
    tension = p["m"] * p["g"] * (3 * np.cos(theta) - 2 * math.cos(theta_0))
    assert_close(c["lambda.rod"], -tension / (2 * p["l"]), CLOSE)


@pytest.mark.parametrize("rate", [0.5, 2.0, 3.5])
def test_spherical_pendulum_by_jacobi_elliptic_functions(rate: float) -> None:
    trajectory = run("charged_pendulum", 5, set={"B": 0}, set_initial={"y'": rate})
    p, c = trajectory.parameters, columns(trajectory)
    m, g, l = p["m"], p["g"], p["l"]
    z_0, x_0 = c["z"][0], c["x"][0]
    energy = m * rate**2 / 2 + m * g * z_0
    # l² z'² = 2 g (z - z_1)(z_2 - z)(z_3 - z), the cubic of energy and angular momentum
    cubic = [2 * g, -2 * energy / m, -2 * g * l**2, 2 * energy * l**2 / m - (x_0 * rate) ** 2]
    z_1, z_2, z_3 = np.sort(np.roots(cubic).real)
    k2, w = (z_2 - z_1) / (z_3 - z_1), math.sqrt(g * (z_3 - z_1) / 2) / l
    at_top = abs(z_0 - z_2) < abs(z_0 - z_1)  # it starts at a turning point
    sn, _, _, _ = ellipj(w * trajectory.time + (ellipk(k2) if at_top else 0), k2)
    z = z_1 + (z_2 - z_1) * sn**2
    assert_close(c["z"], z, CLOSE)
    assert_close(c["lambda.rod"], (3 * m * g * z - 2 * energy) / (2 * l**2), CLOSE)


def test_charged_pendulum_multiplier_and_integrals() -> None:
    trajectory = run("charged_pendulum", 5)
    p, c = trajectory.parameters, columns(trajectory)
    swept = c["x"] * c["y'"] - c["y"] * c["x'"]
    speed2 = c["x'"] ** 2 + c["y'"] ** 2 + c["z'"] ** 2
    # r · (m a = q v × B - m g e_z + 2 λ r), with r · a = -v²
    twice = p["m"] * p["g"] * c["z"] - p["q"] * p["B"] * swept - p["m"] * speed2
    assert_close(c["lambda.rod"], twice / (2 * p["l"] ** 2), 1e-11)
    momentum = p["m"] * swept + p["q"] * p["B"] / 2 * (c["x"] ** 2 + c["y"] ** 2)
    assert_close(momentum, momentum[0], CLOSE)
    # the magnetic force does no work
    energy = p["m"] * speed2 / 2 + p["m"] * p["g"] * c["z"]
    assert_close(energy, energy[0], CLOSE)
    assert_close(trajectory.energy_total, energy, 1e-11)


def test_atwood() -> None:
    trajectory = run("atwood", 1)
    p, c, t = trajectory.parameters, columns(trajectory), trajectory.time
    a = (p["m_1"] - p["m_2"]) * p["g"] / (p["m_1"] + p["m_2"] + p["J"] / p["R"] ** 2)
    assert_close(c["y_1"], a * t**2 / 2, 1e-12)
    assert_close(c["y_2"], p["h"] - a * t**2 / 2, 1e-12)
    assert_close(c["lambda.rope_1"], p["m_1"] * (p["g"] - a), 1e-12)
    assert_close(c["lambda.rope_2"], p["m_2"] * (p["g"] + a), 1e-12)


@pytest.mark.parametrize("rate", [2.0, 4.0])
def test_bead_on_rotating_hoop(rate: float) -> None:
    trajectory = run("bead_on_rotating_hoop", 5, set={"Omega": rate})
    p, c = trajectory.parameters, columns(trajectory)
    m, g, R = p["m"], p["g"], p["R"]
    theta, speed = c["theta"], c["theta'"]
    # the first integral of the motion in the rotating frame ...
    first = speed**2 - rate**2 * np.sin(theta) ** 2 - 2 * g / R * np.cos(theta)
    assert_close(first, first[0], CLOSE)
    # ... and the forces as functions of the state
    centripetal = R * (speed**2 + rate**2 * np.sin(theta) ** 2)
    assert_close(c["lambda.hoop"], -m * (centripetal + g * np.cos(theta)), 1e-11)
    torque = 2 * m * R**2 * rate * speed * np.sin(theta) * np.cos(theta)
    assert_close(c["lambda.drive"], torque, 1e-11)
    assert_close(trajectory.power_constraint, torque * rate, 1e-11)


def test_knife_edge() -> None:
    trajectory = run("knife_edge_incline", 5)
    p, c = trajectory.parameters, columns(trajectory)
    slope, w = p["g"] * math.sin(p["alpha"]), p["Omega"]
    phi = w * trajectory.time
    assert_close(c["phi"], phi, CLOSE)
    assert_close(c["x"], slope / (2 * w**2) * np.sin(phi) ** 2, CLOSE)
    assert_close(c["y"], slope / (2 * w**2) * (phi - np.sin(2 * phi) / 2), CLOSE)
    assert_close(c["lambda.skate"], -2 * p["m"] * slope * np.sin(phi), CLOSE)


@pytest.mark.parametrize("v_0", [1.0, -1.0])
def test_chaplygin_sleigh(v_0: float) -> None:
    trajectory = run("chaplygin_sleigh", 5, set={"v_0": v_0})
    p, c = trajectory.parameters, columns(trajectory)
    m, J, a = p["m"], p["J"], p["a"]
    # v = V tanh s, omega = V/b sech s, s = s_0 + a V t/b², b² = J/m + a²
    b = math.sqrt(J / m + a**2)
    V = math.hypot(v_0, b * p["omega_0"])
    s_0 = math.atanh(v_0 / V)
    s = s_0 + a * V / b**2 * trajectory.time
    v, omega = V * np.tanh(s), V / b / np.cosh(s)
    theta = 2 * b / a * (np.arctan(np.tanh(s / 2)) - math.atan(math.tanh(s_0 / 2)))
    assert_close(trajectory.outputs["speed"], v, CLOSE)
    assert_close(c["theta'"], omega, CLOSE)
    assert_close(c["theta"], theta, CLOSE)
    assert_close(c["lambda.knife"], m * v * omega * (1 - a**2 / b**2), CLOSE)


def test_driven_slider_crank() -> None:
    trajectory = run("driven_slider_crank", 0.5)
    p, found = trajectory.parameters, columns(trajectory)
    r, l, w, m_2, m_3, g = (p[n] for n in ("r", "l", "Omega", "m_2", "m_3", "g"))
    phi = w * trajectory.time
    s, c = np.sin(phi), np.cos(phi)
    psi = np.arcsin(r / l * s)
    S, C = np.sin(psi), np.cos(psi)
    psi_1 = r * w * c / (l * C)
    psi_2 = (l * S * psi_1**2 - r * w**2 * s) / (l * C)
    x_2 = -r * w**2 * c - l * (S * psi_2 + C * psi_1**2)
    x_1 = -r * w * s - l * S * psi_1
    # acceleration of the middle of the rod
    a_x = -r * w**2 * c - l / 2 * (S * psi_2 + C * psi_1**2)
    a_y = -r * w**2 * s - l / 2 * (C * psi_2 - S * psi_1**2)
    # Newton for the piston, moments of the rod about its crank pin, virtual work of the crank
    piston = m_3 * x_2 + p["c"] * x_1
    inertia = p["J_2"] * psi_2 - m_2 * l / 2 * (S * a_x + C * (a_y + g))
    guide = (piston * l * S - inertia) / (l * C)
    drive = m_2 * r * (-s * a_x + c * (a_y + g)) - r * (piston * s + guide * c)
    for name, expected in (
        ("phi", phi),
        ("psi", psi),
        ("x", r * c + l * C),
        ("psi'", psi_1),
        ("x'", x_1),
        ("x''", x_2),
        ("lambda.piston", piston),
        ("lambda.guide", guide),
        ("lambda.drive", drive),
    ):
        # no degree of freedom: nothing is integrated that the projection does not put right
        assert_close(found[name], expected, 1e-11)


@pytest.mark.parametrize(("tilt", "rate"), [(0.4, 1.5), (0.2, 3.0)])
def test_rolling_disk_in_steady_motion(tilt: float, rate: float) -> None:
    trajectory = run("rolling_disk", 4, set={"kick": 0, "theta_0": tilt, "Omega": rate})
    p, c = trajectory.parameters, columns(trajectory)
    m, g, r = p["m"], p["g"], p["r"]
    A, C = m * r**2 / 4, m * r**2 / 2
    # balance of moments in steady circling at constant tilt
    S = (m * g * r * math.sin(tilt) - A * rate**2 * math.sin(tilt) * math.cos(tilt)) / (
        (C + m * r**2) * rate * math.cos(tilt)
    )
    heading = rate * trajectory.time
    friction = m * r * S * rate
    assert_close(c["theta"], tilt, 1e-8)
    assert_close(c["psi"], heading, 1e-8)
    assert_close(c["x"], -r * S / rate * np.sin(heading), 1e-8)
    assert_close(c["lambda.contact"], m * g, 1e-8)
    assert_close(c["lambda.roll_x"], friction * np.sin(heading), 1e-8)
    assert_close(c["lambda.roll_y"], -friction * np.cos(heading), 1e-8)


def test_heavy_top_in_steady_precession() -> None:
    base = lagcli.load(MODELS / "heavy_top.yaml").parameter_values
    m, g, a, spin = (base[n] for n in ("m", "g", "a", "spin"))
    rate = m * g * a / (base["J_s"] * spin)  # axis horizontal: J_s spin rate = m g a, exactly
    trajectory = run("heavy_top", 0.5, set={"precession": rate})
    c, turn = columns(trajectory), rate * trajectory.time
    # twelve turns of the spin: 1e-8 instead of CLOSE
    assert_close(c["X"], -a * np.sin(turn), 1e-8)
    assert_close(c["Y"], a * np.cos(turn), 1e-8)
    np.testing.assert_allclose(c["Z"], 0, atol=1e-8 * a)
    assert_close(c["lambda.pin_x"], m * a * rate**2 * np.sin(turn), 1e-7)
    assert_close(c["lambda.pin_y"], -m * a * rate**2 * np.cos(turn), 1e-7)
    assert_close(c["lambda.pin_z"], m * g, 1e-7)


def test_parallelogram_swings_like_one_pendulum() -> None:
    trajectory = run("parallelogram", 5)
    p, c, t = trajectory.parameters, columns(trajectory), trajectory.time
    m, M, l, d, g = (p[n] for n in ("m", "M", "l", "d", "g"))
    w = math.sqrt((3 * m / 2 + M) * g / ((m + M) * l))
    swing_0 = c["alpha_1"][0] + math.pi / 2
    k2 = math.sin(swing_0 / 2) ** 2
    sn, _, _, _ = ellipj(ellipk(k2) - w * t, k2)
    alpha = 2 * np.arcsin(math.sqrt(k2) * sn) - math.pi / 2
    for crank in ("alpha_1", "alpha_2", "alpha_3"):
        assert_close(c[crank], alpha, CLOSE)
    np.testing.assert_allclose(c["beta"], 0, atol=1e-12)
    # the multipliers are not unique; the moment of all joints on the platform about its left end is
    speed2 = 2 * w**2 * (-np.sin(alpha) - math.cos(swing_0))
    lift = l * (-(w**2) * np.cos(alpha) * np.cos(alpha) - np.sin(alpha) * speed2)
    assert_close(trajectory.outputs["force_platform"], M * d / 2 * (lift + g), CLOSE)


# Models without a closed form: Newton's law of one body, with the multipliers as the forces that
# the comment of the file says they are.


def moment(x: np.ndarray, y: np.ndarray, force_x: np.ndarray, force_y: np.ndarray) -> np.ndarray:
    return x * force_y - y * force_x


def test_four_bar_joint_force_turns_the_rocker() -> None:
    trajectory = run("four_bar", 0.4)
    p, f = trajectory.parameters, columns(trajectory)
    mass, c, g = p["m_3"], p["c"], p["g"]
    x, y = c * np.cos(f["theta_3"]), c * np.sin(f["theta_3"])
    # lambda acts on the coupler, its opposite on the rocker
    joint = moment(x, y, -f["lambda.joint_x"], -f["lambda.joint_y"])
    weight = -mass * g * x / 2
    assert_close(mass * c**2 / 3 * f["theta_3''"], joint + weight, 1e-10)


def test_andrews_pin_force_turns_body_3() -> None:
    trajectory = run("andrews_squeezer", 0.015)
    p, f = trajectory.parameters, columns(trajectory)
    sin, cos = np.sin(f["gamma"]), np.cos(f["gamma"])
    # spring's end and pin, seen from B
    x_d, y_d = p["s_c"] * sin + p["s_d"] * cos, p["s_d"] * sin - p["s_c"] * cos
    x_p, y_p = p["ss"] * sin, -p["ss"] * cos
    to_c = np.array([p["x_c"] - p["x_b"] - x_d, p["y_c"] - p["y_b"] - y_d])
    length = np.hypot(*to_c)
    pull = p["k"] * (length - p["l_0"]) * to_c / length
    pin = moment(x_p, y_p, -f["lambda.p3_x"], -f["lambda.p3_y"])
    inertia = p["J_3"] + p["m_3"] * (p["s_a"] ** 2 + p["s_b"] ** 2)
    assert_close(inertia * f["gamma''"], moment(x_d, y_d, *pull) + pin, 1e-10)


def test_car_axis_forces_move_its_right_end() -> None:
    trajectory = run("car_axis", 1)
    p, f, out = trajectory.parameters, columns(trajectory), trajectory.outputs
    y_b = p["r"] * np.sin(p["w"] * trajectory.time)
    x_b = np.sqrt(p["L"] ** 2 - y_b**2)
    spring = np.array([x_b - f["x_r"], y_b - f["y_r"]])
    spring *= out["right_spring_force"] / np.hypot(*spring)
    axis = out["axis_tension"] / p["L"] * np.array([f["x_l"] - f["x_r"], f["y_l"] - f["y_r"]])
    weight = np.array([[0], [-p["m"] * p["g"]]])
    assert_close(p["m"] * np.array([f["x_r''"], f["y_r''"]]), spring + axis + weight, 1e-10)


def test_heavy_top_support_moves_the_centre_of_mass() -> None:
    trajectory = run("heavy_top", 0.1)
    p, f = trajectory.parameters, columns(trajectory)
    for axis, weight in (("x", 0), ("y", 0), ("z", p["m"] * p["g"])):
        force = f[f"lambda.pin_{axis}"] - weight
        assert_close(p["m"] * f[f"{axis.upper()}''"], force, 1e-10)
    assert_close(trajectory.outputs["spin_rate"], p["spin"], CLOSE)


def test_double_pendulum_tensions_move_the_masses() -> None:
    trajectory = run("double_pendulum_cartesian", 1)
    p, f, out = trajectory.parameters, columns(trajectory), trajectory.outputs
    up_1 = np.array([-f["x_1"], -f["y_1"]]) / p["l_1"]
    up_2 = np.array([f["x_1"] - f["x_2"], f["y_1"] - f["y_2"]]) / p["l_2"]
    g = np.array([[0], [-p["g"]]])
    second = out["tension_2"] * up_2
    first = out["tension_1"] * up_1 - second
    assert_close(p["m_1"] * np.array([f["x_1''"], f["y_1''"]]), first + p["m_1"] * g, 1e-10)
    assert_close(p["m_2"] * np.array([f["x_2''"], f["y_2''"]]), second + p["m_2"] * g, 1e-10)


@pytest.mark.parametrize(
    "potential",
    [
        # the angle of a chord: atan2(1 + cos phi, sin phi) = (pi - phi)/2
        "2*k*(atan2(l + l*cos(phi), l*sin(phi)) - pi/2)^2",
        "k/2*(phi/d)^n*d^2",
    ],
)
def test_oscillators_whose_derivatives_do_not_divide_by_zero(potential: str) -> None:
    model = lagcli.load_text(
        "coordinates: [phi]\nparameters: {k: 9, l: 2, d: 3, n: 2}\nT: phi'^2/2\n"
        f"V: {potential}\ninitial: {{phi: 0, phi': 1}}\n"
    )
    run = lagcli.simulate(model, t_end=1.0, samples=11)
    # rtol is 1e-9
    assert run.q[:, 0] == pytest.approx(np.sin(3 * run.time) / 3, abs=1e-8)
