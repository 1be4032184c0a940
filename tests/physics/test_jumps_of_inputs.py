"""Jumps of inputs that end modes and cause events: at their rows, and seen by the samples there."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import lagcli

METHODS = ("DOP853", "Taylor", "Radau")

#: A block on a floor with friction, under forces that step.
BLOCK = """\
coordinates: {{x: m, y: m}}
parameters: {{m: 1 kg, g: 10 m/s^2, mu: 0.3}}
inputs:
  F: {{times: {times}, values: {pull}, unit: N, interpolation: step, extend: hold}}
  P: {{times: {times}, values: {push}, unit: N, interpolation: step, extend: hold}}
T: m/2*(x'^2 + y'^2)
V: m*g*y
Q: {{x: P, y: F}}
constraints: {{floor: {{expr: y >= 0, friction: mu, slip: x'}}}}
initial: {{x: 0, x': 0, y: 0, y': 0}}
events: {{light: {{when: lambda.floor <= 2, record: [lambda.floor]}}}}
"""


def test_a_block_slips_and_lifts_off_at_rows() -> None:
    text = BLOCK.format(times=[0, 0.25, 0.5, 1], pull=[0, 0, 15, 0], push=[0, 5, 0, 0])
    run = lagcli.simulate(lagcli.load_text(text), times=[0.2, 0.25, 0.4, 0.5, 1.0])
    log = run.events
    assert log is not None
    found = list(zip(log.time.tolist(), log.names, log.kinds, strict=True))
    assert found == [
        (0.25, "floor.slip", "slips"),
        (0.5, "light", "event"),
        (0.5, "floor", "opens"),
    ]
    np.testing.assert_allclose(run.multipliers, [[10, 0], [10, -3], [10, -3], [0, 0], [0, 0]])
    np.testing.assert_allclose(run.a, [[0, 0], [2, 0], [2, 0], [0, 5], [0, -10]], atol=1e-12)
    assert [x[1] for x in log.recorded("lambda.floor")] == [10, 0]


@pytest.mark.parametrize("seed", range(12))
def test_forces_at_rows_obey_the_laws_of_contact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    times = [0.0, *np.sort(rng.choice(np.arange(1, 40), 12, replace=False) / 20).tolist()]
    pull, push = (
        rng.uniform(-10, 14, 13).round(2).tolist(),
        rng.uniform(-6, 6, 13).round(2).tolist(),
    )
    text = BLOCK.format(times=times, pull=pull, push=push)
    run = lagcli.simulate(lagcli.load_text(text), times=times[1:])
    normal, slip, velocity = run.multipliers[:, 0], run.multipliers[:, 1], run.v[:, 0]
    assert (normal >= 0).all()
    assert (np.abs(slip) <= 0.3 * normal * (1 + 1e-9)).all()
    moving = np.abs(velocity) > 1e-6
    np.testing.assert_allclose(slip[moving], -0.3 * (normal * np.sign(velocity))[moving], atol=1e-9)
    rests = ~moving & (normal > 0)
    sticks = np.clip(-np.array(push[1:]), -0.3 * normal, 0.3 * normal)
    np.testing.assert_allclose(slip[rests], sticks[rests], atol=1e-9)
    np.testing.assert_allclose(run.a[:, 1], pull[1:] + normal - 10, atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("clock", ["", "  tick: {every: 0.1, set: {w: w + u}}\n"])
def test_conditions_that_jumps_make_true(method: str, clock: str) -> None:
    """Also at the end, and where a clock ticks; u has the value of the row."""
    text = f"""\
coordinates: [x]
parameters: {{n: 0, w: 0}}
inputs: {{u: {{times: [0, 0.3, 0.5, 0.8], values: [1, 5, 2, 7], interpolation: step}}}}
T: x'^2/2
Q: {{x: u}}
initial: {{x: 0, x': 1}}
outputs: {{count: n, sum: w}}
events:
{clock}  high: {{when: u + x/100 >= 4, set: {{n: n + u}}}}
"""
    run = lagcli.simulate(lagcli.load_text(text), times=[0.1, 0.3, 0.4, 0.5, 0.8], method=method)
    assert run.events is not None
    high = [t for t, name in zip(run.events.time, run.events.names, strict=True) if name == "high"]
    assert high == [0.3, 0.8]
    assert run.outputs["count"].tolist() == [0, 5, 5, 5, 12]
    assert run.a[:, 0].tolist() == [1, 5, 5, 2, 7]
    if clock:
        assert run.outputs["sum"].tolist() == [2, 8, 13, 15, 26]


def test_derivatives_at_rows() -> None:
    """The times of rows are given: they do not depend on the state or on parameters."""
    text = """\
coordinates: [x, y]
parameters: {a: 15, k: 3, s: 0.3}
inputs: {F: {times: [0, 0.5], values: [0, 1], interpolation: step, extend: hold}}
T: (x'^2 + y'^2)/2
V: 10*y + k/2*x^2
Q: {y: a*F + k*x/2}
constraints: {floor: y >= 0}
initial: {x: s, x': 1, y: 0, y': 0}
events: {double: {when: F*(x + 1) >= 0.5, set: {x': 2*x'}}}
"""
    base = {"a": 15.0, "k": 3.0, "s": 0.3}
    options = {"t_end": 0.9, "samples": 2, "rtol": 1e-11}
    run = lagcli.simulate(lagcli.load_text(text), sensitivity=list(base), **options)
    assert run.events is not None
    assert run.events.time.tolist() == [0.5, 0.5]
    assert (np.asarray(run.events.dtime) == 0).all()
    for k, (name, value) in enumerate(base.items()):
        high, low = (
            lagcli.simulate(lagcli.load_text(text, set={name: value + h}), **options)
            for h in (1e-4, -1e-4)
        )
        for derivative, x, y in ((run.dq, high.q, low.q), (run.dv, high.v, low.v)):
            expected = (x[-1] - y[-1]) / 2e-4
            np.testing.assert_allclose(np.asarray(derivative)[-1, :, k], expected, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("span", "time"), [((0, 2), 0.7), ((-3, 4), -1.4), ((0, 40), 0.1)])
def test_times_within_compound_conditions_are_exact(
    method: str, span: tuple[float, float], time: float
) -> None:
    text = f"""\
coordinates: [x]
parameters: {{n: 0}}
T: x'^2/2
initial: {{x: 0, x': 1}}
outputs: {{count: n}}
events:
  both: {{when: x >= -100 and t >= {time}, set: {{n: n + 1}}}}
  either: {{when: x >= 100 or t >= {time}, set: {{n: n + 10}}}}
"""
    ends = {"t_start": span[0], "times": [time, span[1]], "method": method}
    run = lagcli.simulate(lagcli.load_text(text), **ends)
    assert run.events is not None
    assert run.events.time.tolist() == [time, time]
    assert run.outputs["count"].tolist() == [11, 11]


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("u >= 1", [1, 3]),
        ("u > 0", [1, 3]),
        ("not (u < 1)", [1, 3]),
        ("u >= 1 and x >= -5", [1, 3]),
        ("u <= 0", [2]),
        ("u < 1 or x >= 100", [2]),
        ("u = 1", [1, 2, 3]),
        ("n >= 2", [2]),
        ("n > 2", [3]),
        ("n >= 2 and x <= 100", [2]),
        ("not (n <= 2)", [3]),
        ("n = 2", [2]),
        ("n <= -3", []),
    ],
)
def test_conditions_that_jump_to_their_bound(condition: str, expected: list[float]) -> None:
    """Those of inputs that step, and of counters: with `>` they differ from `>=`."""
    text = f"""\
coordinates: [x]
parameters: {{n: 0}}
inputs: {{u: {{times: [0, 1, 2, 3], values: [0, 1, 0, 1], interpolation: step, extend: hold}}}}
T: x'^2/2
initial: {{x: 1, x': 0.1}}
events:
  count: {{every: 1, offset: 1, times: 3, set: {{n: n + 1}}}}
  found: {{when: "{condition}", record: false}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=5, samples=2)
    assert run.events is not None
    log = zip(run.events.time, run.events.names, strict=True)
    assert [t for t, name in log if name == "found"] == expected


@pytest.mark.parametrize("seed", range(12))
def test_rows_of_later_periods_are_at_their_decimal_times(seed: int) -> None:
    """Samples and events at rows of tables far from the run, whose period is no binary fraction."""
    rng = np.random.default_rng(seed)
    h = Fraction(int(rng.integers(1, 100)), int(rng.choice([10, 100, 1000])))
    rows, first, end = (
        int(rng.integers(2, 5)),
        int(rng.integers(-30, 30)),
        int(rng.integers(-200, 200)),
    )
    end = 0 if seed % 2 else end
    start = end - int(rng.integers(3, 40))
    values = [k % 2 for k in range(rows)]

    def value(k: int) -> int:
        return values[(k - first) % rows]

    text = f"""\
coordinates: [x]
inputs:
  u:
    times: {[float(k * h) for k in range(first, first + rows + 1)]}
    values: {[*values, values[0]]}
    interpolation: step
    extend: periodic
T: x'^2/2
Q: {{x: u}}
events: {{rises: {{when: u >= 1}}}}
outputs: {{u: u}}
initial: {{x: 0, x': 0}}
simulation: {{t_start: {float(start * h)}, t_end: {float(end * h)}, dt: {float(h)}}}
"""
    run = lagcli.simulate(lagcli.load_text(text))
    assert run.outputs["u"].tolist() == [value(k) for k in range(start, end + 1)]
    assert run.time.tolist() == [float(k * h) for k in range(start, end + 1)]
    assert run.events is not None
    rises = [k for k in range(start + 1, end + 1) if value(k) > value(k - 1)]
    scale = float(h) * max(abs(start), abs(end), abs(first))
    np.testing.assert_allclose(
        run.events.time, [float(k * h) for k in rises], rtol=0, atol=1e-15 * scale
    )
