"""Contacts whose rows have different units, and limits curved in multipliers, at any scale.

The units of length, mass and time are scaled by powers of two, so that the same motion has the same
digits; only tolerances and decisions could differ.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import lagcli
from lagcli.trajectory.trajectory import Trajectory

SCALES = [(2.0**-30, 2.0**-40, 2.0**-10), (2.0**30, 2.0**60, 2.0**13)]


def tethered(length: float, mass: float, time: float) -> str:
    """Two balls on a rope, m², above a floor, m; the first one is driven where it may rub."""
    speed, force = length / time, mass * length / time**2
    return f"""
coordinates: [x, y, u, w]
parameters: {{m: {mass!r}, g: {9.81 * speed / time!r}, r: {length!r}, mu: 0.3, a: {0.1 * length!r},
  f: {4 / time!r}, F: {12 * force!r}}}
T: m/2*(x'^2 + y'^2 + u'^2 + w'^2)
V: m*g*(y + w)
Q: {{y: F*sin(f*t)}}
constraints:
  rope: "(u - x)^2 + (w - y)^2 <= r^2"
  one: {{expr: y >= 0, friction: mu, slip: x'}}
  two: {{expr: w >= 0, friction: mu, slip: u'}}
  drive: x = a*sin(f*t)
initial:
  x: 0
  y: {0.2 * length!r}
  x': {{guess: 0}}
  y': 0
  u: {0.7 * length!r}
  w: {0.5 * length!r}
  u': {2 * speed!r}
  w': 0
simulation: {{t_end: {2 * time!r}, samples: 41}}
"""


def as_in_si(run: Trajectory, length: float, time: float) -> np.ndarray:
    return np.hstack([run.q / length, run.v / length * time])


@pytest.mark.parametrize("scales", SCALES)
def test_ropes_and_floors(scales: tuple[float, float, float]) -> None:
    length, _, time = scales
    given, other = (
        lagcli.simulate(lagcli.load_text(tethered(*units))) for units in ((1.0, 1.0, 1.0), scales)
    )
    assert given.status == other.status == "completed", other.message
    assert given.events is not None
    assert other.events is not None
    assert {"impact", "closes", "opens", "slips"} <= set(given.events.kinds)
    assert given.events.kinds == other.events.kinds
    np.testing.assert_allclose(other.events.time / time, given.events.time, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        as_in_si(other, length, time), as_in_si(given, 1.0, 1.0), rtol=0, atol=1e-7
    )


@pytest.mark.parametrize("scales", SCALES)
def test_derivatives_of_ropes_and_floors(scales: tuple[float, float, float]) -> None:
    length, mass, _ = scales
    given, other = (
        lagcli.simulate(
            lagcli.load_text(tethered(*units)), sensitivity=["m", "mu"], t_end=0.9 * units[2]
        )
        for units in ((1.0, 1.0, 1.0), scales)
    )
    assert np.isfinite(given.dq).all()
    units = np.array([length / mass, length])
    np.testing.assert_allclose(other.dq / units, given.dq, rtol=0, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_a_contact_between_fixed_bodies_bears_nothing(seed: int) -> None:
    """Its inverse inertia is a rounding error beside that of a ball, and of the bodies alone."""
    random = np.random.default_rng(seed)
    (a, b), (c, d) = random.uniform(-1, 1, size=(2, 2)) * 10.0 ** random.uniform(-6, 6, (2, 1))
    x, y = random.uniform(0.5, 1, size=2)
    text = f"""
coordinates: [x, y, z]
parameters: {{a: {a}, b: {b}, c: {c}, d: {d}, x0: {x}, y0: {y}}}
T: 1e-3*x'^2 + 1e3*y'^2 + z'^2/2
V: 10*z + 3*x + 2*y
constraints:
  first: a*(x - x0) + b*(y - y0) = 0
  second: c*(x - x0) + d*(y - y0) = 0
  near: 2*x + 3*y >= 2*x0 + 3*y0
  floor: {{expr: z >= 0, restitution: 0.5}}
initial: {{x: x0, y: y0, z: 0.2, x': 0, y': 0, z': 0}}
simulation: {{t_end: 0.3, samples: 4}}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    assert run.status == "completed", run.message
    touch, speed = 0.2, 1.0  # √(2 0.2/10), half of 2 m/s
    after = run.time[2:] - touch
    assert run.q[2:, 2] == pytest.approx(speed * after - 5 * after**2, abs=1e-9)
    np.testing.assert_allclose(run.q[:, :2], [[x, y]] * 4, rtol=1e-9)
    assert np.abs(run.multipliers[:, 2]).max() < 1e-6


def ladder(mass: float, law: str) -> str:
    """A rod whose end slides in a guide, with a friction that the normal force determines."""
    return f"""
coordinates: [x, y, th]
parameters: {{m: {mass!r}, l: 0.7, g: 9.81, mu: 0.3, N: {5 * mass!r}}}
definitions: {{x_A: x - l/2*cos(th), y_A: y - l/2*sin(th)}}
T: m/2*(x'^2 + y'^2) + m*l^2/24*th'^2
V: m*g*y
constraints:
  guide: y_A = 0
  rub: {{expr: x_A' = 0, limit: {law}}}
initial: {{x: 0, y: {{guess: 0}}, th: 0.9, x': -1.5, y': {{guess: 0}}, th': 1.2}}
outputs: {{limit: {law}, slip: x_A'}}
simulation: {{t_end: 0.2, samples: 21}}
"""


@pytest.mark.parametrize("law", ["mu*sqrt(lambda.guide^2 + N^2)", "mu*N*(abs(lambda.guide)/N)^0.8"])
@pytest.mark.parametrize("exponent", [-60, 60])
def test_friction_that_is_curved_in_the_normal_force(law: str, exponent: int) -> None:
    mass = 2.0**exponent
    given, other = (lagcli.simulate(lagcli.load_text(ladder(m, law))) for m in (1.0, mass))
    assert given.status == other.status == "completed", other.message
    np.testing.assert_allclose(other.q, given.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(other.multipliers / mass, given.multipliers, rtol=0, atol=1e-7)
    slides = np.abs(other.outputs["slip"]) > 1e-6
    assert slides.any()
    np.testing.assert_allclose(
        np.abs(other.multipliers[slides, 1]), other.outputs["limit"][slides], rtol=1e-12
    )


def test_friction_that_is_curved_sticks_up_to_its_limit() -> None:
    """A block on a rail under F: it sticks while |F| ≤ μ √(m² g² + N²), 0.3 √2 5 with m g = 5."""
    for force, moves in ((2.12, False), (2.13, True)):
        for mass in (1.0, 2.0**-50, 2.0**50):
            run = lagcli.simulate(
                lagcli.load_text(
                    f"coordinates: [x, y]\n"
                    f"parameters: {{m: {mass!r}, F: {force * mass!r}, N: {5 * mass!r}}}\n"
                    "T: m/2*(x'^2 + y'^2)\nV: 5*m*y\nQ: {x: F}\nconstraints:\n  rail: y = 0\n"
                    "  rub: {expr: x' = 0, limit: 0.3*sqrt(lambda.rail^2 + N^2)}\n"
                    "initial: {x: 0, y: 0, x': 0, y': 0}\nsimulation: {t_end: 1, samples: 3}"
                )
            )
            expected = (force - 1.5 * 2**0.5) / 2 if moves else 0.0
            assert run.q[-1, 0] == pytest.approx(expected, abs=1e-9)


#: Laws of friction under a normal force w, with N = 2.
LAWS = {
    "mu*abs(lambda.rail + N)": lambda w: 0.3 * abs(w + 2),
    "mu*max(lambda.rail, 0)": lambda w: 0.3 * max(w, 0),
    "mu*(N + abs(lambda.rail)^1.5/N^0.5)": lambda w: 0.3 * (2 + abs(w) ** 1.5 / 2**0.5),
    "min(mu*abs(lambda.rail), 0.5*N)": lambda w: min(0.3 * abs(w), 1),
    "if(lambda.rail > N, mu*N, mu*abs(lambda.rail))": lambda w: 0.6 if w > 2 else 0.3 * abs(w),
}


@pytest.mark.parametrize("law", LAWS)
def test_friction_by_any_law_sticks_below_its_limit(law: str) -> None:
    for weight in (-6.0, -1.0, 5.0):
        limit = LAWS[law](weight)
        for force in (0.95 * limit, -1.05 * limit, limit + 1):
            run = lagcli.simulate(
                lagcli.load_text(
                    f"coordinates: [x, y]\nparameters: {{w: {weight}, F: {force!r}, N: 2, mu: 0.3}}"
                    "\nT: (x'^2 + y'^2)/2\nV: w*y\nQ: {x: F}\nconstraints:\n  rail: y = 0\n"
                    f"  rub: {{expr: x' = 0, limit: '{law}'}}\n"
                    "initial: {x: 0, y: 0, x': 0, y': 0}\nsimulation: {t_end: 1, samples: 3}"
                )
            )
            moved = max(abs(force) - limit, 0) / 2 * np.sign(force)
            assert run.status == "completed", run.message
            assert run.q[-1, 0] == pytest.approx(moved, abs=1e-9)


#: Laws of friction under two normal forces, of degree one like an affine law, with N = 2.
LAWS_OF_TWO = {
    "mu*sqrt(lambda.first^2 + lambda.second^2)": lambda u, w: 0.3 * math.hypot(u, w),
    "mu*hypot(lambda.first, 2*lambda.second)": lambda u, w: 0.3 * math.hypot(u, 2 * w),
    "mu*abs(lambda.first + lambda.second)": lambda u, w: 0.3 * abs(u + w),
    "mu*max(abs(lambda.first), abs(lambda.second))": lambda u, w: 0.3 * max(abs(u), abs(w)),
    "mu*max(3*abs(lambda.first), abs(lambda.second))": lambda u, w: 0.3 * max(3 * abs(u), abs(w)),
    "mu*sqrt(abs(lambda.first*lambda.second))": lambda u, w: 0.3 * math.sqrt(abs(u * w)),
}


@pytest.mark.parametrize("law", LAWS_OF_TWO)
def test_friction_by_two_forces_sticks_below_its_limit(law: str) -> None:
    """A block in two guides sticks while |F| is below the limit, else F less this moves it."""
    for u, w in ((3.0, 4.0), (-5.0, 1.0), (1.0, -5.0), (-2.0, -2.5), (0.25, 6.0)):
        limit = LAWS_OF_TWO[law](u, w)
        for force in (0.99 * limit, -0.99 * limit, 1.01 * limit, -limit - 1):
            run = lagcli.simulate(
                lagcli.load_text(
                    "coordinates: [x, y, z]\n"
                    f"parameters: {{u: {u}, w: {w}, F: {force!r}, mu: 0.3}}\n"
                    "T: 1/2*(x'^2 + y'^2 + z'^2)\nQ: {x: F, y: -u, z: -w}\nconstraints:\n"
                    f"  first: y = 0\n  second: z = 0\n  rub: {{expr: x' = 0, limit: {law}}}\n"
                    "initial: {x: 0, y: 0, z: 0, x': 0, y': 0, z': 0}\n"
                    "simulation: {t_end: 1, samples: 3}"
                )
            )
            assert run.status == "completed", run.message
            expected = math.copysign(max(abs(force) - limit, 0.0), force) / 2
            assert run.q[-1, 0] == pytest.approx(expected, abs=1e-9), (u, w, force)


@pytest.mark.parametrize("first", [True, False])
def test_friction_by_the_force_of_a_joint(first: bool) -> None:
    """A pendulum in x, y and φ that starts at rest holds while m g l sin φ ≤ μ r m g."""
    joint = "  pin: C - l*[sin(phi), -cos(phi)] = [0, 0]\n"
    rub = "  rub: {expr: phi' = 0, limit: mu*r*hypot(lambda.pin.x, lambda.pin.y)}\n"
    for angle, slips in ((0.2, False), (0.3, True)):
        model = lagcli.load_text(
            "coordinates: [x, y, phi]\n"
            "parameters: {m: 2, g: 9.81, l: 0.5, mu: 0.25, r: 0.5, J: 0.1}\n"
            "definitions: {C: '[x, y]'}\nT: m/2*dot(C', C') + J/2*phi'^2\nV: m*g*y\nconstraints:\n"
            + (joint + rub if first else rub + joint)
            + f"initial: {{phi: {angle}, phi': 0, x: {{guess: 0}}, y: {{guess: -1}},"
            " x': {guess: 0}, y': {guess: 0}}\nsimulation: {t_end: 0.1, samples: 3}\n"
        )
        run = lagcli.simulate(model)
        assert (run.v[-1, 2] < -1e-3) == slips
        force = run.multipliers[:, list(run.constraints).index("rub")]
        if not slips:
            np.testing.assert_allclose(force, 2 * 9.81 * 0.5 * math.sin(angle), rtol=1e-12)


@pytest.mark.parametrize("part", [-0.8, 0.5, 2.5, 9.0])
def test_a_force_that_a_normal_force_causes(part: float) -> None:
    """A rail that is helped by k λ bears λ = w/(1 + k), and the limit of friction is 0.3 λ."""
    weight, limit = 10.0, 3.0 / (1 + part)
    for force in (0.99 * limit, 1.01 * limit, -2 * limit):
        run = lagcli.simulate(
            lagcli.load_text(
                f"coordinates: [x, y]\nparameters: {{w: {weight}, F: {force!r}, k: {part}}}\n"
                "T: (x'^2 + y'^2)/2\nV: w*y\nQ: {x: F, y: k*lambda.rail}\nconstraints:\n"
                "  rail: y = 0\n  rub: {expr: x' = 0, limit: 0.3*abs(lambda.rail)}\n"
                "initial: {x: 0, y: 0, x': 0, y': 0}\nsimulation: {t_end: 1, samples: 3}"
            )
        )
        assert run.multipliers[0, 0] == pytest.approx(weight / (1 + part), rel=1e-12)
        moved = max(abs(force) - limit, 0) / 2 * np.sign(force)
        assert run.q[-1, 0] == pytest.approx(moved, abs=1e-9)


@pytest.mark.parametrize("exponent", [-40, 0, 40])
def test_a_force_that_moves_nothing_obeys_its_law(exponent: int) -> None:
    """A force k λ² helps a rail, which bears λ = w - k λ²; friction is 0.3 λ."""
    unit = 2.0**exponent
    text = f"""
coordinates: [x, y]
parameters: {{w: {unit!r}, k: {0.1 / unit!r}, m: {unit!r}}}
T: m/2*(x'^2 + y'^2)
V: w*(1 + t)*y
Q: {{x: -0.3*lambda.rail, y: k*lambda.rail^2}}
constraints: {{rail: y = 0}}
initial: {{x: 0, y: 0, x': 1, y': 0}}
simulation: {{t_end: 1, samples: 21}}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    bears = (np.sqrt(1 + 0.4 * (1 + run.time)) - 1) / 0.2
    np.testing.assert_allclose(run.multipliers[:, 0] / unit, bears, rtol=1e-13)
    np.testing.assert_allclose(run.a[:, 0], -0.3 * bears, rtol=1e-13)


@pytest.mark.parametrize("slides", [False, True])
def test_an_engaged_row_that_others_imply(slides: bool) -> None:
    """A pendulum whose rod, a circle, holds already: its rate bears nothing, and moves nothing."""
    text = """
coordinates: [x, y, z]
parameters: {l: 1.3}
T: (x'^2 + y'^2 + z'^2)/2
V: 9.81*y
Q: {z: 3}
constraints:
  rod: x^2 + y^2 = l^2
  again: {expr: sqrt(x^2 + y^2) = l}
  rate: {expr: x*x' + y*y' = 0, active: false}
  rub: {expr: z' = 0, limit: 2}
initial: {x: 0.7, y: {guess: -1}, z: 0, x': 1, y': {guess: 0}, z': 0}
events:
  hold: {when: t >= 0.2, engage: rate}
  free: {when: t >= 0.7, release: rate}
simulation: {t_end: 1, samples: 11}
"""
    if not slides:
        text = text.replace("z: 3", "z: 1")
    run = lagcli.simulate(lagcli.load_text(text))
    plain = lagcli.simulate(
        lagcli.load_text(text.replace("t >= 0.2", "t >= 9").replace("t >= 0.7", "t >= 9"))
    )
    assert run.status == "completed", run.message
    np.testing.assert_allclose(run.q, plain.q, rtol=0, atol=1e-9)
    assert run.q[-1, 2] == pytest.approx(0.5 if slides else 0.0, abs=1e-9)
