"""Dynamic jam: rods that slide into Painlevé's singular point, where the force has no bound.

With the slip backwards, λ = N/p, N = m (g − l θ'² s), p = 1 + m l² c (c − μ s)/I. Both vanish at
the singular point. F. Génot and B. Brogliato, Eur. J. Mech. A/Solids 18 (1999) 653,
doi:10.1016/S0997-7538(99)00144-8. In the time τ with dt = p dτ the equations are regular, and the
point is a stable node. λ grows without bound there if μ > 8/(3√3) (a uniform rod).
"""

from __future__ import annotations

import math
import random
from typing import NamedTuple

import numpy as np
import pytest
from random_cases import FUZZ_COUNT
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import lagcli
from lagcli.trajectory.event_log import event_sentences


class Rod(NamedTuple):
    """A rod with half length l, and its start: angle, rate, and the velocity of the tip."""

    mass: float
    length: float
    inertia: float
    gravity: float
    mu: float
    theta: float
    rate: float
    slip: float

    def margin(self, theta: float) -> float:
        c, s = math.cos(theta), math.sin(theta)
        return 1.0 + self.mass * self.length**2 * c * (c - self.mu * s) / self.inertia

    def load(self, theta: float, rate: float) -> float:
        """Return N."""
        return self.mass * (self.gravity - self.length * math.sin(theta) * rate**2)

    def motions(self, theta: float, rate: float) -> int:
        """Count the motions that the laws of contact allow: open, or sliding with λ ≥ 0."""
        load, margin = self.load(theta, rate), self.margin(theta)
        return int(load < 0.0) + int(load / margin >= 0.0)

    def text(self, end: float) -> str:
        c, s = math.cos(self.theta), math.sin(self.theta)
        return f"""
coordinates: [x, y, theta]
parameters: {{m: {self.mass!r}, l: {self.length!r}, I: {self.inertia!r}, g: {self.gravity!r}}}
definitions:
  x_A: x - l*cos(theta)
  y_A: y - l*sin(theta)
T: m/2*(x'^2 + y'^2) + I/2*theta'^2
V: m*g*y
constraints:
  tip: {{expr: y_A >= 0, friction: {self.mu!r}, slip: x_A'}}
initial:
  theta: {self.theta!r}
  x: 0
  y: l*sin({self.theta!r})
  theta': {self.rate!r}
  x': {self.slip - self.length * s * self.rate!r}
  y': {self.length * c * self.rate!r}
simulation: {{t_end: {end!r}, samples: 101}}
"""

    def regular(self) -> tuple[str, float, object]:
        """Integrate in the time τ: how the sliding ends, when, and (θ, θ', t, slip) over τ."""
        rate = math.sqrt(self.gravity / self.length)

        def slopes(_: float, z: np.ndarray) -> list[float]:
            theta, omega = z[0], z[1]
            c, s = math.cos(theta), math.sin(theta)
            p, n = self.margin(theta), self.load(theta, omega)
            turn = -self.length * (c - self.mu * s) / self.inertia * n
            slip = self.mu * n / self.mass + self.length * (s * turn + c * omega**2 * p)
            return [p * omega, turn, p, slip]

        def opens(_: float, z: np.ndarray) -> float:
            return self.load(z[0], z[1])

        def sticks(_: float, z: np.ndarray) -> float:
            return float(z[3])

        opens.terminal = sticks.terminal = True  # type: ignore[attr-defined]
        opens.direction = -1  # type: ignore[attr-defined]
        start = [self.theta, self.rate, 0.0, self.slip]
        sizes = np.array([1.0, rate, 1.0 / rate, rate * self.length])
        found = solve_ivp(
            slopes, (0.0, 400.0 / rate), start, method="DOP853", rtol=1e-12, atol=1e-14 * sizes,
            events=[opens, sticks], dense_output=True,
        )  # fmt: skip
        end = found.y[:, -1]
        if found.t_events[1].size:
            return "sticks", float(end[2]), found
        singular = abs(self.margin(end[0])) < 1e-8
        return "jams" if singular else "opens", float(end[2]), found


def rod(seed: int) -> Rod:
    """Return a rod below Painlevé's range of angles, in random units."""
    rng = random.Random(seed)
    unit = rng.choice([1e-6, 1.0, 1e3])
    second = rng.choice([1e-3, 1.0, 3600.0])
    mass, length = rng.choice([1e-9, 1.0, 1e6]) * rng.uniform(0.2, 5), unit * rng.uniform(0.2, 3)
    gravity = 9.81 * unit / second**2 * rng.uniform(0.2, 3)
    ratio = rng.choice([1 / 3, rng.uniform(0.05, 1)])
    # Painlevé's least friction, 4/3 for a uniform rod
    mu = 2 * math.sqrt(ratio * (1 + ratio)) * rng.uniform(1.02, 2.5)
    made = Rod(mass, length, ratio * mass * length**2, gravity, mu, 0.0, 0.0, 0.0)
    steepest = (math.pi - math.atan(mu)) / 2  # where μ s c − c² is largest
    bound = brentq(made.margin, 1e-9, steepest, xtol=1e-15)
    theta = bound * (1 - rng.choice([0.01, 0.05, 0.1, 0.3]))
    rate = math.sqrt(gravity / length / math.sin(bound)) * rng.uniform(0.3, 1)
    slip = -rng.choice([3, 20, 100]) * math.sqrt(gravity * length)
    return made._replace(theta=theta, rate=rate, slip=slip)


def check_rod(seed: int, rtol: float = 1e-9) -> str:
    """Compare a run up to the end of the sliding; return what it is."""
    one = rod(seed)
    expected, instant, found = one.regular()
    run = lagcli.simulate(lagcli.load_text(one.text(1.01 * instant)), rtol=rtol)
    assert run.events is not None
    kinds = [x for x in run.events.kinds if x not in ("closes", "redundant")]
    if expected != "jams" and abs(one.margin(float(found.y[0, -1]))) < 100 * rtol:
        return "next to the singular point"
    assert kinds[0] == ("slips" if expected == "sticks" and kinds[0] == "slips" else expected)
    time = float(run.events.time[run.events.kinds.index(kinds[0])])
    # errors of the force, and of what ends it, grow with 1/p
    assert time == pytest.approx(instant, rel=1e4 * rtol)
    # λ before, whose errors grow with 1/p
    tau = np.linspace(0.0, found.t[-1], 20_000)
    theta, rate, at, _ = found.sol(tau)
    chosen = [k for k, t in enumerate(run.time) if t < 0.9 * instant]
    before = at < 0.95 * instant
    path = zip(theta[before], rate[before], strict=True)
    force = [one.load(a, b) / one.margin(a) for a, b in path]
    expected_force = np.interp(run.time[chosen], at[before], force)
    assert run.multipliers[chosen, 0] == pytest.approx(expected_force, rel=max(1e-3, 1e5 * rtol))
    if expected != "jams":
        return expected
    assert run.status == "failed"
    assert "`tip`" in " ".join(event_sentences(run.events.to_mapping()))
    assert f"lambda.tip grows without bound while it slides (dynamic jam) at t = {time:.9g} s" in (
        run.message
    )
    # by hand: one motion before, none or two beyond the bound
    assert one.motions(one.theta, one.rate) == 1
    end = float(found.y[0, -1])
    speed = math.sqrt(one.gravity / one.length / math.sin(end))
    assert one.motions(end + 1e-6, 0.999 * speed) == 0
    assert one.motions(end + 1e-6, 1.001 * speed) == 2
    return expected


@pytest.mark.parametrize("seed", [1, 5, 20, 21, 28, 30])
def test_rods_that_slide_to_the_end(seed: int) -> None:
    check_rod(seed)


@pytest.mark.fuzz
def test_many_rods_that_slide_to_the_end() -> None:
    seen = set()
    for seed in range(FUZZ_COUNT // 2):
        seen.add(check_rod(100 + seed, random.Random(seed).choice([1e-7, 1e-9, 1e-11])))
    assert {"jams", "opens", "sticks"} <= seen
