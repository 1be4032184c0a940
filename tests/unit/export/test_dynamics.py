"""The dynamics as a function: values, derivatives, shapes, speed."""

from __future__ import annotations

import time

import numpy as np
import pytest
from exported import close, exported, points
from shipped import every_model

import lagcli
from lagcli.errors import UsageError

MODELS = every_model(smooth=True)


@pytest.mark.parametrize("name", MODELS)
def test_a_and_multipliers_are_those_of_the_engine(name: str) -> None:
    f = lagcli.dynamics(exported(name).model)
    states = [np.array(x) for x in zip(*(point.state for point in points(name)), strict=True)]
    a, multipliers = f(*states)
    position, velocity = f.residuals(*states)
    out = f.outputs(*states)
    for k, point in enumerate(points(name)):
        assert close(a[k], point.a)
        assert close(multipliers[k], point.multipliers)
        assert close(position[k], point.position)
        assert close(velocity[k], point.velocity)
        assert close([x[k] for x in out.values()], point.outputs)


@pytest.mark.parametrize("name", MODELS)
def test_derivatives_are_those_of_differences(name: str) -> None:
    f = lagcli.dynamics(exported(name).model)
    point = points(name)[0]
    state = [np.array(point.t), *map(np.array, point.state[1:])]
    if exported(name).redundant:  # away from the constraints, where they are not redundant
        state[1] += 0.1 * np.random.default_rng(5).standard_normal(len(state[1]))
    found = f.derivatives(*state)
    for place, names in ((1, "q"), (2, "v"), (3, "p")):
        for j in range(len(state[place])):
            # parameters may be of any size: the step follows it
            least = 1.0 if state[place][j] == 0.0 else 0.0 if names == "p" else 1e-2
            h = 1e-5 * max(least, abs(state[place][j]))
            beside = [[x.copy() for x in state] for _ in range(2)]
            beside[0][place][j] -= h
            beside[1][place][j] += h
            low, high = (f(*x) for x in beside)
            for kind, x, y in zip(("a", "multipliers"), low, high, strict=True):
                own = getattr(found, f"{kind}_{names}")
                # second-order differences, next to the largest derivative of the same kind
                size = max(np.abs(own).max(initial=0.0), np.abs(x).max(initial=0.0))
                assert np.abs((y - x) / (2 * h) - own[:, j]).max(initial=0.0) <= 1e-5 * size


@pytest.mark.parametrize(
    ("name", "by"),
    [
        ("slider_crank", ["m", "l", "phi'"]),
        ("rolling_disk", ["g", "x"]),
        ("driven_slider_crank", ["r", "J_1"]),
    ],
)
def test_derivatives_are_those_of_sensitivities(name: str, by: list[str]) -> None:
    """Along the motion: dλ/dθ = ∂λ/∂q dq/dθ + ∂λ/∂v dv/dθ + ∂λ/∂p dp/dθ."""
    model = exported(name).model
    f, run = lagcli.dynamics(model), lagcli.simulate(model, samples=20, sensitivity=by)
    d = f.derivatives(run.time, run.q, run.v)
    for j, direction in enumerate(by):
        of_p = np.array([float(p == direction) for p in f.parameters])
        parts = [
            np.einsum("kij,kj->ki", d.multipliers_q, run.dq[:, :, j]),
            np.einsum("kij,kj->ki", d.multipliers_v, run.dv[:, :, j]),
            d.multipliers_p @ of_p,
        ]
        error = np.abs(sum(parts) - run.dmultipliers[:, :, j]).max()
        assert error <= 1e-12 * max(np.abs(x).max() for x in parts)


def test_derivatives_with_redundant_constraints_are_those_along_motions() -> None:
    """dλ/dl of runs, whose constraints stay redundant, next to differences of runs: h² and 1/h."""
    name, by, h = "parallelogram", "l", 1e-4
    model = exported(name).model
    f = lagcli.dynamics(model)
    options = {"samples": 8, "t_end": 1.0, "rtol": 1e-11}
    run = lagcli.simulate(model, sensitivity=[by], **options)
    value = f.p[f.parameters.index(by)]
    low, high = (
        lagcli.simulate(lagcli.load(name, set={by: value + x}), **options) for x in (-h, h)
    )
    d = f.derivatives(run.time, run.q, run.v)
    of_p = np.array([float(p == by) for p in f.parameters])
    parts = [
        np.einsum("kij,kj->ki", d.multipliers_q, run.dq[:, :, 0]),
        np.einsum("kij,kj->ki", d.multipliers_v, run.dv[:, :, 0]),
        d.multipliers_p @ of_p,
    ]
    expected = (high.multipliers - low.multipliers) / (2 * h)
    assert np.abs(sum(parts) - expected).max() <= 1e-6 * np.abs(expected).max()


def test_axes_of_states_are_broadcast() -> None:
    f = lagcli.dynamics(lagcli.load("slider_crank"))
    q = np.broadcast_to(f.q, (3, 1, 2))
    p = np.array([f.values(m=m) for m in (1.0, 2.0, 4.0, 8.0)])
    a, multipliers = f(np.zeros((3, 1)), q, f.v, p)
    assert a.shape == (3, 4, 2)
    assert multipliers.shape == (3, 4, 1)
    assert np.allclose(multipliers[:, 1], 2 * multipliers[:, 0], rtol=1e-14)
    assert f.derivatives(0.0, q, f.v, p).multipliers_p.shape == (3, 4, 1, 6)
    assert f(0.0, np.empty((0, 2)), np.empty((0, 2))).a.shape == (0, 2)


def test_a_wrong_shape_or_name_is_an_error() -> None:
    f = lagcli.dynamics(lagcli.load("slider_crank"))
    with pytest.raises(UsageError, match="q must have 2 numbers"):
        f(0.0, [1.0, 2.0, 3.0], f.v)
    with pytest.raises(UsageError, match="shapes of the states differ"):
        f(np.zeros(3), np.zeros((2, 2)), f.v)
    with pytest.raises(UsageError, match="not a parameter"):
        f.values(mass=1.0)


def test_a_singular_state_has_no_numbers_and_spoils_no_other() -> None:
    """The rods of a double pendulum of length 0."""
    f = lagcli.dynamics(lagcli.load("pendulum_cartesian"))
    q = np.array([f.q, np.zeros(2), f.q])
    a, multipliers = f(0.0, q, f.v)
    assert np.isnan(a[1]).all()
    assert np.isnan(multipliers[1]).all()
    assert np.array_equal(a[0], a[2])
    assert np.isfinite(a[0]).all()


def test_pivots_of_the_initial_state_that_do_not_suit_are_replaced() -> None:
    """A rod along x, whose pivot vanishes as it turns."""
    f = lagcli.dynamics(lagcli.load("pendulum_cartesian"))
    length = float(np.hypot(*f.q))
    angles = np.append(np.linspace(0, 2 * np.pi, 361), np.arange(5) * np.pi / 2 + 1e-13)
    q = length * np.column_stack([np.sin(angles), -np.cos(angles)])
    rate = 3.0
    v = rate * length * np.column_stack([np.cos(angles), np.sin(angles)])
    _, multipliers = f(0.0, q, v)
    p = dict(zip(f.parameters, f.p, strict=True))
    # x² + y² = l²: 2 λ l is the force along the rod, outwards
    expected = -p["m"] * (p["g"] * np.cos(angles) + rate**2 * length) / (2 * length)
    assert np.allclose(multipliers[:, 0], expected, rtol=1e-12, atol=1e-12)


def test_a_million_states_a_second() -> None:
    """Of CPU, with a factor of three for a busy machine."""
    f = lagcli.dynamics(lagcli.load("slider_crank"))
    q, v = np.tile(f.q, (100_000, 1)), np.tile(f.v, (100_000, 1))
    f(0.0, q, v)
    began = time.process_time()
    f(0.0, q, v)
    assert time.process_time() - began < 0.3
