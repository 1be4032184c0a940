"""Motions along which a pivot of the elimination vanishes, between the ends of steps, too.

z has no inertia: z = 2 cos(ω t) x, λ = k z. The order of elimination that suits the start pairs λ
with x, whose entry of B is 0 where cos(ω t) = 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from random_cases import seeds
from rows_alone import rows_together
from scipy.integrate import solve_ivp

import lagcli
from lagcli.arrays import Array
from lagcli.model.model import Model

MODEL = """
coordinates: [x, z]
parameters: {w: 1, k: 3, m: 1, c: 4, a: 2}
T: m*x'^2/2
V: c*(x - 1)^2/2 + k*z^2/2
constraints: {rod: z = a*cos(w*t)*x}
initial: {x: 1.3, x': 0, z: {guess: 2.6}, z': {guess: 0}}
simulation: {t_end: 3}
"""
EVENT = "events: {zero: {when: CONDITION <= 0}}\n"
END = 3.0


class Case(NamedTuple):
    """Parameters, and the motion by SciPy."""

    values: dict[str, float]

    def model(self, more: str = "") -> Model:
        return lagcli.load_text(MODEL + more, set=self.values)

    @property
    def zeros(self) -> Array:
        """The times at which cos(ω t) = 0."""
        times = (np.arange(20) + 0.5) * math.pi / self.values["w"]
        return times[times < 0.99 * END]

    def crossings(self) -> Array:
        """The times at which z = a cos(ω t) x becomes negative."""
        w, k, m, c, a = (self.values[x] for x in "wkmca")

        def motion(t: float, y: Array) -> list[float]:
            x, v = y
            return [v, (-c * (x - 1) - k * (a * math.cos(w * t)) ** 2 * x) / m]

        def z(t: float, y: Array) -> float:
            return float(math.cos(w * t) * y[0])

        z.direction = -1.0  # type: ignore[attr-defined]
        found = solve_ivp(
            motion, (0, END), [1.3, 0.0], "DOP853", events=z, rtol=1e-12, atol=1e-13, max_step=1e-3
        )
        return np.asarray(found.t_events[0])


def random_case(seed: int) -> Case:
    rng = np.random.default_rng(seed)
    ranges = {"w": (0.6, 4), "k": (0.5, 5), "m": (0.3, 3), "c": (0.5, 9), "a": (1.2, 6)}
    return Case({name: float(rng.uniform(*ends)) for name, ends in ranges.items()})


@pytest.mark.parametrize("method", ["DOP853", "Radau", "Taylor"])
@pytest.mark.parametrize("seed", seeds(4, 60))
def test_multipliers_where_a_pivot_vanishes(seed: int, method: str) -> None:
    """They were 1e16 in one of three runs of which a sample was there."""
    case = random_case(seed)
    beside = np.array([-1e-7, -1e-10, -1e-13, 0.0, 1e-15, 1e-12, 1e-8])
    times = np.unique([0.0, END, *np.ravel(np.outer(case.zeros, 1 + beside))])
    run = lagcli.simulate(case.model(), times=times, method=method)
    assert run.status == "completed", run.message
    z, x, force = run.q[:, 1], run.q[:, 0], run.multipliers[:, 0]
    size = np.abs(z).max()
    exact = case.values["a"] * np.cos(case.values["w"] * run.time) * x
    np.testing.assert_allclose(z, exact, atol=1e-12 * size)
    np.testing.assert_allclose(force, case.values["k"] * z, atol=1e-9 * case.values["k"] * size)


@pytest.mark.parametrize("condition", ["z", "lambda.rod", "x*cos(w*t)"])
@pytest.mark.parametrize("seed", seeds(4, 60))
def test_events_where_a_pivot_vanishes(seed: int, condition: str) -> None:
    """Half of these runs ended, and others went on from the state before the step."""
    case = random_case(seed)
    run = lagcli.simulate(case.model(EVENT.replace("CONDITION", condition)))
    assert run.status == "completed", run.message
    assert run.events is not None
    expected = case.crossings()
    assert len(run.events) == len(expected)
    np.testing.assert_allclose(run.events.time, expected, atol=1e-7)


def test_rows_of_a_sweep_where_a_pivot_vanishes() -> None:
    model, rates = lagcli.load_text(MODEL), np.linspace(1, 3, 32)
    for some in np.split(rates, 4):
        times = np.unique([0.0, END, *(math.pi / 2 / some)])
        _, rows = rows_together(model, ["w"], some[:, None], samples=None, times=times)
        for samples, run, _ in rows:
            assert getattr(run, "status", run) == "completed"
            np.testing.assert_allclose(samples[:, 7], 3 * samples[:, 2], atol=1e-8)
