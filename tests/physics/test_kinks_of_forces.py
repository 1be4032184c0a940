"""Laws and conditions with kinks and jumps in multipliers: friction of guides, forces, events.

A guide y = 0 carries a load of known zeros, so that λ, its kinks, and the momentum that a law takes
from a sliding body are known in closed form. Where the load depends on the motion, SciPy integrates
the equations.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import lagcli
from lagcli.trajectory.trajectory import Trajectory

GUIDE = "guide: y = 0"


def run(force: str, law: str, constraints: str, v0: float, end: float) -> Trajectory:
    """Return a run of a body of 1 kg that slides in x, with a force on y and a law in x."""
    q_x = f', x: "{law}"' if law else ""
    model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
Q: {{y: "{force}"{q_x}}}
constraints: {{{constraints}}}
initial: {{x: 0, x': {v0!r}, y: 0, y': 0}}
simulation: {{t_end: {end!r}, samples: 3}}
""")
    return lagcli.simulate(model)


def rubs(limit: str, left: str = "{", right: str = "}") -> str:
    return f'{GUIDE}, rubs: {left}expr: "x\' = 0", limit: {limit}{right}'


@pytest.mark.parametrize("seed", range(40))
def test_friction_under_a_polynomial_load_is_exact(seed: int) -> None:
    """Zeros of the load may be close to each other. DOP853 is exact for these polynomials."""
    rng = np.random.default_rng(seed)
    roots = np.sort(rng.uniform(0.2, 1.8, rng.integers(1, 4)))
    if seed % 2 and len(roots) > 1:
        roots[1] = roots[0] + 10.0 ** -rng.uniform(1, 5)
    load = Polynomial.fromroots(roots) * rng.choice([-1.7, 1.7])
    force = " + ".join(f"({c!r})*t^{k}" for k, c in enumerate(load.coef.tolist()))
    found = run(force, "", rubs("0.3*abs(lambda.guide)"), 5.0, 2.0)
    whole = load.integ()
    ends = [0.0, *np.sort(roots), 2.0]
    taken = 0.3 * sum(abs(whole(b) - whole(a)) for a, b in pairwise(ends))
    assert found.v[-1, 0] == pytest.approx(5.0 - taken, abs=1e-13)
    assert found.counts["rejected"] <= 2


#: Laws with the same magnitude, mu |λ|: in Q, or as a limit.
LAWS = {
    "limit": ("", rubs("{mu}*abs(lambda.guide)", "{{", "}}"), -1),
    "sign": ("-{mu}*abs(lambda.guide)*sign(x')", GUIDE, -1),
    "force": ("{mu}*abs(lambda.guide)", GUIDE, 1),
    "max": ("{mu}*max(lambda.guide, 0) + {mu}*max(-lambda.guide, 0)", GUIDE, 1),
    "select": ("{mu}*if(lambda.guide > 0, lambda.guide, -lambda.guide)", GUIDE, 1),
    "redundant": (
        "",
        f"{GUIDE}, other: y = 0, rubs:"
        ' {{expr: "x\' = 0", limit: {mu}*abs(lambda.guide + lambda.other)}}',
        -1,
    ),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(6))
def test_an_oscillating_load(law: str, seed: int) -> None:
    """Of µN to MN, over milliseconds or seconds, with zeros at the start or touched."""
    rng = np.random.default_rng(seed)
    end, size = float(rng.choice([0.02, 1.0, 20.0])), float(10.0 ** rng.uniform(-6, 6))
    w, mu = float(rng.uniform(3, 30) / end), float(rng.uniform(0.1, 0.5))
    phase, mean = (float(rng.choice([0.0, x])) for x in (rng.uniform(0, 6), rng.choice([0.999, 1])))

    def impulse(t: float) -> float:
        return size * (mean * t - math.cos(w * t + phase) / w)

    zeros = [
        (x - phase + 2 * math.pi * n) / w
        for n in range(-2, 10)
        for x in (-math.asin(mean), math.pi + math.asin(mean))
    ]
    times = [0.0, *sorted(t for t in zeros if 0 < t < end), end]
    whole = mu * sum(abs(impulse(b) - impulse(a)) for a, b in pairwise(times))
    force, constraints, sign = LAWS[law]
    v0 = 2 * whole
    found = run(
        f"{size!r}*({mean!r} + sin({w!r}*t + {phase!r}))",
        force.format(mu=repr(mu)),
        constraints.format(mu=repr(mu)),
        v0,
        end,
    )
    assert found.status == "completed"
    assert found.v[-1, 0] == pytest.approx(v0 + sign * whole, rel=3e-10)


def test_a_jump_where_the_multiplier_exceeds_a_value() -> None:
    """λ = −sin 3 t: the force acts while λ > 0.4, and not else."""
    found = run("sin(3*t)", "if(lambda.guide > 0.4, 2, 0)", GUIDE, 1.0, 3.2)
    start, length = (math.pi + math.asin(0.4)) / 3, (math.pi - 2 * math.asin(0.4)) / 3
    assert start + length < 3.2 < start + 2 * math.pi / 3
    assert found.v[-1, 0] == pytest.approx(1 + 2 * length, abs=1e-11)


@pytest.mark.parametrize(
    ("law", "force"),
    [
        ("-0.3*abs(lambda.guide)*x'", lambda n, x, v: -0.3 * abs(n) * v),
        ("-0.3*max(lambda.guide - 0.5, 0)", lambda n, x, v: -0.3 * max(n - 0.5, 0)),
        ("-0.3*abs(abs(lambda.guide) - 0.5)", lambda n, x, v: -0.3 * abs(abs(n) - 0.5)),
        ("-0.3*min(abs(lambda.guide), 0.5)*x'", lambda n, x, v: -0.3 * min(abs(n), 0.5) * v),
        ("-0.3*max(lambda.guide, x, 0)", lambda n, x, v: -0.3 * max(n, x, 0)),
        ("-0.3*sqrt(lambda.guide^2 + 1)", lambda n, x, v: -0.3 * math.sqrt(n * n + 1)),
    ],
)
@pytest.mark.parametrize("c", [0.7, 2.9])
def test_a_load_that_depends_on_the_motion(
    law: str, force: Callable[[float, float, float], float], c: float
) -> None:
    def rates(t: float, y: np.ndarray[tuple[int], np.dtype[np.float64]]) -> list[float]:
        return [y[1], force(c * math.sin(3 * t) * (1 + 0.3 * math.sin(y[0])), y[0], y[1])]

    expected = solve_ivp(
        rates, (0, 5), [0.0, 1.0], method="DOP853", rtol=1e-13, atol=1e-13, max_step=0.005
    )
    found = run(f"-{c}*sin(3*t)*(1 + 0.3*sin(x))", law, GUIDE, 1.0, 5.0)
    assert [found.q[-1, 0], found.v[-1, 0]] == pytest.approx(expected.y[:, -1].tolist(), abs=1e-8)


def test_an_unloaded_guide_takes_no_steps() -> None:
    """Its multiplier is a rounding error, whose sign changes all the time."""
    text = """
coordinates: [x, y, z]
T: (x'^2 + y'^2 + z'^2)/2
Q: {y: "cos(t)", z: "sin(t) - sin(t)*cos(x) + (cos(x) - 1)*sin(t)"}
constraints:
  guide: y = 0
  other: z = 0
  rubs: {expr: "x' = 0", limit: 0.1*abs(lambda.guide) + 0.1*abs(lambda.other)}
initial: {x: 0, x': 5, y: 0, y': 0, z: 0, z': 0}
simulation: {t_end: 20, samples: 3}
"""
    found = lagcli.simulate(lagcli.load_text(text))
    # |cos| integrated to 20 = 6.37 pi
    taken = 12 + math.sin(20 - 6 * math.pi) if 20 - 6 * math.pi < math.pi / 2 else math.nan
    assert found.v[-1, 0] == pytest.approx(5 - 0.1 * taken, abs=1e-9)
    assert found.counts["steps"] < 150


def test_derivatives_pass_the_zeros_of_a_multiplier() -> None:
    """v(3) = v_0 − mu ∫ |A sin(w t) + c| dt, with zeros that depend on c."""
    model = lagcli.load_text("""
coordinates: [x, y]
parameters: {mu: 0.3, A: 2, w: 5, c: 0.7}
T: (x'^2 + y'^2)/2
Q: {y: "A*sin(w*t) + c"}
constraints: {guide: y = 0, rubs: {expr: "x' = 0", limit: mu*abs(lambda.guide)}}
initial: {x: 0, x': 9, y: 0, y': 0}
simulation: {t_end: 3, samples: 2}
""")
    found = lagcli.simulate(model, sensitivity=("mu", "c"))
    turn, part = 2 * math.pi / 5, math.asin(0.35) / 5  # sin 5 t = −0.35
    down = [math.pi / 5 + part + k * turn for k in range(2)]
    up = [turn - part + k * turn for k in range(2)]
    times = [0.0, *sorted([*down, *up]), 3.0]
    parts = list(pairwise(times))

    def impulse(t: float) -> float:
        return -0.4 * math.cos(5 * t) + 0.7 * t

    of_mu = sum(abs(impulse(b) - impulse(a)) for a, b in parts)
    of_c = 0.3 * sum((-1) ** k * (b - a) for k, (a, b) in enumerate(parts))
    assert found.dv is not None
    names = found.sensitivity
    assert found.v[-1, 0] == pytest.approx(9 - 0.3 * of_mu, abs=1e-9)
    assert found.dv[-1, 0, names.index("mu")] == pytest.approx(-of_mu, abs=2e-9)
    assert found.dv[-1, 0, names.index("c")] == pytest.approx(-of_c, abs=2e-9)


def test_derivatives_pass_a_jump_with_a_multiplier() -> None:
    """λ = −A sin 3 t: v(3.2) = 1 + 2/3 (π − 2 asin(c/A))."""
    model = lagcli.load_text("""
coordinates: [x, y]
parameters: {A: 1, c: 0.4}
T: (x'^2 + y'^2)/2
Q: {y: "A*sin(3*t)", x: "if(lambda.guide > c, 2, 0)"}
constraints: {guide: y = 0}
initial: {x: 0, x': 1, y: 0, y': 0}
simulation: {t_end: 3.2, samples: 2}
""")
    found = lagcli.simulate(model, sensitivity=("c", "A"))
    of_c = -4 / 3 / math.sqrt(1 - 0.4**2)
    assert found.dv is not None
    assert found.dv[-1, 0].tolist() == pytest.approx([of_c, -0.4 * of_c], abs=1e-9)


#: Pendulums with friction in their bearings: length, moment of inertia, friction, first angle.
PENDULUMS = (
    (0.5856491671436244, 0.1565647279682449, 0.08211470186857572, 1.9554050901609195),
    (0.8269722766055607, 0.4942745795020665, 0.03868397546369651, 2.471372339550072),
    (1.3702492039700847, 0.1790677440893999, 0.06428333350464058, 2.443835207300447),
    (1.3309833188891114, 0.21242600007541546, 0.07324653750238494, 2.650296966631486),
    (0.6225655096738716, 0.16615088364774785, 0.0465193655039018, 2.922959870361055),
)


@pytest.mark.parametrize(
    ("l", "J", "k", "start"),
    [*PENDULUMS[:2], *(pytest.param(*x, marks=pytest.mark.slow) for x in PENDULUMS[2:])],
)
def test_friction_of_a_bearing_whose_forces_pass_zero(
    l: float, J: float, k: float, start: float
) -> None:
    """The error of a root of a force may exceed the rounding error of forces; g is 9.81."""
    model = lagcli.load_text(f"""
coordinates: [x, y, h]
T: (x'^2 + y'^2)/2 + {J!r}/2*h'^2
V: 9.81*y
Q: {{h: "-{k!r}*(abs(lambda.hor) + abs(lambda.ver))*tanh(h'/0.1)"}}
constraints: {{hor: x = {l!r}*sin(h), ver: y = -{l!r}*cos(h)}}
initial:
  {{x: {{guess: 0}}, y: {{guess: 0}}, x': {{guess: 0}}, y': {{guess: 0}}, h: {start!r}, h': 0}}
simulation: {{t_end: 10, samples: 11}}
""")
    found = lagcli.simulate(model)
    assert found.status == "completed", found.message

    def forces(h: float, w: float, a: float) -> tuple[float, float]:
        s, c = math.sin(h), math.cos(h)
        return l * (c * a - s * w * w), l * (s * a + c * w * w) + 9.81

    def rhs(_: float, y: Any) -> list[float]:
        h, w = y
        a = 0.0
        for _ in range(40):  # it contracts: k l/(l^2 + J) is small
            load = sum(map(abs, forces(h, w, a)))
            a = (-9.81 * l * math.sin(h) - k * load * math.tanh(w / 0.1)) / (l * l + J)
        return [w, a]

    own = solve_ivp(rhs, (0, 10), [start, 0.0], t_eval=found.time, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(found.q[:, 2], own.y[0], rtol=0, atol=1e-6)
    states = zip(found.q[:, 2], found.v[:, 2], found.a[:, 2], strict=True)
    expected = [forces(*state) for state in states]
    np.testing.assert_allclose(found.multipliers, expected, rtol=0, atol=1e-8)


INCLINED = """
coordinates: [x, y]
parameters: {{c: 0.65, F: {force}, b: -0.08}}
T: (x'^2 + y'^2)/2
Q: {{y: "3*sin(2.6*t) + b*x", x: "if(lambda.guide > c, F, 0)"}}
constraints: {{guide: y = 0.66*x}}
initial: {{x: 0, x': 1, y: 0, y': {{guess: 0}}}}
simulation: {{t_end: 5.1, samples: 2, rtol: 1e-11}}
"""


def test_a_jump_that_moves_its_multiplier() -> None:
    """On an inclined guide the force raises λ: it starts at c and ends at a lower value."""
    names = ("c", "F", "b")
    text = INCLINED.format(force=0.6)
    found = lagcli.simulate(lagcli.load_text(text), sensitivity=names)
    assert found.dq is not None
    for k, name in enumerate(names):
        value = {"c": 0.65, "F": 0.6, "b": -0.08}[name]
        ends = [
            lagcli.simulate(lagcli.load_text(text, set={name: repr(value + h)})).q[-1, 0]
            for h in (1e-4, -1e-4)
        ]
        assert found.dq[-1, 0, k] == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-6)


@pytest.mark.parametrize("rtol", [1e-6, 1e-11])
def test_a_jump_without_a_solution(rtol: float) -> None:
    """The force lowers λ: above c it brings it below c, where it does not act."""
    model = lagcli.load_text(INCLINED.format(force=-0.6))
    found = lagcli.simulate(model, rtol=rtol)
    # until then there is no force: λ = (0.08 x − 3 sin 2.6 t) / (1 + 0.66²) reaches c
    assert found.status == "failed"
    assert "there is no solution" in found.message

    def rates(t: float, y: list[float]) -> list[float]:
        load = 3 * math.sin(2.6 * t) - 0.08 * y[0]
        return [y[1], 0.66 * load / (1 + 0.66**2)]

    def reaches(t: float, y: list[float]) -> float:
        return (0.08 * y[0] - 3 * math.sin(2.6 * t)) / (1 + 0.66**2) - 0.65

    reaches.terminal = True  # type: ignore[attr-defined]
    expected = solve_ivp(rates, (0, 5), [0.0, 1.0], rtol=1e-12, atol=1e-12, events=reaches)
    (time,) = expected.t_events[0]
    stated = re.match(r"at t = (\S+) s", found.message)
    assert stated is not None
    assert float(stated[1]) == pytest.approx(time, abs=1e-7 if rtol > 1e-9 else 5e-9)


#: Conditions on λ = sin(w t + phase), with a bound c, as functions that rise through zero.
CONDITIONS: dict[str, Callable[[float, float], float]] = {
    "lambda.guide >= {c}": lambda n, c: n - c,
    "abs(lambda.guide) <= {c}": lambda n, c: c - abs(n),
    "abs(lambda.guide) >= {c} and x > -100": lambda n, c: abs(n) - c,
    "max(lambda.guide, -2*lambda.guide) <= {c}": lambda n, c: c - max(n, -2 * n),
    "abs(lambda.guide) <= {c} or lambda.guide >= 0.95": lambda n, c: max(c - abs(n), n - 0.95),
    "sign(lambda.guide - {c}) >= 1": lambda n, c: n - c,
    "if(lambda.guide > {c}, 1, 0) >= 1": lambda n, c: n - c,
}


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("seed", range(5))
def test_events_of_forces_with_kinks(condition: str, seed: int) -> None:
    """Also where the force vanishes many times within a step: steps depend on the motion alone."""
    rng = np.random.default_rng(seed)
    c, phase, end = rng.uniform(0.02, 0.9), rng.uniform(0, 6), float(rng.choice([1, 5, 20]))
    w = float(10 ** rng.uniform(-0.5, 1.7))
    move = ("0", "-4*x", "-x'")[seed % 3]
    model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
Q: {{y: "-sin({w}*t + {phase})", x: "{move}"}}
constraints: {{guide: y = 0}}
events: {{hit: {{when: "{condition.format(c=c)}"}}}}
initial: {{x: 1, x': 1, y: 0, y': 0}}
simulation: {{t_end: {end}, samples: 2}}
""")
    found = lagcli.simulate(model)
    angles = [
        sign * math.asin(x) + turn
        for x in (c, c / 2, 0.95)
        for sign, turn in ((1, 0.0), (-1, math.pi), (-1, 0.0), (1, math.pi))
    ]
    times = sorted(
        t
        for n in range(-2, int(w * end / (2 * math.pi)) + 3)
        for angle in angles
        if 0 < (t := (angle - phase + 2 * math.pi * n) / w) < end
    )

    def at(t: float) -> float:
        return CONDITIONS[condition](math.sin(w * t + phase), c)

    expected = [t for t in times if at(t - 1e-6 / w) < 0 < at(t + 1e-6 / w)]
    assert found.events is not None
    assert len(expected) == len(found.events.time)
    assert found.events.time == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("condition", "rises"),
    [
        ("lambda.guide*abs(x) <= 0.3", lambda x: 0.3 - abs(x)),
        ("max(x, -2*x)*lambda.guide <= 0.3", lambda x: 0.3 - max(x, -2 * x)),
        ("lambda.guide*sign(x - 0.3) >= 1", lambda x: x - 0.3),
        ("lambda.guide*step(x - 0.3) >= 0.5", lambda x: x - 0.3),
    ],
)
@pytest.mark.parametrize("w", [0.7, 9.0])
def test_events_of_forces_with_kinks_of_the_state(
    condition: str, rises: Callable[[float], float], w: float
) -> None:
    """λ = 1, and x = sin(w t): jumps to the bound of a condition are events, too."""
    model = lagcli.load_text(f"""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
V: {w * w / 2}*x^2
Q: {{y: -1}}
constraints: {{guide: y = 0}}
events: {{hit: {{when: "{condition}"}}}}
initial: {{x: 0, x': {w}, y: 0, y': 0}}
simulation: {{t_end: 20, samples: 2}}
""")
    found = lagcli.simulate(model)
    angles = [
        angle for x in (0.3, -0.3, 0.15, -0.15) for angle in (math.asin(x), math.pi - math.asin(x))
    ]
    times = sorted((a + 2 * math.pi * n) / w for n in range(-1, 30) for a in angles)
    expected = [
        t
        for t in times
        if 0 < t < 20 and rises(math.sin(w * t - 1e-6)) < 0 < rises(math.sin(w * t + 1e-6))
    ]
    assert found.events is not None
    assert len(expected) == len(found.events.time)
    assert found.events.time == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize(
    ("law", "function"),
    [
        ("1.2*atan(20*(lambda.rail + 0.33))", lambda x: 1.2 * np.arctan(20 * (x + 0.33))),
        ("0.6*tanh(50*(lambda.rail - 0.23))", lambda x: 0.6 * np.tanh(50 * (x - 0.23))),
        ("0.7*sqrt((lambda.rail - 1.1)^2 + 1e-6)", lambda x: 0.7 * np.sqrt((x - 1.1) ** 2 + 1e-6)),
        ("-0.5*sin(2*lambda.rail)", lambda x: -0.5 * np.sin(2 * x)),
    ],
)
@pytest.mark.parametrize("slope", [-1.2, -0.6])
def test_forces_that_bend_sharply_with_multipliers_obey_their_laws(
    law: str, function: Callable[[float], float], slope: float
) -> None:
    """On y = k x, lambda = k x'' - g and (1 + k^2) x'' = F(lambda) + f + k g, solved for lambda.

    Newton's method does not converge from everywhere: forces that it had not found were taken.
    """
    model = lagcli.load_text(
        "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\n"
        f'Q: {{x: "{law} + 4*sin(3*t)", y: -0.8}}\nconstraints: {{rail: y = {slope}*x}}\n'
        "initial: {x: 0, y: {guess: 0}, x': 0, y': {guess: 0}}\n"
    )
    result = lagcli.simulate(model, t_end=2, samples=41, max_steps=5000)
    assert result.status == "completed", result.message

    def rest(multiplier: float, t: float) -> float:
        push = function(multiplier) + 4 * math.sin(3 * t) - 0.8 * slope
        return multiplier - slope * push / (1 + slope**2) - 0.8

    expected = [brentq(rest, -50, 50, (t,), xtol=1e-14) for t in result.time.tolist()]
    assert result.multipliers[:, 0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("law", ["3.3*sin(6*lambda.rail)", "2*(lambda.rail - 1)^2"])
def test_forces_that_are_not_found_end_the_run(law: str) -> None:
    model = lagcli.load_text(
        "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\n"
        f'Q: {{x: "{law} + 4*sin(3*t)", y: -0.8}}\nconstraints: {{rail: y = 1.7*x}}\n'
        "initial: {x: 0, y: {guess: 0}, x': 0, y': {guess: 0}}\n"
    )
    result = lagcli.simulate(model, t_end=2, samples=41, max_steps=5000)
    assert result.status == "failed"
    assert "no finite value" in result.message
    assert "in the force on `x`, by its multipliers, has none" in result.message
