"""Changes of states, and derivatives of a System's tapes along them."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.engine.lowering import lower
from lagcli.engine.sensitivity.changes import Change, DirectionalSystem
from lagcli.engine.switching.kinks import frozen_of

MODEL = """
coordinates: [x, y]
parameters: {m: 2, l: 3, F: 4}
T: m*(x'^2 + y'^2)/2
V: 0
Q: {x: "F*abs(x)"}
constraints: {rod: {expr: x^2 + y^2 <= l^2, restitution: m/10}}
events: {out: {when: x >= l*t, set: {x': 2*x'*m}}}
initial: {x: 1, y: 0, x': 0, y': 0}
"""
#: t, q, v, parameters, and the branch of abs
STATE = (0.5, 1.5, -2.0, 0.3, 0.4, 2.0, 3.0, 4.0, 1.0)


def change(**parts: list[float]) -> Change:
    given = {"t": [0.0], "q": [0.0, 0.0], "v": [0.0, 0.0], "p": [0.0] * 4} | parts
    found = {name: np.array(x, dtype=float)[:, None] for name, x in given.items()}
    return Change(found["t"][0], found["q"], found["v"], found["p"])


@pytest.fixture(scope="module")
def system() -> DirectionalSystem:
    frozen = frozen_of(lower(lagcli.derive(lagcli.load_text(MODEL))))
    assert frozen is not None
    return DirectionalSystem(frozen.system, frozen)


def test_changes_move_with_the_motion_and_stand_beside_each_other() -> None:
    one = change(q=[1, 2]).moved(np.array([0.5]), np.array([2.0, 4.0]), np.array([6.0, 8.0]))
    assert one.t.tolist() == [0.5]
    assert one.q[:, 0].tolist() == [2.0, 4.0]
    assert one.v[:, 0].tolist() == [3.0, 4.0]
    both = one.beside(change(t=[7]))
    assert both.directions == 2
    assert both.t.tolist() == [0.5, 7.0]
    assert both.inputs().shape == (9, 2)


def test_dynamics_and_constraints(system: DirectionalSystem) -> None:
    changes = change(q=[0.1, 0.2], p=[1, 0, 10, 0]).inputs()
    found = system.matrices.dynamics(system.along("dynamics", STATE, changes), True)
    np.testing.assert_allclose(found.mass_matrix[:, :, 0], np.eye(2))
    # F |x| on the branch x > 0
    np.testing.assert_allclose(found.forcing[:, 0], [10 * 1.5 + 4 * 0.1, 0.0])
    changes = change(q=[0.1, 0.2], p=[0, 1, 0, 0]).inputs()
    constraints = system.matrices.constraints(system.along("constraint", STATE, changes))
    np.testing.assert_allclose(constraints.jacobian[0, :, 0], [0.2, 0.4])
    np.testing.assert_allclose(
        constraints.position[0], 2 * (1.5 * 0.1 - 2 * 0.2) - 2 * 3.0, rtol=1e-14
    )


def test_impacts_conditions_actions_and_kinks(system: DirectionalSystem) -> None:
    by_m, by_l = change(p=[1, 0, 0, 0]), change(t=[1], q=[2, 0], p=[0, 1, 0, 0])
    assert system.along("impact", STATE, by_m.inputs()).ravel().tolist() == [0.1]
    # x − l t, with either sign
    slope = system.along("conditions", STATE, by_l.inputs()).item()
    assert abs(slope) == pytest.approx(abs(2 - 3.0 - 0.5))
    inputs = (*STATE[:5], 0.0, 0.0, 0.0, *STATE[5:])
    extra = [np.zeros((3, 1))]
    assert system.along("actions", inputs, by_m.inputs(extra)).item() == pytest.approx(0.6)
    assert abs(system.along("kinks", STATE, by_l.inputs())[0, 0]) == 2.0
    assert system.along("forces", inputs, by_m.inputs(extra)).shape == (0, 1)
