"""The System of the motion and its derivatives: names, patterns, tapes."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import symengine as se
from oracle import Motion, motion

import lagcli
from lagcli.engine.constraints.index1 import Index1
from lagcli.engine.contract import Block
from lagcli.engine.evaluator import Evaluator
from lagcli.engine.linear.dense import solve_regular
from lagcli.engine.lowering.tangent import lower_tangent
from lagcli.engine.sensitivity.integration import Derivatives, with_derivatives
from lagcli.engine.system import System
from lagcli.engine.tape.interpreter import ScalarTape
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.simulation import Simulation, prepare

MODELS = Path(__file__).parents[4] / "models"
SIMULATION = prepare(lagcli.load(MODELS / "slider_crank.yaml"))
DIRECTIONS = [{"m": se.Integer(1)}, {"l": se.Integer(1)}]


def made() -> System:
    tangent = lower_tangent(SIMULATION.equations, DIRECTIONS)
    return with_derivatives(SIMULATION.system, tangent, ("m", "l"))


def test_names_and_patterns_repeat_in_blocks() -> None:
    system = made()
    assert system.coordinates == ("phi", "psi", "dphi/dm", "dpsi/dm", "dphi/dl", "dpsi/dl")
    assert system.constraints == ("guide", "dguide/dm", "dguide/dl")
    assert system.holonomic == (0, 1, 2)
    assert {(i // 2, j // 2) for i, j in system.mass_pattern} == {(0, 0), (1, 1), (2, 2)}
    assert {(i, j // 2) for i, j in system.jacobian_pattern} == {(0, 0), (1, 1), (2, 2)}


def test_accelerations_solve_the_variational_equations() -> None:
    system, own = made(), SIMULATION.start.state
    rng = np.random.default_rng(3)
    s, u = rng.uniform(-1, 1, 4), rng.uniform(-1, 1, 4)
    q, v = np.concatenate([own.q, s]), np.concatenate([own.v, u])
    # with derivatives, the dynamics tape has f and γ of the motion alone
    d = Evaluator(system, own.p).dynamics(0.0, q, v)
    assert not d.forcing[2:].any()
    assert not d.rhs[1:].any()
    a, multipliers, power = Index1(Evaluator(system, own.p), 3).accelerations(0.0, q, v)
    base = Evaluator(SIMULATION.system, own.p).dynamics(0.0, own.q, own.v)
    expected = solve_regular(base.mass_matrix, base.forcing, base.jacobian, base.rhs)
    np.testing.assert_allclose(a[:2], expected[0], rtol=1e-12)
    np.testing.assert_allclose(multipliers[:1], expected[1], rtol=1e-12)
    tangent = lower_tangent(SIMULATION.equations, DIRECTIONS)
    sides = np.array(
        ScalarTape(tangent.dynamics)((0.0, *q, *v, *expected[0], *expected[1], *own.p))
    ).reshape(2, 3)
    for k in range(2):
        found, force = a[2 + 2 * k : 4 + 2 * k], multipliers[1 + k]
        left = base.mass_matrix @ found - base.jacobian.T @ [force]
        np.testing.assert_allclose(left, sides[k, :2], rtol=1e-10, atol=1e-9)
        np.testing.assert_allclose(base.jacobian @ found, sides[k, 2:], rtol=1e-10, atol=1e-9)
    # the power of the derivatives' multipliers is none of the motion's
    own_power = base.power + expected[1] @ (base.jacobian @ own.v)
    np.testing.assert_allclose(power, own_power, atol=1e-13 * np.abs(multipliers).max())


def test_derivatives_for_implicit_methods_are_block_diagonal() -> None:
    system = made()
    assert system.variation is not None
    assert SIMULATION.system.variation is not None
    own, found = SIMULATION.system.variation(), system.variation()
    assert not found.exact
    assert len(found.force_position) == 3 * len(own.force_position)
    assert all(i // 2 == j // 2 for i, j in found.force_position)


def simulation(name: str = "slider_crank", **options: object) -> Simulation:
    settings = SettingsOverrides(
        **{"sensitivity": ("l", "m"), "samples": 21, "t_end": 1.0, **options}
    )
    return prepare(lagcli.load(MODELS / f"{name}.yaml"), settings)


def run(prepared: Simulation) -> tuple[list[tuple[Block, Derivatives]], object]:
    blocks: list[tuple[Block, Derivatives]] = []
    assert prepared.sensitivity is not None
    found = prepared.sensitivity.integrate(prepared.request, lambda *x: blocks.append(x))
    return blocks, found


@cache
def accurate(end: float) -> list[tuple[Block, Derivatives]]:
    """Return the blocks of a run with a small tolerance."""
    return run(simulation(rtol=1e-12, t_end=end))[0]


@pytest.mark.parametrize(
    "options",
    [
        {"method": "Radau"},
        {"method": "Taylor"},
        {"formulation": "baumgarte"},
        {"formulation": "index1"},
    ],
    ids=lambda options: "-".join(map(str, options.values())),
)
def test_methods_and_formulations_agree(options: dict[str, object]) -> None:
    reference = accurate(1.0)
    found, _ = run(simulation(rtol=1e-10, **options))
    for part in ("q", "v", "multipliers"):
        expected = np.concatenate([getattr(d, part) for _, d in reference])
        values = np.concatenate([getattr(d, part) for _, d in found])
        # a hundred tolerances, of the largest
        np.testing.assert_allclose(values, expected, atol=1e-8 * np.abs(expected).max())


def test_blocks_hold_the_motion_and_derivatives_by_parameter() -> None:
    blocks, _ = run(simulation())
    motion = np.concatenate([block.q for block, _ in blocks])
    plain = lagcli.simulate(lagcli.load(MODELS / "slider_crank.yaml"), samples=21, t_end=1.0)
    np.testing.assert_allclose(motion, plain.q, rtol=1e-7)
    derivatives = blocks[0][1]
    count = len(blocks[0][0].time)
    assert derivatives.q.shape == derivatives.v.shape == derivatives.a.shape == (count, 2, 2)
    assert derivatives.multipliers.shape == (count, 1, 2)
    work = np.concatenate([block.work for block, _ in blocks])
    # nothing works on the slider-crank: the power of the derivatives' multipliers is left out
    np.testing.assert_allclose(work, 0.0, atol=1e-9)


def test_a_run_continues_with_another_order_of_elimination(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where a pivot vanishes on the way."""
    from lagcli.engine.integrate.run import Integration

    whole, _ = run(simulation())
    prepared = simulation()
    advance, steps = Integration.handle_status, []

    def interrupted(self: Integration, status: int) -> bool:
        done = advance(self, status)
        steps.append(status)
        if len(steps) == 3:
            self.reorder()
        return done

    monkeypatch.setattr("lagcli.engine.integrate.run._SLICE", 1e-5)
    monkeypatch.setattr(Integration, "handle_status", interrupted)
    found, _ = run(prepared)
    assert len(steps) > 3
    times = np.concatenate([block.time for block, _ in found])
    np.testing.assert_array_equal(times, np.concatenate([block.time for block, _ in whole]))
    for part in ("q", "multipliers"):
        expected = np.concatenate([getattr(d, part) for _, d in whole])
        values = np.concatenate([getattr(d, part) for _, d in found])
        np.testing.assert_allclose(values, expected, atol=1e-6 * np.abs(expected).max())


def test_multipliers_that_are_not_unique_have_no_derivatives() -> None:
    blocks, _ = run(simulation("parallelogram", sensitivity=("m",)))
    assert np.isnan(np.concatenate([d.multipliers for _, d in blocks])).any()
    assert np.isfinite(np.concatenate([d.q for _, d in blocks])).all()


@cache
def by_differences(name: str, parameter: str, **settings: object) -> Motion:
    """Return the derivatives of the oracle's motion, by central differences of fourth order."""
    value = lagcli.load(MODELS / f"{name}.yaml").parameter_values[parameter]
    h = 1e-3 * value
    at = [
        motion(lagcli.load(MODELS / f"{name}.yaml", set={parameter: value + k * h}), **settings)
        for k in (-2, -1, 1, 2)
    ]
    return Motion(*((a - 8 * b + 8 * c - d) / (12 * h) for a, b, c, d in zip(*at, strict=True)))


@pytest.mark.parametrize("name", ["slider_crank", "parallelogram"])
@pytest.mark.parametrize("method", ["DOP853", "Radau"])
def test_derivatives_where_the_matrix_is_dense(
    name: str, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where no static order suits: redundant constraints, or masses that vanish."""
    names = ("m",) if name == "parallelogram" else ("l", "m")
    options = {"sensitivity": names, "rtol": 1e-10, "t_end": 0.5}
    reference = [by_differences(name, parameter, t_end=0.5, samples=21) for parameter in names]
    monkeypatch.setattr("lagcli.engine.integrate.run.find_elimination", lambda *arguments: None)
    found, _ = run(simulation(name, method=method, **options))
    for part in ("q", "v", "multipliers"):
        expected = np.stack([getattr(x, part) for x in reference], axis=-1)
        values = np.concatenate([getattr(d, part) for _, d in found])
        if (name, part) == ("parallelogram", "multipliers"):  # not unique
            assert np.isnan(values).all()
            continue
        scale = np.abs(expected).max(initial=1e-300)
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-7 * scale)


def test_derivatives_do_not_shorten_the_steps_of_the_motion() -> None:
    plain = lagcli.simulate(lagcli.load(MODELS / "chain.yaml"), t_end=1.0)
    found = prepare(
        lagcli.load(MODELS / "chain.yaml"), SettingsOverrides(t_end=1.0, sensitivity=("l", "g"))
    ).run(lambda samples: None)
    assert found.counts["steps"] <= 1.1 * plain.counts["steps"]


def test_a_motion_at_rest_does_not_lengthen_the_steps_of_its_derivatives() -> None:
    """x'' + ω² x = F at rest for F = 0: dx/dF = (1 − cos ωt)/ω², over many periods."""
    model = lagcli.load_text("""
coordinates: [x]
parameters: {F: 0, k: 100}
T: x'^2/2
V: k*x^2/2
Q: {x: F}
initial: {x: 0, x': 0}
""")
    found = lagcli.simulate(model, t_end=20, samples=201, rtol=1e-9, sensitivity=("F",))
    assert found.dq is not None
    expected = (1 - np.cos(10 * found.time)) / 100
    # 100 rtol at each step, over 32 periods
    np.testing.assert_allclose(found.dq[:, 0, 0], expected, atol=1e-6 / 100)
