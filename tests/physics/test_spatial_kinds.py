"""Kinds of joints and forces of machines in space against closed forms and shipped models."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import lagcli

MODELS = Path(__file__).resolve().parents[2] / "models"


def run(text: str) -> lagcli.trajectory.trajectory.Trajectory:
    return lagcli.simulate(lagcli.load_text(text))


def column(r: lagcli.trajectory.trajectory.Trajectory, name: str) -> np.ndarray:
    """Return a coordinate, a velocity with a prime, an acceleration with two, or λ over time."""
    if name.startswith("lambda."):
        return r.multipliers[:, r.constraints.index(name.removeprefix("lambda."))]
    values = (r.q, r.v, r.a)[name.count("'")]
    return values[:, r.coordinates.index(name.rstrip("'"))]


TOP = """
gravity: [0, 0, -9.81 m/s^2]
bodies:
  top:
    mass: 15 kg
    inertia: [0.234375 kg*m^2, 0.46875 kg*m^2, 0.234375 kg*m^2]
    points: {foot: [0, -1 m, 0]}
joints: {pin: "spherical(ground, top.foot)"}
initial: {top.e: 1, top.e': [0, 150 rad/s, -4.61538 rad/s]}
simulation: {t_end: 0.5, samples: 11, rtol: 1e-11}
"""


def test_the_heavy_top_is_that_of_the_shipped_model() -> None:
    r = run(TOP)
    model = lagcli.load(MODELS / "heavy_top.yaml")
    other = lagcli.simulate(model, t_end=0.5, samples=11, rtol=1e-11)
    names = {"r.x": "X", "r.y": "Y", "r.z": "Z", "e.0": "e0", "e.3": "e3"}
    for one, two in names.items():
        np.testing.assert_allclose(column(r, f"top.{one}"), column(other, two), atol=1e-7)
    np.testing.assert_allclose(
        column(r, "lambda.pin.z"), column(other, "lambda.pin_z"), rtol=1e-6, atol=1e-4
    )


def test_a_rolling_disk_is_that_of_the_shipped_model() -> None:
    # the shipped model at psi = phi = 0: axle along y, tilted by theta_0 about x
    model = lagcli.load(MODELS / "rolling_disk.yaml")
    p = {name: x.value for name, x in model.parameters.items()}
    other = lagcli.simulate(model, t_end=1, samples=6, rtol=1e-11)
    theta, spin = p["theta_0"], -p["S"] - p["Omega"] * math.sin(p["theta_0"])
    # ω = theta' x + Omega z + spin axle, in the frame of the disk, turned by theta about x
    c, s = math.cos(theta), math.sin(theta)
    omega = [p["kick"], spin + p["Omega"] * s, p["Omega"] * c]
    r = run(f"""
gravity: [0, 0, -9.81]
bodies: {{disk: {{mass: 2, inertia: [{p["A"]!r}, {p["C"]!r}, {p["A"]!r}]}}}}
joints: {{roll: "rolling(ground, disk, normal=z, axis=y, radius=0.3)"}}
initial: {{disk.e: rot_x({theta!r}), disk.e': {omega!r}, disk.r.x: 0, disk.r.y: 0}}
simulation: {{t_end: 1, samples: 6, rtol: 1e-11}}
""")
    for one, two in (("disk.r.x", "x"), ("disk.r.y", "y"), ("disk.r.z", "z")):
        np.testing.assert_allclose(column(r, one), column(other, two), atol=1e-8)
    for one, two in (("n", "contact"), ("x", "roll_x"), ("y", "roll_y")):
        np.testing.assert_allclose(
            column(r, f"lambda.roll.{one}"), column(other, f"lambda.{two}"), rtol=1e-6, atol=1e-6
        )


def test_rolling_on_an_inclined_plane_of_a_body_is_rolling_on_the_ground() -> None:
    # a fixed wedge and an inclined normal of the ground: the same plane
    disk = "disk: {mass: 2, inertia: [0.045, 0.09, 0.045]}"
    start = """
initial: {disk.e: rot_x(-20 deg)*rot_y(10 deg), disk.e': [0.2, 5, 0.3],
  disk.r: {guess: [0, 0.1, 0.3]}}
simulation: {t_end: 0.5, samples: 6, rtol: 1e-11}
"""
    n = [0.0, math.sin(math.radians(20)), math.cos(math.radians(20))]
    one = run(
        f"gravity: [0, 0, -9.81]\nbodies: {{{disk}}}\njoints:\n"
        f"  roll: rolling(ground, disk, normal={n!r}, axis=y, radius=0.3)\n" + start
    )
    two = run(
        f"gravity: [0, 0, -9.81]\nbodies: {{{disk}, wedge: {{mass: 1, inertia: [1, 1, 1]}}}}\n"
        "joints:\n  weld: fixed(ground, wedge)\n"
        f"  roll: rolling(wedge, disk, normal={n!r}, axis=y, radius=0.3)\n" + start
    )
    for name in ("disk.r.x", "disk.r.y", "disk.r.z", "lambda.roll.n", "lambda.roll.x"):
        np.testing.assert_allclose(column(one, name), column(two, name), rtol=1e-8, atol=1e-8)


def test_cardan_shaft() -> None:
    # tan γ = cos β tan α between the input and the middle shaft; the output turns like the input;
    # the motor balances the brake and accelerates the middle shaft: M ω = 20 ω + J γ' γ''
    beta, omega = math.radians(30), 30.0
    c, s = math.cos(beta), math.sin(beta)
    r = run(f"""
gravity: [0, 0, -9.81]
bodies:
  ground: {{points: {{O: [0, 0, 0], E: [{0.4 + 1.2 * c!r}, {1.2 * s!r}, 0]}}}}
  one: {{mass: 5, inertia: [0.02, 0.05, 0.05], points: {{O: [-0.1, 0, 0], U: [0.1, 0, 0]}}}}
  mid: {{mass: 8, inertia: [0.03, 1, 1], points: {{a: [-0.6, 0, 0], b: [0.6, 0, 0]}}}}
  two: {{mass: 5, inertia: [0.02, 0.05, 0.05], points: {{U: [-0.1, 0, 0], E: [0.1, 0, 0]}}}}
joints:
  J1: revolute(ground.O, one.O, axis=x)
  U1: universal(one.U, mid.a, axis=[z, y])
  U2: universal(mid.b, two.U, axis=[y, z])
  J2: {{cylindrical: [ground.E, two.E], axis: x, angle: {{torque: -20}}}}
  motor: {{drive: J1, angle: 30*t}}
initial: {{mid.e: {{guess: rot_z(30 deg)}}, two.e: {{guess: 1}}}}
simulation: {{t_end: 1, samples: 41, rtol: 1e-12, atol: 1e-12}}
""")
    alpha = omega * r.time
    np.testing.assert_allclose(column(r, "J1.angle"), alpha, atol=1e-9)
    np.testing.assert_allclose(column(r, "J2.angle"), alpha, atol=1e-9)  # over many turns
    q = {k: column(r, f"mid.e.{k}") for k in "0123"}
    # y axis of the middle shaft in the fixed frame: cos γ (−s, c, 0) + sin γ z
    sine = 2 * (q["2"] * q["3"] + q["0"] * q["1"])
    cosine = c * (1 - 2 * (q["1"] ** 2 + q["3"] ** 2)) - s * 2 * (q["1"] * q["2"] - q["0"] * q["3"])
    gamma = np.arctan2(c * np.sin(alpha), np.cos(alpha))
    np.testing.assert_allclose(np.sin(np.arctan2(sine, cosine) - gamma), 0, atol=1e-9)
    size = 1 - (s * np.sin(alpha)) ** 2
    rate = omega * c / size
    acceleration = omega**2 * c * s**2 * np.sin(2 * alpha) / size**2
    torque = 20 + 0.03 * rate * acceleration / omega
    np.testing.assert_allclose(column(r, "lambda.motor"), torque, rtol=1e-8)
    np.testing.assert_allclose(column(r, "lambda.J2.Mu"), -20, rtol=1e-12)


def test_conical_pendulum() -> None:
    # θ = 0.5: ω² = g/(l cos θ), force of the rod m g/cos θ
    g, length, theta = 9.81, 0.7, 0.5
    omega = math.sqrt(g / (length * math.cos(theta)))
    x, z = length * math.sin(theta), -length * math.cos(theta)
    r = run(f"""
gravity: [0, 0, -9.81]
bodies: {{bob: {{mass: 2}}}}
joints: {{string: "rod(ground, bob, length=0.7)"}}
initial: {{bob.r: [{x!r}, 0, {{guess: {z!r}}}], bob.r': [0, {omega * x!r}, {{guess: 0}}]}}
simulation: {{t_end: 3, samples: 7, rtol: 1e-11}}
""")
    np.testing.assert_allclose(column(r, "bob.r.x"), x * np.cos(omega * r.time), atol=1e-8)
    np.testing.assert_allclose(column(r, "bob.r.y"), x * np.sin(omega * r.time), atol=1e-8)
    np.testing.assert_allclose(column(r, "lambda.string"), -2 * g / math.cos(theta), rtol=1e-7)


@pytest.mark.parametrize("axis", ["x", "z", "[0.3, -0.4, 1.2]"])
def test_a_wheel_turns_many_times(axis: str) -> None:
    # q = ω t + τ t²/(2 J): the angle is not reduced to one turn, and the quaternion stays normal
    r = run(f"""
bodies: {{wheel: {{mass: 1, inertia: [0.2, 0.2, 0.2]}}}}
dimension: 3
joints: {{pin: "revolute(ground, wheel, axis={axis}, torque=0.4)"}}
initial: {{pin.angle: 0.3, pin.angle': 100}}
simulation: {{t_end: 10, samples: 11, rtol: 1e-10}}
""")
    t = r.time
    np.testing.assert_allclose(column(r, "pin.angle"), 0.3 + 100 * t + t**2, rtol=1e-8)
    length = sum(column(r, f"wheel.e.{k}") ** 2 for k in "0123")
    np.testing.assert_allclose(length, 1, atol=1e-12)
    np.testing.assert_allclose(column(r, "lambda.pin.Mu"), 0.4, rtol=1e-9)
    half = np.arctan2(
        np.sqrt(sum(column(r, f"wheel.e.{k}") ** 2 for k in "123")), abs(column(r, "wheel.e.0"))
    )
    expected = abs(
        np.arctan2(np.sin(column(r, "pin.angle") / 2), np.cos(column(r, "pin.angle") / 2))
    )
    np.testing.assert_allclose(np.cos(2 * half), np.cos(2 * expected), atol=1e-7)


def test_a_screw_slows_the_fall_of_its_nut() -> None:
    # z = p q/2π: (m p/2π + J 2π/p) q'' = −m g
    r = run("""
gravity: [0, 0, -9.81]
bodies: {nut: {mass: 3, inertia: [0.02, 0.02, 0.04]}}
joints: {thread: "screw(ground, nut, axis=z, pitch=50 mm)"}
initial: {thread.angle: 0, thread.angle': 0}
simulation: {t_end: 1, samples: 3}
""")
    lead = 0.05 / math.tau
    a = -3 * 9.81 * lead / (3 * lead**2 + 0.04)
    np.testing.assert_allclose(column(r, "thread.angle''"), a, rtol=1e-9)
    np.testing.assert_allclose(column(r, "nut.r.z"), lead * a * r.time**2 / 2, atol=1e-9)
    np.testing.assert_allclose(column(r, "lambda.thread.h"), 3 * (9.81 + lead * a), rtol=1e-8)


def test_moments_of_a_cantilever_and_of_a_hinge_beside_its_body() -> None:
    # a weight m g at the arm (0.5, 0.2, 0): moment of the support −r × (−m g z)
    weld = """
gravity: [0, 0, -9.81]
bodies: {arm: {mass: 2, inertia: [0.1, 0.1, 0.1], points: {O: [-0.5, -0.2, 0]}}}
joints: {hold: "%s"}
simulation: {t_end: 0.01, samples: 2}
"""
    r = run(weld % "fixed(ground, arm.O)")
    found = [column(r, f"lambda.hold.{n}")[0] for n in ("x", "y", "z", "M.x", "M.y", "M.z")]
    np.testing.assert_allclose(found, [0, 0, 19.62, 0.2 * 19.62, -0.5 * 19.62, 0], atol=1e-9)
    # about a vertical axis the same moments, about v = x and w = y
    r = run(weld % "revolute(ground, arm.O, axis=z)" + "initial: {arm.e': [0, 0, 0]}\n")
    found = [column(r, f"lambda.hold.{n}")[0] for n in ("x", "y", "z", "Mv", "Mw")]
    np.testing.assert_allclose(found, [0, 0, 19.62, 0.2 * 19.62, -0.5 * 19.62], atol=1e-9)


def test_a_slider_on_a_spring_with_a_stop() -> None:
    r = run("""
dimension: 3
bodies: {slider: {mass: 2, shape: "box(0.1, 0.2, 0.3)"}}
joints:
  guide: prismatic(ground, slider, axis=[0, 0.6, 0.8], stiffness=50, rest=0.1, damping=0)
initial: {guide.position: 0.4, guide.position': 0}
simulation: {t_end: 1, samples: 5, rtol: 1e-11}
""")
    x = 0.1 + 0.3 * np.cos(5 * r.time)
    np.testing.assert_allclose(column(r, "slider.r.y"), 0.6 * x, atol=1e-9)
    np.testing.assert_allclose(column(r, "slider.r.z"), 0.8 * x, atol=1e-9)


def test_a_machine_in_a_plane_of_space_is_the_planar_machine() -> None:
    # a family of links, with an index, on pins along z
    text = """
parameters: {N: 3}
bodies: {"link[1..N]": {mass: 0.5, length: 0.2%s}}
joints:
  O: revolute(ground, link[1].a%s, damping=0.02)
  J[i = 2..N]: revolute(link[i-1].b, link[i].a%s, damping=0.01)
simulation: {t_end: 0.4, samples: 3, rtol: 1e-11}
"""
    planar = run("gravity: [0, -9.81]\n" + text % ("", "", ""))
    inertia = ", inertia: [0.001, 0.5*0.2^2/12, 0.5*0.2^2/12]"
    space = run("gravity: [0, -9.81, 0]\n" + text % (inertia, *[", axis=z"] * 2))
    for k in (1, 2, 3):
        for c in "xy":
            np.testing.assert_allclose(
                column(space, f"link[{k}].r.{c}"), column(planar, f"link[{k}].{c}"), atol=1e-9
            )
    np.testing.assert_allclose(
        column(space, "lambda.J[3].y"), column(planar, "lambda.J[3].y"), rtol=1e-7, atol=1e-8
    )
    angle = column(planar, "link[3].phi") - column(planar, "link[2].phi")
    np.testing.assert_allclose(column(space, "J[3].angle"), angle, atol=1e-9)


def test_wrenches_and_springs_in_space() -> None:
    text = """
dimension: 3
bodies:
  block: {mass: 2, inertia: [0.1, 0.2, 0.25], points: {P: [0.1, 0, 0]}}
  bob: {mass: 4}
forces:
  w: wrench(block.P, force=[0, 3, 0], moment=[0.2, 0, 0]%s)
  s: spring(bob, block, stiffness=10, length=0.5)
initial: {block.r: 0, block.r': 0, block.e: rot_z(90 deg), block.e': 0, bob.r: [0, 0, 2],
  bob.r': 0}
simulation: {t_end: 0.001, samples: 2}
"""
    for inside, force, alpha in (
        # in the fixed frame: the point is at (0, 0.1, 0); the body's y axis is −x
        ("", [0, 1.5], [0, -0.2 / 0.2, 0]),
        # in the body's frame: force along −x, at the arm (0.1, 0, 0)
        (", in=block", [-1.5, 0], [0.2 / 0.1, 0, 0.3 / 0.25]),
    ):
        r = run(text % inside)
        a = [column(r, f"block.r.{c}''")[0] for c in "xyz"]
        np.testing.assert_allclose(a, [*force, 15 / 2], atol=1e-12)
        assert column(r, "bob.r.z''")[0] == pytest.approx(-15 / 4)
        e = np.array([column(r, f"block.e.{k}")[0] for k in "0123"])
        rate = np.array([column(r, f"block.e.{k}''")[0] for k in "0123"])
        found = 2 * (e[0] * rate[1:] - rate[0] * e[1:] - np.cross(e[1:], rate[1:]))
        np.testing.assert_allclose(found, alpha, atol=1e-12)


@pytest.mark.parametrize(
    ("shape", "moments"),
    [
        ("box(0.1, 0.2, 0.3)", [0.13 / 6, 0.1 / 6, 0.05 / 6]),
        ("cylinder(0.2, 0.6)", [0.12 / 6 + 0.36 / 6, 0.12 / 6 + 0.36 / 6, 0.04]),
        ("sphere(0.5)", [0.2, 0.2, 0.2]),
    ],
)
def test_inertia_of_shapes(shape: str, moments: list[float]) -> None:
    model = lagcli.load_text(
        f"dimension: 3\nbodies: {{b: {{mass: 2, shape: '{shape}'}}}}\n"
        "initial: {b.r: 0, b.r': 0, b.e: 1, b.e': 0}\n"
    )
    found = [model.parameters[f"b.inertia.{c}"].value for c in "xyz"]
    np.testing.assert_allclose(found, moments, rtol=1e-12)


def test_center_of_mass_beside_the_origin_of_the_points() -> None:
    text = """
gravity: [0, 0, -9.81]
bodies: {bar: {mass: 2, inertia: [0.1, 0.1, 0.1]%s}}
joints: {O: "revolute(ground, bar.P, axis=y)"}
initial: {O.angle: 0, O.angle': 0}
simulation: {t_end: 0.001, samples: 2}
"""
    for points in (", com: [0.3, 0, 0], points: {P: [0.1, 0, 0]}", ", points: {P: [-0.2, 0, 0]}"):
        a = column(run(text % points), "O.angle''")[0]
        assert a == pytest.approx(9.81 * 0.2 * 2 / (0.1 + 2 * 0.04), rel=1e-12)


def test_a_loop_closes_from_guesses_of_angles() -> None:
    # a four-bar linkage with pins along z, its coupler on spherical and universal joints
    r = run("""
gravity: [0, 0, -9.81]
bodies:
  ground: {points: {O: [0, 0, 0], D: [0.5, 0, 0]}}
  crank: {mass: 1, inertia: [0.01, 0.01, 0.01], points: {a: [-0.1, 0, 0], b: [0.1, 0, 0]}}
  coupler: {mass: 1, inertia: [0.01, 0.02, 0.02], points: {a: [-0.25, 0, 0], b: [0.25, 0, 0]}}
  rocker: {mass: 1, inertia: [0.01, 0.02, 0.02], points: {a: [-0.2, 0, 0], b: [0.2, 0, 0]}}
joints:
  O: revolute(ground.O, crank.a, axis=z)
  A: universal(crank.b, coupler.a, axis=[y, z])
  B: spherical(coupler.b, rocker.b)
  D: revolute(ground.D, rocker.a, axis=z)
  motor: {drive: O, angle: pi/3 + 10*t}
initial: {D.angle: {guess: 100 deg}}
simulation: {t_end: 1, samples: 21}
""")
    phi = 2 * np.arctan2(column(r, "rocker.e.3"), column(r, "rocker.e.0"))
    crank = math.pi / 3 + 10 * r.time
    x = 0.5 + 0.4 * np.cos(phi) - 0.2 * np.cos(crank)
    y = 0.4 * np.sin(phi) - 0.2 * np.sin(crank)
    np.testing.assert_allclose(np.hypot(x, y), 0.5, atol=1e-9)
    assert np.sin(phi).min() > 0  # the rocker stays on its side
