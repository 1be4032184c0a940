"""Textbook problems with contacts, as somebody new to the program writes them: closed forms."""

from __future__ import annotations

from math import asin, cos, pi, radians, sin, sqrt, tan

import numpy as np
import pytest

import lagcli
from lagcli.settings.settings import SettingsOverrides
from lagcli.trajectory.trajectory import Trajectory

G = 9.81


def run(text: str, **settings: object) -> Trajectory:
    found = lagcli.simulate(lagcli.load_text(text), SettingsOverrides(rtol=1e-11, **settings))
    assert found.status in ("completed", "stopped-by-event"), found.message
    assert np.abs(found.energy_balance).max() < 1e-9 * np.abs(found.energy_total).max()
    return found


def happened(found: Trajectory, name: str, kind: str) -> list[int]:
    """Return the entries of the log of what happened to a constraint or an event."""
    log = found.events
    assert log is not None
    return [
        i for i, pair in enumerate(zip(log.names, log.kinds, strict=True)) if pair == (name, kind)
    ]


ROD = """
coordinates: {x: m, y: m, theta: rad}
parameters: {m: 3 kg, l: 2 m, g: 9.81 m/s^2, theta_0: 60 deg}
definitions:
  x_A: x - l/2*cos(theta)
  y_B: y - l/2*sin(theta)
T: m/2*(x'^2 + y'^2) + m*l^2/24*theta'^2
V: m*g*y
constraints: {wall: x_A >= 0, floor: y_B >= 0}
initial: {theta: theta_0, x: {guess: 0.4}, y: {guess: 0.8}, theta': 0, x': 0, y': 0,
  wall: closed, floor: closed}
events: {flat: {when: theta <= 0, stop: true}}
simulation: {t_end: 3}
"""


def test_a_rod_in_a_corner_leaves_the_wall() -> None:
    """At two thirds of the height of its start, with ω² = g sin θ0/l; then x' stays."""
    found = run(ROD)
    log = found.events
    (leaves,), (flat,) = happened(found, "wall", "opens"), happened(found, "flat", "event")
    height = sin(radians(60))
    theta = asin(2 / 3 * height)
    assert log.q[leaves][2] == pytest.approx(theta, abs=1e-10)
    omega = -sqrt(G * height / 2)
    assert log.after[leaves][2] == pytest.approx(omega, rel=1e-10)
    speed = -omega * sin(theta)  # of the centre: l/2 = 1 m
    assert log.after[flat][0] == pytest.approx(speed, rel=1e-10)
    # at the end y' = ω l/2, and all energy is in x' and the fall about B
    last = -sqrt(6 * (G * height - speed**2 / 2) / 4)
    assert log.after[flat][2] == pytest.approx(last, rel=1e-10)


DIMER = """
coordinates: {x: m, y: m, phi: rad}
parameters: {m: 10 g, L: 5 cm, g: 9.81 m/s^2, e: 0.7, phi_0: 20 deg, v_0: 1 m/s}
T: m*(x'^2 + y'^2) + m*L^2/4*phi'^2
V: 2*m*g*y
constraints:
  bead_1: {expr: y - L/2*sin(phi) >= 0, restitution: e}
  bead_2: {expr: y + L/2*sin(phi) >= 0, restitution: e}
initial: {x: 0, y: L/2*sin(phi_0), phi: phi_0, x': 0.2, y': -v_0, phi': 0}
simulation: {t_end: 0.3}
"""


def test_a_dimer_bounces_on_one_bead() -> None:
    """Two beads on a massless rod: the mass at the bead is 2 m/(1 + cos² φ)."""
    found = run(DIMER)
    log = found.events
    first = happened(found, "bead_1", "impact")[0]
    assert log.time[first] == 0
    c, m, length, e = cos(radians(20)), 0.01, 0.05, 0.7
    mass = 2 * m / (1 + c * c)
    impulse = mass * (1 + e)
    assert log.impulse[first].tolist() == pytest.approx([impulse, 0], rel=1e-12)
    after = [0.2, -1 + impulse / (2 * m), -length / 2 * c * impulse / (m * length**2 / 2)]
    assert log.after[first].tolist() == pytest.approx(after, rel=1e-12)
    assert log.loss[first] == pytest.approx(mass * (1 - e * e) / 2, rel=1e-12)
    # until the other bead strikes, it turns evenly
    t = log.time[happened(found, "bead_2", "impact")[0]]
    phi = radians(20) + after[2] * t
    y = length / 2 * sin(radians(20)) + after[1] * t - G / 2 * t * t
    assert y + length / 2 * sin(phi) == pytest.approx(0, abs=1e-12)


YOYO = """
coordinates: {y: m, phi: rad}     # y downwards; the string has unwound by r φ
parameters: {m: 50 g, R: 3 cm, r: 5 mm, g: 9.81 m/s^2, P: 0.02 N*s, t_1: 0.5 s}
T: m/2*y'^2 + m*R^2/4*phi'^2
V: -m*g*y
constraints: {string: y <= r*phi}
events: {lift: {when: t >= t_1, impulse: {y: -P}}}
initial: {y: 0, phi: 0, y': 0, phi': 0}
simulation: {times: [0, 0.3, 1.2]}
"""


def test_a_yoyo_s_string_slackens_and_tightens() -> None:
    """Struck from below it flies for 2 P/(m g) while it spins on; then the string jerks."""
    found = run(YOYO)
    log = found.events
    m, r, p, wheel = 0.05, 0.005, 0.02, 0.05 * 0.03**2 / 2
    turning = wheel / r**2  # inertia of the wheel as a mass on the string
    fall = m * G / (m + turning)
    assert found.q[1, 0] == pytest.approx(fall * 0.045, rel=1e-10)
    assert found.multipliers[1, 0] == pytest.approx(-m * (G - fall), rel=1e-10)
    (jerk,) = happened(found, "string", "impact")
    assert log.time[jerk] == pytest.approx(0.5 + 2 * p / (m * G), abs=1e-11)
    spin, down = fall * 0.5, fall * 0.5 + p / m  # r φ' and y' when it is taut again
    both = (m * down + turning * spin) / (m + turning)
    assert log.after[jerk].tolist() == pytest.approx([both, both / r], rel=1e-10)
    assert log.impulse[jerk][0] == pytest.approx(-m * (down - both), rel=1e-10)
    loss = m * turning / (m + turning) * (down - spin) ** 2 / 2
    assert log.loss[jerk] == pytest.approx(loss, rel=1e-10)


WIRE = """
coordinates: {x: m, y: m}
parameters: {m: 0.2 kg, g: 9.81 m/s^2, alpha: 30 deg, mu: 0.4, v_0: 4 m/s}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  wire: {expr: y*cos(alpha) = x*sin(alpha), friction: mu, slip: x'*cos(alpha) + y'*sin(alpha)}
initial: {x: 0, y: 0, x': v_0*cos(alpha), y': v_0*sin(alpha)}
events: {back: {when: x <= 0, stop: true}}
outputs: {s: x*cos(alpha) + y*sin(alpha)}
simulation: {t_end: 5}
"""


def test_a_bead_on_a_rough_wire_comes_back_slower() -> None:
    """Up with g (sin α + μ cos α), down with g (sin α − μ cos α)."""
    found = run(WIRE)
    log = found.events
    up, down = (G * (sin(pi / 6) + sign * 0.4 * cos(pi / 6)) for sign in (1, -1))
    top = 16 / (2 * up)
    (turns,), (back,) = happened(found, "wire.slip", "slips"), happened(found, "back", "event")
    assert log.time[turns] == pytest.approx(4 / up, abs=1e-10)
    assert log.q[turns].tolist() == pytest.approx([top * cos(pi / 6), top / 2], rel=1e-10)
    assert log.time[back] == pytest.approx(4 / up + sqrt(2 * top / down), abs=1e-10)
    assert log.after[back][0] == pytest.approx(-sqrt(2 * down * top) * cos(pi / 6), rel=1e-10)


def test_a_bead_on_a_rougher_wire_stays() -> None:
    assert tan(pi / 6) < 0.7
    found = run(WIRE.replace("mu: 0.4", "mu: 0.7"))
    (sticks,) = happened(found, "wire.slip", "sticks")
    up = G * (sin(pi / 6) + 0.7 * cos(pi / 6))
    assert found.events.time[sticks] == pytest.approx(4 / up, abs=1e-10)
    assert found.outputs["s"][-1] == pytest.approx(8 / up, rel=1e-10)
    # friction bears the weight along the wire, no more
    assert found.multipliers[-1, 1] == pytest.approx(0.2 * G / 2, rel=1e-9)


BILLIARD = """
coordinates: {x: m, y: m, phi: rad}
parameters: {m: 170 g, r: 28.6 mm, g: 9.81 m/s^2, mu: 0.2, v_0: 2 m/s, w: 0 rad/s}
T: m/2*(x'^2 + y'^2) + m*r^2/5*phi'^2
V: m*g*y
constraints:
  table: {expr: y >= r, friction: mu, slip: x' - r*phi'}
initial: {x: 0, y: r, phi: 0, x': v_0, y': 0, phi': w}
simulation: {t_end: 3}
"""


@pytest.mark.parametrize("spin", [0.0, 60.0, -300.0])  # plain, follow, draw
def test_a_billiard_ball_slides_then_rolls(spin: float) -> None:
    """Rolls at 5/7 v0 + 2/7 r ω0; a draw shot comes back."""
    found = run(BILLIARD.replace("w: 0", f"w: {spin}"))
    log = found.events
    (rolls,) = happened(found, "table.slip", "sticks")
    surface = 0.0286 * spin
    t = 2 * (2 - surface) / (7 * 0.2 * G)
    speed = 5 / 7 * 2 + 2 / 7 * surface
    assert log.time[rolls] == pytest.approx(t, abs=1e-10)
    assert log.after[rolls][0] == pytest.approx(speed, rel=1e-10)
    x = 2 * t - 0.2 * G * t * t / 2
    assert log.q[rolls][0] == pytest.approx(x, rel=1e-10)
    assert found.q[-1, 0] == pytest.approx(x + speed * (3 - t), rel=1e-9)
    assert (speed < 0) == (spin == -300)


CHAIN = """
coordinates: {"y[1..N]": m}
parameters: {N: 6, m: 0.3 kg, a: 0.2 m, h: 0.1 m, g: 9.81 m/s^2}
T: sum(m/2*y[i]'^2, i = 1..N)
V: sum(m*g*y[i], i = 1..N)
constraints:
  link[i = 1..N-1]: y[i+1] - y[i] <= a
  table[i = 1..N]: y[i] >= 0
initial: {"y[i = 1..N]": h + (i - 1)*a, "y[1..N]'": 0}
simulation: {t_end: 0.6, samples: 7}
"""


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_a_chain_falls_onto_a_table(rtol: float) -> None:
    """Links are taut without a force: each mass falls freely, and the table takes its momentum."""
    for method in ("DOP853", "Rodas5P"):
        settings = SettingsOverrides(rtol=rtol, method=method)
        found = lagcli.simulate(lagcli.load_text(CHAIN), settings)
        assert found.status == "completed", found.message
        for i in range(6):
            at = happened(found, f"table[{i + 1}]", "impact")
            assert len(at) == 1
            fall = sqrt(2 * (0.1 + 0.2 * i) / G)
            assert found.events is not None
            assert found.events.time[at[0]] == pytest.approx(fall, rel=1e-11)
            lands = found.constraints.index(f"table[{i + 1}]")
            assert found.events.impulse[at[0], lands] == pytest.approx(0.3 * G * fall, rel=1e-11)
