"""Steady motions along symmetries, against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from random_cases import seeds

import lagcli
from lagcli.errors import ModelError, NumericalError, UsageError

MODELS = Path(__file__).parents[2] / "models"

#: A spherical pendulum in Cartesian coordinates.
PENDULUM = """
coordinates: [x, y, z]
parameters: {m: 2, l: 0.5, g: 9.81}
T: m/2*(x'^2 + y'^2 + z'^2)
V: m*g*z
constraints: {rod: x^2 + y^2 + z^2 = l^2}
"""

#: A symmetric top whose tip is fixed.
TOP = """
coordinates: {e: quaternion}
parameters: {I1: 0.05 kg*m^2, I3: 0.02 kg*m^2, m: 1 kg, l: 0.3 m, g: 9.81 m/s^2}
definitions:
  w: omega(e)
  r: e*[0, 0, l]
T: 1/2*(I1*(w.x^2 + w.y^2) + I3*w.z^2)
V: m*g*r.z
"""

#: A free rigid body.
BODY = """
coordinates: {r: point, e: quaternion}
parameters: {A: 1 kg*m^2, B: 2 kg*m^2, C: 2.5 kg*m^2, m: 3 kg}
definitions: {w: omega(e)}
T: m/2*dot(r', r') + 1/2*(A*w.x^2 + B*w.y^2 + C*w.z^2)
V: 0
initial: {r: [0 m, 0 m, 0 m], r': [0 m/s, 0 m/s, 0 m/s], e: [0.6, 0, 0.8, 0], e': [0, 0, 0]}
"""


def pendulum(angle: float, **values: float) -> lagcli.Model:
    l = values.get("l", 0.5)
    start = f"x: {l * math.sin(angle)!r}, y: 0, z: {-l * math.cos(angle)!r}"
    text = PENDULUM + f"initial: {{{start}, x': 0, y': 0, z': 0}}\n"
    return lagcli.load_text(text, set={name: repr(x) for name, x in values.items()})


@pytest.mark.parametrize("seed", seeds(5, 8))
def test_conical_pendulum_in_cartesian_coordinates(seed: int) -> None:
    # cos θ = g/(l ω²); nutation ω² (1 + 3 cos²θ)
    random = np.random.default_rng(seed)
    m, l, g = random.uniform(0.1, 5), random.uniform(0.1, 3), random.uniform(1, 20)
    angle = random.uniform(0.3, 1.4)
    rate = math.sqrt(g / (l * math.cos(angle)))
    model = pendulum(random.uniform(0.3, 1.4), m=m, l=l, g=g)
    momentum = m * l**2 * math.sin(angle) ** 2 * rate
    given: list[dict[str, float | None]] = [
        {"rate(J_1)": rate},
        {"z": -l * math.cos(angle)},  # the speed is looked for
        {"z": -l * math.cos(angle), "y'": None},
        {"J_1": momentum},
        {"x*y' - y*x'": momentum / m},
    ]
    for steady in given:
        (one,) = lagcli.equilibrium(model, steady=steady).equilibria
        point = one.operating_point.point
        assert one.speeds["rate(J_1)"] ** 2 == pytest.approx(rate**2, rel=1e-9)
        assert point.q[2] == pytest.approx(-l * math.cos(angle), rel=1e-9)
        assert point.multipliers[0] == pytest.approx(-m * rate**2 / 2, rel=1e-9)
        assert one.stability.verdict == "stable"
        largest = np.abs(one.stability.eigenvalues).max()
        nutation = rate * math.sqrt(1 + 3 * math.cos(angle) ** 2)
        assert largest == pytest.approx(nutation, rel=1e-9)


def test_a_steady_motion_is_that_of_the_simulation() -> None:
    model = pendulum(1.0)
    (one,) = lagcli.equilibrium(model, steady={"rate(J_1)": 7.0}).equilibria
    point = one.operating_point.point
    names = model.coordinate_names
    start = {name: repr(x) for name, x in zip(names, point.q.tolist(), strict=True)}
    start |= {f"{name}'": repr(x) for name, x in zip(names, point.v.tolist(), strict=True)}
    moved = lagcli.load_text(model.text, set_initial=start)
    run = lagcli.simulate(moved, t_end=2.0, samples=50, rtol=1e-10)
    np.testing.assert_allclose(run.q[:, 2], point.q[2], rtol=1e-7)
    turned = math.hypot(*point.q[:2]) * np.cos(7.0 * run.time + math.atan2(*point.q[1::-1]))
    np.testing.assert_allclose(run.q[:, 0], turned, atol=1e-7)
    np.testing.assert_allclose(run.multipliers[:, 0], point.multipliers[0], rtol=1e-6)


def test_velocities_that_turn_are_those_of_a_motion_along_a_symmetry() -> None:
    (one,) = lagcli.equilibrium(pendulum(0.6), steady={"y'": 2.0}).equilibria
    q, v = one.operating_point.point.q, one.operating_point.point.v
    assert v[1] == pytest.approx(2.0, rel=1e-10)
    assert one.speeds["rate(J_1)"] ** 2 == pytest.approx(-9.81 / q[2], rel=1e-9)


def test_a_branch_over_a_rate_ends_in_the_hanging_pendulum() -> None:
    model = pendulum(1.2)
    diagram = lagcli.follow_equilibria(model, "rate(J_1)", 9.0, 4.5)
    (branch,) = diagram.branches
    assert branch.parameter[-1] == pytest.approx(4.5, rel=1e-12)
    np.testing.assert_allclose(-branch.q[:, 2], 9.81 / branch.parameter**2, rtol=1e-9)
    assert set(branch.stability) == {"stable"}
    longer = lagcli.follow_equilibria(model, "l", 0.5, 0.9, steady={"rate(J_1)": 9.0})
    (branch,) = longer.branches
    np.testing.assert_allclose(-branch.q[:, 2], 9.81 / 81, rtol=1e-9)
    # the momentum m l² sin²θ ω contains the parameter m
    heavier = lagcli.follow_equilibria(model, "m", 2.0, 4.0, steady={"J_1": 1.0})
    (branch,) = heavier.branches
    cosine = -branch.q[:, 2] / 0.5
    rate = np.sqrt(9.81 / (0.5 * cosine))
    np.testing.assert_allclose(branch.parameter * 0.25 * (1 - cosine**2) * rate, 1.0, rtol=1e-8)


def top(set: dict[str, str] | None = None, tilt: float = 0.0) -> lagcli.Model:
    start = f"[{math.cos(tilt / 2)!r}, {math.sin(tilt / 2)!r}, 0, 0]"
    text = TOP + f"initial: {{e: {start}, e': [0, 0, 0]}}\n"
    return lagcli.load_text(text, set=set)


@pytest.mark.parametrize("seed", seeds(3, 5))
def test_sleeping_top_loses_its_stability_at_the_spin_of_the_closed_form(seed: int) -> None:
    # ω² = 4 m g l I1/I3²
    random = np.random.default_rng(seed)
    m, l, g = random.uniform(0.5, 3), random.uniform(0.1, 0.5), random.uniform(5, 15)
    i1, i3 = random.uniform(0.01, 0.1), random.uniform(0.01, 0.1)
    critical = math.sqrt(4 * m * g * l * i1) / i3
    values = {"m": f"{m} kg", "l": f"{l} m", "g": f"{g} m/s^2"}
    values |= {"I1": f"{i1} kg*m^2", "I3": f"{i3} kg*m^2"}
    model = top(values)
    for factor, verdict in ((1.01, "linearly stable"), (0.99, "unstable")):
        given = {"omega(e).z": factor * critical}
        (one,) = lagcli.equilibrium(model, steady=given).equilibria
        assert one.stability.verdict == verdict
    diagram = lagcli.follow_equilibria(model, "omega(e).z", 1.7 * critical, 0.4 * critical)
    (point,) = diagram.special
    assert (point.kind, point.stability) == ("flutter", ("linearly stable", "unstable"))
    assert point.parameter == pytest.approx(critical, rel=1e-9)
    # the frequency in fixed axes, which the spin leaves alone: I3 ω/(2 I1)
    assert point.frequency == pytest.approx(i3 * critical / (2 * i1), rel=1e-5)


def test_steady_precession_of_a_top() -> None:
    # (I1 Ω² cos θ − I3 ω Ω + m g l) = 0 with ω the spin about the body's axis
    model, tilt, precession = top(tilt=0.9), 0.9, 3.0
    spin = (0.05 * precession**2 * math.cos(tilt) + 9.81 * 0.3) / (0.02 * precession)
    for steady in (
        {
            "rate(J_1)": None,
            "rate(J_2)": None,
            "omega(e).z": spin,
            "(e*[0, 0, 1]).z": math.cos(tilt),
        },
        {"omega(e).z": spin, "(e*[0, 0, 1]).z": math.cos(tilt)},
    ):
        (one,) = lagcli.equilibrium(model, steady=steady).equilibria
        point = one.operating_point.point
        e0, e1, e2, e3 = point.q
        # the axis turns about the vertical: its horizontal part is perpendicular to its velocity
        axis = np.array([2 * (e1 * e3 + e0 * e2), 2 * (e2 * e3 - e0 * e1)])
        d0, d1, d2, d3 = point.v
        rate = np.array(
            [
                2 * (d1 * e3 + e1 * d3 + d0 * e2 + e0 * d2),
                2 * (d2 * e3 + e2 * d3 - d0 * e1 - e0 * d1),
            ]
        )
        found = (axis[0] * rate[1] - axis[1] * rate[0]) / (axis @ axis)
        slow_and_fast = np.roots([0.05 * math.cos(tilt), -0.02 * spin, 9.81 * 0.3])
        assert np.abs(slow_and_fast - found).min() < 1e-8 * abs(found)


@pytest.mark.parametrize("seed", range(4))
def test_permanent_rotations_of_a_free_body(seed: int) -> None:
    # about the middle axis, deviations grow with ω √((B − A)(C − B)/(A C))
    random = np.random.default_rng(seed)
    a, b, c = sorted(random.uniform(0.5, 1.0, 3) + np.array([0.0, 0.0, 0.0]))
    values = {name: f"{x} kg*m^2" for name, x in zip("ABC", (a, b, c), strict=True)}
    model, speed = lagcli.load_text(BODY, set=values), random.uniform(1, 10)
    verdicts = []
    for place, axis in enumerate("xyz"):
        (one,) = lagcli.equilibrium(model, steady={f"w.{axis}": speed}).equilibria
        e, rate = one.operating_point.point.q[3:], one.operating_point.point.v[3:]
        conjugate = np.array([e[0], -e[1], -e[2], -e[3]])
        scalar = conjugate[0] * rate[1:] + rate[0] * conjugate[1:]
        omega = 2 * (scalar + np.cross(conjugate[1:], rate[1:]))
        np.testing.assert_allclose(omega, speed * np.eye(3)[place], atol=1e-8)
        verdicts.append(one.stability.verdict == "unstable")
        if axis == "y":
            growth = one.stability.eigenvalues.real.max()
            expected = speed * math.sqrt((b - a) * (c - b) / (a * c))
            assert growth == pytest.approx(expected, rel=1e-6)
    assert verdicts == [False, True, False]


def test_tilt_of_a_rolling_disk_gives_its_spin() -> None:
    # nonholonomic: the velocities are held, one of them is looked for
    model = lagcli.load(MODELS / "rolling_disk.yaml")
    values = model.parameter_values
    steady = {"theta": 0.3, "psi'": values["Omega"], "phi'": None}
    (one,) = lagcli.equilibrium(model, steady=steady).equilibria
    m, g, r, a, c = (values[name] for name in ("m", "g", "r", "A", "C"))
    omega, sin, cos = values["Omega"], math.sin(0.3), math.cos(0.3)
    rolling = (m * g * r * sin - a * omega**2 * sin * cos) / ((c + m * r**2) * omega * cos)
    assert one.speeds["phi'"] == pytest.approx(-rolling - omega * sin, rel=1e-10)


def test_two_bodies_that_attract_each_other_circle() -> None:
    # Kepler: ω² = G (m1 + m2)/d³
    text = (
        "coordinates: {a: point, b: point}\nparameters: {G: 2, m1: 3, m2: 5}\n"
        "T: m1/2*dot(a', a') + m2/2*dot(b', b')\nV: -G*m1*m2/sqrt(dot(a - b, a - b))\n"
        "initial: {a: [1, 0, 0], b: [-0.6, 0, 0], a': [0, 1, 0], b': [0, -0.6, 0]}\n"
    )
    model = lagcli.load_text(text)
    distance = "sqrt((a.x - b.x)^2 + (a.y - b.y)^2 + (a.z - b.z)^2)"
    (one,) = lagcli.equilibrium(model, steady={distance: 1.7}).equilibria
    q, v = one.operating_point.point.q, one.operating_point.point.v
    between, relative = q[:3] - q[3:], v[:3] - v[3:]
    assert np.linalg.norm(between) == pytest.approx(1.7, rel=1e-10)
    rate = np.linalg.norm(np.cross(between, relative)) / 1.7**2
    assert rate**2 == pytest.approx(2 * 8 / 1.7**3, rel=1e-8)


def test_velocities_of_the_file_are_not_ignored_in_silence() -> None:
    text = PENDULUM + "initial: {x: 0.3, y: 0, z: -0.4, x': 0, y': 2, z': 0}\n"
    model = lagcli.load_text(text)
    assert lagcli.equilibrium(model).ignored == {"y'": 2.0}
    assert lagcli.equilibrium(model, steady={"y'": 2.0}).ignored == {}
    notes = lagcli.linearize(model, equilibrium=True).notes
    assert notes == ("the equilibrium does not have initial velocities of the file: y' = 2",)


def test_mistakes_are_explained() -> None:
    model = pendulum(1.0)
    with pytest.raises(UsageError, match="`J_7` is not a momentum that lagcli check finds"):
        lagcli.equilibrium(model, steady={"rate(J_7)": 1.0})
    with pytest.raises(UsageError, match="`z` has no value"):
        lagcli.equilibrium(model, steady={"z": None})
    with pytest.raises(UsageError, match="give a finite value"):
        lagcli.equilibrium(model, steady={"z": math.nan})
    with pytest.raises(UsageError, match="does not depend on the motion"):
        lagcli.equilibrium(model, steady={"2*m": 1.0})
    with pytest.raises(ModelError, match="not declared"):
        lagcli.equilibrium(model, steady={"foo": 1.0})
    with pytest.raises(NumericalError, match="no steady motion"):
        lagcli.equilibrium(model, steady={"z": 0.3})  # above the pivot
    bound = lagcli.load_text("coordinates: [x]\nT: x'^2/2\nV: x^2\ninitial: {x: 1, x': 0}\n")
    with pytest.raises(UsageError, match="no symmetry"):
        lagcli.equilibrium(bound, steady={"x": 1.0})


PARTICLES = """
coordinates: [x, y, z, u, v, w]
parameters: {m: 1, M: 2, k: 30, c: 5, l: 0.5, a: 0.3, g: 9.81, omega: 3}
"""
SPRINGS = """
V: g*(m*z + M*w) + k/2*(sqrt((x - u)^2 + (y - v)^2 + (z - w)^2) - a)^2 + c/2*(u^2 + v^2)
constraints: {rod: x^2 + y^2 + z^2 = l^2}
"""
FIXED = "T: m/2*(x'^2 + y'^2 + z'^2) + M/2*(u'^2 + v'^2 + w'^2)"
TURNING = (
    "T: m/2*((x' - omega*y)^2 + (y' + omega*x)^2 + z'^2)"
    " + M/2*((u' - omega*v)^2 + (v' + omega*u)^2 + w'^2)"
)


@pytest.mark.parametrize("seed", seeds(6, 12))
def test_motions_along_symmetries_are_equilibria_in_axes_that_turn(seed: int) -> None:
    """Two particles on a rod and a spring, in fixed axes and in axes that turn with ω."""
    random = np.random.default_rng(seed)
    values = {name: repr(random.uniform(0.5, 3)) for name in ("m", "M", "l", "a")}
    values |= {"k": repr(random.uniform(20, 300)), "c": repr(random.uniform(0, 30))}
    omega = random.uniform(0.5, 8)
    place = random.standard_normal(6)
    place[:3] *= float(values["l"]) / np.linalg.norm(place[:3])
    names = ["x", "y", "z", "u", "v", "w"]
    start = {n: f"{{guess: {x!r}}}" for n, x in zip(names, place.tolist(), strict=True)}
    start |= {f"{n}'": "{guess: 0}" for n in names}
    initial = f"initial: {{{', '.join(f'{n}: {x}' for n, x in start.items())}}}\n"
    set = {**values, "omega": repr(omega)}
    turning = lagcli.load_text(f"{PARTICLES}{TURNING}\n{SPRINGS}{initial}", set=set)
    (expected,) = lagcli.equilibrium(turning).equilibria
    q = expected.operating_point.point.q
    moved = {n: repr(x) for n, x in zip(names, q.tolist(), strict=True)}
    moved = {n: f"{{guess: {x}}}" for n, x in moved.items()}
    fixed = lagcli.load_text(f"{PARTICLES}{FIXED}\n{SPRINGS}{initial}", set=set, set_initial=moved)
    (found,) = lagcli.equilibrium(fixed, steady={"rate(J_1)": omega}).equilibria
    np.testing.assert_allclose(found.operating_point.point.q, q, atol=1e-8)
    for one, other in (
        (found.operating_point.point.multipliers, expected.operating_point.point.multipliers),
        (found.constraint_forces, expected.constraint_forces),
        (found.stability.stiffness, expected.stability.stiffness),
    ):
        size = np.abs(other).max()
        np.testing.assert_allclose(one, other, atol=1e-8 * size)
    assert found.stability.verdict == expected.stability.verdict
    assert found.dimension == expected.dimension

    def ordered(values: np.ndarray) -> np.ndarray:
        return np.array(sorted(values, key=lambda s: (round(abs(s), 5), round(s.real, 5))))

    one, other = (ordered(x.stability.eigenvalues) for x in (found, expected))
    assert len(one) == len(other)
    np.testing.assert_allclose(one, other, atol=1e-5 * np.abs(other).max())


def test_linearize_names_a_start_along_a_symmetry() -> None:
    """A top that sleeps is steady, though the rates of its quaternion change."""
    model = lagcli.load_text(TOP + "initial: {e: 1, e': [0, 0, 40]}\n")
    note = lagcli.linearize(model).notes[0]
    assert note.startswith("the start is a steady motion along a symmetry")
    given = dict(x.split("=") for x in note.split('"')[1::2])
    assert list(given.values()) == ["40"]
    steady = lagcli.linearize(
        model, equilibrium=True, steady={k: float(v) for k, v in given.items()}
    )
    np.testing.assert_allclose(steady.operating_point.point.v, [0, 0, 0, 20], atol=1e-12)
    tilted = lagcli.load_text(TOP + "initial: {e: [0.96, 0.28, 0, 0], e': [0, 0, 40]}\n")
    assert "is not an equilibrium or a steady motion" in lagcli.linearize(tilted).notes[0]
