"""Machines of bodies and joints against closed forms, SciPy, and other formulations."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lagcli

FOLDER = Path(__file__).parent / "machines"


def machine(name: str, **options: Any) -> Any:
    """Load a machine of the folder."""
    return lagcli.load(FOLDER / f"{name}.yaml", **options)


def columns(run: Any) -> dict[str, np.ndarray]:
    """Return q, q' and λ by name."""
    found = {c: run.q[:, i] for i, c in enumerate(run.coordinates)}
    found |= {f"{c}'": run.v[:, i] for i, c in enumerate(run.coordinates)}
    return found | {f"lambda.{c}": run.multipliers[:, i] for i, c in enumerate(run.constraints)}


#: State and forces of the press after two turns, from its equations in expanded form, whose forces
#: balance the accelerations of every body.
PRESS = {
    "crank.phi": 12.566370614359172,
    "coupler.x": 0.25636372367552945,
    "coupler.phi": 1.175095565324041,
    "rocker.phi": 2.083928585038475,
    "rod.phi": -0.8471509216810509,
    "ram.y": 0.011725130593198137,
    "lambda.O.x": -48.781517994109464,
    "lambda.O.y": 7.122139810713598,
    "lambda.A.x": -36.14842436071508,
    "lambda.A.y": -32.11786018928641,
    "lambda.B.x": -17.13947803786345,
    "lambda.B.y": -75.06983562602576,
    "lambda.D.x": -182.74669153889002,
    "lambda.D.y": 344.3958586472585,
    "lambda.C.x": -199.8367480161201,
    "lambda.C.y": 233.5327101572833,
    "lambda.E.x": -199.8120372358034,
    "lambda.E.y": 217.04624164315103,
    "lambda.guide.n": -199.8120372358034,
    "lambda.motor": -1.999657630285828,
}


def test_six_bar_press() -> None:
    run = lagcli.simulate(machine("six_bar_press"), rtol=1e-11, samples=5)
    found = columns(run)
    for name, value in PRESS.items():
        assert found[name][-1] == pytest.approx(value, rel=1e-7, abs=1e-7), name
    # the motor's work is the change of the mechanical energy: none in a whole turn, to its end
    stroke = run.outputs["stroke"]
    assert stroke[0] == pytest.approx(stroke[-1], abs=1e-8)


def test_planetary_gear_by_willis_and_newton() -> None:
    model = machine("planetary_gear")
    found = columns(run := lagcli.simulate(model, samples=6))
    r_s, r_p, r_r, a = 0.04, 0.02, 0.08, 0.06
    np.testing.assert_allclose(found["sun.phi'"], 3 * found["carrier.phi'"], rtol=1e-9)
    np.testing.assert_allclose(found["planet_2.phi'"], -3 * found["carrier.phi'"], rtol=1e-9)
    np.testing.assert_allclose(run.outputs["ratio"], 1 + r_r / r_s, rtol=1e-9)
    # with the carrier's speed: torque of the sun and load, inertia of all bodies
    inertia = 9 * 5e-4 + 0.01 + 3 * (0.3 * a**2 + 9 * 8e-5)
    carrier = (3 * 1.0 - 2.0) / inertia
    np.testing.assert_allclose(found["carrier.phi'"], 10 / 3 + carrier * run.time, rtol=1e-8)
    # sun: J α = torque - 3 F r_s; planet: J α = (F_ring - F_sun) r_p, with α = -3 carrier
    sun = (1.0 - 5e-4 * 3 * carrier) / (3 * r_s)
    ring = sun + 8e-5 * (-3 * carrier) / r_p
    for planet in (1, 2, 3):
        np.testing.assert_allclose(np.abs(found[f"lambda.sun_{planet}"]), sun, rtol=1e-8)
        np.testing.assert_allclose(np.abs(found[f"lambda.ring_{planet}"]), ring, rtol=1e-8)
    # the pin carries both tooth forces along the tangent, and the planet's circular motion
    along = sun + ring - 0.3 * a * carrier
    across = 0.3 * a * found["carrier.phi'"] ** 2
    np.testing.assert_allclose(run.outputs["pin_force"], np.hypot(along, across), rtol=1e-8)


def test_engine_by_its_equation_in_one_angle() -> None:
    run = lagcli.simulate(machine("single_cylinder_engine"), t_end=0.5, samples=11, rtol=1e-10)
    r, l, g = 0.04, 0.14, 9.81
    c = 0.3 * l

    def geometry(phi: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the rod's center, its angle and the piston's height; and their rates by phi."""
        # the rod goes from the crank's pin to the axis: r cos(phi) + l cos(psi) = 0
        psi = math.acos(-r * math.cos(phi) / l)
        turned = -r * math.sin(phi) / (l * math.sin(psi))
        at = [
            r * math.cos(phi) + c * math.cos(psi),
            r * math.sin(phi) + c * math.sin(psi),
            psi,
            r * math.sin(phi) + l * math.sin(psi),
        ]
        rate = [
            -r * math.sin(phi) - c * math.sin(psi) * turned,
            r * math.cos(phi) + c * math.cos(psi) * turned,
            turned,
            r * math.cos(phi) + l * math.cos(psi) * turned,
        ]
        return np.array(at), np.array(rate)

    masses = np.array([0.6, 0.6, 1.5e-3, 0.5])

    def inertia(phi: float) -> float:
        return 0.08 + float(masses @ geometry(phi)[1] ** 2)

    def motion(_t: float, y: np.ndarray) -> list[float]:
        phi, v = y
        (_, rate), h = geometry(phi), 1e-5
        slope = (inertia(phi + h) - inertia(phi - h)) / (2 * h)
        gas = 6000 * math.exp(12 * (math.cos((phi - math.pi / 2 - math.radians(30)) / 2) - 1))
        force = -0.6 * g * rate[1] - (0.5 * g + gas) * rate[3] - 0.25 * v
        return [v, (force - slope * v**2 / 2) / inertia(phi)]

    start = [math.radians(100), 10 * math.pi]
    exact = solve_ivp(
        motion, (0, 0.5), start, rtol=1e-11, atol=1e-11, t_eval=run.time, method="DOP853"
    )
    found = columns(run)
    np.testing.assert_allclose(found["crank.phi"], exact.y[0], atol=1e-7)
    np.testing.assert_allclose(found["crank.phi'"], exact.y[1], rtol=1e-7)


def test_andrews_mechanism_of_bodies_is_that_of_angles() -> None:
    bodies, angles = (
        columns(lagcli.simulate(model, rtol=1e-11, samples=7))
        for model in (machine("andrews_bodies"), lagcli.load("andrews_squeezer"))
    )
    for body, angle in (("k1", "beta"), ("k3", "gamma"), ("k5", "delta"), ("k7", "epsilon")):
        np.testing.assert_allclose(bodies[f"{body}.phi"], angles[angle], atol=1e-9)
        scale = np.abs(angles[f"{angle}'"]).max()
        np.testing.assert_allclose(bodies[f"{body}.phi'"], angles[f"{angle}'"], atol=1e-9 * scale)
    turned = angles["phi"] + angles["delta"]
    np.testing.assert_allclose(bodies["k4.phi"], turned, atol=1e-9)
    for body in (3, 4, 6):
        for axis in "xy":
            one, two = bodies[f"lambda.P{body}.{axis}"], angles[f"lambda.p{body}_{axis}"]
            np.testing.assert_allclose(one, two, atol=1e-9 * np.abs(two).max())


def test_cam_drive_in_closed_form() -> None:
    run = lagcli.simulate(machine("cam_drive"), samples=41)
    found, w, h, r = columns(run), 10 * math.pi, 0.008, 0.03
    lift = r + h * (1 - np.cos(2 * w * run.time))
    np.testing.assert_allclose(run.outputs["lift"], lift, atol=1e-12)
    spring = 3000 * (0.14 - (0.15 - lift))
    force = 0.4 * (9.81 + 4 * h * w**2 * np.cos(2 * w * run.time)) + spring
    np.testing.assert_allclose(found["lambda.contact"], force, rtol=1e-9)
    torque = force * 2 * h * np.sin(2 * w * run.time)
    np.testing.assert_allclose(run.outputs["torque"], torque, atol=1e-8)
    faster = columns(lagcli.simulate(machine("cam_drive", set={"n": "900 rpm"}), t_end=0.1))
    assert found["lambda.contact"].min() > 0 > faster["lambda.contact"].min()
