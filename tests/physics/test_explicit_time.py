"""Stiff forces of time and state: no more steps than with time as a coordinate; and moving loads.

A belt's friction changes quickly at a fixed velocity of the block that it drags, but not along the
motion, where the block follows it. A short load that passes a body at rest is a pulse of time.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from random_cases import some

import lagcli

FOUND = Path(__file__).parents[1] / "found"
PAIRS = {"belt_ramp": "belt_ramp_notime", "disc_block_2d": "disc_block_notime"}
#: More than the steps of the model without explicit time, which vary with rounding.
MORE = 1.5


@pytest.mark.parametrize("eps", ["1e-5", "1e-6"])
@pytest.mark.parametrize("method", ["auto", "Radau"])
@pytest.mark.parametrize("name", PAIRS)
def test_found(name: str, method: str, eps: str) -> None:
    timed, other = (
        lagcli.simulate(
            lagcli.load_text(
                re.sub(r"eps: 1e-5", f"eps: {eps}", (FOUND / f"{which}.yaml").read_text())
            ),
            method=method,
        )
        for which in (name, PAIRS[name])
    )
    assert timed.status == other.status == "completed"
    assert timed.counts["steps"] < MORE * other.counts["steps"]
    for coordinate in timed.coordinates:
        there = other.coordinates.index(coordinate)
        here = timed.coordinates.index(coordinate)
        # the tolerance, of coordinates of order one
        np.testing.assert_allclose(timed.q[:, here], other.q[:, there], atol=1e-8)
        np.testing.assert_allclose(timed.v[:, here], other.v[:, there], atol=1e-8)


#: Stiff forces on x, of the drive's position P and velocity V, and of their width e.
FORCES = {
    "friction": "-2*(x' - V)/sqrt((x' - V)^2 + e^2)",
    "Stribeck": "-(1 + 0.6*exp(-((x' - V)/0.2)^2))*tanh((x' - V)/e)",
    "spring": "-(x - P)/e - 5/e*(x - P)^3 - (x' - V)/sqrt(e)*(1 + 0.1*(x' - V)^2)",
    "saturation": "-3*tanh((x - P)/e) - 2/sqrt(e)*(x' - V)/(1 + 4*(x' - V)^2)",
    "wall": "1/e*((P - x + sqrt((P - x)^2 + e^2))/2)^1.5",
}
#: Drives: their positions and velocities.
DRIVES = {
    "ramp": ("(0.2*t + 0.4*t^2)", "(0.2 + 0.8*t)"),
    "sine": ("(-0.3*cos(2*t + 1))", "(0.6*sin(2*t + 1))"),
}


@pytest.mark.parametrize("method", ["auto", "Radau", "DOP853", "Taylor"])
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("force", FORCES)
def test_time_costs_as_much_as_a_coordinate(force: str, drive: str, method: str) -> None:
    """The coordinate tau has a constant velocity, and hardly any energy."""
    width = 1e-4 if method in ("auto", "Radau") else 3e-3
    where, speed = DRIVES[drive]
    text = FORCES[force].replace("P", where).replace("V", speed).replace("e^", f"{width}^")
    text = re.sub(r"\be\b", str(width), text)
    timed = f"coordinates: [x]\nT: x'^2/2\nV: 4*x^2\nQ: {{x: \"{text}\"}}\ninitial: {{x: 0, x': 0}}"
    still = timed.replace("[x]", "[tau, x]").replace("T: ", "T: 1e-9*tau'^2/2 + ")
    still = re.sub(r"\bt\b", "tau", still).replace("{x: 0,", "{tau: 0, tau': 1, x: 0,")
    one, other = (
        lagcli.simulate(lagcli.load_text(model), method=method, t_end=3.0, samples=4, atol=1e-10)
        for model in (timed, still)
    )
    assert one.status == other.status == "completed"
    assert one.counts["steps"] < MORE * other.counts["steps"] + 10
    np.testing.assert_allclose(one.q[:, 0], other.q[:, 1], atol=1e-7)


#: Loads of z and their integrals.
LOADS = {"exp(-z^2)": math.sqrt(math.pi), "1/cosh(z)^2": 2.0, "exp(-z^4)": 2 * math.gamma(1.25)}


@pytest.mark.parametrize("method", some(["auto", "Radau", "DOP853", "Taylor", "Rodas5P"], 2))
@pytest.mark.parametrize(("own", "speed"), [(0.0, 0.5), (0.0, -2.0), (0.3, -0.4), (-0.5, -0.6)])
@pytest.mark.parametrize("load", LOADS)
def test_a_short_load_that_passes_a_body(load: str, own: float, speed: float, method: str) -> None:
    """It meets a body that moves with its `own` velocity at 4.2 s, for about a millisecond."""
    impulse, time, width = 1e-5, 4.2, 1e-3
    z = f"((x - {own * time!r} - {speed!r}*(t - {time!r}))/{width * abs(speed - own)!r})"
    size = impulse / LOADS[load] / width
    text = (
        f'coordinates: [x]\nT: x\'^2/2\nQ: {{x: "{size!r}*({load.replace("z", z)})"}}\n'
        f"initial: {{x: 0, x': {own!r}}}\n"
    )
    found = lagcli.simulate(lagcli.load_text(text), method=method, t_end=10.0, samples=3)
    assert found.status == "completed", found.message
    # the body moves by less than a thousandth of the load's width; a moving one has a tolerance
    assert found.v[-1, 0] - own == pytest.approx(impulse, rel=1e-3, abs=1e-9)
    # the impulse is what the tolerance of a body at rest follows
    assert found.counts["steps"] < (1000 if method in ("auto", "DOP853", "Taylor") else 10_000)


def test_a_load_that_a_body_runs_into() -> None:
    """Where the body begins, the load is 1e-250 of its size, and rises as it comes nearer.

    Steps were a billionth of the run. The body hardly slows down: it nears the load at 1 m/s.
    """
    text = (
        'coordinates: [x]\nT: x\'^2/2\nQ: {x: "3e-6*exp(-((x + 3 + t)/0.3)^2)"}\n'
        "initial: {x: 5, x': -2}\n"
    )
    found = lagcli.simulate(lagcli.load_text(text), t_end=20.0, samples=3)
    assert found.status == "completed"
    assert found.counts["steps"] < 500
    impulse = 3e-6 * 0.3 * math.sqrt(math.pi)
    assert found.v[-1, 0] + 2 == pytest.approx(impulse, rel=1e-4, abs=1e-9)


def _logistic() -> str:
    """Return a model with a difference of logistic functions that passes a body at rest.

    Before it, the difference is 1 - 1: rounding errors of it are larger than any velocity so far.
    """
    size, speed, time, width = 8.98, 1.637, 6.1625, 7.3e-5
    z = f"((x - {speed}*(t - {time}))/{width})"
    return (
        "coordinates: [x]\nT: x'^2/2\n"
        f'Q: {{x: "{size}*(1/(1 + exp(-{z})) - 1/(1 + exp(1 - {z})))"}}\n'
        "initial: {x: 0, x': 0}\n"
    )


LOGISTIC = _logistic()


def test_a_force_that_sets_in_below_rounding_errors() -> None:
    """Steps fell to the smallest where the force is smaller than what rounding errors change.

    The velocity is that of the force without cancellation, S s(z) s(1 - z) (1 - 1/e) with the
    logistic function s, integrated by SciPy's DOP853 with rtol = 1e-12 and steps of 20 us at most.
    """
    found = lagcli.simulate(lagcli.load_text(LOGISTIC), method="Radau", t_end=10.0, samples=3)
    assert found.status == "completed", found.message
    assert found.v[-1, 0] == pytest.approx(4.0050103881701676e-4, rel=1e-8)


@pytest.mark.parametrize("method", ["auto", "DOP853", "Radau"])
@pytest.mark.parametrize(
    "load",
    [
        "2*t/(1 - x/0.5)",
        "2*t^3/(1 - x/0.5)",
        "2*max(0, t - 0.5)/(1 - x/0.5)",
        "2*max(0, t - 0.5)/(1 - x/0.5)^2",
        "2*exp(-1/max(t, 1e-9))/(1 - x/0.5)",
        "2/(1 - x/0.5)/(1 + exp(-(t - 1)/0.001))",
    ],
)
def test_a_body_that_leaves_rest_does_not_pass_a_pole(load: str, method: str) -> None:
    """Rounding errors beside the pole excused any error: the body came out on its other side.

    Before it, the force is positive: x rises to 0.5, where the motion ends.
    """
    text = f"coordinates: [x]\nT: x'^2/2\nQ: {{x: \"{load}\"}}\ninitial: {{x: 0, x': 0}}\n"
    found = lagcli.simulate(lagcli.load_text(text), method=method, t_end=5.0, samples=501)
    assert found.status == "failed"
    assert np.all(np.diff(found.q[:, 0]) >= -1e-12)
    assert 0.4 < found.q[-1, 0] < 0.5


def test_a_step_taken_back_is_not_repeated() -> None:
    """Next to the load the series fails. DOP853's first step was longer than what was taken back.

    It was taken back again, without end.
    """
    found = lagcli.simulate(
        lagcli.load_text(LOGISTIC), method="Taylor", t_end=10.0, max_steps=100, timeout=30.0
    )
    assert found.counts["steps"] == 100, found.message
