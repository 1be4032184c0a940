"""The power of friction and other limits, apart from that of the constraints."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.columns import ColumnName
from lagcli.engine.contract import Block
from lagcli.engine.lowering.lower import lower
from lagcli.equations.derivation.column_expressions import column_expression
from lagcli.equations.derivation.lagrange import derive
from lagcli.simulations.derived import DerivedColumns
from lagcli.trajectory.samples import Samples

MODEL = """\
name: block
coordinates: {x: m, y: m}
parameters: {m: 2 kg, g: 9.81 m/s^2, mu: 0.5, u: 0.25 m/s}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  floor: {expr: y >= 0, friction: mu, slip: x' - u}
initial: {x: 0, y: 0, x': 0.25, y': 0}
"""
WEIGHT = 2 * 9.81


def derived(rows: list[tuple[float, ...]]) -> Samples:
    """Return samples of (y, x', y', λ, λ_slip)."""
    equations = derive(lagcli.load_text(MODEL))
    system = lower(equations)
    y, x_dot, y_dot, *forces = np.array(rows).T
    nothing = np.zeros(len(rows))
    block = Block(
        time=np.arange(len(rows)) * 0.1,
        q=np.column_stack([nothing, y]),
        v=np.column_stack([x_dot, y_dot]),
        a=np.zeros((len(rows), 2)),
        multipliers=np.column_stack(forces),
        work=nothing,
    )
    return DerivedColumns(system, tuple(equations.model.parameter_values.values()))(block)


def test_friction_takes_energy_and_its_belt_supplies_it() -> None:
    """λ x' = λ (x' − u) + λ u: what slip takes, and what the belt supplies."""
    samples = derived(
        [(0.0, 1.25, 0.0, WEIGHT, -WEIGHT / 2), (0.0, 0.25, 0.0, WEIGHT, 3.0), (1, 2, 3, 0, 0)]
    )
    assert samples.power_friction == pytest.approx([-WEIGHT / 2, 0.0, 0.0])
    assert samples.power_constraint == pytest.approx([-WEIGHT / 2 * 0.25, 3.0 * 0.25, 0.0])


def test_measures_have_the_same_powers() -> None:
    """The columns as expressions, which measures of sweeps are evaluated from."""
    equations = derive(lagcli.load_text(MODEL))
    samples = derived([(0.0, 1.25, 0.0, WEIGHT, -WEIGHT / 2)])
    values = dict(zip(equations.v, [1.25, 0.0], strict=True)) | {"u": 0.25, "mu": 0.5}
    force = dict(zip(["lambda.floor", "lambda.floor.slip"], [WEIGHT, -WEIGHT / 2], strict=True))
    assert [str(ColumnName("multipliers", c)) for c in samples.constraints] == list(force)
    from lagcli.model.model import multiplier

    for name in ("power_friction", "power_constraint"):
        expression = column_expression(equations, name).subs(
            values | {multiplier(c.removeprefix("lambda.")): x for c, x in force.items()}
        )
        assert float(expression) == pytest.approx(getattr(samples, name)[0])


def test_models_without_contacts_have_no_friction() -> None:
    run = lagcli.simulate(lagcli.load("slider_crank"), t_end=0.1, samples=3)
    assert (run.power_friction == 0.0).all()
