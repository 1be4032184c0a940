"""Mechanisms of textbooks, held to closed forms or to equations in minimal coordinates.

The latter are written here by hand and integrated by SciPy; the multipliers follow from Newton's
law for the motion so found, or from the equation of the coordinate that the constraint takes away.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import lagcli
from lagcli.arrays import Array
from lagcli.trajectory.trajectory import Trajectory

#: Of the largest value: both solutions have a relative tolerance of 1e-9 or less per step.
CLOSE = 1e-7


def run(text: str) -> Trajectory:
    found = lagcli.simulate(lagcli.load_text(text), rtol=1e-11)
    assert found.status == "completed", found.message
    assert found.warnings == ()
    return found


def integrated(f: Callable[[float, Array], Array], t: Array, y: list[float]) -> Array:
    """Return the solution of y' = f(t, y) at times, (n, times)."""
    found = solve_ivp(f, (t[0], t[-1]), y, "DOP853", t, rtol=1e-12, atol=1e-13)
    return np.asarray(found.y)


def near(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=CLOSE * np.abs(expected).max())


def of(run: Trajectory, name: str) -> Array:
    """Return a coordinate, a velocity or a multiplier by its name."""
    base = name.removesuffix("'")
    if base in run.constraints:
        return np.asarray(run.multipliers[:, run.constraints.index(base)])
    values = run.v if name.endswith("'") else run.q
    return np.asarray(values[:, run.coordinates.index(base)])


PEAUCELLIER = """
coordinates: {phi: rad, C: point, D: point, P: point}
parameters: {a: 0.1 m, l: 0.3 m, s: 0.12 m, m: 1 kg, w: 2 rad/s}
definitions: {B: "[a + a*cos(phi), a*sin(phi), 0]"}
T: m/2*dot(C', C') + m/2*dot(D', D') + m/2*dot(P', P') + m/2*dot(B', B')
constraints:
  OC: dot(C, C) = l^2
  OD: dot(D, D) = l^2
  BC: dot(C - B, C - B) = s^2
  BD: dot(D - B, D - B) = s^2
  PC: dot(P - C, P - C) = s^2
  PD: dot(P - D, P - D) = s^2
  flat: [C.z, D.z, P.z] = 0
initial:
  phi: 0.3 rad
  C: {guess: [0.25, 0.16, 0]}
  D: {guess: [0.29, -0.06, 0]}
  P: {guess: [0.36, 0.1, 0]}
  phi': 1 rad/s
  C': {guess: 0}
  D': {guess: 0}
  P': {guess: 0}
simulation: {t_end: 0.6, samples: 13}
"""


def linkage(phi: float) -> tuple[Array, Array, Array]:
    """Return C, D and P of Peaucellier's linkage by its geometry."""
    b = 0.1 * np.array([1 + np.cos(phi), np.sin(phi)])
    far = np.linalg.norm(b)
    along = (far**2 + 0.3**2 - 0.12**2) / (2 * far)
    aside = np.sqrt(0.3**2 - along**2)
    e, n = b / far, np.array([-b[1], b[0]]) / far
    return along * e + aside * n, along * e - aside * n, b * (0.3**2 - 0.12**2) / far**2


def test_peaucellier_s_linkage_draws_a_straight_line() -> None:
    """OB OP = l² - s²; with B on a circle through O, P moves on a straight line."""
    found = run(PEAUCELLIER)
    near(of(found, "P.x"), np.full(len(found.time), (0.3**2 - 0.12**2) / 0.2))

    def places(phi: float) -> Array:
        b = 0.1 * np.array([1 + np.cos(phi), np.sin(phi)])
        return np.concatenate([b, *linkage(phi)])

    h = 1e-3

    def slope(f: Callable[[float], Array], x: float) -> Array:
        parts = ((1, 672), (2, -168), (3, 32), (4, -3))
        return sum(w * (f(x + k * h) - f(x - k * h)) for k, w in parts) / (840 * h)

    def inertia(phi: float) -> Array:
        return np.asarray(slope(places, phi) @ slope(places, phi))

    def rates(_: float, y: Array) -> Array:
        return np.array([y[1], -slope(inertia, y[0]) / (2 * inertia(y[0])) * y[1] ** 2])

    phi, rate = integrated(rates, found.time, [0.3, 1.0])
    near(of(found, "phi"), phi)
    curved = [slope(lambda x: slope(places, x), x) for x in phi]
    moving = [rates(0.0, np.array(y))[1] for y in zip(phi, rate, strict=True)]
    for i, (x, w, a) in enumerate(zip(phi, rate, moving, strict=True)):
        c, d, p = linkage(x)
        acceleration = (slope(places, x) * a + curved[i] * w**2)[6:]
        forces = np.linalg.solve(2 * np.column_stack([p - c, p - d]), acceleration)
        np.testing.assert_allclose(
            forces, [of(found, "PC")[i], of(found, "PD")[i]], rtol=1e-6, atol=1e-6
        )


WHITWORTH = """
name: Whitworth quick return
coordinates: {phi: rad, theta: rad, rho: m}
parameters: {J: 0.2 kg*m^2, m: 1 kg, r: 0.1 m, d: 0.25 m, w: 6 rad/s}
definitions:
  P: [r*cos(phi), d + r*sin(phi)]
T: J/2*theta'^2 + m/2*dot(P', P')
constraints:
  crank: phi = w*t
  slot: P = [rho*cos(theta), rho*sin(theta)]
initial:
  phi: {guess: 0}
  theta: {guess: 1}
  rho: {guess: 0.3}
  phi': {guess: 6}
  theta': {guess: 0}
  rho': {guess: 0}
simulation: {t_end: 2, samples: 201}
"""


def test_whitworth_s_quick_return() -> None:
    found = run(WHITWORTH)
    t, r, d, w, inertia = found.time, 0.1, 0.25, 6.0, 0.2
    x, y = r * np.cos(w * t), d + r * np.sin(w * t)
    near(of(found, "rho"), np.hypot(x, y))
    near(of(found, "theta"), np.arctan2(y, x))
    # with u = rho^2: theta' = r w (r + d sin w t)/u; the crank's torque is what the lever takes
    u = r * r + d * d + 2 * r * d * np.sin(w * t)
    rate = r * w * (r + d * np.sin(w * t)) / u
    down = 2 * r * d * w * np.cos(w * t)
    second = r * w * w * d * np.cos(w * t) / u - rate * down / u
    near(of(found, "theta'"), rate)
    near(of(found, "crank") * w, inertia * rate * second)


CARDAN = """
name: double Cardan joint
coordinates: {A: quaternion, B: quaternion, C: quaternion}
parameters: {b: 30 deg, J: 0.1 kg*m^2, w: 5 rad/s}
definitions:
  z: [0, 0, 1]
  y: [0, 1, 0]
  x: [1, 0, 0]
  axis: rot_y(b)*z
T: J/2*(dot(omega(A), omega(A)) + dot(omega(B), omega(B)) + dot(omega(C), omega(C)))
constraints:
  first: [(A*z).x, (A*z).y] = 0
  middle: [dot(B*z, rot_y(b)*x), dot(B*z, y)] = 0
  last: [(C*z).x, (C*z).y] = 0
  joint: dot(A*x, B*y) = 0
  other: dot(B*y, C*x) = 0
initial:
  A: 1
  B: {guess: rot_y(b)}
  C: {guess: 1}
  A': [0, 0, w]
  B': {guess: [0, 0, w]}
  C': {guess: [0, 0, w]}
simulation: {t_end: 1, samples: 101}
"""


def test_a_double_cardan_joint_keeps_the_speed() -> None:
    """Two joints in opposite phase: the last shaft turns as the first, the middle one does not."""
    found = run(CARDAN)
    b = np.radians(30)
    a0, a3, c0, c3 = (of(found, name) for name in ("A.0", "A.3", "C.0", "C.3"))
    angle = np.unwrap(2 * np.arctan2(a3, a0))
    near(np.unwrap(2 * np.arctan2(c3, c0)), angle)

    def ratio(x: Array | float) -> Array:
        """Return the middle shaft's speed over the first's; its cross axis is A's x axis."""
        return np.asarray(np.cos(b) / (1 - np.sin(b) ** 2 * np.cos(x) ** 2))

    energy = 5.0**2 * (2 + ratio(0.0) ** 2)
    turned = integrated(lambda _, y: np.sqrt(energy / (2 + ratio(y) ** 2)), found.time, [0.0])
    near(angle, turned[0])
    # the first joint turns the first shaft: lambda (A x) x (B y) along its axis
    slope = -2 * np.sin(b) ** 2 * np.sin(angle) * np.cos(angle) * ratio(angle) ** 2 / np.cos(b)
    speed = np.sqrt(energy / (2 + ratio(angle) ** 2))
    acceleration = -(speed**2) * ratio(angle) * slope / (2 + ratio(angle) ** 2)
    q = np.array([of(found, f"B.{i}") for i in range(4)])
    pin = np.array([2 * (q[1] * q[2] - q[0] * q[3]), 1 - 2 * (q[1] ** 2 + q[3] ** 2)])
    lever = np.cos(angle) * pin[1] - np.sin(angle) * pin[0]
    near(of(found, "joint") * lever, 0.1 * acceleration)


TOP = """
name: gyroscopic pendulum
coordinates: {e: quaternion}
parameters: {m: 2 kg, l: 0.3 m, A: 0.25 kg*m^2, C: 0.02 kg*m^2, g: 9.81 m/s^2}
T: dot(omega(e), diag(A, A, C)*omega(e))/2
V: m*g*l*(e*[0, 0, 1]).z
initial: {e: rot_x(2), e': [0.3, 0, 40]}
simulation: {t_end: 1, samples: 101}
"""


def test_a_gyroscopic_pendulum_in_quaternions_is_that_in_euler_s_angles() -> None:
    found = run(TOP)
    weight, a, c = 2 * 0.3 * 9.81, 0.25, 0.02
    spin, tilt = c * 40.0, 2.0  # the moment of momentum along the axis, and the angle to it
    vertical = spin * np.cos(tilt)

    def rates(_: float, y: Array) -> Array:
        s, k = np.sin(y[0]), np.cos(y[0])
        turn = (vertical - spin * k) / (a * s * s)
        return np.array([y[1], turn * turn * s * k - spin * turn * s / a + weight * s / a, turn])

    theta, _, psi = integrated(rates, found.time, [tilt, 0.3, 0.0])
    e = [of(found, f"e.{i}") for i in range(4)]
    near(1 - 2 * (e[1] ** 2 + e[2] ** 2), np.cos(theta))
    near(2 * (e[1] * e[3] + e[0] * e[2]), np.sin(theta) * np.sin(psi))
    near(2 * (e[2] * e[3] - e[0] * e[1]), -np.sin(theta) * np.cos(psi))


CYLINDER = """
name: ball rolling inside a vertical cylinder
coordinates: {r: point, e: quaternion}
parameters: {m: 0.5 kg, a: 0.02 m, R: 0.22 m, g: 9.81 m/s^2, W: 3 rad/s}
definitions:
  n: "[r.x/(R - a), r.y/(R - a), 0]"
  J: 2/5*m*a^2*diag(1, 1, 1)
  w: e*omega(e)
T: body(m, J, r, e)
V: m*g*r.z
constraints:
  wall: r.x^2 + r.y^2 = (R - a)^2
  roll_t: r.x'*(-r.y) + r.y'*r.x + cross(w, a*n).x*(-r.y) + cross(w, a*n).y*r.x = 0
  roll_z: r.z' + cross(w, a*n).z = 0
initial:
  r: [R - a, 0, 0]
  e: 1
  r': [0, W*(R - a), 0]
  e': {guess: 0}
simulation: {t_end: 0.8, samples: 41}
"""


def test_a_ball_in_a_vertical_cylinder_does_not_fall_down() -> None:
    """Routh: it goes up and down with sqrt(2/7) of its angular velocity about the axis."""
    found = run(CYLINDER)
    t, around = found.time, 3.0
    near(of(found, "r.x"), 0.2 * np.cos(around * t))
    near(of(found, "r.z"), -5 * 9.81 / (2 * around**2) * (1 - np.cos(np.sqrt(2 / 7) * around * t)))
    near(of(found, "wall"), np.full(len(t), -0.5 * around**2 / 2))


CHAIN = """
name: chain sliding over a table edge
coordinates: {x: m, y: m}
parameters: {L: 2 m, rho: 1.5 kg/m, g: 9.81 m/s^2, x0: 0.1 m}
T: rho*L/4*(x'^2 + y'^2)
V: -rho*g*x^2/2
constraints: {length: x + y = L}
initial: {x: x0, y: {guess: 1}, x': 0, y': {guess: 0}}
simulation: {t_end: 1.2, samples: 121}
"""


def test_a_chain_slides_over_the_edge_of_a_table() -> None:
    found = run(CHAIN)
    rate = np.sqrt(9.81 / 2)
    near(of(found, "x"), 0.1 * np.cosh(rate * found.time))
    near(of(found, "length"), -1.5 * rate**2 * 0.1 * np.cosh(rate * found.time))


KAPITZA = """
name: Kapitza pendulum
coordinates: [x, y]
parameters: {l: 0.2 m, m: 0.3 kg, a: 0.01 m, w: 400 rad/s, g: 9.81 m/s^2}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {rod: x^2 + (y - a*cos(w*t))^2 = l^2}
initial: {x: 0.04, y: {guess: 0.2}, x': {guess: 0}, y': 0}
simulation: {t_end: 0.5, samples: 101}
"""


def test_kapitza_s_pendulum_stands() -> None:
    found = run(KAPITZA)
    length, mass, a, w, g = 0.2, 0.3, 0.01, 400.0, 9.81

    def felt(t: Array | float) -> Array:
        return np.asarray(g - a * w * w * np.cos(w * t))

    x, y = 0.04, of(found, "y")[0] - a
    start = [np.arctan2(x, y), of(found, "x'")[0] / y]
    theta, rate = integrated(
        lambda t, z: np.array([z[1], felt(t) / length * np.sin(z[0])]), found.time, start
    )
    near(of(found, "x"), length * np.sin(theta))
    assert np.abs(theta).max() < 0.3
    near(of(found, "rod"), mass * (felt(found.time) * np.cos(theta) / length - rate**2) / 2)


SWINGING_ATWOOD = """
name: swinging Atwood machine
coordinates: {x: m, y: m, z: m}
parameters: {m: 1 kg, M: 3 kg, L: 3 m, g: 9.81 m/s^2}
T: m/2*(x'^2 + y'^2) + M/2*z'^2
V: m*g*y - M*g*z
constraints: {rope: norm([x, y]) + z = L}
initial: {x: 1, y: 0, z: {guess: 2}, x': 0, y': 0, z': {guess: 0}}
simulation: {t_end: 1.5, samples: 151}
"""


def test_a_swinging_atwood_machine() -> None:
    found = run(SWINGING_ATWOOD)
    m, heavy, g = 1.0, 3.0, 9.81

    def pull(y: Array) -> Array:
        r, _, theta, rate = y
        return np.asarray((m * r * rate**2 - heavy * g + m * g * np.cos(theta)) / (m + heavy))

    def rates(_: float, y: Array) -> Array:
        r, speed, theta, rate = y
        return np.array([speed, pull(y), rate, -(2 * speed * rate + g * np.sin(theta)) / r])

    y = integrated(rates, found.time, [1.0, 0.0, np.pi / 2, 0.0])
    near(of(found, "x"), y[0] * np.sin(y[2]))
    near(of(found, "y"), -y[0] * np.cos(y[2]))
    near(of(found, "rope"), heavy * (-pull(y) - g))


ROTT = """
name: Rott's pendulum
coordinates: [x1, y1, phi]
parameters: {m: 1 kg, M: 0.6 kg, a: 0.3 m, b: 0.25 m, c: 0.2 m, g: 9.81 m/s^2}
definitions:
  P: [x1, y1]
  u: P/a
  C: "[b*u.y, -b*u.x]"      # a quarter turn from OP
  Q: C + [c*sin(phi), -c*cos(phi)]
T: m/2*dot(P', P') + M/2*dot(Q', Q')
V: m*g*P.y + M*g*Q.y
constraints: {arm: "dot(P, P) = a^2"}
initial: {x1: {guess: 0.1}, y1: -0.2, phi: 1, x1': {guess: 0}, y1': 0, phi': 0}
simulation: {t_end: 1.5, samples: 151}
"""


def test_rott_s_pendulum() -> None:
    """Two links at a right angle, one more at the end of the second: in their angles.

    The multiplier is that of the length of the first link, which is a coordinate for it.
    """
    found = run(ROTT)
    t = sp.Symbol("t")
    length, alpha, phi = (sp.Function(x)(t) for x in ("length", "alpha", "phi"))
    p = sp.Matrix([length * sp.sin(alpha), -length * sp.cos(alpha)])
    joint = sp.Rational(25, 30) * sp.Matrix([p[1], -p[0]])
    end = joint + sp.Rational(1, 5) * sp.Matrix([sp.sin(phi), -sp.cos(phi)])
    mass, g = sp.Rational(3, 5), sp.Float("9.81", 20)
    kinetic = (p.diff(t).dot(p.diff(t)) + mass * end.diff(t).dot(end.diff(t))) / 2
    lagrangian = kinetic - g * p[1] - mass * g * end[1]
    every = (length, alpha, phi)
    equations = [lagrangian.diff(x.diff(t)).diff(t) - lagrangian.diff(x) for x in every]
    known = {length.diff(t, 2): 0, length.diff(t): 0, length: sp.Rational(3, 10)}
    names = sp.symbols("aa pa av pv al ph")
    second = [alpha.diff(t, 2), phi.diff(t, 2), alpha.diff(t), phi.diff(t), alpha, phi]
    plain = []
    for equation in equations:
        for part in (
            known,
            dict(zip(second[:2], names[:2], strict=True)),
            dict(zip(second[2:4], names[2:4], strict=True)),
            dict(zip(second[4:], names[4:], strict=True)),
        ):
            equation = equation.subs(part)
        plain.append(equation)
    matrix, right = sp.linear_eq_to_matrix(plain[1:], names[:2])
    numbers = sp.lambdify(names[2:], [matrix, right])

    def rates(_: float, y: Array) -> Array:
        m, f = numbers(y[2], y[3], y[0], y[1])
        return np.array([y[2], y[3], *np.linalg.solve(m, f).ravel()])

    x = of(found, "x1")
    y = integrated(rates, found.time, [np.arctan2(x[0], 0.2), 1.0, 0.0, 0.0])
    near(x, 0.3 * np.sin(y[0]))
    near(of(found, "phi"), y[1])
    accelerations = np.array([rates(0.0, z)[2:] for z in y.T]).T
    along = sp.lambdify(names, plain[0])(*accelerations, y[2], y[3], y[0], y[1])
    near(of(found, "arm") * 2 * 0.3, along)


FOUCAULT = """
name: Foucault pendulum
coordinates: {r: point}
parameters: {m: 1 kg, l: 10 m, g: 9.81 m/s^2, W: 0.05 rad/s, beta: 50 deg}
definitions:
  O: "[-W*cos(beta), 0, W*sin(beta)]"
  v: r' + cross(O, r)
T: m/2*dot(v, v)
V: m*g*r.z + m/2*dot(cross(O, r), cross(O, r))
constraints: {rod: "dot(r, r) = l^2"}
initial: {r: [0.1 m, 0, {guess: -10}], r': [0, 0, {guess: 0}]}
simulation: {t_end: 20, samples: 101}
"""


def test_foucault_s_pendulum() -> None:
    found = run(FOUCAULT)
    turn = 0.05 * np.array([-np.cos(np.radians(50)), 0, np.sin(np.radians(50))])

    def force(y: Array) -> tuple[Array, float]:
        """Return the force per mass, and the multiplier that keeps r·r: r·r'' = -r'·r'."""
        r, v = y[:3], y[3:]
        free = np.array([0, 0, -9.81]) - 2 * np.cross(turn, v)
        factor = -(v @ v + r @ free) / 200
        return free + 2 * factor * r, factor

    z = -np.sqrt(100 - 0.01)
    y = integrated(
        lambda _, y: np.concatenate([y[3:], force(y)[0]]), found.time, [0.1, 0, z, 0, 0, 0]
    )
    near(found.q, y[:3].T)
    near(of(found, "rod"), np.array([force(x)[1] for x in y.T]))
    # to the first order, its plane turns by the vertical part, against the earth
    east, north = found.q[:, 0], found.q[:, 1]
    i = int(np.argmax(np.hypot(east, north)[-30:])) + len(east) - 30
    plane = np.arctan2(north[i], east[i])
    expected = -turn[2] * found.time[i]
    assert abs((plane - expected + np.pi / 2) % np.pi - np.pi / 2) < 2e-2


CYCLOID = """
name: cycloidal pendulum
coordinates: [x, y, theta]
parameters: {m: 1 kg, a: 0.25 m, g: 9.81 m/s^2}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  cx: x = a*(theta + sin(theta))
  cy: y = -a*(1 + cos(theta))
initial: {x: {guess: 0}, y: {guess: 0}, theta: 1.5, x': {guess: 0}, y': {guess: 0}, theta': 0}
simulation: {t_end: 5, samples: 501}
"""


def test_huygens_pendulum_is_isochronous() -> None:
    """The arc from the lowest point, 4 a sin(theta/2), oscillates as a spring, however far."""
    found = run(CYCLOID)
    a, g, t = 0.25, 9.81, found.time
    w = np.sqrt(g / (4 * a))
    top = np.sin(0.75)
    half = np.arcsin(top * np.cos(w * t))
    near(of(found, "theta"), 2 * half)
    # s = sin(theta/2): theta = 2 asin s, x = a (theta + sin theta), y = -a (1 + cos theta)
    s, ds, dds = (top * x for x in (np.cos(w * t), -w * np.sin(w * t), -w * w * np.cos(w * t)))
    near(of(found, "cy") - g, 4 * a * (ds**2 + s * dds))
    root = np.sqrt(1 - s * s)
    near(of(found, "cx"), 4 * a * (root * dds - s * ds**2 / root))


TRAMMEL = """
name: trammel of Archimedes
coordinates: [x, y, A, B]
parameters: {m: 2 kg, l: 0.5 m, J: m*l^2/12}
T: m/2*(x'^2 + y'^2) + J/2*(A'^2 + B'^2)/l^2
V: 0
constraints:
  mx: 2*x = A
  my: 2*y = B
  rod: A^2 + B^2 = l^2
initial:
  {A: 0.3, B: {guess: 0.4}, x: {guess: 0.1}, y: {guess: 0.2},
  A': {guess: -2}, B': 1.8, x': {guess: 0}, y': {guess: 0}}
simulation: {t_end: 2, samples: 201}
"""


def test_the_trammel_of_archimedes_turns_evenly() -> None:
    found = run(TRAMMEL)
    length, mass, inertia, t = 0.5, 2.0, 2.0 * 0.25 / 12, found.time
    rate = 1.8 / 0.3
    angle = np.arctan2(0.4, 0.3) + rate * t
    near(of(found, "A"), 0.5 * np.cos(angle))
    near(of(found, "y"), 0.25 * np.sin(angle))
    force = -mass * length / 4 * rate**2  # of the middle of the rod
    near(of(found, "mx"), force * np.cos(angle))
    near(of(found, "my"), force * np.sin(angle))
    ends = -inertia / length**2 * rate**2 + force / length  # over the coordinate
    near(of(found, "rod"), np.full(len(t), ends / 2))


CONE = """
name: bead in a rotating cone
coordinates: {r: point}
parameters: {m: 0.1 kg, alpha: 35 deg, g: 9.81 m/s^2}
T: m/2*dot(r', r')
V: m*g*r.z
constraints: {wall: r.z*tan(alpha) = norm([r.x, r.y])}
initial: {r: [0.3 m, 0, {guess: 0.4}], r': [0.2 m/s, 1.5 m/s, {guess: 0}]}
simulation: {t_end: 4, samples: 401}
"""


def test_a_bead_on_a_cone() -> None:
    found = run(CONE)
    slope = np.tan(np.radians(35))
    moment = 0.3 * 1.5

    def second(r: Array) -> Array:
        return np.asarray((moment**2 / r**3 - 9.81 / slope) / (1 + 1 / slope**2))

    def rates(_: float, y: Array) -> Array:
        return np.array([y[1], second(y[0]), moment / y[0] ** 2])

    r, _, angle = integrated(rates, found.time, [0.3, 0.2, 0.0])
    near(found.q, np.column_stack([r * np.cos(angle), r * np.sin(angle), r / slope]))
    near(of(found, "wall"), 0.1 * (9.81 + second(r) / slope) / slope)
