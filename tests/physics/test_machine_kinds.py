"""Kinds of joints, couplings and forces of machines against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import lagcli


def run(text: str, **options: object) -> lagcli.trajectory.trajectory.Trajectory:
    return lagcli.simulate(lagcli.load_text(text), **options)


def start(text: str) -> dict[str, float]:
    """Return a, λ and q at t = 0 by name; accelerations have two primes."""
    r = run(text + "\nsimulation: {t_end: 0.01, samples: 2}\n")
    found = {f"{c}''": r.a[0, i] for i, c in enumerate(r.coordinates)}
    found |= {c: r.q[0, i] for i, c in enumerate(r.coordinates)}
    return found | {f"lambda.{c}": r.multipliers[0, i] for i, c in enumerate(r.constraints)}


def test_wheels_of_a_gear_load_their_bearings() -> None:
    # torque 3 on the first: (J1 + (r1/r2)² J2) a1 = 3; the tooth force turns the second wheel
    x = start("""
bodies:
  ground: {points: {O: [0, 0], P: [0.3, 0]}}
  one: {mass: 2, inertia: 0.05}
  two: {mass: 1, inertia: 0.02}
joints:
  O: revolute(ground.O, one, torque=3)
  P: revolute(ground.P, two)
  mesh: gear(one, two, radii=[0.2, 0.1])
""")
    a = 3 / (0.05 + 4 * 0.02)
    force = 0.02 * 2 * a / 0.1
    assert x["one.phi''"] == pytest.approx(a, rel=1e-12)
    assert x["two.phi''"] == pytest.approx(-2 * a, rel=1e-12)
    assert x["lambda.mesh"] == pytest.approx(force, rel=1e-12)
    assert x["lambda.P.y"] == pytest.approx(-force, rel=1e-12)
    assert x["lambda.O.y"] == pytest.approx(force, rel=1e-12)


def test_a_pressure_angle_pushes_the_wheels_apart() -> None:
    text = """
bodies:
  ground: {points: {O: [0, 0], P: [0.3, 0]}}
  one: {mass: 2, inertia: 0.05}
  two: {mass: 1, inertia: 0.02}
joints:
  O: revolute(ground.O, one, torque=3)
  P: revolute(ground.P, two)
  mesh: gear(one, two, radii=[0.2, 0.1], pressure=%s)
"""
    plain, inclined = start(text % 0), start(text % "20 deg")
    tangential = plain["lambda.P.y"]
    assert inclined["one.phi''"] == pytest.approx(plain["one.phi''"], rel=1e-12)
    assert inclined["lambda.P.y"] == pytest.approx(tangential, rel=1e-12)
    assert abs(inclined["lambda.P.x"]) == pytest.approx(
        abs(tangential) * math.tan(math.radians(20)), rel=1e-12
    )


@pytest.mark.parametrize("torque", [1.0, 2.5])
def test_planetary_gear(torque: float) -> None:
    # ring fixed: Willis' equation gives sun : carrier = 3, planet : carrier = -3
    x = start(f"""
bodies:
  ground: {{}}
  sun: {{mass: 1, inertia: 0.0005}}
  carrier: {{mass: 2, inertia: 0.01, points: {{P: [60 mm, 0]}}}}
  planet: {{mass: 0.3, inertia: 0.00008}}
joints:
  S: revolute(ground, sun, torque={torque})
  C: revolute(ground, carrier)
  P: revolute(carrier.P, planet)
  inside: gear(sun, planet, radii=[40 mm, 20 mm])
  ring: gear(ground, planet, radii=[80 mm, 20 mm], inner=true)
initial: {{sun.phi: 0, carrier.phi: {{guess: 0}}, sun.phi': 0}}
""")
    inertia = 0.0005 * 9 + 0.01 + 0.3 * 0.06**2 + 0.00008 * 9  # for the carrier's speed
    carrier = 3 * torque / inertia
    assert x["carrier.phi''"] == pytest.approx(carrier, rel=1e-9)
    assert x["sun.phi''"] == pytest.approx(3 * carrier, rel=1e-9)
    assert x["planet.phi''"] == pytest.approx(-3 * carrier, rel=1e-9)
    # the pin accelerates the carrier, at rest
    assert -x["lambda.P.y"] * 0.06 == pytest.approx(0.01 * carrier, rel=1e-9)
    assert x["lambda.inside"] * 0.04 == pytest.approx(torque - 0.0005 * 3 * carrier, rel=1e-9)


def test_belts_open_and_crossed() -> None:
    text = """
bodies:
  ground: {points: {O: [0, 0], P: [0.5, 0]}}
  one: {mass: 2, inertia: 0.05}
  two: {mass: 1, inertia: 0.02}
joints:
  O: revolute(ground.O, one, torque=3)
  P: revolute(ground.P, two)
  b: belt(one, two, radii=[0.1, 0.2]%s)
"""
    for crossed, sign in (("", 1), (", crossed=true", -1)):
        x = start(text % crossed)
        a = 3 / (0.05 + 0.02 / 4)
        strand = 0.02 * a / 2 / 0.2
        assert x["one.phi''"] == pytest.approx(a, rel=1e-12)
        assert x["two.phi''"] == pytest.approx(sign * a / 2, rel=1e-12)
        assert x["lambda.b"] == pytest.approx(-strand, rel=1e-12)  # the strand pulls
        assert np.hypot(x["lambda.P.x"], x["lambda.P.y"]) == pytest.approx(strand, rel=1e-12)


def test_a_rack_and_its_pinion() -> None:
    # the pinion above a rack along x: turning by +1 rad moves the rack by +r
    x = start("""
bodies:
  ground: {points: {O: [0, 0.1]}}
  pinion: {mass: 2, inertia: 0.05}
  rack: {mass: 4, inertia: 0.1}
joints:
  O: revolute(ground.O, pinion, torque=3)
  guide: prismatic(ground, rack, along=x)
  mesh: rack(pinion, rack, radius=0.1, along=x)
""")
    a = 3 / (0.05 + 4 * 0.1**2)
    assert x["pinion.phi''"] == pytest.approx(a, rel=1e-12)
    assert x["rack.x''"] == pytest.approx(0.1 * a, rel=1e-12)
    assert x["lambda.mesh"] == pytest.approx(0.4 * a, rel=1e-12)
    assert x["lambda.O.x"] == pytest.approx(0.4 * a, rel=1e-12)


def test_gearbox_cam_and_stops() -> None:
    x = start("""
bodies:
  ground: {points: {P: [1, 0]}}
  one: {mass: 1, inertia: 0.05}
  two: {mass: 1, inertia: 0.02}
joints:
  In: revolute(ground, one, torque=3)
  Out: revolute(ground.P, two)
  box: {gearbox: [In, Out], ratio: 5}
""")
    a = 3 / (0.05 + 0.02 / 25)
    assert x["one.phi''"] == pytest.approx(a, rel=1e-12)
    assert x["two.phi''"] == pytest.approx(a / 5, rel=1e-12)
    r = run("""
parameters: {h: 10 mm}
bodies:
  wheel: {mass: 1, inertia: 0.05}
  follower: {mass: 2, inertia: 0.02}
joints:
  C: revolute(ground, wheel)
  F: prismatic(ground, follower, along=y)
  turning: {drive: C, speed: 10 rad/s}
  cam: {cam: [C, F], lift: h*(1 - cos(C.angle))}
initial: {wheel.phi: 0}
simulation: {t_end: 0.5, samples: 6}
""")
    lifted = 0.01 * (1 - np.cos(10 * r.time))
    np.testing.assert_allclose(r.q[:, r.coordinates.index("follower.y")], lifted, atol=1e-10)
    force = r.multipliers[:, r.constraints.index("cam")]
    np.testing.assert_allclose(force, 2 * 0.01 * 100 * np.cos(10 * r.time), atol=1e-7)


def test_what_acts_on_a_joint() -> None:
    # armature, spring, damper, torque: (J + m l²/4 + a) φ'' = τ - c φ' - k (φ - φ0)
    r = run("""
bodies:
  bar: {mass: 3, length: 0.8}
joints:
  O: revolute(ground, bar.a, damping=0.4, stiffness=5, rest=0.3, torque=2*t, armature=0.2)
initial: {O.angle: 0.5, O.angle': 2 rad/s}
simulation: {t_end: 1, samples: 3}
""")
    v, a, q = (x[:, r.coordinates.index("bar.phi")] for x in (r.v, r.a, r.q))
    assert (q[0], v[0]) == (0.5, 2)
    inertia = 3 * 0.8**2 / 3 + 0.2
    np.testing.assert_allclose(inertia * a, 2 * r.time - 0.4 * v - 5 * (q - 0.3), atol=1e-9)


def test_a_stop_reverses_a_bar() -> None:
    r = run("""
bodies: {bar: {mass: 3, length: 0.8}}
joints: {O: "revolute(ground, bar.a, max=0.5, restitution=0.5)"}
initial: {O.angle: 0, O.angle': 2 rad/s}
simulation: {t_end: 0.5, samples: 3}
""")
    assert r.v[-1, r.coordinates.index("bar.phi")] == pytest.approx(-1, abs=1e-9)
    assert r.q[-1, r.coordinates.index("bar.phi")] == pytest.approx(0.5 - 0.25, abs=1e-9)


def test_dry_friction_of_a_joint() -> None:
    r = run("""
bodies: {bar: {mass: 3, inertia: 0.5}}
joints: {O: "revolute(ground, bar, friction=0.25)"}
initial: {O.angle: 0, O.angle': 1 rad/s}
simulation: {t_end: 1, samples: 3}
""")
    assert r.v[-1, r.coordinates.index("bar.phi")] == pytest.approx(0.5, abs=1e-9)


def test_an_angle_between_two_moving_bodies_is_kept_at_the_start() -> None:
    r = run("""
gravity: [0, -9.81 m/s^2]
bodies:
  one: {mass: 1, length: 0.4}
  two: {mass: 1, length: 0.3}
joints:
  O: revolute(ground, one.a)
  A: revolute(one.b, two.a)
initial: {O.angle: {guess: 20 deg}, A.angle: 40 deg, A.angle': 3, O.angle': 0}
simulation: {t_end: 0.1, samples: 3}
""")
    q, v = (dict(zip(r.coordinates, x[0], strict=True)) for x in (r.q, r.v))
    assert q["two.phi"] - q["one.phi"] == pytest.approx(math.radians(40), abs=1e-14)
    assert v["two.phi"] - v["one.phi"] == pytest.approx(3, abs=1e-14)
    np.testing.assert_allclose(r.multipliers[:, r.constraints.index("A.q")], 0, atol=1e-12)


def test_a_chain_of_a_family_is_the_chain_of_single_bodies() -> None:
    family = """
gravity: [0, -9.81]
parameters: {N: 4}
bodies: {"link[1..N]": {mass: 0.5, length: 0.2}}
joints:
  O: revolute(ground, link[1].a)
  J[i = 2..N]: revolute(link[i-1].b, link[i].a, damping=0.01)
initial: {"link[i = 1..N].phi": 0, "link[i = 1..N].phi'": 0}
simulation: {t_end: 0.2, samples: 3}
"""
    single = "gravity: [0, -9.81]\nbodies:\n"
    single += "".join(f"  l{k}: {{mass: 0.5, length: 0.2}}\n" for k in range(1, 5))
    single += "joints:\n  O: revolute(ground, l1.a)\n"
    single += "".join(f"  J{k}: revolute(l{k - 1}.b, l{k}.a, damping=0.01)\n" for k in (2, 3, 4))
    starts = ", ".join(f"l{k}.phi: 0, l{k}.phi': 0" for k in range(1, 5))
    single += f"initial: {{{starts}}}\nsimulation: {{t_end: 0.2, samples: 3}}\n"
    one, two = run(family), run(single)
    for n in range(1, 5):
        for c in ("x", "y", "phi"):
            i, j = one.coordinates.index(f"link[{n}].{c}"), two.coordinates.index(f"l{n}.{c}")
            np.testing.assert_allclose(one.q[:, i], two.q[:, j], atol=1e-12)
    longer = lagcli.load_text(family, set={"N": 6})
    assert "J[6].angle" in longer.definitions


def test_forces_between_points() -> None:
    # a wrench in the body's frame, and an actuator along x
    x = start("""
bodies:
  block: {mass: 2, inertia: 0.1, points: {P: [0.1, 0]}}
  other: {mass: 4, inertia: 0.1}
joints: {g: "prismatic(ground, other, along=x)"}
forces:
  w: wrench(block.P, force=[0, 3], moment=0.2, in=block)
  a: actuator(block, other, force=6)
initial: {block.x: 0, block.y: 0, block.phi: 0, other.x: 1,
  block.x': 0, block.y': 0, block.phi': 0, other.x': 0}
""")
    assert x["block.x''"] == pytest.approx(-3, rel=1e-12)
    assert x["block.y''"] == pytest.approx(1.5, rel=1e-12)
    assert x["block.phi''"] == pytest.approx(5, rel=1e-12)
    assert x["other.x''"] == pytest.approx(1.5, rel=1e-12)


def test_center_of_mass_beside_the_origin_of_the_points() -> None:
    text = """
gravity: [0, -9.81]
bodies: {bar: {mass: 2, inertia: 0.1%s}}
joints: {O: "revolute(ground, bar.P)"}
initial: {O.angle: 0, O.angle': 0}
"""
    one = start(text % ", com: [0.3, 0], points: {P: [0.1, 0]}")
    two = start(text % ", points: {P: [-0.2, 0]}")
    assert one["bar.phi''"] == pytest.approx(two["bar.phi''"], rel=1e-12)
    assert one["bar.phi''"] == pytest.approx(-9.81 * 0.2 * 2 / (0.1 + 2 * 0.04), rel=1e-12)


def test_parameters_of_bodies_are_set_like_others() -> None:
    text = "bodies: {bar: {mass: 2, length: 500 mm}}\njoints: {O: 'revolute(ground, bar.a)'}\n"
    text += "initial: {O.angle: 0, O.angle': 0}\n"
    model = lagcli.load_text(text, set={"bar.length": "0.3 m"})
    assert model.parameters["bar.inertia"].value == pytest.approx(2 * 0.3**2 / 12)
    assert model.initial["bar.x"].value == pytest.approx(0.15)
