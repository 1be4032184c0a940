"""Bodies that friction or limits hold at rest under harmonic forces, against closed forms.

A body on which the load is F sin(ω t) sticks while |F sin(ω t)| <= G. From rest it slips first at
asin(G/F)/ω. If F < 1.86 G it comes to rest before the load turns, and slips again half a period
after that, with

    v = F/(m ω) (cos(ω t₁) − cos(ω t)) − G/m (t − t₁).

Errors of forces that balance must not look like errors of the motion: runs ended with "the step
size fell" or at the largest number of steps.
"""

from __future__ import annotations

import math
import random
from typing import NamedTuple

import numpy as np
import pytest
from random_cases import FUZZ_COUNT
from scipy.optimize import brentq

import lagcli
from lagcli.trajectory.trajectory import Trajectory

METHODS = ["auto", "DOP853", "Taylor", "Radau", "Rodas5P"]
#: Ratio F/G from which a slip lasts until the load exceeds G in the other direction.
NO_REST = 1.86


class Load(NamedTuple):
    """A body of mass m under F sin(ω t), held by at most G."""

    mass: float
    limit: float
    force: float
    rate: float
    periods: float

    @property
    def first_slip(self) -> float:
        return math.asin(self.limit / self.force) / self.rate

    @property
    def rest(self) -> float:
        """The time at which the first slip ends."""

        def rate(x: float) -> float:
            slip = math.cos(x0) - math.cos(x)
            return self.force / self.limit * slip - (x - x0)

        x0 = self.first_slip * self.rate
        return brentq(rate, math.pi - x0, x0 + math.pi, xtol=1e-14) / self.rate

    def instants(self) -> list[tuple[float, str]]:
        """Return when it slips and sticks, if it comes to rest in each half of a period."""
        if self.force <= self.limit:
            return []
        half, end = math.pi / self.rate, self.periods * 2 * math.pi / self.rate
        both = ((self.first_slip, "slips"), (self.rest, "sticks"))
        all_ = [(t + k * half, kind) for k in range(int(2 * self.periods) + 1) for t, kind in both]
        return [x for x in all_ if x[0] <= end]


def block(load: Load, form: str) -> str:
    """Return the model of a block that a limit, friction, or a belt holds."""
    end = load.periods * 2 * math.pi / load.rate
    values = f"m: {load.mass!r}, G: {load.limit!r}, F: {load.force!r}, w: {load.rate!r}, g: 9.81"
    x, more, law, potential = "x", "", "{expr: x' = 0, limit: G}", "0"
    force, speed = "F*sin(w*t)", "0"
    if form == "belt":
        law, values, speed = "{expr: x' = u, limit: G}", f"{values}, u: 0.3", "u"
    elif form in ("floor", "guide"):
        x, more, potential = "x, y", " + m/2*y'^2", "m*g*y"
        sign = ">=" if form == "floor" else "="
        law = f"{{expr: y {sign} 0, friction: G/(m*g), slip: x'}}"
    elif form == "sign":
        force += " - G*sign(x')"
    constraints = "" if form == "sign" else f"constraints:\n  hold: {law}\n"
    start = ", y: 0, y': 0" if form in ("floor", "guide") else ""
    return (
        f"coordinates: [{x}]\nparameters: {{{values}}}\nT: m/2*x'^2{more}\nV: {potential}\n"
        f'Q: {{x: "{force}"}}\n{constraints}initial: {{x: 0, x\': {speed}{start}}}\n'
        f"simulation: {{t_end: {end!r}, samples: 101}}\n"
    )


def check_block(load: Load, form: str, method: str) -> Trajectory:
    model = lagcli.load_text(block(load, form))
    run = lagcli.simulate(model, method=method, max_steps=100_000)
    assert run.status == "completed", run.message
    assert run.events is not None
    expected = load.instants()
    assert [x for x in run.events.kinds if x in ("slips", "sticks")] == [x[1] for x in expected]
    # the first slip is a double root next to F = G: its instant is known to √ε/(F/G − 1)
    np.testing.assert_allclose(
        [t * load.rate for t in run.events.time], [t * load.rate for t, _ in expected], atol=2e-6
    )
    friction = run.multipliers[:, -1]
    assert np.abs(friction).max() <= load.limit * (1 + 1e-9)
    if not expected:  # it balances the load
        assert friction == pytest.approx(
            -load.force * np.sin(load.rate * run.time), abs=1e-9 * load.limit
        )
        speed = 0.3 if form == "belt" else 0.0
        assert np.abs(run.v[:, 0] - speed).max() <= 1e-9 * load.force / load.mass / load.rate
    return run


@pytest.mark.parametrize(
    ("mass", "limit", "rate", "ratio", "periods", "form", "method"),
    [
        (1e5, 1e4, 1.0, 1 + 1e-6, 1.3, "sign", "auto"),
        (9.984, 1.0, 1000.0, 0.999, 1.3, "limit", "DOP853"),
        (1e5, 1.0, 1e-3, 0.9, 200, "limit", "Rodas5P"),
        (2.87, 1e-9, 46.15, 1 - 1e-9, 20, "limit", "Taylor"),
        (3.147, 1e-9, 1e6, 1.0, 1.3, "limit", "Taylor"),
        (4.695, 1e4, 31.84, 1.1, 5, "limit", "auto"),
        (1e5, 1e-9, 1.0, 1.4937, 0.2, "limit", "Radau"),
    ],
)
def test_blocks_that_did_not_end(
    mass: float, limit: float, rate: float, ratio: float, periods: float, form: str, method: str
) -> None:
    check_block(Load(mass, limit, ratio * limit, rate, periods), form, method)


def random_block(seed: int) -> tuple[Load, str, str]:
    rng = random.Random(seed)
    form = rng.choice(["limit", "sign", "floor", "guide", "belt"])
    limit = rng.choice([1.0, 1e-9, 1e4, rng.uniform(0.1, 10)])
    mass = rng.choice([1.0, 1e-6, 1e5, rng.uniform(0.1, 10)])
    if form in ("floor", "guide"):
        mass = limit / (9.81 * rng.choice([0.1, 0.5, 1, 30]))
    rate = rng.choice([1.0, 1e-3, 1e6, rng.uniform(0.1, 100)])
    if form == "belt":  # its speed is of the size of the block's
        mass, rate = limit, rng.uniform(0.5, 5)
    near = rng.choice([0, 1e-6, -1e-6, 1e-3, -1e-3, rng.uniform(-1, NO_REST - 1)])
    if near == 0 and form in ("floor", "guide"):
        near = -1e-12  # μ N is G but for rounding
    periods = rng.choice([0.2, 1.3, 5, 20])
    return Load(mass, limit, limit * (1 + near), rate, periods), form, rng.choice(METHODS)


@pytest.mark.parametrize("seed", range(20))
def test_random_blocks(seed: int) -> None:
    check_block(*random_block(seed))


@pytest.mark.fuzz
def test_many_random_blocks() -> None:
    for seed in range(FUZZ_COUNT):
        check_block(*random_block(1000 + seed))


@pytest.mark.parametrize("method", ["auto", "Taylor"])
def test_many_periods_of_rest_in_a_step(method: str) -> None:
    """The load has whole periods between the times at which later forces are looked at."""
    check_block(Load(3.0, 1.0, 0.99, 1e3, 128), "limit", method)


def test_a_constraint_holds_a_body_at_rest_under_a_growing_load() -> None:
    for rate in (1e-3, 1.0, 1e6):
        text = (
            f"coordinates: [x, y]\nparameters: {{m: 1e-3, F: 7, w: {rate}}}\n"
            "T: m/2*(x'^2 + y'^2)\nV: F*(x - y)^2\nQ: {x: F*sin(w*t)}\n"
            "constraints: {hold: x' = 0}\ninitial: {x: 0, y: 0, x': 0, y': 0}\n"
            f"simulation: {{t_end: {20 / rate!r}}}\n"
        )
        run = lagcli.simulate(lagcli.load_text(text))
        assert run.status == "completed", run.message
        assert run.counts["steps"] < 200
        expected = -7 * np.sin(rate * run.time)
        assert run.multipliers[:, 0] == pytest.approx(expected, abs=1e-9)


def stack(seed: int) -> tuple[str, float]:
    """Return the model of two blocks, one on the other, that stay at rest; and the largest load."""
    rng = random.Random(seed)
    unit = rng.choice([1e-6, 1.0, 1e4])
    lower, upper = unit * 10 ** rng.uniform(-1.5, 1), unit * 10 ** rng.uniform(-1.5, 1)
    floor, between = unit * rng.uniform(1, 30), unit * rng.uniform(1, 30)
    part = rng.choice([0.0, 0.5, 1.0])
    load = min(floor, between / part if part else floor) * rng.choice([0.3, 0.999, 1 - 1e-6])
    rate = rng.choice([1e-3, 1.0, 50.0, 1e4])
    text = (
        f"coordinates: [x, y]\nparameters: {{m: {lower!r}, n: {upper!r}, G: {floor!r}, "
        f"H: {between!r}, F: {load!r}, w: {rate!r}}}\n"
        "T: m/2*x'^2 + n/2*y'^2\n"
        f"Q: {{x: {1 - part}*F*sin(w*t), y: {part}*F*sin(w*t)}}\n"
        "constraints:\n  floor: {expr: x' = 0, limit: G}\n  on: {expr: y' - x' = 0, limit: H}\n"
        "initial: {x: 0, x': 0, y: 0, y': 0}\n"
        f"simulation: {{t_end: {rng.choice([2, 8, 60]) / rate!r}}}\n"
    )
    return text, load


def check_stack(seed: int) -> None:
    text, load = stack(seed)
    method = random.Random(-seed).choice(METHODS)
    run = lagcli.simulate(lagcli.load_text(text), method=method, max_steps=100_000)
    assert run.status == "completed", run.message
    assert run.events is not None
    assert len(run.events) == 0
    rate = float(text.split(" w: ")[1].split("}")[0])
    expected = -load * np.sin(rate * run.time)
    assert run.multipliers[:, 0] == pytest.approx(expected, abs=1e-9 * load)


@pytest.mark.parametrize("seed", range(12))
def test_stacks_that_stay(seed: int) -> None:
    check_stack(seed)


@pytest.mark.fuzz
def test_many_stacks_that_stay() -> None:
    for seed in range(FUZZ_COUNT // 2):
        check_stack(1000 + seed)


@pytest.mark.parametrize("force", [0.3, 2.0])
def test_a_box_that_stays_at_rest_has_no_warnings(force: float) -> None:
    """Its velocities, and the terms of its constraints, are rounding errors of 1e-30 m/s."""
    run = lagcli.simulate(
        lagcli.load_text(f"""
coordinates: [x, y, th]
parameters: {{m: 1.3, b: 1, h: 0.6, g: 9.81, mu: 0.6, F: {force}}}
definitions:
  r_a: [x - b/2*cos(th) + h/2*sin(th), y - b/2*sin(th) - h/2*cos(th)]
  r_b: [x + b/2*cos(th) + h/2*sin(th), y + b/2*sin(th) - h/2*cos(th)]
T: m/2*(x'^2 + y'^2) + m*(b^2 + h^2)/24*th'^2
V: m*g*y
Q: {{x: F*sin(3*t)}}
constraints:
  a: {{expr: r_a.y >= 0, friction: mu, slip: r_a.x'}}
  b_: {{expr: r_b.y >= 0, friction: mu, slip: r_b.x'}}
initial: {{x: 0, y: h/2, th: 0, x': 0, y': 0, th': 0}}
simulation: {{t_end: 1, samples: 21}}
""")
    )
    assert run.status == "completed"
    assert np.abs(run.v).max() < 1e-15
    assert run.warnings == ()


#: Three links of 1 mm from rest, in SI: friction holds the first two together until 1.4 s.
LINKS = """
coordinates: [x, y, a, u, w, b, r, s, c]
inputs:
  push: {times: [0, 0.7, 1.5], values: [0.2, 1, -0.5], interpolation: step, extend: hold}
T: 0.00132/2*(x'^2 + y'^2) + 2.15e-10/2*a'^2 + 0.00105/2*(u'^2 + w'^2) + 3.36e-11/2*b'^2
  + 0.00138/2*(r'^2 + s'^2) + 3.28e-10/2*c'^2
Q:
  a: 1.32e-9*push - 3.66e-5*max(abs(lambda.Ox), abs(lambda.Oy))*tanh(a'/0.1) + 3.2e-9
  b: 6.43e-10
  c: -1.13e-9
constraints:
  Ox: x - 0.000537*sin(a) = 0
  Oy: y + 0.000537*cos(a) = 0
  Ax: u - 0.000296*sin(b) = x + 0.000537*sin(a)
  Ay: w + 0.000296*cos(b) = y - 0.000537*cos(a)
  Bx: r - 0.000662*sin(c) = u + 0.000296*sin(b)
  By: s + 0.000662*cos(c) = w - 0.000296*cos(b)
  rubs:
    expr: b' - a' = 0
    limit:
      static: 2.288e-5*sqrt(lambda.Ax^2 + lambda.Ay^2)
      kinetic: 1.76e-5*sqrt(lambda.Ax^2 + lambda.Ay^2)
initial: {x: {guess: 0}, y: {guess: 0}, u: {guess: 0}, w: {guess: 0}, r: {guess: 0},
  s: {guess: 0}, x': 0, y': 0, u': 0, w': 0, r': 0, s': 0,
  a: -2.16, a': 0, b: -2.27, b': 0, c: 2.18, c': 0}
simulation: {t_end: 2, samples: 5}
"""


@pytest.mark.parametrize("rtol", [1e-10, 1e-11, 1e-12])
def test_tolerances_of_links_that_friction_holds_together(rtol: float) -> None:
    """Rounding errors that rows pass on are not passed on again: tolerances grew to 1 rad."""
    model = lagcli.load_text(LINKS)
    run, rough = (lagcli.simulate(model, rtol=x) for x in (rtol, 1e-8))
    assert run.tolerances is not None
    assert max(run.tolerances[name] for name in ("a", "b", "c")) <= 10 * rtol
    np.testing.assert_allclose(run.q[:, 2::3], rough.q[:, 2::3], rtol=0, atol=1e-6)
    # the rates at the end: by steps of at most 0.02 s, whatever the tolerances
    small = lagcli.simulate(model, rtol=rtol, max_step=0.02)
    np.testing.assert_allclose(run.v[-1, 2::3], small.v[-1, 2::3], rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("share", [0.9, 2.86, 20.0])
def test_a_body_on_a_stop_with_friction_leaves_when_the_friction_gives_way(
    share: float, side: int, method: str
) -> None:
    """The stop bears what exceeds the friction: beyond G, the load moves it by (t - t1)^3/6."""
    limit, growth = 3.1, 5.5
    start = -share * limit
    begins = (limit - start) / growth
    model = lagcli.load_text(
        "coordinates: [x]\nT: 1.7*x'^2/2\n"
        f'Q: {{x: "{side * start!r} + {side * growth!r}*t"}}\n'
        f"constraints:\n  stop: x {'>=' if side > 0 else '<='} 0\n"
        f"  friction: {{expr: x' = 0, limit: {limit}}}\n"
        "initial: {x: 0, x': 0}\n"
    )
    run = lagcli.simulate(model, t_end=1.5 * begins, samples=31, method=method, max_steps=1000)
    assert run.status == "completed", run.message
    expected = side * growth * np.maximum(run.time - begins, 0) ** 3 / 6 / 1.7
    # the motion is a cubic of time: its errors are those of the instant and of rounding
    assert run.q[:, 0] == pytest.approx(expected, abs=1e-8 * abs(expected[-1]))
    assert run.events is not None
    slips = run.events.time[[kind == "slips" for kind in run.events.kinds]]
    assert slips == pytest.approx([begins], rel=1e-8)


@pytest.mark.parametrize("stiffness", [1.0, 10.0, 20.0])
def test_a_mass_that_pulls_at_a_body_on_a_stop_with_friction_swings(stiffness: float) -> None:
    """While p1 stands, p4 is an oscillator: p4 = -cos(w t)."""
    model = lagcli.load_text(
        "coordinates: [p1, p4]\nT: p1'^2/2 + p4'^2/2\n"
        f"V: p1 + {stiffness}*(p4 - p1)^2/2\n"
        "constraints:\n  stop: p1 >= 0\n  friction: {expr: p1' = 0, limit: 0.3}\n"
        "initial: {p1: 0, p1': 0, p4: -1, p4': 0}\n"
    )
    rate = math.sqrt(stiffness)
    end = 0.99 * math.acos(-1 if stiffness < 1.3 else -1.3 / stiffness) / rate
    run = lagcli.simulate(model, t_end=end, samples=11, max_steps=1000)
    assert run.status == "completed", run.message
    assert np.abs(run.q[:, 0]).max() == 0
    assert run.q[:, 1] == pytest.approx(-np.cos(rate * run.time), abs=1e-8)


@pytest.mark.parametrize("drag", ["", "- 0.7*x'", "- 0.7*abs(x')*x'", "- 0.7*max(x', 0)"])
@pytest.mark.parametrize("seed", range(12))
def test_a_body_anywhere_slips_once_under_a_growing_load(seed: int, drag: str) -> None:
    """From t1 = G/f on, m v' = f (t - t1) - drag: where the body stands does not matter."""
    rng = random.Random(seed)
    limit, growth, mass = rng.uniform(2, 6), rng.uniform(1, 8), rng.uniform(0.3, 4)
    begins = limit / growth
    model = lagcli.load_text(
        f"coordinates: [x]\nT: {mass!r}*x'^2/2\n"
        f'Q: {{x: "{growth!r}*t {drag}"}}\n'
        f"constraints:\n  friction: {{expr: x' = 0, limit: {limit!r}}}\n"
        f"initial: {{x: {rng.choice([0.3, -2])}, x': 0}}\n"
    )
    run = lagcli.simulate(model, t_end=1.5 * begins, samples=16, max_steps=1000)
    assert run.status == "completed", run.message
    assert run.events is not None
    assert run.events.kinds == ("slips",)
    assert run.events.time == pytest.approx([begins], rel=1e-8)
    moving = run.time > begins
    assert run.q[~moving, 0] == pytest.approx(run.q[0, 0], abs=1e-12)
    if not drag:
        expected = growth * (run.time[moving] - begins) ** 2 / 2 / mass
        assert run.v[moving, 0] == pytest.approx(expected, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("rtol", [1e-7, 1e-9, 1e-11])
@pytest.mark.parametrize("drag", ["abs(x')*x'", "max(x', 0)", "if(x' > 0, x'^2, x')"])
def test_a_body_that_begins_to_slip_does_not_stick_at_once(drag: str, rtol: float) -> None:
    """Its static limit is higher: where its drag has a kink at rest, it could hold there again."""
    events, kept = [], []
    for kick in (0.1, -0.1):  # along the slip, and back
        model = lagcli.load_text(
            "coordinates: [x]\nT: 1.7*x'^2/2\n"
            f'Q: {{x: "3.3*t - 0.8*({drag})"}}\n'
            "constraints:\n"
            "  friction: {expr: x' = 0, limit: {static: 4.9, kinetic: 1.5}}\n"
            f"events:\n  kick: {{when: friction slips, impulse: {{x: {kick}}}, times: 1}}\n"
            "initial: {x: 0.3, x': 0}\n"
        )
        run = lagcli.simulate(model, t_end=3, samples=4, rtol=rtol, max_steps=1000)
        assert run.status == "completed", run.message
        assert run.events is not None
        events.append(run.events.kinds)
        kept.append(run.v[-1, 0])
    assert events[0] == ("slips", "event")
    assert kept[0] > kept[1]


@pytest.mark.parametrize("condition", ["x2' > 0", "x2 > 0.2 and x2' > 0"])
def test_a_force_that_jumps_at_rest_has_one_side_while_friction_holds(condition: str) -> None:
    """Rounding errors of x2' chose the force: x2 stuck and slipped as rtol chose."""
    model = lagcli.load_text(
        "coordinates: [x1, x2]\nT: 1.497*x1'^2/2 + 1.751*x2'^2/2\nV: 3.035*(x1 - x2)^2\n"
        "Q:\n  x1: -1.575*x1*abs(x1 - 0.214)\n"
        f'  x2: "if({condition}, -11.01, -5.505*x2)"\n'
        "constraints:\n  friction: {expr: x2' = 0, limit: 2.76}\n"
        "initial: {x1: 0.008553, x1': 1.98, x2: 0.7374, x2': -1.383}\n"
    )
    logs = []
    for rtol in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12):
        run = lagcli.simulate(model, t_end=2, samples=2, rtol=rtol)
        assert run.status == "completed", run.message
        assert run.events is not None
        logs.append((run.events.kinds, run.events.time.round(5).tolist()))
    assert all(log == logs[-1] for log in logs), logs
